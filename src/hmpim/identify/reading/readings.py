"""What is read off a fitted model: each parameter of the result, with its error bar."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.fit import Fit, jacobian
from hmpim.identify.fitting.nested import widened
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.autoregression import autoregressive_spectrum
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.reading.propagation import gradient
from hmpim.identify.result import Estimate, Parameters
from hmpim.identify.result.error_bars import estimate, noise_estimate
from hmpim.model.dynamics import Structure, coefficients_of, denominator_of
from hmpim.model.filters import in_delta
from hmpim.model.response import (
    PeakGain,
    RationalDelay,
    bandwidth_3db,
    bandwidth_phase,
    dominant_time_constant,
    peak_gain,
    response,
)

__all__ = [
    "Readings",
    "figures_at",
    "figures_of",
    "read_figures",
    "read_parameters",
    "system_of",
]

_Vector = NDArray[np.float64]

_ROUNDING = 1e-13
"""Share of the output (r.m.s.) by which rounding may move it, whatever the residual shows."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """The parameters, the system they stand for, and the covariance behind them.

    Parameters
    ----------
    parameters : Parameters
        Estimates.
    system : RationalDelay
        In seconds, the scale factor included.
    vector : ndarray, shape (p,)
        Delay in samples, parameters of the denominator's sections in samples, numerator,
        bias.
    covariance : ndarray, shape (p, p)
        Of `vector`.
    white : bool
        Whether the residual passed for white.
    rows : ndarray, shape (p, n)
        Derivatives of the prediction, from `hmpim.identify.fitting.fit.jacobian`, whitened.
    innovations : ndarray, shape (n,)
        The residual, whitened.
    whitened : bool
        Whether that passed for white.
    coefficient_covariance : ndarray, shape (q, q)
        Of the delay and the coefficients of `system` that may vary, by rising powers of s.
    """

    parameters: Parameters
    system: RationalDelay
    vector: _Vector
    covariance: _Vector
    white: bool
    rows: _Vector
    innovations: _Vector
    whitened: bool
    coefficient_covariance: _Vector

    def variance(self, function: Callable[[_Vector], float]) -> float:
        """Variance of a function of `vector`, to first order."""
        slope = gradient(function, self.vector)
        return float(slope @ self.covariance @ slope)


def system_of(structure: Structure, vector: _Vector, fs: float) -> RationalDelay:
    """Build the system in seconds that a fit's vector stands for."""
    order = structure.order
    if structure.sampled:
        above, below = in_delta(
            structure, coefficients_of(structure, vector[1 : 1 + order]), vector[1 + order : -1]
        )
        return RationalDelay(
            delay=float(vector[0]) / fs, numerator=above, denominator=below, step=1.0 / fs
        )
    denominator = denominator_of(structure, coefficients_of(structure, vector[1 : 1 + order]))
    told = vector[1 + order : -1] * fs**structure.integrators
    numerator = np.concatenate([np.zeros(structure.dc_zeros), told])
    return RationalDelay(
        delay=float(vector[0]) / fs,
        numerator=numerator / fs ** np.arange(numerator.size),
        denominator=denominator / fs ** (np.arange(denominator.size) - structure.integrators),
    )


def read_parameters(
    joint: JointFit,
    *,
    fs: float,
    highest: float,
    delay_correlation: float | None,
    known_covariance: _Vector | None = None,
    input_unit: str,
    output_unit: str,
) -> Readings:
    """Turn the chosen fit into estimates.

    Parameters
    ----------
    joint : JointFit
        From `hmpim.identify.fitting.joint.joint_fit`.
    fs : float
        Rate in Hz.
    highest : float
        Frequency in Hz beyond which no bandwidth is read off: the end of the excited band.
    delay_correlation : float or None
        The paper's delay (eq. 8), in s.
    known_covariance : ndarray, shape (p, p), optional
        Of the fit's parameters, where other inputs were fitted with it.
    input_unit, output_unit : str
        Units of the channels.
    """
    fit = joint.best.fit
    structure = fit.structure
    vector = np.concatenate([fit.theta, fit.linear])
    weighed = joint.weighed
    freedom = max(weighed.counted - vector.size, 1)
    residual = weighed.innovations(fit.prediction, fit.residual)
    white = is_white(weighed.counting(residual))
    tested = joint.hidden
    rows = tested.rows if tested is not None and tested.fit is fit else jacobian(weighed, fit)
    cov = known_covariance
    if cov is None:
        cov = widened(joint, _covariance(joint, rows, residual, freedom=freedom, white=white))
    if weighed.noise is not None:
        cov = _wandering(cov, fit.residual, joint.problem.counted)
    parameters, system, coefficients = read_figures(
        structure,
        vector,
        cov,
        fs=fs,
        highest=highest,
        effective=freedom * joint.weighed_share,
        noise=noise_estimate(
            fit.cost,
            freedom=max(joint.problem.counted - vector.size, 1),
            share=joint.effective_share,
            unit=output_unit,
        ),
        units=(input_unit, output_unit),
    )
    return Readings(
        parameters=replace(parameters, delay_correlation=_from_lag(delay_correlation, fs)),
        system=system,
        vector=vector,
        covariance=cov,
        white=white and weighed.noise is None,
        rows=rows,
        innovations=residual,
        whitened=white,
        coefficient_covariance=coefficients,
    )


