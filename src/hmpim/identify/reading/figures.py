"""Figures of a system, each with its error bar from the covariance of the fit."""

from collections.abc import Callable

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.error_bars import estimate
from hmpim.identify.result.groups import FIXED_UNITS
from hmpim.model.dynamics import Structure, coefficients_of, denominator_of, numerator_of
from hmpim.model.filters import in_delta
from hmpim.model.response import (
    PeakGain,
    RationalDelay,
    bandwidth_3db,
    bandwidth_phase,
    dominant_time_constant,
    log_slopes,
    peak_gain,
    response,
)
from hmpim.units import quotient_unit

__all__ = [
    "figures_at",
    "figures_of",
    "gradient",
    "read_figures",
    "system_of",
    "units_of",
    "variance_of",
]


def units_of(structure: Structure, units: tuple[str, str]) -> dict[str, str]:
    """Return the unit of each figure, from those of input and output."""
    source, output = units
    gain = quotient_unit(output, source) if source else output
    if structure.integrators:
        gain = f"{gain or '1'}/s"
    if structure.dc_zeros:
        time = "s" if structure.dc_zeros == 1 else f"s^{structure.dc_zeros}"
        gain = f"{gain}*{time}" if gain else time
    return {
        **FIXED_UNITS,
        "damping_ratio": "",
        "scale_factor": gain,
        "bias": output,
        "noise_std": output,
    }


def system_of(structure: Structure, vector: Real, fs: float) -> RationalDelay:
    """Return the system in seconds for the vector of a fit."""
    order, delay = structure.order, float(vector[0]) / fs
    coefficients, above = coefficients_of(structure, vector[1 : 1 + order]), vector[1 + order : -1]
    if structure.sampled:
        numerator, denominator = in_delta(structure, coefficients, above)
        return RationalDelay(
            delay=delay, numerator=numerator, denominator=denominator, step=1.0 / fs
        )
    denominator = denominator_of(structure, coefficients)
    numerator = numerator_of(structure, coefficients, above * fs**structure.integrators)
    return RationalDelay(
        delay=delay,
        numerator=numerator / fs ** np.arange(numerator.size),
        denominator=denominator / fs ** (np.arange(denominator.size) - structure.integrators),
    )


def read_figures(
    structure: Structure,
    vector: Real,
    cov: Real,
    *,
    fs: float,
    highest: float | None,
    effective: float,
    noise: Estimate,
    units: tuple[str, str],
) -> tuple[Parameters, RationalDelay, Real]:
    """Turn the parameters of a fit, `vector` as in `Readings`, and their covariance into estimates.

    Parameters
    ----------
    fs, highest : float
        As for `read_parameters`; nothing is read off the response if `highest` is None.
    effective : float
        Independent samples less parameters.
    noise : Estimate
        Standard deviation of the noise.
    units : (str, str)
        Of input and output.

    Returns
    -------
    parameters : Parameters
        Without the paper's delay.
    system : RationalDelay
        The system in seconds, the scale factor included.
    spread : ndarray, shape (q, q)
        Covariance of its delay and of the coefficients that may vary.
    """
    system = system_of(structure, vector, fs)
    values, peak = _values(structure, vector, system, fs=fs, highest=highest)

    def coefficients(at: Real) -> Real:
        """The delay and the coefficients of B and A in s; the first of A that is not 0 is 1."""
        other = system_of(structure, at, fs)
        varied = other.denominator[structure.integrators + 1 :]
        return np.concatenate([[other.delay], other.numerator, varied])

    by_coefficient = gradient(coefficients, vector)  # (p, q)
    slopes = _slopes(structure, vector, fs, values)
    slopes |= _slopes_of_marks(structure, system, by_coefficient, values, peak)
    unit_of = units_of(structure, units)

    def read(name: str, value: float) -> Estimate:
        variance = variance_of(slopes[name], cov)
        return estimate(value, variance, freedom=effective, unit=unit_of[name])

    given = {name: read(name, value) for name, value in values.items() if value is not None}
    spread = by_coefficient.T @ cov @ by_coefficient
    return Parameters(noise_std=noise, **given), system, spread


