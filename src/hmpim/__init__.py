"""One short, safe excitation; every parameter a simulation needs; an honest error bar on each.

>>> import hmpim
>>> limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
>>> stimulus = hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
>>> sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
>>> result = hmpim.identify(hmpim.run(sensor, stimulus, rng=1))
>>> round(result["y", "u"].delay.value, 3)
0.15
"""

from hmpim.batch import batch
from hmpim.errors import HmpimError
from hmpim.experiment import Until, run
from hmpim.formats import load, read, save
from hmpim.formats.models import export
from hmpim.identify import (
    Estimate,
    Identification,
    LiveEstimator,
    Statistics,
    compress,
    identify,
    identify_levels,
    identify_repeats,
    paper_analysis,
    predict,
    to_model,
    validate,
)
from hmpim.model import Model, draw_models, frequency_response, simulate
from hmpim.optimal import gentlest
from hmpim.record import Channel, Record
from hmpim.report import report
from hmpim.rigs import FunctionRig, Sensor
from hmpim.stimulus import (
    Chirp,
    Limits,
    Ramp,
    Sine,
    Step,
    Stimulus,
    SumOfSines,
    Sweep,
    design,
)
from hmpim.stimulus.axes import design_axes

__version__ = "0.1.0"

__all__ = [
    "Channel",
    "Chirp",
    "Estimate",
    "FunctionRig",
    "HmpimError",
    "Identification",
    "Limits",
    "LiveEstimator",
    "Model",
    "Ramp",
    "Record",
    "Sensor",
    "Sine",
    "Statistics",
    "Step",
    "Stimulus",
    "SumOfSines",
    "Sweep",
    "Until",
    "batch",
    "compress",
    "design",
    "design_axes",
    "draw_models",
    "export",
    "frequency_response",
    "gentlest",
    "identify",
    "identify_levels",
    "identify_repeats",
    "load",
    "paper_analysis",
    "predict",
    "read",
    "report",
    "run",
    "save",
    "simulate",
    "to_model",
    "validate",
]
