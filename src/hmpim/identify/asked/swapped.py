"""Whether an input follows its output: columns that were swapped, seen before anything is fitted.

A unit answers after it was asked: its output is a weighted sum of the input's past. Where the
columns are swapped, what is called output leads, and what is called input answers it: the pair
then shows the inverse of a unit, which needs the future of what it is given.

So each of the two is told twice from the other, by least squares with equally many weights: from
its past alone, and from past and future in equal parts. Where the order is right, the past alone
serves the output at least as well, and the input worse. The difference of the two, in logarithms,
changes its sign when the columns are swapped; nothing else about the record needs to be known.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
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
"""Samples of the future that the change of `y` may need: a central difference does."""

_STEPS = (1, 2, 4)
"""Samples from weight to weight: what is near is seen finely, what is far coarsely."""

_BAND = 0.1
"""Cycles a sample below which nearly all of what the two share lies, after thinning."""

_ROWS = 20_000
"""Samples that are looked at, at most."""

_FEWEST = 200
"""Samples that are looked at, at least."""

_UNSEEN = 1e-11
"""Share of the greatest eigenvalue below which the source does not have a direction."""


def is_swapped(u: Real, y: Real, valid: Mask) -> bool:
    """Whether `u` follows `y` rather than `y` follows `u`.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Samples of what is called input, and of what is called output.
    valid : ndarray of bool, shape (n,)
        Samples at which both were measured.

    Returns
    -------
    bool
        True only if all of this holds: `y` is ahead at the peak of the correlation; the past of
        `y` serves `u`, beside past and future, better than the past of `u` serves `y`, by a fifth;
        no other reach of the weights says the contrary; and `y` is no integral of `u`.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> t = np.arange(1000) / 100
    >>> asked = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    >>> lagging = np.convolve(asked, 0.2 * 0.8 ** np.arange(60))[:1000]
    >>> answered = np.roll(lagging, 5) + 0.02 * rng.standard_normal(1000)
    >>> told = np.ones(1000, dtype=bool)
    >>> is_swapped(asked, answered, told), is_swapped(answered, asked, told)
    (False, True)
    """
    if np.count_nonzero(valid) < _FEWEST:
        return False
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
    """Sentence on columns that were swapped.

    Examples
    --------
    >>> swapped_finding("u", "y").message[:60]
    "Input 'u' follows output 'y', not the other way round: the c"
    """
    return Finding(
        code="swapped",
        message=f"Input {source!r} follows output {output!r}, not the other way round: the "
        "columns are swapped, a clock is late, or a loop makes the input from the output. "
        "Swap the names, check the time stamps, or take the loop's reference as input.",
        severity="doubt",
        parameters=EVERY,
    )


def lags_behind(joint: JointFit) -> bool:
    """Whether an output that is ahead lags all the same, as the inverse of a unit cannot.

    Its clock then is late, and the columns are right: behind a negative delay there are poles that
    the record tells, and they leave white noise.
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
    """Means over blocks that are still short beside what the two have in common."""
    size = min(u.size, max(64, u.size // 8))
    frequency, shared = scipy.signal.csd(u, y, nperseg=size, detrend="constant")
    total = np.cumsum(np.abs(shared))
    highest = float(frequency[np.searchsorted(total, 0.95 * total[-1])])
    block = int(_BAND / highest) if highest > 0.0 else u.size
    block = max(1, min(block, u.size // (2 * _FEWEST)))
    whole = u.size // block * block
    u, y = (x[:whole].reshape(-1, block).mean(axis=1) for x in (u, y))
    return u, y, np.asarray(valid[:whole].reshape(-1, block).all(axis=1))


def _evidence(u: Real, y: Real, valid: Mask, step: int, *, lead: int = 0) -> float:
    """Logarithm by which the past serves `u` better than `y`; 0 if there is too little to tell."""
    rows = _rows(valid, 2 * _WEIGHTS * step)
    if rows.size < _FEWEST:
        return 0.0
    return _future_needed(y, u, rows, step, lead) - _future_needed(u, y, rows, step, lead)


def _rows(valid: Mask, reach: int) -> NDArray[np.intp]:
    """Samples all of whose neighbours within reach were measured; evenly thinned."""
    lost = np.concatenate([[0], np.cumsum(~valid)])
    at = np.arange(reach, valid.size - reach)
    rows = at[lost[at + reach + 1] == lost[at - reach]]
    return np.asarray(rows[:: max(1, -(-rows.size // _ROWS))])


def _future_needed(
    target: Real, source: Real, rows: NDArray[np.intp], step: int, lead: int
) -> float:
    """Logarithm of what the past of `source` leaves over beside what past and future leave."""
    lags = step * np.arange(-_WEIGHTS, 2 * _WEIGHTS + 1)
    matrix = source[rows[:, None] - lags]
    matrix -= matrix.mean(axis=0)
    wanted = target[rows] - target[rows].mean()
    gram, product, power = matrix.T @ matrix, matrix.T @ wanted, float(wanted @ wanted)
    if power == 0.0:
        return 0.0
    past, both = slice(_WEIGHTS - lead, 3 * _WEIGHTS + 1 - lead), slice(0, 2 * _WEIGHTS + 1)
    told = (  # by directions that the source hardly has, nothing is
        product[at] @ np.linalg.pinv(gram[at, at], rcond=_UNSEEN, hermitian=True) @ product[at]
        for at in (past, both)
    )
    alone, together = (max(0.0, 1.0 - one / power) + MATERIAL**2 for one in told)
    return 0.5 * float(np.log(alone / together))