def _slopes(
    structure: Structure, vector: Real, fs: float, values: dict[str, float | None]
) -> dict[str, Real]:
    """Derivatives by the vector of the fit, of figures that do not come from the response."""
    axis, order = np.eye(vector.size), structure.order
    slopes = {
        "delay": axis[0] / fs,
        "scale_factor": _gain_rate(structure, fs) * axis[1 + order],
        "bias": axis[-1],
    }
    mode, natural = _lowest_mode(structure, vector), values["natural_frequency"]
    if mode is not None and natural is not None:
        stretch = axis[mode + 1] / (2 * vector[mode + 1])
        slopes["natural_frequency"] = -natural * (axis[mode] + stretch)
        slopes["damping_ratio"] = -(values["damping_ratio"] or 0.0) * stretch
    if values["time_constant"] is not None:
        slopes["time_constant"] = gradient(
            lambda v: dominant_time_constant(system_of(structure, v, fs)) or float("nan"), vector
        )
    return slopes


def variance_of(slope: Real, cov: Real) -> float:
    """Variance of a figure by its derivatives, (p,), to first order, and at least its rounding."""
    # Along a direction that the record leaves open nearly everything cancels.
    rounding = np.finfo(float).eps * float(np.abs(slope) @ np.abs(cov) @ np.abs(slope))
    return max(float(slope @ cov @ slope), rounding)


def gradient(function: Callable[[Real], float] | Callable[[Real], Real], at: Real) -> Real:
    """Derivatives by central differences, shape (p,), or (p, q) of a function of q values."""
    out = []
    for i, step in enumerate(1e-6 * np.maximum(np.abs(at), 1e-3)):
        up, down = at.copy(), at.copy()
        up[i] += step
        down[i] -= step
        out.append((function(up) - function(down)) / (2 * step))
    return np.array(out)


def figures_of(fit: Fit, *, fs: float, highest: float) -> dict[str, float | None]:
    """Values of the figures that `read_parameters` gives with error bars, without the noise."""
    vector = np.concatenate([fit.theta, fit.linear])
    return figures_at(fit.structure, vector, fs=fs, highest=highest)


def figures_at(
    structure: Structure, vector: Real, *, fs: float, highest: float
) -> dict[str, float | None]:
    """The same at any parameters, `vector` as in `Readings`."""
    return _values(structure, vector, system_of(structure, vector, fs), fs=fs, highest=highest)[0]


def _values(
    structure: Structure, vector: Real, system: RationalDelay, *, fs: float, highest: float | None
) -> tuple[dict[str, float | None], PeakGain | None]:
    """Every figure of a system except the noise; the peak of its gain."""
    mode, steady = _lowest_mode(structure, vector), _is_steady(structure)
    natural = damping = phase90 = without_delay = half = peak = None
    if mode is not None:  # 1 + c1 s + c2 s²: c2^(-1/2), c1 ω / 2; the vector holds c2 / c1²
        damping = 0.5 / float(np.sqrt(vector[mode + 1]))
        natural = 2 * damping * float(np.exp(-vector[mode])) * fs / (2 * np.pi)
    if steady and highest is not None:
        phase90 = bandwidth_phase(system, highest=highest)
        if structure.order:
            without_delay = bandwidth_phase(system, highest=highest, delay=False)
            half = bandwidth_3db(system, highest=highest)
            peak = peak_gain(system, highest=highest)
    values = {
        "delay": system.delay,
        "delay_low_frequency": _slope_at_dc(system) if steady else system.delay,
        "scale_factor": _gain_rate(structure, fs) * float(vector[1 + structure.order]),
        "bias": float(vector[-1]),
        "natural_frequency": natural,
        "damping_ratio": damping,
        "time_constant": dominant_time_constant(system),
        "bandwidth_phase90": phase90,
        "bandwidth_phase90_without_delay": without_delay,
        "bandwidth_3db": half,
        "peak_gain_db": None if peak is None else peak.gain_db,
    }
    return values, peak


