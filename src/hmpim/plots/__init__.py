"""Pictures: one function for each, taking arrays or results, returning a description of it."""

from hmpim.plots.bode import Mark, bode, bode_items, pair_bode, pair_deviation
from hmpim.plots.candidates import candidates
from hmpim.plots.correlation import cross_correlation, error_autocorrelation
from hmpim.plots.curves import BodeCurve, deviation_curve, measured_curve, model_curve
from hmpim.plots.description import (
    Axis,
    Band,
    Bars,
    Curve,
    Figure,
    Image,
    Panel,
    Points,
    Rule,
    Span,
    Words,
)
from hmpim.plots.envelope import envelope
from hmpim.plots.frames import tracked_frames
from hmpim.plots.harmonics import harmonics
from hmpim.plots.histories import (
    input_output,
    model_over_measurement,
    residuals,
    time_histories,
)
from hmpim.plots.inputs import inputs_plot
from hmpim.plots.margin import added_phase
from hmpim.plots.spectra import excited_band, spectra, spectrum_curve

__all__ = [
    "Axis",
    "Band",
    "Bars",
    "BodeCurve",
    "Curve",
    "Figure",
    "Image",
    "Mark",
    "Panel",
    "Points",
    "Rule",
    "Span",
    "Words",
    "added_phase",
    "bode",
    "bode_items",
    "candidates",
    "cross_correlation",
    "deviation_curve",
    "envelope",
    "error_autocorrelation",
    "excited_band",
    "harmonics",
    "input_output",
    "inputs_plot",
    "measured_curve",
    "model_curve",
    "model_over_measurement",
    "pair_bode",
    "pair_deviation",
    "residuals",
    "spectra",
    "spectrum_curve",
    "time_histories",
    "tracked_frames",
]
