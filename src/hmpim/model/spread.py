"""What an identification leaves open about a model: standard deviations and covariance."""

from dataclasses import dataclass

__all__ = ["Spread"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """How far the figures of a model may be off: standard deviations, 0 where known.

    Parameters
    ----------
    covariance : tuple of tuple of float
        Of the delay in s, of the numerator times the scale factor, and of the denominator
        before its last coefficient that is not 0, each highest power of s first; (q, q).
    bias, noise_std, saturation_low, saturation_high, hold_period, quantization_step : float
        Standard deviations of the fields of these names.
    """

    covariance: tuple[tuple[float, ...], ...]
    bias: float = 0.0
    noise_std: float = 0.0
    saturation_low: float = 0.0
    saturation_high: float = 0.0
    hold_period: float = 0.0
    quantization_step: float = 0.0
