"""Frequency response of a rational system with delay, and the figures read off it.

Coefficients here are in seconds: numerator and denominator by rising powers of s.
"""

import cmath
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from math import atan, pi

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.model.filters import delta_of

__all__ = [
    "PeakGain",
    "RationalDelay",
    "bandwidth_3db",
    "bandwidth_phase",
    "by_falling_powers",
    "dominant_time_constant",
    "log_slopes",
    "peak_gain",
    "per_step",
    "phase",
    "response",
    "response_std",
    "slowest_time_constant",
]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RationalDelay:
    """``e^(-s τ) B(s) / A(s)``.

    Parameters
    ----------
    delay : float
        τ in seconds.
    numerator, denominator : ndarray, shapes (m + 1,) and (n + 1,)
        B and A by rising powers of s, in seconds; A(0) = 1.
    step: float or None
        Of a filter in z, its sample time in s: powers are those of 1 - 1/z then, not of s.
    """

    delay: float
    numerator: NDArray[np.float64]
    denominator: NDArray[np.float64]
    step: float | None = None

    def variable(self, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
        """What the polynomials are in, at `frequency` in Hz: s, or 1 - 1/z."""
        if self.step is not None:
            return delta_of(frequency, self.step)
        return np.asarray(2j * np.pi * np.asarray(frequency, dtype=np.float64), dtype=np.complex128)


def per_step(coefficients: NDArray[np.float64], rate: float) -> NDArray[np.float64]:
    """Coefficients by rising powers of s, with time in steps of which there are `rate` to its unit.

    Examples
    --------
    >>> per_step(np.array([1.0, 0.5]), 200.0).tolist()
    [1.0, 100.0]
    """
    return np.asarray(coefficients * rate ** np.arange(coefficients.size))


def response(system: RationalDelay, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex response at `frequency` in Hz, shape (m,); output unit per input unit.

    Examples
    --------
    >>> lag = RationalDelay(delay=0.0, numerator=np.ones(1), denominator=np.array([1.0, 1.0]))
    >>> abs(response(lag, np.array([1 / (2 * np.pi)]))).round(6).tolist()
    [0.707107]
    """
    x = system.variable(frequency)
    ratio = _polynomial(system.numerator, x) / _polynomial(system.denominator, x)
    late = np.exp(-2j * np.pi * np.asarray(frequency, dtype=np.float64) * system.delay)
    return np.asarray(ratio * late)


def _polynomial(
    coefficients: NDArray[np.float64], s: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """By Horner's rule: `numpy.polynomial` checks its arguments longer than it computes."""
    value = np.full(s.shape, coefficients[-1], dtype=np.complex128)
    for coefficient in coefficients[-2::-1]:
        value = coefficient + s * value
    return value


def _roots(coefficients: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Roots of a polynomial by rising powers."""
    trimmed = coefficients if coefficients[-1] else np.trim_zeros(coefficients, "b")
    if trimmed.size == 3:  # in closed form, without loss where one root is much the greater
        c, b, a = trimmed.tolist()
        away = cmath.sqrt(b * b - 4 * a * c)
        q = -0.5 * (b + (away if (b * away.conjugate()).real >= 0 else -away))
        return np.array([q / a, c / q]) if q != 0 else np.zeros(2, dtype=complex)
    return _roots_of(tuple(trimmed.tolist()))


@lru_cache(maxsize=8)  # each figure of a system begins with them
def _roots_of(coefficients: tuple[float, ...]) -> NDArray[np.complex128]:
    """Roots as eigenvalues."""
    roots = np.asarray(np.roots(coefficients[::-1]), dtype=np.complex128)
    roots.flags.writeable = False
    return roots


def _turn(roots: NDArray[np.complex128], omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Continuous phase in jω of a polynomial with these roots, zero at ω = 0, in radians."""
    if not roots.size:
        return np.zeros(omega.shape)
    away, aside = np.abs(roots.real)[:, None], roots.imag[:, None]
    side = np.where(roots.real > 0.0, -1.0, 1.0)[:, None]  # a root on the axis counts as stable
    turned = np.arctan2(omega - aside, away) - np.arctan2(-aside, away)
    return np.asarray((side * turned).sum(axis=0))


def _turn_in_z(roots: NDArray[np.complex128], omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Continuous phase of a polynomial in 1 - 1/z, zero at DC, at radians per sample."""
    inverse = (1.0 - roots)[:, None]  # 1 - δ/r is 1 - q/z but for a factor, q its inverse
    outside = np.abs(inverse) < 1.0 - 1e-9
    inner = np.divide(1.0, inverse, out=inverse.copy(), where=~outside)
    sign = np.where(outside, 1.0, -1.0)
    turned = np.angle(1.0 - inner * np.exp(1j * sign * omega)) - np.angle(1.0 - inner)
    return np.asarray((turned - np.where(outside, omega, 0.0)).sum(axis=0))


def phase(
    system: RationalDelay, frequency: NDArray[np.float64], *, delay: bool = True
) -> NDArray[np.float64]:
    """Phase in radians relative to DC, continuous from 0 Hz on, however often it wraps.

    Parameters
    ----------
    system : RationalDelay
        The system; the sign of its gain does not matter here.
    frequency : ndarray, shape (m,)
        Hz.
    delay : bool
        Whether the pure delay's lag is included (paper, eq. 25, takes it out).
    """
    return _phase_of(system, delay=delay)(np.asarray(frequency, dtype=np.float64))


def _phase_of(
    system: RationalDelay, *, delay: bool
) -> Callable[[NDArray[np.float64]], NDArray[np.float64]]:
    """`phase` as a function of the frequency alone, the roots found once."""
    zeros, poles = _roots(system.numerator), _roots(system.denominator)
    late = system.delay if delay else 0.0

    def at(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
        omega = 2 * np.pi * frequency
        if system.step is not None:
            turn = omega * system.step
            return _turn_in_z(zeros, turn) - _turn_in_z(poles, turn) - omega * late
        return _turn(zeros, omega) - _turn(poles, omega) - omega * late

    return at


def _first_crossing(values: NDArray[np.float64]) -> int | None:
    """Index before the first change from positive to not positive."""
    below = np.flatnonzero((values[:-1] > 0) & (values[1:] <= 0))
    return int(below[0]) if below.size else None


_LIGHT = 0.2
"""Damping below which a mode may be narrower than the grid's steps of a sixteenth."""

_AROUND = np.array([-10.0, -3.0, -1.0, -0.3, 0.0, 0.3, 1.0, 3.0, 10.0])
"""Widths of a light mode or a notch at which a curve is looked at about it."""


def _places(system: RationalDelay, highest: float) -> NDArray[np.float64]:
    """Frequencies that show every turn of a response: a grid, and more about light roots."""
    grid = _grid(highest)
    if system.step is not None:
        return grid
    roots = np.concatenate([_roots(system.numerator), _roots(system.denominator)])
    light = roots[(roots.imag > 0) & (np.abs(roots.real) < _LIGHT * roots.imag)] / (2 * np.pi)
    if not light.size:
        return grid
    about = (light.imag[:, None] + np.abs(light.real)[:, None] * _AROUND).ravel()
    return np.unique(np.concatenate([grid, about[(about > 0) & (about < highest)]]))


@lru_cache(maxsize=8)
def _grid(highest: float) -> NDArray[np.float64]:
    grid = np.concatenate([[0.0], np.geomspace(highest * 1e-4, highest, 150)])
    grid.flags.writeable = False
    return grid


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Curves:
    """What every figure of a system is read off, at frequencies that show every turn.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz.
    turned : ndarray, shape (m,)
        Phase in radians without the pure delay, zero at DC.
    gain : ndarray, shape (m,)
        In the output's unit per the input's.
    """

    frequency: NDArray[np.float64]
    turned: NDArray[np.float64]
    gain: NDArray[np.float64]


def _curves(system: RationalDelay, highest: float) -> _Curves:
    """Of a system up to `highest` Hz; its delay does not matter."""
    coefficients = (tuple(each.tolist()) for each in (system.numerator, system.denominator))
    return _curves_of(*coefficients, system.step, highest)


@lru_cache(maxsize=8)
def _curves_of(
    numerator: tuple[float, ...],
    denominator: tuple[float, ...],
    step: float | None,
    highest: float,
) -> _Curves:
    system = RationalDelay(
        delay=0.0, numerator=np.array(numerator), denominator=np.array(denominator), step=step
    )
    frequency = _places(system, highest)
    return _Curves(
        frequency=frequency,
        turned=_phase_of(system, delay=False)(frequency),
        gain=_gain(system, frequency),
    )


def _gain(system: RationalDelay, frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    x = system.variable(frequency)
    return np.abs(_polynomial(system.numerator, x) / _polynomial(system.denominator, x))


def bandwidth_phase(
    system: RationalDelay, *, highest: float, lag: float = np.pi / 2, delay: bool = True
) -> float | None:
    """Lowest frequency in Hz at which the phase lags by `lag` rad; None beyond `highest` Hz."""
    curves, late = _curves(system, highest), system.delay if delay else 0.0

    def margin() -> Callable[[float], float]:
        if system.step is None:
            phase = _single_phase(system, late=late)
            return lambda f: phase(f) + lag
        turned = _phase_of(system, delay=delay)
        return lambda f: float(turned(np.array([f]))[0]) + lag

    seen = curves.turned - 2 * np.pi * curves.frequency * late + lag
    return _lowest(seen, margin, curves.frequency)


def _lowest(
    seen: NDArray[np.float64],
    margin: Callable[[], Callable[[float], float]],
    grid: NDArray[np.float64],
) -> float | None:
    """Lowest frequency in Hz at which a margin, as seen on a grid, falls to 0.

    Between the grid's places it may dip below 0 and come back.
    """
    end = _first_crossing(seen)
    for i in _dips(seen[: None if end is None else end + 1]):
        curve = margin()
        bounds, room = (grid[i - 1], grid[i + 1]), 1e-9 * grid[i]
        turn = scipy.optimize.minimize_scalar(
            curve, bounds=bounds, method="bounded", options={"xatol": room}
        )
        if turn.fun <= 0.0:
            return float(scipy.optimize.brentq(curve, grid[i - 1], turn.x))
    return None if end is None else float(scipy.optimize.brentq(margin(), grid[end], grid[end + 1]))


def _dips(seen: NDArray[np.float64]) -> list[int]:
    """Where a positive margin turns, and lies no higher than it fell to there or rises from it."""
    here, before, after = seen[1:-1], seen[:-2] - seen[1:-1], seen[2:] - seen[1:-1]
    turns = (here > 0) & (before >= 0) & (after > 0) & (here < np.maximum(before, after))
    return [int(i) + 1 for i in np.flatnonzero(turns)]


def _single_phase(system: RationalDelay, *, late: float) -> Callable[[float], float]:
    """`phase` at one frequency after the other: NumPy takes longer to begin than this to end."""
    parts = []
    for sign, roots in ((1.0, _roots(system.numerator)), (-1.0, _roots(system.denominator))):
        for root in roots.tolist():
            away = -root.real or float(np.finfo(float).tiny)
            parts.append((sign, root.imag, away, atan(-root.imag / away)))

    def at(frequency: float) -> float:
        omega = 2 * pi * frequency
        turned = sum(sign * (atan((omega - x) / away) - start) for sign, x, away, start in parts)
        return turned - omega * late

    return at


def _single_gain(system: RationalDelay) -> Callable[[float], float]:
    """Square of the gain over that at DC, at one frequency after the other."""
    above = (system.numerator / system.numerator[0])[::-1].tolist()
    below = system.denominator[::-1].tolist()

    def at(frequency: float) -> float:
        s = 2j * pi * frequency
        top = bottom = 0.0j
        for coefficient in above:
            top = coefficient + s * top
        for coefficient in below:
            bottom = coefficient + s * bottom
        return float(abs(top / bottom) ** 2)

    return at


def bandwidth_3db(system: RationalDelay, *, highest: float) -> float | None:
    """Lowest frequency in Hz at which the gain is 1/√2 of that at DC; None beyond `highest` Hz."""
    if system.numerator[0] == 0:
        return None

    curves = _curves(system, highest)

    def margin() -> Callable[[float], float]:
        if system.step is None:
            power = _single_gain(system)
            return lambda f: power(f) - 0.5
        return lambda f: float(_gain(system, np.array([f]))[0] / system.numerator[0]) ** 2 - 0.5

    return _lowest((curves.gain / system.numerator[0]) ** 2 - 0.5, margin, curves.frequency)


_FINER = np.linspace(0.0, 1.0, 21)
"""Places in a step of the grid at which a peak is looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeakGain:
    """Greatest gain over the gain at DC, in dB, and the frequency in Hz where it is."""

    gain_db: float
    frequency: float


def peak_gain(system: RationalDelay, *, highest: float) -> PeakGain | None:
    """Greatest gain up to `highest` Hz over the gain at DC; 0 dB at 0 Hz without a hump.

    None where the gain still rises at `highest`.

    For a second-order lag this is -20 lg(2ζ√(1-ζ²)) (paper, Fig. 16; Ogata, Modern Control
    Engineering, 1970, ch. 9).
    """
    curves = _curves(system, highest)
    grid, i = curves.frequency, int(np.argmax(curves.gain))
    if i == 0:
        return PeakGain(gain_db=0.0, frequency=0.0)
    if i == grid.size - 1:
        return None
    low, high = grid[max(i - 1, 0)], grid[min(i + 1, grid.size - 1)]
    for _ in range(3):
        fine = low + (high - low) * _FINER
        gain = _gain(system, fine) / abs(system.numerator[0])
        i = int(np.argmax(gain))
        low, high = fine[max(i - 1, 0)], fine[min(i + 1, 20)]
    return PeakGain(gain_db=float(20 * np.log10(gain[i])), frequency=float(fine[i]))


def _moving_poles(denominator: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Poles other than those at zero, which belong to an integrator."""
    return _roots(np.trim_zeros(denominator, "f"))


def slowest_time_constant(denominator: NDArray[np.float64]) -> float:
    """Time after which the slowest mode has fallen to 1/e; 0 without dynamics.

    Parameters
    ----------
    denominator : ndarray, shape (n + 1,)
        A by rising powers of s; poles at zero do not count.

    Returns
    -------
    float
        In the unit of 1/s.

    Examples
    --------
    >>> slowest_time_constant(np.array([1.0, 0.25]))
    0.25
    """
    poles = _moving_poles(denominator)
    return float(np.max(-1.0 / poles.real)) if poles.size else 0.0


def dominant_time_constant(system: RationalDelay) -> float | None:
    """Slowest time constant in seconds where the slowest pole is real, else None."""
    poles = _moving_poles(system.denominator)
    if system.step is not None:
        poles = np.asarray(-np.log(1.0 - poles) / system.step, dtype=np.complex128)
    if not poles.size:
        return None
    slowest = poles[np.argmax(poles.real)]
    # beside a coefficient of next to nothing the other poles are lost to rounding
    if slowest.real == 0.0 or abs(slowest.imag) > 1e-9 * abs(slowest):
        return None
    return float(-1.0 / slowest.real)


def log_slopes(
    system: RationalDelay, frequency: NDArray[np.float64]
) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
    """Derivatives of the logarithm of a response, at each frequency in Hz, (m,).

    By the delay, (1, m); the numerator, (k, m); and the denominator after its first coefficient
    that is not zero, (l, m).
    """
    above, below = system.numerator, system.denominator
    powers = system.variable(frequency)[None, :] ** np.arange(max(above.size, below.size))[:, None]
    first = int(np.flatnonzero(below)[0]) + 1
    return (
        np.asarray(-2j * np.pi * frequency[None, :], dtype=np.complex128),
        powers[: above.size] / (above @ powers[: above.size]),
        -powers[first : below.size] / (below @ powers[: below.size]),
    )


def response_std(
    system: RationalDelay, covariance: NDArray[np.float64], frequency: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Standard deviation of a response, sqrt(E|error|²), at each frequency in Hz, (m,).

    To first order, in the response's unit. The covariance, (q, q), is that of the parameters of
    `log_slopes`, in their order.

    Examples
    --------
    A delay that is known to 1 ms turns the response by 2π/1000 at 1 Hz:

    >>> late = RationalDelay(delay=0.1, numerator=np.ones(1), denominator=np.ones(1))
    >>> response_std(late, np.diag([1e-6, 0.0]), np.array([1.0])).round(6).tolist()
    [0.006283]
    """
    slopes = np.concatenate(log_slopes(system, frequency))
    variance = np.sum(slopes.conj() * (covariance @ slopes), axis=0).real
    return np.asarray(np.abs(response(system, frequency)) * np.sqrt(np.maximum(variance, 0.0)))


def by_falling_powers(covariance: NDArray[np.float64], numerator: int) -> NDArray[np.float64]:
    """The same covariance by falling powers for rising ones, or by rising for falling ones.

    `numerator` is the number of the numerator's coefficients.

    Examples
    --------
    >>> by_falling_powers(np.diag([0.0, 1.0, 2.0, 3.0, 4.0]), 2).diagonal().tolist()
    [0.0, 2.0, 1.0, 4.0, 3.0]
    """
    above = 1 + numerator
    order = [0, *range(1, above)[::-1], *range(above, covariance.shape[0])[::-1]]
    return covariance[np.ix_(order, order)]
