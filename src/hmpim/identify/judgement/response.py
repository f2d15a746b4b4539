"""Bandwidths that differ between measured response and model, and ambiguous crossings."""

from collections.abc import Iterator

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import DEVIATIONS
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.reading.bandwidth import are_apart
from hmpim.identify.reading.figures import gradient, system_of, variance_of
from hmpim.identify.result.groups import PHASE_SPLIT, in_words
from hmpim.model.response import RationalDelay, phase, response
from hmpim.record import Finding

__all__ = ["bandwidth_disagrees", "grazed_bandwidth"]

_SHAPED_BY = {
    "bandwidth_phase90": PHASE_SPLIT,
    "bandwidth_phase90_without_delay": PHASE_SPLIT,
    "bandwidth_3db": ("natural_frequency", "damping_ratio", "time_constant", "peak_gain_db"),
}
"""Bandwidths, and the figures that shape the response there."""

_POINTS = 400
"""Frequencies at which a curve is searched for turns."""


def _heights(system: RationalDelay, frequency: Real) -> dict[str, Real]:
    """Height of phase or log gain above the level of each bandwidth."""
    turned = phase(system, frequency, delay=False) + np.pi / 2
    at_dc = system.numerator[0] / system.denominator[0]
    return {
        "bandwidth_phase90": turned - 2 * np.pi * frequency * system.delay,
        "bandwidth_phase90_without_delay": turned,
        "bandwidth_3db": np.log(np.abs(response(system, frequency) / at_dc)) + 0.5 * np.log(2.0),
    }


def bandwidth_disagrees(evidence: Evidence) -> Iterator[Finding]:
    """Doubt bandwidths that differ beyond their error bars, and the figures that shape them.

    The measured response of a held output includes the hold and is not compared.
    """
    if evidence.held:
        return
    measured, model = evidence.measured, evidence.readings.parameters
    apart = [n for n in _SHAPED_BY if are_apart(getattr(measured, n), getattr(model, n))]
    if not apart:
        return
    first = apart[0]  # one sentence is enough
    touched = [name for each in apart for name in (each, *_SHAPED_BY[each])]
    yield Finding(
        code="bandwidth_disagrees",
        message=f"The {in_words(first)} is {getattr(measured, first).value:.4g} Hz by the measured "
        f"response and {getattr(model, first).value:.4g} Hz by the model, further apart than their "
        "errors allow. Look at the Bode plot there before using either.",
        severity="doubt",
        parameters=tuple(dict.fromkeys(touched)),
    )


def grazed_bandwidth(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a bandwidth if the curve turns at its level, within the error there.

    A notch may take the phase to -89° and back: noise decides whether it crosses -90°, and the
    error bar of one crossing does not cover the other.
    """
    structure, p = evidence.joint.best.fit.structure, evidence.readings.parameters
    system = evidence.readings.system
    if structure.order < 2 or structure.integrators or structure.dc_zeros or structure.sampled:
        return
    grid = np.geomspace(evidence.band[1] * 1e-3, evidence.band[1], _POINTS)
    turns = {}
    for name, curve in _heights(system, grid).items():
        found = getattr(p, name)
        place = _nearest_turn(grid, curve, np.inf if found is None else found.value)
        if place is not None:
            turns[name] = place
    if not turns:
        return
    places = np.array([*turns.values()])

    def heights(vector: Real) -> Real:
        found = _heights(system_of(structure, vector, evidence.fs), places)
        return np.array([found[name][i] for i, name in enumerate(turns)])

    vector, own = evidence.readings.vector, evidence.readings.covariance
    slopes = gradient(heights, vector).T
    errors = np.sqrt([variance_of(slope, own) for slope in slopes])
    near = np.abs(heights(vector)) < DEVIATIONS * errors
    touched = [turn for turn, close in zip(turns.items(), near, strict=True) if close]
    if not touched:
        return
    yield Finding(
        code="grazed_bandwidth",
        message=f"At {touched[0][1]:.4g} Hz the response comes so close to the level of a "
        "bandwidth that this record does not show whether it crosses that level. "
        "Read the Bode plot instead, or lower the noise.",
        severity="doubt",
        parameters=tuple(name for name, _ in touched),
    )


def _nearest_turn(frequency: Real, height: Real, crossing: float) -> float | None:
    """Frequency at which a curve turns above its level before its crossing, or returns after it."""
    inner = height[1:-1]
    turns = np.flatnonzero((inner <= height[:-2]) & (inner < height[2:])) + 1
    before = [i for i in turns if frequency[i] < crossing]
    after = [i for i in turns if frequency[i] > crossing and height[i] < 0]
    after = [i for i in after[:1] if np.any(height[i:] > 0)]
    nearest = min([*before, *after], key=lambda i: abs(height[i]), default=None)
    return None if nearest is None else float(frequency[nearest])
