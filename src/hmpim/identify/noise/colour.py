"""The kind of noise: white, correlated, low-frequency, or with a line.

All of it is estimated from the residual of a fit, and is only as good as the fit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import SEARCHED
from hmpim.identify.noise.whiteness import autocovariance, is_white

__all__ = ["Colour", "NoiseColour", "line_of", "noise_colour", "tone_of"]

Colour = Literal["white", "autoregressive", "power_law"]
"""White; correlated over a few samples (AR(1)); or a power of the frequency (1/f, wander)."""

_NEIGHBOURS = 30
"""Bins on either side that a line is compared with."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseColour:
    """Colour of a noise."""

    kind: Colour  # the likelier description, apart from a line
    coefficient: float  # correlation between one sample and the next: the AR(1) coefficient
    exponent: float  # α of a power spectrum as f^-α; 0 is white, 1 flicker, 2 random walk
    line_frequency: float | None  # of the strongest line above the noise, Hz

    @property
    def description(self) -> str:
        """The colour in words."""
        match self.kind:
            case "white":
                words = "white"
            case "autoregressive":
                words = f"correlated from sample to sample (coefficient {self.coefficient:.2f})"
            case "power_law":
                words = f"stronger at low frequency (power as 1/f^{self.exponent:.1f})"
        if self.line_frequency is None:
            return words
        return f"{words}, with a line at {self.line_frequency:.4g} Hz"


def noise_colour(residual: Real, fs: float) -> NoiseColour:
    """Describe the noise in the residual of a fit, (m,), by the samples that count.

    Coloured noise is AR(1) or a power law, the likelier of the two, each fitted by Whittle's
    likelihood (P. Whittle, Arkiv för Matematik 2, 1953).
    """
    e = residual - residual.mean()
    n = e.size
    line = line_of(e, fs)
    if line is not None:
        e = e - tone_of(e, line / fs)
    r = autocovariance(e, 1)
    rho = float(r[1] / r[0])
    rho = float(np.clip(rho + (1 + 3 * rho) / n, -0.9999, 0.9999))  # Kendall's bias
    kind: Colour = "white"
    exponent = 0.0
    if not is_white(e):
        kind, exponent = _likelier(e)
    return NoiseColour(kind=kind, coefficient=rho, exponent=exponent, line_frequency=line)


def line_of(e: Real, fs: float) -> float | None:
    """Frequency in Hz of the strongest narrow line in samples (n,) of zero mean, or None."""
    n = e.size
    size = float(np.max(np.abs(e)))
    if n < 8 * _NEIGHBOURS or size == 0.0:
        return None
    power = np.abs(scipy.fft.rfft(e / size * np.hanning(n))) ** 2
    rounding = np.finfo(float).eps ** 2 * float(power.max())
    inner = np.arange(_NEIGHBOURS, power.size)
    power = np.pad(power, (0, _NEIGHBOURS + 1), mode="reflect")  # beyond half the rate
    summed = np.concatenate([[0.0], np.cumsum(power)])
    wide = summed[inner + _NEIGHBOURS + 1] - summed[inner - _NEIGHBOURS]
    narrow = summed[inner + 3] - summed[inner - 2]
    around = (wide - narrow) / (2 * _NEIGHBOURS - 4)
    ratio = power[inner] / np.maximum(around, rounding)
    best = int(np.argmax(ratio))
    if ratio[best] < SEARCHED:
        return None
    k = int(inner[best])
    left, here, right = np.log(np.maximum(power[k - 1 : k + 2], np.finfo(float).tiny))
    return float((k + 0.5 * (left - right) / (left - 2 * here + right)) * fs / n)


def tone_of(e: Real, frequency: float) -> Real:
    """The line at `frequency`, in cycles per sample, in a residual of zero mean."""
    phase = 2 * np.pi * frequency * np.arange(e.size)
    rows = np.stack([np.cos(phase), np.sin(phase)])
    return np.asarray(np.linalg.solve(rows @ rows.T, rows @ e) @ rows)


def _likelier(e: Real) -> tuple[Colour, float]:
    """AR(1) or a power law, by Whittle's likelihood, and the power law's exponent."""
    n = e.size
    power = np.abs(scipy.fft.rfft(e)[1 : (n - 1) // 2]) ** 2 / n
    power = np.maximum(power, 1e-12 * power.mean())
    omega = 2 * np.pi * np.arange(1, power.size + 1) / n

    def best(shaped: Callable[[float], Real], low: float, high: float) -> Any:
        def cost(at: float) -> float:
            shape = shaped(at)
            return float(np.log(np.mean(power / shape)) + np.mean(np.log(shape)))

        return scipy.optimize.minimize_scalar(cost, bounds=(low, high), method="bounded")

    first = best(lambda rho: 1.0 / (1.0 - 2.0 * rho * np.cos(omega) + rho * rho), -0.999, 0.9999)
    second = best(lambda exponent: omega**-exponent, -2.0, 4.0)
    kind: Colour = "autoregressive" if first.fun <= second.fun else "power_law"
    return kind, float(second.x)
