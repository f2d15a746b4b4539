"""Smooth functions on a box as polynomials: evaluated for many points at once, with slopes.

A function of a few parameters that is expensive to evaluate is sampled once over a box, and a
polynomial of Chebyshev products of one total degree is evaluated instead. Its error is measured at
points that took no part in the fit.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy
from numpy.polynomial import chebyshev
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real

__all__ = ["Surface", "places_in"]


_FEWEST_SPARE = 10
"""Least number of points of the fit beyond the coefficients; else as many as those. With half as
many the error in a wide box is twice as large; with more it is no smaller."""

_CHECKS = 40
"""Points at which the error is measured."""


def places_in(low: Real, high: Real, degree: int) -> Real:
    """Points, (m, p), of a box at which to sample a function, dense towards its faces.

    The degree is the total degree of the polynomial. The points are always the same, those of a
    lower degree first; the last 40 are for the error.
    """
    size = len(_powers(low.size, degree))
    count = size + max(size, _FEWEST_SPARE) + _CHECKS
    points = scipy.stats.qmc.Halton(d=low.size, scramble=False).random(count + 1)[1:]
    return np.asarray((low + high) / 2 - (high - low) / 2 * np.cos(np.pi * points))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Surface:
    """A function on a box, with k values."""

    low: Real  # (p,): a corner of the box
    high: Real  # (p,): the opposite one
    powers: NDArray[np.int64]  # (c, p): degrees of each product of Chebyshev polynomials
    weights: Real  # (c, k): their coefficients
    error: Real  # (k,): largest error at points that took no part in the fit

    @classmethod
    def fitted(cls, low: Real, high: Real, places: Real, values: Real, *, degree: int) -> "Surface":
        """Fit the polynomial to a function's values, (m, k), at places from `places_in`, (m, p)."""
        powers = _powers(low.size, degree)
        rows, _ = _products(_scaled(places, low, high), powers)
        weights = np.linalg.lstsq(rows[:-_CHECKS], values[:-_CHECKS], rcond=None)[0]
        off = np.abs(rows[-_CHECKS:] @ weights - values[-_CHECKS:])
        worst = np.asarray(off.max(axis=0))
        return cls(low=low, high=high, powers=powers, weights=np.asarray(weights), error=worst)

    def at(self, places: Real) -> tuple[Real, Real]:
        """Values, shape (n, k), and slopes, shape (n, p, k), at places of shape (n, p)."""
        rows, slopes = _products(_scaled(places, self.low, self.high), self.powers)
        rate = 2.0 / (self.high - self.low)
        return rows @ self.weights, (slopes @ self.weights) * rate[None, :, None]

    def values(self, places: Real) -> Real:
        """Values alone, shape (n, k), at places of shape (n, p)."""
        first, _ = _polynomials(_scaled(places, self.low, self.high), int(self.powers.max()))
        return np.asarray(_multiplied(first, self.powers) @ self.weights)

    def holds(self, places: Real) -> Mask:
        """Which places are inside the box, shape (n,)."""
        return np.asarray(((places > self.low) & (places < self.high)).all(axis=1))


def _powers(size: int, degree: int) -> NDArray[np.int64]:
    every = product(range(degree + 1), repeat=size)
    return np.array([p for p in every if sum(p) <= degree], dtype=np.int64)


def _scaled(places: Real, low: Real, high: Real) -> Real:
    return np.asarray((2.0 * places - low - high) / (high - low))


def _products(x: Real, powers: NDArray[np.int64]) -> tuple[Real, Real]:
    """Products of Chebyshev polynomials, (n, c), and their slopes, (n, p, c), at (n, p)."""
    first, rate = _polynomials(x, int(powers.max(initial=0)))
    slopes = np.empty((x.shape[0], x.shape[1], powers.shape[0]))
    for j in range(x.shape[1]):
        turned = first.copy()
        turned[:, j] = rate[:, j]
        slopes[:, j] = _multiplied(turned, powers)
    return _multiplied(first, powers), slopes


def _multiplied(each: Real, powers: NDArray[np.int64]) -> Real:
    """Products, (n, c), of the polynomials of each variable, (n, p, degrees)."""
    out = each[:, 0, powers[:, 0]]
    for j in range(1, powers.shape[1]):
        out *= each[:, j, powers[:, j]]
    return np.asarray(out)


def _polynomials(x: Real, degree: int) -> tuple[Real, Real]:
    """Chebyshev polynomials up to a degree, and their slopes, (n, p, degree + 1), at (n, p)."""
    first = np.asarray(chebyshev.chebvander(x, degree), dtype=np.float64)
    return first, first[..., :-1] @ chebyshev.chebder(np.eye(degree + 1))
