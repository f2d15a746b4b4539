"""Fits to the rough response: starts for fits to the samples, and whether these are worthwhile.

Samples determine a structure's poles exactly, but each step costs a response as long as the record.
The rough response determines them approximately, and all starts of a structure are fitted to it at
once: by output error, the numerator solved for (variable projection), with Levenberg-Marquardt.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.start import RoughResponse, distinct
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import Structure

__all__ = ["RoughFits", "condensed", "fitted_roughly", "residual_of", "reweighted"]

_ALONE = 128
"""Bins up to this one stay single; each octave above is condensed into half as many groups."""

_STEPS = 10
"""Most steps on the rough response."""

_STILL = 1e-2
"""A step that lowers the squared error by less than this share counts as no gain."""

_FACTOR = 10.0
"""The damping is divided by this after a step that gains, else multiplied; a start stops once its
damping exceeds it."""

_LEAST = 1e-12
"""Share of each diagonal element that is added to normal equations: less is rounding."""

_REWEIGHTINGS = 4
"""Times that Sanathanan and Koerner's equations are weighted by the latest denominator."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RoughFits:
    """Fits to a rough response.

    `error` is the least share of its power that is missed, and `likely`, (k, 1 + order), holds the
    parameters of the fits that miss at most twice as much, the best first.
    """

    error: float
    likely: Real


def condensed(rough: RoughResponse) -> RoughResponse:
    """The same response, neighbouring bins averaged where an octave has many."""
    octave = np.maximum(np.floor(np.log2(np.maximum(rough.bins, 1) / _ALONE)) + 1.0, 0.0)
    group = rough.bins // (2 ** octave.astype(np.int64)) + (_ALONE * octave).astype(np.int64)
    starts = np.flatnonzero(np.diff(group, prepend=-1))
    if starts.size == rough.bins.size:
        return rough
    weight = np.add.reduceat(rough.weight, starts)
    return replace(
        rough,
        bins=rough.bins[starts],
        omega=np.add.reduceat(rough.weight * rough.omega, starts) / weight,
        response=np.asarray(
            np.add.reduceat(rough.weight * rough.response, starts) / weight, dtype=np.complex128
        ),
        weight=weight,
    )


def fitted_roughly(
    rough: RoughResponse,
    structure: Structure,
    thetas: Real,
    *,
    held: bool = False,
    steps: int = _STEPS,
) -> RoughFits:
    """Fit a structure without integrators from all starts, (k, 1 + order), at once.

    The rough response is best `condensed`. The delay stays if it is `held`. At most so many
    `steps` are taken. A start is followed until it no longer gains, or its squared error is sixteen
    times the best one's.
    """
    model = _Rough(rough, structure)
    errors, (normal, moment) = model.errors(thetas), model.normal()
    thetas, damping = thetas.copy(), np.full(len(thetas), 1e-3)
    going = np.arange(len(thetas))
    for _ in range(steps):
        step = _damped(normal, moment, damping) * (np.arange(thetas.shape[1]) >= held)
        moved, before = _bounded(structure, thetas[going] + step), errors[going]
        then = model.errors(moved)
        better, still = then < before, ~(before - then > _STILL * before)
        damping = np.where(better, damping / _FACTOR, damping * _FACTOR)
        thetas[going[better]], errors[going[better]] = moved[better], then[better]
        goes_on = ~(still & (better | (damping > _FACTOR)))
        goes_on &= errors[going] < TWICE**4 * errors.min()
        if not goes_on.any():
            break
        for own, new in zip((normal, moment), model.normal(), strict=True):
            own[better] = new[better]
        going, damping = going[goes_on], damping[goes_on]
        normal, moment = normal[goes_on], moment[goes_on]
    least = float(errors.min())
    order = [i for i in np.argsort(errors) if errors[i] <= TWICE * least]
    power = float(rough.weight @ np.abs(rough.response) ** 2)
    return RoughFits(error=least / (power or 1.0), likely=np.array(distinct(thetas[order])))