def read_figures(
    structure: Structure,
    vector: _Vector,
    cov: _Vector,
    *,
    fs: float,
    highest: float,
    effective: float,
    noise: Estimate,
    units: tuple[str, str],
) -> tuple[Parameters, RationalDelay, _Vector]:
    """Turn a fit's parameters and their covariance into estimates.

    Parameters
    ----------
    structure : Structure
        What was fitted.
    vector : ndarray, shape (p,)
        As `Readings` has it.
    cov : ndarray, shape (p, p)
        Of `vector`.
    fs, highest : float
        As for `read_parameters`.
    effective : float
        Independent samples less parameters.
    noise : Estimate
        Of the noise.
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
    input_unit, output_unit = units
    system = system_of(structure, vector, fs)

    def explicit(function: Callable[[_Vector], float], unit: str) -> Estimate:
        slope = gradient(function, vector)
        return estimate(function(vector), float(slope @ cov @ slope), freedom=effective, unit=unit)

    def linear(value: float, slope: _Vector, unit: str) -> Estimate:
        """An estimate whose derivatives are known in closed form."""
        return estimate(value, float(slope @ cov @ slope), freedom=effective, unit=unit)

    axis = np.eye(vector.size)

    order = structure.order
    # Neither an integrator nor a washout has a gain at DC to compare with.
    steady = structure.integrators == 0 and structure.dc_zeros == 0
    dynamic = order > 0 and steady
    marks, peak = _marks_of(structure, system, highest=highest)
    sensitivity = _Sensitivity(structure, vector, fs, tuple(f for f in marks if f is not None))

    def crossing(value: float | None, delay: bool | None) -> Estimate | None:
        """Frequency at which the phase (with the delay or without) or, for None, the gain is met.

        By the implicit function: the curve's own error over its slope.
        """
        if value is None:
            return None
        change, rate = sensitivity.at(value)
        if delay is None:
            slope, steep = change.real, rate.real
        else:
            slope, steep = change.imag.copy(), rate.imag
            if not delay:
                slope[0] += 2 * np.pi * value / fs
                steep += 2 * np.pi * system.delay
        return estimate(value, float(slope @ cov @ slope) / steep**2, freedom=effective, unit="Hz")

    mode = _lowest_mode(structure, vector)
    slow = dominant_time_constant(system)
    gain_unit = _ratio(output_unit, input_unit)
    gain_rate = fs ** (structure.integrators - structure.dc_zeros)
    if structure.integrators:
        gain_unit = f"{gain_unit or '1'}/s"
    if structure.dc_zeros:
        gain_unit = f"{gain_unit}*s" if gain_unit else "s"
    low_frequency = None
    if dynamic:

        def slope_at_dc(v: _Vector) -> float:
            return _slope_at_dc(system_of(structure, v, fs))

        low_frequency = explicit(slope_at_dc, "s")
    natural = damping = 0.0
    stretch = np.zeros(vector.size)
    if mode is not None:
        natural, damping = _mode_at(vector, mode, fs)
        stretch = axis[mode + 1] / (2 * vector[mode + 1])
    parameters = Parameters(
        delay=linear(vector[0] / fs, axis[0] / fs, "s"),
        delay_low_frequency=low_frequency or linear(vector[0] / fs, axis[0] / fs, "s"),
        scale_factor=linear(gain_rate * vector[1 + order], gain_rate * axis[1 + order], gain_unit),
        bias=linear(vector[-1], axis[-1], output_unit),
        noise_std=noise,
        natural_frequency=linear(natural, -natural * (axis[mode] + stretch), "Hz")
        if mode is not None
        else None,
        damping_ratio=linear(damping, -damping * stretch, "") if mode is not None else None,
        time_constant=explicit(
            lambda v: dominant_time_constant(system_of(structure, v, fs)) or float("nan"), "s"
        )
        if slow is not None
        else None,
        bandwidth_phase90=crossing(marks[0], True),
        bandwidth_phase90_without_delay=crossing(marks[1], False),
        bandwidth_3db=crossing(marks[2], None),
        # At a maximum the frequency's own shift does not count; without a hump it is 0 dB exactly.
        peak_gain_db=linear(
            peak.gain_db,
            20 / np.log(10) * sensitivity.at(peak.frequency)[0].real * (peak.frequency > 0),
            "dB",
        )
        if peak is not None
        else None,
    )
    slopes = sensitivity.coefficients
    return parameters, system, slopes.T @ cov @ slopes


def _marks_of(
    structure: Structure, system: RationalDelay, *, highest: float, split_alone: bool = False
) -> tuple[tuple[float | None, float | None, float | None, float | None], PeakGain | None]:
    """-90° with the delay and without, -3 dB, the peak's frequency; and the peak."""
    steady = structure.integrators == 0 and structure.dc_zeros == 0
    dynamic = structure.order > 0 and steady
    split = bandwidth_phase(system, highest=highest, delay=False) if dynamic else None
    if split_alone:
        return (None, split, None, None), None
    peak = peak_gain(system, highest=highest) if dynamic else None
    marks = (
        bandwidth_phase(system, highest=highest) if steady else None,
        split,
        bandwidth_3db(system, highest=highest) if dynamic else None,
        peak.frequency if peak is not None else None,
    )
    return marks, peak


