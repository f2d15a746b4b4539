"""Mains hum on the output: sinusoids, fitted together with the model.

They are looked for if the residual has a spectral line that the input lacks. Each line is three
rows of the same fit: cosine, sine, and the change with a small error in frequency, so that the
error bars include that error.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.effects.disturbance import criterion_gain, without_rows
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.colour import line_of
from hmpim.identify.worth import ROUNDING
from hmpim.record import Finding

__all__ = ["Humming", "hum_finding", "line_near", "with_hum"]

_MOST = 8
"""Most lines that are looked for: the mains and its harmonics."""

_ROWS = 3
"""Rows for each line."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Humming:
    """A fit with spectral lines on the output."""

    joint: JointFit  # of the output without the lines, whose rows stay free
    rows: Real  # (3 k, n): of k lines
    trend: Real  # (n,): the sum of all lines, in the output's unit
    # of the lines, the strongest first, in cycles per sample, and in the output's unit
    frequencies: tuple[float, ...]
    amplitudes: tuple[float, ...]


def with_hum(first: JointFit, fitted: Callable[[Real, bool], JointFit]) -> Humming | None:
    """Fit again with the lines of the residual, if Schwarz's criterion improves.

    `first` has no lines, and its residual is not white; neither the input nor its distortion has
    lines. `fitted` makes the joint fit with rows for the lines, of plain structures only if its
    second argument is true.
    """
    frequencies = _lines(first)
    if not frequencies:
        return None
    rows = np.vstack([_rows_of(first, one) for one in frequencies])
    joint = fitted(rows, first.best.fit.structure.name in PLAIN)
    if criterion_gain(joint, rows.shape[0], first.best.fit, first.problem) < 0.0:
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
    """Report the frequencies and amplitudes of the hum."""
    lines = [
        f"{frequency * fs:.4g} Hz ({amplitude:.3g} {unit}".rstrip() + ")"
        for frequency, amplitude in zip(humming.frequencies, humming.amplitudes, strict=True)
    ]
    what = "A line is" if len(lines) == 1 else "Lines are"
    text = lines[0] if len(lines) == 1 else ", ".join(lines[:-1]) + " and " + lines[-1]
    return Finding(
        code="hum",
        message=f"{what} on the output that the input does not have: {text}. Each is fitted and "
        "removed, and the noise stated is without it. Look for mains hum or vibration.",
        severity="info",
        parameters=("noise_std",),
    )


def _lines(joint: JointFit) -> list[float]:
    """Frequencies of the residual's lines, in cycles per sample."""
    residual, valid = joint.best.fit.residual, joint.problem.valid
    weight = np.ones(residual.size) if valid is None else valid.astype(np.float64)
    rest = np.where(weight > 0.0, residual - residual[weight > 0.0].mean(), 0.0)
    found: list[float] = []
    motion = joint.problem.y - joint.problem.y.mean()
    if float(rest @ rest) <= ROUNDING**2 * float(motion @ motion):
        return found  # rounding errors have a period of their own
    while len(found) < _MOST:
        line = line_of(rest, 1.0)
        if line is None:
            break
        found.append(line_near(rest, line))
        phase = 2 * np.pi * found[-1] * np.arange(rest.size)
        rows = np.stack([np.cos(phase), np.sin(phase)]) * weight
        rest = rest - solved(rows @ rows.T, rows @ rest) @ rows
    return found


def line_near(residual: Real, line: float) -> float:
    """Frequency near `line` at which the periodogram is greatest, in cycles per sample."""
    size = residual.size
    at = np.arange(size) - size // 2

    def depth(frequency: float) -> float:
        return -float(np.abs(residual @ np.exp(-2j * np.pi * frequency * at)))

    best = scipy.optimize.minimize_scalar(
        depth,
        bounds=(line - 0.5 / size, min(line + 0.5 / size, 0.5)),
        method="bounded",
        options={"xatol": 1e-5 / size},
    )
    return float(best.x)


def _rows_of(joint: JointFit, frequency: float) -> Real:
    """Cosine, sine, and the change of the fitted line with its frequency, shape (3, n)."""
    residual = joint.best.fit.residual
    at = np.arange(residual.size) - residual.size // 2
    phase = 2 * np.pi * frequency * at
    pair = np.stack([np.cos(phase), np.sin(phase)])
    valid = joint.problem.valid
    counted = pair if valid is None else pair * valid
    a, b = solved(counted @ counted.T, counted @ residual)
    turned = (b * pair[0] - a * pair[1]) * at
    return np.vstack([pair, turned / max(np.abs(turned).max(), np.finfo(float).tiny)])
