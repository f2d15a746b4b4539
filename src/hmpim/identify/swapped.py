"""Whether an input follows its output: columns that were swapped, seen before anything is fitted.

A unit answers after it was asked. So the output is a weighted sum of the input's past, and the
future of the input adds nothing. Where the columns are swapped it is the other way round: the
*input* is a weighted sum of the output's past, and the output needs the input's future, which it
cannot have. Both sums are least squares with a few dozen weights, milliseconds for a record.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from hmpim.identify.groups import EVERY
from hmpim.record import Finding

__all__ = ["is_swapped", "swapped_finding"]

_WEIGHTS = 40
"""Weights on each side."""

_SPAN = 3.0
"""How far the weights reach, in times of the lag between the two."""

_ROWS = 20_000
"""Samples that are looked at, at most."""

_EXPLAINED = 0.5
"""Share (r.m.s.) of the input that the output's past leaves over, at most."""

_NEEDED = 1.5
"""What the past leaves, beside what past and future leave, from where on the future is needed."""

_NEEDLESS = 1.2
"""What the past leaves, beside what past and future leave, where no future is needed."""


def is_swapped(u: NDArray[np.float64], y: NDArray[np.float64], valid: NDArray[np.bool_]) -> bool:
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
        True only if all of this holds: `y` is ahead by two samples or more at the peak of the
        correlation; its past tells at least three quarters of the power of `u`, its future adds
        next to nothing to that; and `y` cannot be told without the future of `u`.

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
    u, y = (np.where(valid, x - x[valid].mean(), 0.0) for x in (u, y))
    lag = _lag(u, y)
    if lag > -2:
        return False
    reach = int(np.ceil(_SPAN * -lag))
    step = max(1, -(-reach // _WEIGHTS))
    past = np.arange(0, max(reach, _WEIGHTS // 2) + 1, step)
    both = np.concatenate([-past[:0:-1], past])
    rows = _rows(valid, int(past[-1]))
    if rows.size < 5 * both.size:
        return False
    told = _left(u, y, rows, past)
    if told > _EXPLAINED or told > _NEEDLESS * _left(u, y, rows, both):
        return False
    return _left(y, u, rows, past) > _NEEDED * _left(y, u, rows, both)


def swapped_finding(source: str, output: str) -> Finding:
    """Sentence on columns that were swapped.

    Examples
    --------
    >>> swapped_finding("u", "y").message[:60]
    "Input 'u' follows output 'y', and not the other way round: t"
    """
    return Finding(
        code="swapped",
        message=f"Input {source!r} follows output {output!r}, and not the other way round: the "
        "columns are swapped, a clock is late, or the input is made from the output in a loop. "
        "Name them the other way round, check the stamps, or take the loop's reference as input.",
        severity="doubt",
        parameters=EVERY,
    )


def _lag(u: NDArray[np.float64], y: NDArray[np.float64]) -> int:
    """Samples by which `y` is behind `u` where they resemble each other most."""
    size = fft.next_fast_len(2 * u.size, real=True)
    product = np.conj(fft.rfft(u, size)) * fft.rfft(y, size)
    place = int(np.argmax(np.abs(fft.irfft(product, size))))
    return place if place < u.size else place - size


def _rows(valid: NDArray[np.bool_], reach: int) -> NDArray[np.intp]:
    """Samples all of whose neighbours within reach were measured; evenly thinned."""
    lost = np.concatenate([[0], np.cumsum(~valid)])
    at = np.arange(reach, valid.size - reach)
    rows = at[lost[at + reach + 1] == lost[at - reach]]
    return np.asarray(rows[:: max(1, -(-rows.size // _ROWS))])


def _left(
    target: NDArray[np.float64],
    source: NDArray[np.float64],
    rows: NDArray[np.intp],
    lags: NDArray[np.intp],
) -> float:
    """Share (r.m.s.) of `target` that a weighted sum of `source` at these lags leaves over."""
    matrix = np.column_stack([source[rows[:, None] - lags], np.ones(rows.size)])
    wanted = target[rows]
    size = float(np.std(wanted))
    if size == 0.0:
        return 1.0
    weights, *_ = np.linalg.lstsq(matrix, wanted, rcond=1e-6)
    left = wanted - matrix @ weights
    freedom = rows.size - matrix.shape[1]
    return float(np.sqrt(left @ left / freedom)) / size