def figures_of(
    fit: Fit, *, fs: float, highest: float, split_alone: bool = False
) -> dict[str, float | None]:
    """Values alone of what `read_parameters` gives with error bars, the noise apart.

    Parameters
    ----------
    fit : Fit
        Any fit.
    fs, highest : float
        As for `read_parameters`.
    split_alone : bool
        Whether `PHASE_SPLIT` is all that is asked; what else is looked for along a curve is None.
    """
    vector = np.concatenate([fit.theta, fit.linear])
    return figures_at(fit.structure, vector, fs=fs, highest=highest, split_alone=split_alone)


def figures_at(
    structure: Structure,
    vector: _Vector,
    *,
    fs: float,
    highest: float,
    split_alone: bool = False,
) -> dict[str, float | None]:
    """The same at any parameters, `vector` as `Readings` has it."""
    system = system_of(structure, vector, fs)
    marks, peak = _marks_of(structure, system, highest=highest, split_alone=split_alone)
    mode = _lowest_mode(structure, vector)
    natural, damping = (None, None) if mode is None else _mode_at(vector, mode, fs)
    steady = structure.integrators == 0 and structure.dc_zeros == 0
    return {
        "delay": system.delay,
        "delay_low_frequency": _slope_at_dc(system) if steady else system.delay,
        "scale_factor": fs ** (structure.integrators - structure.dc_zeros)
        * float(vector[1 + structure.order]),
        "bias": float(vector[-1]),
        "natural_frequency": natural,
        "damping_ratio": damping,
        "time_constant": dominant_time_constant(system),
        "bandwidth_phase90": marks[0],
        "bandwidth_phase90_without_delay": marks[1],
        "bandwidth_3db": marks[2],
        "peak_gain_db": None if peak is None else peak.gain_db,
    }


def _slope_at_dc(system: RationalDelay) -> float:
    """Delay that the phase shows at low frequency, in s."""
    first = 0.0 if system.denominator.size < 2 else float(system.denominator[1])
    lead = system.numerator[1] / system.numerator[0] if system.numerator.size > 1 else 0.0
    return float(system.delay + (first - lead) * (system.step or 1.0))


def _mode_at(vector: _Vector, mode: int, fs: float) -> tuple[float, float]:
    """Natural frequency in Hz and damping ratio of 1 + c1 s + c2 s²: c2^(-1/2), c1 ω / 2."""
    damping = 0.5 / float(np.sqrt(vector[mode + 1]))  # it holds c2 / c1²
    return 2 * damping * float(np.exp(-vector[mode])) * fs / (2 * np.pi), damping