def reweighted(rough: RoughResponse, structure: Structure, delays: Real) -> tuple[Real, Real]:
    """Sanathanan and Koerner's iteration at many delays, (k,), at once; not for modes in parallel.

    Returned are the least squared output error at each delay, (k,), and the denominators,
    (k, order + 1), by rising powers of s over the highest frequency, A(0) = 1.
    """
    order, first, last = structure.order, structure.dc_zeros, structure.zeros
    above, below = np.arange(first, last + 1), np.arange(order + 1)
    rows, split = np.append(below, above), order + 1
    grid, turn = rows[:, None] + rows, (1j ** np.arange(-8, 9))[rows - rows[:, None] + 8]
    x = rough.omega / rough.omega[-1]
    powers = x ** np.arange(2 * max(order, last) + 1)[:, None]
    target = rough.response * np.exp(1j * rough.omega * (delays[:, None] - rough.lag))
    size = np.abs(rough.response) ** 2
    weight = np.broadcast_to(rough.weight, target.shape)
    errors, best = np.full(delays.size, np.inf), np.ones((delays.size, order + 1))
    for _ in range(_REWEIGHTINGS):
        own = (weight * size) @ powers.T
        fixed = weight @ powers.T
        mixed = (weight * target.conj()) @ powers.T
        across = -(mixed[:, grid[:split, split:]] * turn[:split, split:]).real
        gram = np.empty((delays.size, rows.size, rows.size))
        gram[:, :split, :split] = own[:, grid[:split, :split]] * turn[:split, :split].real
        gram[:, split:, split:] = fixed[:, grid[split:, split:]] * turn[split:, split:].real
        gram[:, :split, split:], gram[:, split:, :split] = across, across.swapaxes(1, 2)
        scale = np.sqrt(np.maximum(np.einsum("kii->ki", gram), np.finfo(float).tiny))
        scaled = _ridged(gram / (scale[:, :, None] * scale[:, None, :]))
        found = np.linalg.solve(scaled[:, 1:, 1:], -scaled[:, 1:, :1])[..., 0]
        found *= scale[:, :1] / scale[:, 1:]
        denominators = np.insert(found[:, :order], 0, 1.0, axis=1)
        a = (denominators * 1j**below) @ powers[: order + 1]
        b = (found[:, order:] * 1j**above) @ powers[first : last + 1]
        missed = target - b / a
        error = (missed.real**2 + missed.imag**2) @ rough.weight
        better = error < errors
        errors[better], best[better] = error[better], denominators[better]
        weight = rough.weight / (a.real**2 + a.imag**2)
    return errors, best


def residual_of(rough: RoughResponse, structure: Structure, theta: Real) -> RoughResponse:
    """Residual of a rough response for a structure at given parameters, (1 + order,)."""
    model = _Rough(rough, structure)
    model.errors(theta[None])
    weighted = model.residuals[0].view(np.complex128)
    response = np.asarray(weighted / np.sqrt(rough.weight), dtype=np.complex128)
    return replace(rough, response=response)