def _is_steady(structure: Structure) -> bool:
    """Whether there is a gain at DC: an integrator and a washout have none."""
    return structure.integrators == 0 and structure.dc_zeros == 0


def _gain_rate(structure: Structure, fs: float) -> float:
    """Ratio of the scale factor in seconds to that in samples."""
    return float(fs ** (structure.integrators - structure.dc_zeros))


def _slope_at_dc(system: RationalDelay) -> float:
    """Delay at low frequency, by the slope of the phase, in s."""
    first = 0.0 if system.denominator.size < 2 else float(system.denominator[1])
    above = system.numerator
    lead = above[1] / above[0] if above.size > 1 and above[0] else 0.0
    return float(system.delay + (first - lead) * (system.step or 1.0))


def _slopes_of_marks(
    structure: Structure,
    system: RationalDelay,
    by_coefficient: Real,
    values: dict[str, float | None],
    peak: PeakGain | None,
) -> dict[str, Real]:
    """Derivatives by the vector of the fit, (p,), of figures that come from the response.

    For a crossing by the implicit function: the change of the curve over its slope.
    """

    def at(frequency: float) -> tuple[Complex, complex]:
        """Derivatives of ln(G / G(0)) by the vector, shape (p,), and by the frequency in Hz."""
        places = frequency * np.array([1.0 - 1e-5, 1.0, 1.0 + 1e-5])
        below, here, above = response(system, places)
        rate = (above - below) / ((places[2] - places[0]) * here)
        by_delay, by_above, by_below = log_slopes(system, places[1:2])
        first = structure.dc_zeros
        by_above[first] -= 1.0 / system.numerator[first]
        change = by_coefficient @ np.concatenate([by_delay, by_above, by_below])[:, 0]
        return change, complex(rate)

    delay = by_coefficient[:, 0]
    slopes = {"delay_low_frequency": delay + _late_at_dc(structure, system, by_coefficient[:, 1:])}
    for name, turn in (("bandwidth_phase90", 0.0), ("bandwidth_phase90_without_delay", 1.0)):
        if (value := values[name]) is not None:
            change, rate = at(value)
            late = 2 * np.pi * turn
            slopes[name] = (change.imag + late * value * delay) / (rate.imag + late * system.delay)
    if (value := values["bandwidth_3db"]) is not None:
        change, rate = at(value)
        slopes["bandwidth_3db"] = change.real / rate.real
    if peak is not None:
        slopes["peak_gain_db"] = np.zeros(delay.size)  # 0 dB, if there is no hump
        if peak.frequency > 0.0:  # at a maximum a shift of its frequency has no effect
            slopes["peak_gain_db"] = 20 / np.log(10) * at(peak.frequency)[0].real
    return slopes


def _late_at_dc(structure: Structure, system: RationalDelay, slopes: Real) -> Real:
    """Derivative of the delay of the dynamics at low frequency, in s, shape (p,)."""
    above, late = system.numerator, np.zeros(slopes.shape[0])
    if not _is_steady(structure):
        return late
    if system.denominator.size > 1:
        late = late + slopes[:, above.size]
    if above.size > 1 and above[0]:
        late = late - (slopes[:, 1] - above[1] / above[0] * slopes[:, 0]) / above[0]
    return np.asarray(late * (system.step or 1.0))


def _lowest_mode(structure: Structure, vector: Real) -> int | None:
    """Index in `vector` of the second-order section with the lowest natural frequency."""
    starts = np.cumsum([1, *structure.sections]).tolist()
    modes = [k for k, order in zip(starts, structure.sections, strict=False) if order == 2]
    return min(modes, key=lambda k: np.exp(-vector[k]) / np.sqrt(vector[k + 1]), default=None)
