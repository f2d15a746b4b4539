"""One short, safe excitation; every parameter a simulation needs; an honest error bar on each.

>>> import hmpim
>>> limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
>>> stimulus = hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
>>> sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
>>> result = hmpim.identify(hmpim.run(sensor, stimulus, rng=1))
>>> round(result["y", "u"].delay.value, 3)
0.15
"""

import sys
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what `_PLACES` says, as type checkers and editors read it
    from hmpim.batch import batch
    from hmpim.errors import HmpimError
    from hmpim.experiment import Until
    from hmpim.experiment.run import run
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

_PLACES = {
    "Channel": "hmpim.record",
    "Chirp": "hmpim.stimulus",
    "Estimate": "hmpim.identify",
    "FunctionRig": "hmpim.rigs",
    "HmpimError": "hmpim.errors",
    "Identification": "hmpim.identify",
    "Limits": "hmpim.stimulus",
    "LiveEstimator": "hmpim.identify",
    "Model": "hmpim.model",
    "Ramp": "hmpim.stimulus",
    "Record": "hmpim.record",
    "Sensor": "hmpim.rigs",
    "Sine": "hmpim.stimulus",
    "Statistics": "hmpim.identify",
    "Step": "hmpim.stimulus",
    "Stimulus": "hmpim.stimulus",
    "SumOfSines": "hmpim.stimulus",
    "Sweep": "hmpim.stimulus",
    "Until": "hmpim.experiment",
    "batch": "hmpim.batch",
    "compress": "hmpim.identify",
    "design": "hmpim.stimulus",
    "design_axes": "hmpim.stimulus.axes",
    "draw_models": "hmpim.model",
    "export": "hmpim.formats.models",
    "frequency_response": "hmpim.model",
    "gentlest": "hmpim.optimal",
    "identify": "hmpim.identify",
    "identify_levels": "hmpim.identify",
    "identify_repeats": "hmpim.identify",
    "load": "hmpim.formats",
    "paper_analysis": "hmpim.identify",
    "predict": "hmpim.identify",
    "read": "hmpim.formats",
    "report": "hmpim.report",
    "run": "hmpim.experiment.run",
    "save": "hmpim.formats",
    "simulate": "hmpim.model",
    "to_model": "hmpim.identify",
    "validate": "hmpim.identify",
}
"""Module of each public name, which is imported when the name is first used."""

_ROOMS = (
    *("arguments", "equality", "errors", "experiment", "formats", "model", "optimal", "plots"),
    *("record", "rigs", "stimulus", "tables", "units"),
)
"""Packages and modules that are there after ``import hmpim`` alone."""


class _Package(ModuleType):
    """The package: public names are imported when they are first used.

    `batch`, `identify` and `report` are functions in it. Python makes each imported submodule an
    attribute of its package; these three would take the place of the functions of the same name.
    """

    def __getattr__(self, name: str) -> object:
        if name in _PLACES:
            value = getattr(import_module(_PLACES[name]), name)
            setattr(self, name, value)  # the next time it is there
            return value
        if name in _ROOMS:
            return import_module(f"hmpim.{name}")
        raise AttributeError(f"module 'hmpim' has no attribute {name!r}", name=name, obj=self)

    def __setattr__(self, name: str, value: object) -> None:
        if not (name in _PLACES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)

    def __dir__(self) -> list[str]:
        return sorted({*__all__, *_ROOMS, *(name for name in vars(self) if name[:2] == "__")})


sys.modules[__name__].__class__ = _Package