class _Sensitivity:
    """Derivatives of ln(G / G(0)) with respect to the fit's vector, and to the frequency."""

    def __init__(
        self, structure: Structure, vector: _Vector, fs: float, frequencies: tuple[float, ...]
    ) -> None:
        self._places = np.array(frequencies)

        def curve(system: RationalDelay, f: _Vector) -> NDArray[np.complex128]:
            told = system.numerator[structure.dc_zeros]
            return np.asarray(response(system, f) / told)

        def coefficients(system: RationalDelay) -> _Vector:
            varied = system.denominator[structure.integrators + 1 :]
            return np.concatenate([[system.delay], system.numerator, varied])

        middle = system_of(structure, vector, fs)
        here = curve(middle, self._places)
        self._slopes = np.empty((vector.size, self._places.size), dtype=np.complex128)
        by_coefficient = []
        for i, value in enumerate(vector):
            step = np.zeros(vector.size)
            step[i] = 1e-6 * max(abs(value), 1e-3)
            above, below = (system_of(structure, vector + sign * step, fs) for sign in (1.0, -1.0))
            up, down = curve(above, self._places), curve(below, self._places)
            self._slopes[i] = (up - down) / (2 * step[i] * here)
            by_coefficient.append((coefficients(above) - coefficients(below)) / (2 * step[i]))
        self.coefficients = np.stack(by_coefficient)
        """Derivatives of the delay and the coefficients of B and A, in s, shape (p, q)."""
        up, down = (curve(middle, self._places * (1 + sign * 1e-5)) for sign in (1.0, -1.0))
        self._rates = (up - down) / (2e-5 * np.maximum(self._places, 1e-300) * here)

    def at(self, frequency: float) -> tuple[NDArray[np.complex128], complex]:
        """Derivatives with respect to the vector, shape (p,), and to the frequency in Hz."""
        i = int(np.flatnonzero(self._places == frequency)[0])
        return self._slopes[:, i], complex(self._rates[i])


def _lowest_mode(structure: Structure, vector: _Vector) -> int | None:
    """Index in `vector` of the second-order section with the lowest natural frequency."""
    found, start = [], 1
    for order in structure.sections:
        if order == 2:
            omega = np.exp(-vector[start]) / np.sqrt(vector[start + 1])
            found.append((float(omega), start))
        start += order
    return min(found)[1] if found else None


def _covariance(
    joint: JointFit, rows: _Vector, residual: _Vector, *, freedom: int, white: bool
) -> _Vector:
    """Covariance of theta and linear; a held, static system moves in whole samples only."""
    fit = joint.best.fit
    if fit.structure.sampled:  # its delay is a whole number of samples
        inner = covariance(rows[1:], residual, freedom=freedom, white=white)
        rounding = _ROUNDING**2 * float(joint.problem.y @ joint.problem.y)
        full = np.zeros((rows.shape[0], rows.shape[0]))
        full[1:, 1:] = inner * (1.0 + rounding / max(fit.cost, 1e-3 * rounding))
        return full
    if fit.structure.name == "static" and joint.best.intersample == "zoh":
        inner = covariance(rows[1:], residual, freedom=freedom, white=white)
        full = np.zeros((rows.shape[0], rows.shape[0]))
        full[1:, 1:] = inner
        full[0, 0] = 1.0 / 12.0  # uniform over the sample in which the delay ends
        return full
    return covariance(rows, residual, freedom=freedom, white=white)


def _wandering(cov: _Vector, residual: _Vector, counted: int) -> _Vector:
    """Widen the bias to what noise does that rises towards DC below what an autoregression tells.

    The variance of a mean is the noise's power at half a bin over the samples.
    """
    slowest = np.array([np.pi / residual.size])
    known = float(autoregressive_spectrum(residual, slowest)[0]) / counted
    if known <= cov[-1, -1]:
        return cov
    stretch = np.ones(cov.shape[0])
    stretch[-1] = np.sqrt(known / cov[-1, -1])
    return np.asarray(cov * np.outer(stretch, stretch))


def _from_lag(delay: float | None, fs: float) -> Estimate | None:
    """The paper's delay is a whole number of samples: uniform over one sample."""
    if delay is None:
        return None
    half = 0.5 / fs
    return Estimate(value=delay, std=half / np.sqrt(3), ci95=(delay - half, delay + half), unit="s")


def _ratio(output_unit: str, input_unit: str) -> str:
    if output_unit == input_unit:
        return ""
    return f"{output_unit or '1'}/{input_unit}" if input_unit else output_unit
