"""Whether an input follows its output: swapped columns, detected before anything is fitted.

A unit responds after its input: its output is a weighted sum of the input's past. If the columns
are swapped, the so-called output leads, and the pair shows the inverse of a unit, which needs the
future of its input.

So each of the two is predicted from the other by least squares, with equally many weights: from its
past alone, and from past and future in equal parts. If the order is right, the past alone is enough
for the output, but not for the input. The difference of the two, in logarithms, changes its sign if
the columns are swapped; nothing else about the record needs to be known.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real, thinned
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.result.groups import EVERY
from hmpim.identify.section_iv.correlation import likeness
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import FEW, MATERIAL, PART
from hmpim.record import Finding

__all__ = ["is_swapped", "lags_behind", "swapped_finding"]

_WEIGHTS = 20
"""Weights on each side; twice as many for the past alone."""

_LEAD = 1
"""Samples of the future that the change of `y` may need: one for a central difference."""

_STEPS = (1, 2, 4)
"""Samples from weight to weight: short steps resolve fast responses, long ones reach further."""

_BAND = 0.1
"""Cycles per sample below which nearly all common power lies, after averaging over blocks."""

_ROWS = 20_000
"""Most samples used."""

_FEWEST = 200
"""Fewest samples used."""

_UNSEEN = 1e-11
"""Share of the greatest eigenvalue below which the source has no power in a direction."""


def is_swapped(u: Real, y: Real, valid: Mask) -> bool:
    """Whether `u` follows `y` rather than `y` follows `u`.

    `u` and `y` are the samples of the so-called input and output, (n,), and `valid` marks those at
    which both were measured. True only if all of this holds: `y` is ahead at the peak of the
    correlation; the past of `y` alone predicts `u` better than the past of `u` alone predicts `y`,
    by a fifth, each relative to past and future; no other step contradicts; and `y` is no integral
    of `u`.
    """
    if not valid.all():
        u, y = (np.where(valid, x - x[valid].mean(), 0.0) for x in (u, y))
    if not likeness(u, y, longest_lag(u.size)).is_ahead:
        return False
    u, y = ((x - x.mean()) / (float(np.abs(x - x.mean()).max()) or 1.0) for x in (u, y))
    u, y, valid = _thinned(u, y, valid)
    evidence = [_evidence(u, y, valid, step) for step in _STEPS]
    if max(evidence) <= PART or min(evidence) <= -FEW:
        return False
    change, known = np.diff(y), valid[1:] & valid[:-1]
    return any(_evidence(u[1:], change, known, step, lead=_LEAD) > FEW for step in _STEPS)


def swapped_finding(source: str, output: str) -> Finding:
    """Report that input and output are swapped."""
    return Finding(
        code="swapped",
        message=f"Input {source!r} follows output {output!r}, not the other way round: the "
        "columns are swapped, a clock is late, or a loop makes the input from the output. "
        "Swap the names, check the time stamps, or take the loop's reference as input.",
        severity="doubt",
        parameters=EVERY,
    )


def lags_behind(joint: JointFit) -> bool:
    """Whether an output that is ahead still lags, which the inverse of a unit cannot.

    Its clock is then late, and the columns are right: a negative delay is followed by poles that
    the record determines, and the residual is white.
    """
    fit = joint.best.fit
    if not fit.structure.order or not is_white(joint.problem.counting(fit.residual)):
        return False
    rows = jacobian(joint.problem, fit)
    variance = covariance(
        rows, fit.residual, freedom=max(joint.problem.counted - len(rows), 1), white=True
    )
    # The logarithm of the first section's time constant comes after the delay.
    return bool(variance[1, 1] < PART**2)


def _thinned(u: Real, y: Real, valid: Mask) -> tuple[Real, Real, Mask]:
    """Averages over blocks that are short compared with the periods that the two share."""
    size = min(u.size, max(64, u.size // 8))
    frequency, shared = scipy.signal.csd(u, y, nperseg=size, detrend="constant")
    total = np.cumsum(np.abs(shared))
    highest = float(frequency[np.searchsorted(total, 0.95 * total[-1])])
    block = int(_BAND / highest) if highest > 0.0 else u.size
    block = max(1, min(block, u.size // (2 * _FEWEST)))
    return thinned(u, block), thinned(y, block), thinned(valid.astype(np.float64), block) == 1.0


def _evidence(u: Real, y: Real, valid: Mask, step: int, *, lead: int = 0) -> float:
    """How much better the past predicts `u` than `y`, as a logarithm; 0 if too few samples."""
    rows = _rows(valid, 2 * _WEIGHTS * step)
    if rows.size < _FEWEST:
        return 0.0
    return _future_needed(y, u, rows, step, lead) - _future_needed(u, y, rows, step, lead)


def _rows(valid: Mask, reach: int) -> NDArray[np.intp]:
    """Samples with all neighbours within reach measured; evenly thinned."""
    lost = np.concatenate([[0], np.cumsum(~valid)])
    at = np.arange(reach, valid.size - reach)
    rows = at[lost[at + reach + 1] == lost[at - reach]]
    return np.asarray(rows[:: max(1, -(-rows.size // _ROWS))])


def _future_needed(
    target: Real, source: Real, rows: NDArray[np.intp], step: int, lead: int
) -> float:
    """Logarithm of the residual from the past of `source` over that from past and future."""
    lags = step * np.arange(-_WEIGHTS, 2 * _WEIGHTS + 1)
    matrix = source[rows[:, None] - lags]
    matrix -= matrix.mean(axis=0)
    wanted = target[rows] - target[rows].mean()
    gram, product, power = matrix.T @ matrix, matrix.T @ wanted, float(wanted @ wanted)
    if power == 0.0:
        return 0.0
    past, both = slice(_WEIGHTS - lead, 3 * _WEIGHTS + 1 - lead), slice(0, 2 * _WEIGHTS + 1)
    explained = (  # not by directions in which the source has hardly any power
        product[at] @ np.linalg.pinv(gram[at, at], rcond=_UNSEEN, hermitian=True) @ product[at]
        for at in (past, both)
    )
    alone, together = (max(0.0, 1.0 - part / power) + MATERIAL**2 for part in explained)
    return 0.5 * float(np.log(alone / together))