class _Rough:
    """Responses of one structure. `errors` sets its parameters and solves for the numerators."""

    def __init__(self, rough: RoughResponse, structure: Structure) -> None:
        self.structure, self._lag, self._root = structure, rough.lag, np.sqrt(rough.weight)
        s = self._s = np.asarray(1j * rough.omega, dtype=np.complex128)
        self._target = _real(rough.response * self._root)
        self._scaled = s * (1.0 / rough.omega[-1])
        powers = np.arange(structure.dc_zeros, structure.zeros + 1)[:, None]
        self._powers = None if structure.parallel else self._scaled**powers

    def errors(self, thetas: Real) -> Real:
        """Squared errors at several parameters, (k, 1 + order): shape (k,)."""
        s, structure, target = self._s, self.structure, self._target
        late = np.exp(-s * (thetas[:, :1] - self._lag)) * self._root
        self._sections = _sections(structure, thetas, s)
        below = [1.0 / section for section, _ in self._sections]
        if self._powers is not None:
            rows = math.prod(below, start=late)[:, None, :] * self._powers
        else:
            rows = np.stack([late * each for each in below], axis=1)
            if structure.zeros == structure.order - 1:
                rows = np.concatenate([rows, rows * self._scaled], axis=1)
        self._rows = rows
        self._real = _real(rows)
        self._gram = _ridged(self._real @ self._real.swapaxes(1, 2))
        self.linear = np.linalg.solve(self._gram, self._real @ target[:, None])[..., 0]
        self.residuals = target - (self.linear[:, None, :] @ self._real)[:, 0]
        errors = np.vecdot(self.residuals, self.residuals)
        return np.asarray(np.where(np.isfinite(errors), errors, np.inf))

    def normal(self) -> tuple[Real, Real]:
        """Normal equations of all parameters: (k, 1 + order, 1 + order) and (k, 1 + order)."""
        count = len(self._sections)
        moved = self.linear[..., None] * self._rows
        whole = moved.sum(axis=1)
        slopes = [-self._s * whole]
        for k, (section, factors) in enumerate(self._sections):
            own = moved[:, k::count].sum(axis=1) if self.structure.parallel else whole
            slopes += [-own * factor / section for factor in factors]
        rows = _real(np.stack(slopes, axis=1))
        mixed = rows @ self._real.swapaxes(1, 2)
        normal = rows @ rows.swapaxes(1, 2)
        # For a direction that the numerator explains fully, only rounding remains, of either sign.
        least = np.finfo(float).eps * np.einsum("kii->ki", normal) + np.finfo(float).tiny
        normal -= mixed @ np.linalg.solve(self._gram, mixed.swapaxes(1, 2))
        diagonal = np.einsum("kii->ki", normal)
        diagonal[:] = np.maximum(diagonal, least)
        return normal, (rows @ self.residuals[..., None])[..., 0]


def _damped(normal: Real, moment: Real, damping: Real) -> Real:
    """Steps of all parameters, shape (k, 1 + order)."""
    scale = np.sqrt(np.einsum("kii->ki", normal))
    scaled = normal / (scale[:, :, None] * scale[:, None, :])
    scaled += (damping[:, None, None] + _LEAST) * np.eye(scale.shape[1])
    found = np.linalg.solve(scaled, (moment / scale)[..., None])[..., 0] / scale
    return np.asarray(np.where(np.isfinite(found), found, 0.0))


def _real(rows: Complex) -> Real:
    """Real and imaginary parts side by side."""
    return np.ascontiguousarray(rows).view(np.float64)


def _ridged(gram: Real) -> Real:
    """The same matrices, their diagonals raised by about their rounding error."""
    diagonal = np.einsum("kii->ki", gram)
    diagonal += _LEAST * np.maximum(diagonal, np.finfo(float).tiny)
    return gram


def _sections(
    structure: Structure, thetas: Real, s: Complex
) -> list[tuple[Complex, list[Complex]]]:
    """Each section at each start, (k, m), and its derivatives by its own parameters."""
    out, start = [], 1
    for order in structure.sections:
        first = np.exp(thetas[:, start, None]) * s
        if order == 1:
            out.append((1.0 + first, [first]))
        else:
            second = first * first
            curved = thetas[:, start + 1, None] * second
            out.append((1.0 + first + curved, [first + 2.0 * curved, second]))
        start += order
    return out


def _bounded(structure: Structure, thetas: Real) -> Real:
    """Limit time constants, and keep shapes above 0: below, a pole is in the right half plane."""
    start = 1
    for order in structure.sections:
        thetas[:, start] = np.clip(thetas[:, start], -30.0, 30.0)
        if order == 2:
            thetas[:, start + 1] = np.clip(thetas[:, start + 1], 1e-4, 1e6)
        start += order
    return thetas
