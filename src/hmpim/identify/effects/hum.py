"""Mains hum on the output: sinusoids, fitted together with everything else.

Looked for where the residual holds a line that the input has not. Each is three rows of the same
fit: a cosine, a sine, and what a frequency a little off would add, so that the error bars know it.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.effects.disturbance import gain_by_rows, without_rows
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.colour import line_of
from hmpim.identify.worth import MOST, ROUNDING
from hmpim.record import Finding

__all__ = ["Humming", "hum_finding", "line_near", "with_hum"]

_MOST = 8
"""Lines that are looked for: the mains and its harmonics."""

_AT_HALF = 0.01
"""Share of a bin below half the rate in which a line is taken to be there, where it has no sine."""

_ROWS = 3
"""Rows of a line."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Humming:
    """A fit together with lines of a frequency of their own.

    Parameters
    ----------
    joint : JointFit
        Fitted to the output, the lines taken off, their rows free to move.
    rows : ndarray, shape (3 k, n)
        Of k lines.
    trend : ndarray, shape (n,)
        The lines together, in the output's unit.
    frequencies : tuple of float
        Of the lines, the strongest first, in cycles per sample.
    amplitudes : tuple of float
        In the output's unit.
    """

    joint: JointFit
    rows: Real
    trend: Real
    frequencies: tuple[float, ...]
    amplitudes: tuple[float, ...]


def with_hum(first: JointFit, fitted: Callable[[Real, bool], JointFit]) -> Humming | None:
    """Fit again with the lines of the residual, where that gains more than it costs (Schwarz).

    `first` is without lines, its residual not white; of an input without lines, whose distortion
    has none either. `fitted` makes the joint fit with rows for the lines, of the plain structures
    only if its second argument is true.
    """
    frequencies, share = _lines(first)
    if not frequencies:
        return None
    rows = np.vstack([_rows_of(first, one) for one in frequencies])
    # Lines that are the lesser part of what is left over hid no dynamics.
    joint = fitted(rows, share < MOST and first.best.fit.structure.name in PLAIN)
    if gain_by_rows(joint, rows.shape[0], first.best.fit, first.problem) < 0.0:
        return None
    parts = joint.best.fit.nuisance.reshape(-1, _ROWS)
    sizes = np.hypot(parts[:, 0], parts[:, 1])
    order = np.argsort(-sizes)
    return Humming(
        joint=without_rows(joint, slice(None)),
        rows=rows,
        trend=joint.best.fit.nuisance @ rows,
        frequencies=tuple(frequencies[i] for i in order),
        amplitudes=tuple(float(sizes[i]) for i in order),
    )


def hum_finding(humming: Humming, fs: float, unit: str) -> Finding:
    """Say at which frequencies the output hums, and how much."""
    lines = [
        f"{frequency * fs:.4g} Hz ({amplitude:.3g} {unit}".rstrip() + ")"
        for frequency, amplitude in zip(humming.frequencies, humming.amplitudes, strict=True)
    ]
    what = "A line is" if len(lines) == 1 else "Lines are"
    said = lines[0] if len(lines) == 1 else ", ".join(lines[:-1]) + " and " + lines[-1]
    return Finding(
        code="hum",
        message=f"{what} on the output that the input does not have: {said}. Each is fitted and "
        "removed, and the noise stated is without it. Look for mains hum or vibration.",
        severity="info",
        parameters=("noise_std",),
    )


def _lines(joint: JointFit) -> tuple[list[float], float]:
    """Frequencies of the residual's lines, in cycles per sample, and their share of its power."""
    residual, valid = joint.best.fit.residual, joint.problem.valid
    told = np.ones(residual.size) if valid is None else valid.astype(np.float64)
    left = np.where(told > 0.0, residual - residual[told > 0.0].mean(), 0.0)
    found: list[float] = []
    whole, moves = float(left @ left), joint.problem.y - joint.problem.y.mean()
    if whole <= ROUNDING**2 * float(moves @ moves):
        return found, 0.0  # rounding has a period of its own
    while len(found) < _MOST:
        line = line_of(left, 1.0)
        if line is None:
            break
        found.append(line_near(left, line))
        phase = 2 * np.pi * found[-1] * np.arange(left.size)
        rows = np.stack([np.cos(phase), np.sin(phase)]) * told
        left = left - solved(rows @ rows.T, rows @ left) @ rows
    return found, 1.0 - float(left @ left) / whole if found else 0.0


def line_near(left: Real, line: float) -> float:
    """Frequency near `line` at which the periodogram is greatest, in cycles per sample."""
    at = np.arange(left.size) - left.size // 2

    def depth(frequency: float) -> float:
        return -float(np.abs(left @ np.exp(-2j * np.pi * frequency * at)))

    best = scipy.optimize.minimize_scalar(
        depth,
        bounds=(line - 0.5 / left.size, min(line + 0.5 / left.size, 0.5)),
        method="bounded",
        options={"xatol": 1e-5 / left.size},
    )
    near = float(best.x)
    return 0.5 if 0.5 - near < _AT_HALF / left.size else near


def _rows_of(joint: JointFit, frequency: float) -> Real:
    """Cosine, sine, and the change of what was found of them with the frequency, shape (3, n)."""
    residual = joint.best.fit.residual
    at = np.arange(residual.size) - residual.size // 2
    phase = 2 * np.pi * frequency * at
    sine = np.sin(phase) if frequency < 0.5 else np.zeros_like(phase)
    pair = np.stack([np.cos(phase), sine])
    valid = joint.problem.valid
    seen = pair if valid is None else pair * valid
    a, b = solved(seen @ seen.T, seen @ residual)
    turned = (b * pair[0] - a * pair[1]) * at
    return np.vstack([pair, turned / max(np.abs(turned).max(), np.finfo(float).tiny)])
