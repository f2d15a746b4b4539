"""A short filter that makes a stepped model right over a band, from past samples alone.

What a band-limited signal does between its samples depends on samples to come. A program that
runs a model has none, unless the model's own delay gives it some. Over less than the whole band
up to half the rate it needs none: the past tells enough, and the narrower the band the better.
The taps are least squares on the response over the band. Beyond it they are drawn, with a small
weight, towards a plain delay, so that steps and noise are not blown up.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["CausalFilter", "causal_filter"]

_BACK = 32
"""Taps beyond those that look ahead."""

_INSIDE, _BEYOND = 160, 64
"""Frequencies over the band, closer at its ends, and beyond it."""

_WEIGHTS = tuple(10.0**-k for k in range(2, 9))
"""Weights beyond the band, tried from the calmest filter on."""

_RIGHT = 1e-7
"""Relative error over the band at which to stop: a tenth of what is promised."""

_MOST_GAIN = 10.0
"""Greatest gain at any frequency that a filter may have."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CausalFilter:
    """Taps, newest sample first, and how right they are.

    Parameters
    ----------
    taps : ndarray, shape (p,)
        Filter coefficients.
    error : float
        Greatest relative error of the response over the band.
    gain : float
        Greatest gain at any frequency.
    """

    taps: NDArray[np.float64]
    error: float
    gain: float


def causal_filter(
    wanted: Callable[[NDArray[np.float64]], NDArray[np.complex128]],
    bare: Callable[[NDArray[np.float64]], NDArray[np.complex128]],
    *,
    ahead: int,
    band: float,
) -> CausalFilter:
    """Design the taps that turn a response into the one that is wanted.

    Parameters
    ----------
    wanted : callable
        Response that is wanted, at frequencies over the rate, shape (m,).
    bare : callable
        Response without the taps, `ahead` samples less late.
    ahead : int
        Samples by which the taps may come late.
    band : float
        Highest frequency that counts, over the rate.

    Examples
    --------
    A delay of 4.3 samples, exact up to a fifth of the rate:

    >>> late = causal_filter(
    ...     lambda f: np.exp(-2j * np.pi * f * 4.3), lambda f: np.ones(f.size, complex),
    ...     ahead=4, band=0.2,
    ... )
    >>> late.error < 1e-7, late.gain < 3
    (True, True)
    """
    f = 0.5 * band * (1.0 - np.cos(np.pi * (np.arange(_INSIDE) + 0.5) / _INSIDE))
    beyond = np.linspace(band, 0.5, _BEYOND + 1)[1:]
    aim = wanted(f)
    size = np.abs(aim)
    size = np.maximum(size, 1e-9 * size.max())
    delays = np.arange(ahead + 1 + _BACK)
    columns = np.exp(-2j * np.pi * np.outer(f, delays)) * (bare(f) / size)[:, None]
    outside = np.exp(-2j * np.pi * np.outer(beyond, delays))
    plain = outside[:, ahead]
    aim = aim / size
    best: CausalFilter | None = None
    for weight in _WEIGHTS:
        rows = np.concatenate([columns, weight * outside])
        right = np.concatenate([aim, weight * plain])
        price = 0.01 * weight * np.eye(delays.size)
        taps = np.linalg.lstsq(
            np.concatenate([rows.real, rows.imag, price]),
            np.concatenate([right.real, right.imag, np.zeros(delays.size)]),
            rcond=None,
        )[0]
        found = CausalFilter(
            taps=taps,
            error=float(np.max(np.abs(columns @ taps - aim))),
            gain=float(np.max(np.abs(outside @ taps), initial=1.0)),
        )
        if best is not None and found.gain > _MOST_GAIN:
            break
        if best is None or found.error < best.error:
            best = found
        if best.error < _RIGHT:
            break
    assert best is not None
    return best
