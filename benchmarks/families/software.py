"""Software under test: output sample k from input samples up to k."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.signal import lfilter

__all__ = ["Filter", "alpha_beta", "figures_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """B(z)/A(z) by rising powers of 1/z, `late` samples later."""

    top: np.ndarray
    below: np.ndarray
    late: int = 0

    def run(self, u: np.ndarray, *, settled: bool = True) -> np.ndarray:
        """Output for an input that stood at u[0] before, or of a memory that holds zeros."""
        if not settled:
            moved = np.concatenate([np.zeros(self.late), u])[: u.size]
            return lfilter(self.top, self.below, moved)
        moved = np.concatenate([np.full(self.late, u[0]), u])[: u.size]
        return lfilter(self.top, self.below, moved - u[0]) + self.gain * u[0]

    @property
    def gain(self) -> float:
        return float(self.top.sum() / self.below.sum())

    def response(self, frequency: np.ndarray, fs: float) -> np.ndarray:
        back = np.exp(-2j * np.pi * np.asarray(frequency) / fs)
        top = np.polynomial.polynomial.polyval(back, self.top)
        below = np.polynomial.polynomial.polyval(back, self.below)
        return top / below * back**self.late


def alpha_beta(alpha: float, beta: float) -> Filter:
    """Position estimate of the α-β tracker (predict, correct)."""
    # x⁻ = x + v, r = u - x⁻, x = x⁻ + α r, v += β r; eliminated for x over u.
    top = np.array([alpha, beta - alpha])
    below = np.array([1.0, alpha + beta - 2.0, 1.0 - alpha])
    return Filter(top=top, below=below)


def figures_of(unit: Filter, fs: float) -> dict[str, float]:
    """Delay, gain, and bandwidths of the response from samples to samples."""
    found = {"delay": unit.late / fs, "scale_factor": unit.gain, "bias": 0.0}
    grid = np.linspace(0, 0.5 * fs, 6001)[1:-1]

    def own(f: np.ndarray) -> np.ndarray:
        return unit.response(f, fs) / unit.gain

    value = own(grid)
    turned = np.unwrap(np.concatenate([[0.0], np.angle(value)]))[1:]
    without = turned + 2 * np.pi * grid * unit.late / fs

    def phase(f: float, *, late: int) -> float:
        exact = np.angle(own(np.array([f]))[0]) + 2 * np.pi * f * (unit.late - late) / fs
        near = np.interp(f, grid, turned if late else without)
        return exact + 2 * np.pi * np.round((near - exact) / (2 * np.pi))

    def crossing(values: np.ndarray, function) -> float | None:
        below = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
        return brentq(function, grid[below[0]], grid[below[0] + 1]) if below.size else None

    places = {
        "bandwidth_phase90": crossing(
            turned + np.pi / 2, lambda f: phase(f, late=unit.late) + np.pi / 2
        ),
        "bandwidth_phase90_without_delay": crossing(
            without + np.pi / 2, lambda f: phase(f, late=0) + np.pi / 2
        ),
        "bandwidth_3db": crossing(
            np.abs(value) ** 2 - 0.5, lambda f: abs(own(np.array([f]))[0]) ** 2 - 0.5
        ),
    }
    return found | {name: place for name, place in places.items() if place is not None}
