"""What is measured without a model: the frequency response, bandwidths, what is nonlinear."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hmpim.equality import ByValue
from hmpim.identify.arrays import Complex, Real
from hmpim.identify.result.estimate import Estimate, Estimates
from hmpim.identify.result.plain import Plain

__all__ = ["FrequencyResponse", "HarmonicCurve", "Nonlinearity", "ResponseBandwidths"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FrequencyResponse(ByValue):
    """Measured frequency response, output over input, with its error at each frequency.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, increasing.
    response : complex ndarray, shape (m,)
        Output unit per input unit, e^(+jωt) convention; delay included.
    std : ndarray, shape (m,)
        Standard deviation of |error|: sqrt(E|Ĝ-G|²), same unit as the response.
    coherence : ndarray, shape (m,), or None
        None where it means nothing, as with a single segment.
    """

    frequency: Real
    response: Complex
    std: Real
    coherence: Real | None = None

    def to_dict(self) -> dict[str, Any]:
        """Return the response as plain JSON values."""
        return {
            "frequency": self.frequency.tolist(),
            "real": self.response.real.tolist(),
            "imag": self.response.imag.tolist(),
            "std": self.std.tolist(),
            "coherence": None if self.coherence is None else self.coherence.tolist(),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "FrequencyResponse":
        """Read back what `to_dict` wrote."""
        coherence = data["coherence"]
        return cls(
            frequency=np.asarray(data["frequency"], dtype=float),
            response=np.asarray(data["real"], dtype=float) + 1j * np.asarray(data["imag"]),
            std=np.asarray(data["std"], dtype=float),
            coherence=None if coherence is None else np.asarray(coherence, dtype=float),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ResponseBandwidths(Estimates):
    """Bandwidths read off the measured response, in Hz; None where it does not reach them."""

    bandwidth_phase90: Estimate | None = None
    bandwidth_phase90_without_delay: Estimate | None = None
    bandwidth_3db: Estimate | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicCurve(Plain):
    """One harmonic along a sweep.

    Parameters
    ----------
    order : int
        Multiple of the sweep's frequency.
    frequency : tuple of float
        Frequency of the sweep itself, Hz.
    amplitude, std : tuple of float
        Amplitude of the harmonic while the sweep is there, and its standard deviation, in the
        output's unit.
    """

    order: int
    frequency: tuple[float, ...]
    amplitude: tuple[float, ...]
    std: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Nonlinearity(Plain):
    """What no linear system makes of the input, and what it looks like.

    Parameters
    ----------
    share : float
        R.m.s. of the nonlinear part over that of the output about its mean; 0 if none is seen.
    even, odd : float
        The same for the part that is asymmetric and the part that is alike either way, noise
        taken off.
    noise, linear, nonlinear : float
        What the power of the residual is made of; they add to 1. `linear` still follows the
        input: dynamics left out, and what of a nonlinearity looks linear.
    kinds : tuple of str
        What the record leaves in question: one if it tells ('hardening', 'softening',
        'friction', 'backlash', 'rate_limit', 'saturation', 'asymmetry', 'curvature',
        'dead_zone'), several
        if not, none if it is like none of them or too small to ask.
    size : Estimate or None
        Of the kind, if there is one: half width of the band of friction, backlash or a dead zone,
        speed, level, or share by which the largest deflection departs from proportion.
    harmonics : tuple of HarmonicCurve
        Of a sweep in which there is something to see; order 1 is the output itself.
    """

    share: float
    even: float
    odd: float
    noise: float
    linear: float
    nonlinear: float
    kinds: tuple[str, ...] = ()
    size: Estimate | None = None
    harmonics: tuple[HarmonicCurve, ...] = ()
