"""Measurements: the frequency response, bandwidths, nonlinearity."""

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

    It relates samples to samples. If the input is held or linear between its samples, it therefore
    differs from the response in continuous time towards half the sampling rate. A held input costs
    half a sample of delay and, at a quarter of the rate, about a tenth of the gain, a linear one
    about a fifth of the gain there.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, increasing.
    response : complex ndarray, shape (m,)
        Output unit per input unit, e^(+jωt) convention; delay included.
    std : ndarray, shape (m,)
        Standard deviation of |error|: sqrt(E|Ĝ-G|²), same unit as the response.
    coherence : ndarray, shape (m,), or None
        None where it has no meaning, as with a single segment.
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
        Amplitude of the harmonic when the sweep has that frequency, and its standard deviation, in
        the output's unit.
    """

    order: int
    frequency: tuple[float, ...]
    amplitude: tuple[float, ...]
    std: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Nonlinearity(Plain):
    """The nonlinear part of the output, and its kind.

    Parameters
    ----------
    share : float
        R.m.s. of the nonlinear part over that of the output about its mean; 0 if none is detected.
    even, odd : float
        The same for the asymmetric part and the symmetric part, without the noise.
    noise, linear, nonlinear : float
        Shares of the power of the residual; they add to 1. `linear` still follows the input:
        dynamics that the model lacks, and the part of a nonlinearity that looks linear.
    kinds : tuple of str
        Kinds that are possible: one if the record determines it ('hardening', 'softening',
        'friction', 'backlash', 'rate_limit', 'saturation', 'asymmetry', 'curvature',
        'dead_zone'), several
        if it does not, none if no kind fits or the nonlinear part is too small.
    size : Estimate or None
        Of the kind, if there is one: half width of the band of friction, backlash or a dead zone,
        speed, level, or share by which the largest deflection departs from proportion.
    harmonics : tuple of HarmonicCurve
        For a sweep with visible harmonics; order 1 is the output itself.
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
