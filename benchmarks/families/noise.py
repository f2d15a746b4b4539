"""Stationary noise of known colour: drawn, and its covariance in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cho_factor, cho_solve, toeplitz
from scipy.linalg import solve_toeplitz as solve
from scipy.signal import lfilter

__all__ = ["Noise", "pink", "vibration", "wander", "white"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Sum of independent parts (variance, radius, angle): r^|k| cos(angle k) correlated.

    Radius 0 is white; angle 0 a first-order autoregression; both a narrow band.
    """

    parts: tuple[tuple[float, float, float], ...] = ()

    @property
    def variance(self) -> float:
        return sum(v for v, _, _ in self.parts)

    @property
    def is_white(self) -> bool:
        return all(r == 0 for _, r, _ in self.parts)

    def scaled(self, std: float) -> Noise:
        factor = std**2 / self.variance
        return Noise(parts=tuple((v * factor, r, a) for v, r, a in self.parts))

    def plus(self, variance: float) -> Noise:
        return Noise(parts=(*self.parts, (variance, 0.0, 0.0)))

    def draw(self, size: int, rng: np.random.Generator) -> np.ndarray:
        total = np.zeros(size)
        for variance, radius, angle in self.parts:
            white_pair = rng.standard_normal((2, size))
            if radius == 0:
                total += np.sqrt(variance) * white_pair[0]
                continue
            innovation = (white_pair[0] + 1j * white_pair[1]) * np.sqrt(1 - radius**2)
            innovation[0] /= np.sqrt(1 - radius**2)
            state = lfilter([1.0], [1.0, -radius * np.exp(1j * angle)], innovation)
            total += np.sqrt(variance) * state.real
        return total

    def covariance(self, lags: np.ndarray) -> np.ndarray:
        total = np.zeros(lags.size)
        for variance, radius, angle in self.parts:
            if radius == 0:
                total += variance * (lags == 0)
            else:
                total += variance * radius ** np.abs(lags) * np.cos(angle * lags)
        return total

    def solve(self, rows: np.ndarray, valid: np.ndarray | None = None) -> np.ndarray:
        """R⁻¹ of each column; only of the samples that are valid."""
        keep = slice(None) if valid is None else valid
        out = np.zeros_like(rows)
        if self.is_white:
            out[keep] = rows[keep] / self.variance
            return out
        lags = self.covariance(np.arange(rows.shape[0]))
        if valid is None or valid.all():
            return solve(lags, rows)
        factor = cho_factor(toeplitz(lags)[np.ix_(valid, valid)])
        out[valid] = cho_solve(factor, rows[valid])
        return out


def white() -> Noise:
    return Noise(parts=((1.0, 0.0, 0.0),))


def wander(coefficient: float) -> Noise:
    """First-order autoregression."""
    return Noise(parts=((1.0, coefficient, 0.0),))


def pink(samples: int) -> Noise:
    """1/f from twice the record's length to the Nyquist frequency, by eight lags a decade."""
    corners = np.geomspace(0.25 / samples, 0.5, int(8 * np.log10(2 * samples)))
    return Noise(
        parts=tuple((1.0 / corners.size, float(np.exp(-2 * np.pi * c)), 0.0) for c in corners)
    )


def vibration(cycles: float, width: float, share: float) -> Noise:
    """A narrow band at `cycles` per sample with `share` of the power, on white noise."""
    radius = float(np.exp(-np.pi * width))
    return Noise(parts=((share, radius, 2 * np.pi * cycles), (1 - share, 0.0, 0.0)))
