"""One more pole, at any order: chosen, left open, or excluded by the likelihood.

A pole much faster than the others looks like delay. Together with a pure delay of τ - T,

    e^(sT) / (1 + sT) = 1 + (sT)² / 2 + ...,

so the record determines q = T², not T. The log-likelihood is quadratic in q, and a score test of q
(C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948) costs one response. If that test is significant, the
richer structure is fitted. Schwarz's criterion chooses; a structure that only loses by the price
of its pole is a rival, which the intervals cover.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import DEVIATIONS, HALF, ONE_SIDED
from hmpim.identify.fitting.derivatives import combined, products
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure, within_reach
from hmpim.identify.fitting.least_squares import added
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.worth import MATERIAL, PART
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName, coefficients_of, theta_of

__all__ = [
    "FEW_POLES",
    "Growth",
    "HiddenPole",
    "adjusted_for_pole",
    "as_if_hidden",
    "as_if_zero",
    "grow",
    "hidden_pole",
    "one_more_pole",
    "response_to_square",
    "scale_of",
    "with_pole",
]

_TINY = float(np.finfo(float).tiny)

_TOLD = 1e-6
"""Least share of a row's power, other rows projected out, that products give accurately."""

_PROBE = 0.3
"""Time constant, over the fit's own, at which the derivative with respect to q is taken."""

_FARTHEST = 1.0
"""Most change of a time constant's logarithm to make room for a hidden pole."""

_ANY = 10_000_000
"""A record length that bounds no time constant."""

_MOST = 7
"""Most poles that a structure may have in the end."""

FEW_POLES = 4
"""Most poles with which a structure need not leave white noise."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HiddenPole:
    """The test of a fit for one more pole, T its time constant in samples.

    Parameters
    ----------
    squared, std : float
        q = T² estimated by a score test, and its standard deviation. Below 0 no real pole but a
        zero, or a pair of poles, is missing.
    shift : ndarray, shape (p,)
        Change of theta and the linear parameters with q.
    fit : Fit
        The tested fit.
    halves : ndarray, shape (2, p + 1, p + 1), or None
        Products of its derivatives and the whitened residual over either half of the record,
        from `hmpim.identify.fitting.derivatives.products`. None for compressed records.
    """

    squared: float
    std: float
    shift: Real
    fit: Fit
    halves: Real | None = None

    @property
    def scale(self) -> float:
        """Characteristic time of the fit, in samples."""
        return scale_of(self.fit)

    @property
    def limit(self) -> float:
        """Longest time constant, in samples, that the record does not exclude."""
        return float(np.sqrt(max(self.squared, 0.0) + HALF * self.std))

    @property
    def lead(self) -> float:
        """Longest time constant of a zero, in samples, that the record does not exclude."""
        return float(np.sqrt(max(-self.squared, 0.0) + HALF * self.std))

    @property
    def is_significant(self) -> bool:
        """Whether a further pole is significant, and slow enough to matter."""
        return self.squared > ONE_SIDED * self.std and self.squared > (MATERIAL * self.scale) ** 2

    @property
    def may_hide(self) -> bool:
        """Whether a chain may hide one more pole that is slow, or that the estimate supports.

        Not for two poles, which the paper's sensors have, nor for a sum of modes. Two poles with
        zeros are seldom all of a servo.
        """
        far = self.limit > PART * self.scale or self.squared > self.std
        structure = self.fit.structure
        proper = structure.zeros == structure.dc_zeros
        servo = structure.order == 2 and structure.zeros > structure.dc_zeros == 0
        chain = structure.order <= 1 or servo or (structure.order > 2 and proper)
        return chain and far

    @property
    def may_hide_zero(self) -> bool:
        """Whether the fit may hide one more zero that is slow."""
        return self.lead > PART * self.scale


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Growth:
    """The result of adding poles.

    `grown` are fits that each beat the one before, the best last; `rivals` are fits with one more
    pole that lose only by its price; `hidden` is the test of the best fit for one more pole.
    """

    grown: tuple[Fit, ...]
    rivals: tuple[Fit, ...]
    hidden: HiddenPole


@cache
def one_more_pole(structure: Structure) -> Structure:
    """Return a structure with one more pole; a single real pole becomes a pair.

    Examples
    --------
    >>> one_more_pole(STRUCTURES["first_order"]).name
    'second_order'
    >>> one_more_pole(STRUCTURES["two_modes"]).sections
    (2, 2, 1)
    """
    pairs = [order for order in structure.sections if order == 2]
    sections = (*pairs, *((2,) if 1 in structure.sections else (1,)))
    richer = replace(structure, sections=sections, parallel=False)
    named = (known for known in STRUCTURES.values() if replace(richer, name=known.name) == known)
    return next(named, richer)


def with_pole(structure: Structure, theta: Real, lag: float) -> Real:
    """Parameters of `one_more_pole(structure)`: a pole with time constant `lag` replaces delay.

    Parameters
    ----------
    structure : Structure
        The one without it.
    theta : ndarray, shape (1 + order,)
        Its parameters, in samples.
    lag : float
        Time constant in samples.

    Examples
    --------
    >>> with_pole(STRUCTURES["static"], np.array([9.0]), 1.0).tolist()
    [8.0, 0.0]
    """
    own = coefficients_of(structure, theta[1:])
    if 1 in structure.sections:  # the last section
        added = [own[-1] + lag, own[-1] * lag]
        own = own[:-1]
    else:
        added = [lag]
    richer = one_more_pole(structure)
    return np.concatenate([[theta[0] - lag], theta_of(richer, np.concatenate([own, added]))])


def hidden_pole(problem: Problem, fit: Fit) -> HiddenPole:
    """Test a fit for one more pole, the delay shortened by as much.

    Parameters
    ----------
    problem, fit : Problem, Fit
        The data, and any fit to them except a filter in z.
    """
    row = response_to_square(problem, fit)
    residual = problem.innovations(fit.prediction, fit.residual)
    halves = products(problem, fit, residual, row, edges=(residual.size // 2,))
    gram = halves.sum(axis=0)
    freedom = max(problem.counted - gram.shape[0] + 1, 1)
    # Of the row's part that no other parameter can make: power, and product with the residual.
    shift, left, gain = added(
        gram[:-2, :-2], gram[:-2, -2], gram[-2, -2], gram[:-2, -1], gram[-2, -1]
    )
    power, along = float(left), float(gain)
    white = is_white(problem.counting(residual))
    variance = float(gram[-1, -1]) / freedom / max(power, _TINY)
    if not white or power <= _TOLD * gram[-2, -2]:  # the difference of products is too small
        own = combined(problem, fit, shift, row)
        power, along = max(float(own @ own), _TINY), float(own @ residual)
        variance = float(covariance(own[None], residual, freedom=freedom, white=white)[0, 0])
    others = np.delete(np.arange(len(gram)), -2)
    return HiddenPole(
        squared=along / power,
        std=float(np.sqrt(variance)),
        shift=shift,
        fit=fit,
        halves=halves[:, others[:, None], others],
    )


def response_to_square(problem: Problem, fit: Fit) -> Real:
    """Derivative of the prediction with respect to q, shape (n,).

    Parameters
    ----------
    problem, fit
        As for `hidden_pole`.
    """
    lag = _PROBE * scale_of(fit)
    richer, theta = one_more_pole(fit.structure), with_pole(fit.structure, fit.theta, lag)
    above = fit.numerator[fit.structure.dc_zeros :]
    there = part_of(problem, richer, theta).driven(above)
    if fit.initial.size or not fit.prediction.size:
        here = part_of(problem, fit.structure, fit.theta).driven(fit.linear[:-1])
    else:  # the prediction, less bias and drift
        here = fit.prediction - fit.linear[-1]
        if problem.nuisance is not None:
            here = here - fit.nuisance @ problem.nuisance
    return np.asarray((there - here) / lag**2)


def scale_of(fit: Fit) -> float:
    """Characteristic time of a fit, in samples: geometric mean of its poles', or its delay."""
    order = fit.structure.order
    return float(fit.denominator[order] ** (1.0 / order)) if order else max(fit.delay, 0.1)


def as_if_hidden(fit: Fit, hidden: HiddenPole) -> Fit:
    """Return a fit with the slowest pole that the record does not exclude, the others adjusted.

    Parameters
    ----------
    fit, hidden : Fit, HiddenPole
        The fit without it, and its test by `hidden_pole`.
    """
    moved = adjusted_for_pole(fit, hidden)
    theta = with_pole(fit.structure, moved.theta, hidden.limit)
    return replace(moved, structure=one_more_pole(fit.structure), theta=theta)


def adjusted_for_pole(fit: Fit, hidden: HiddenPole) -> Fit:
    """Return the fit adjusted for that pole, but still without it.

    Parameters
    ----------
    fit, hidden
        As for `as_if_hidden`.
    """
    change = hidden.limit**2 * hidden.shift
    change[1 : fit.theta.size] = np.clip(change[1 : fit.theta.size], -_FARTHEST, _FARTHEST)
    theta, linear = _moved(fit, change)
    return replace(fit, theta=theta, linear=linear)


def as_if_zero(fit: Fit, hidden: HiddenPole) -> Fit:
    """Return a fit with the slowest zero that q below 0 may mean, its delay longer by as much.

    Parameters
    ----------
    fit, hidden
        As for `as_if_hidden`.
    """
    theta, linear = _moved(fit, -(hidden.lead**2) * hidden.shift, later=hidden.lead)
    linear = np.append(np.convolve(linear[:-1], [1.0, hidden.lead]), linear[-1])
    structure = replace(fit.structure, zeros=fit.structure.zeros + 1)
    return replace(fit, structure=structure, theta=theta, linear=linear)


def _moved(fit: Fit, change: Real, *, later: float = 0.0) -> tuple[Real, Real]:
    """Theta, its time constants inside their bounds, and linear parameters of a moved fit."""
    theta, linear = np.split(np.concatenate([fit.theta, fit.linear]) + change, [fit.theta.size])
    theta[0] += later
    theta = within_reach(fit.structure, theta, delays=(-np.inf, np.inf), samples=_ANY)
    return theta, linear


def grow(
    problem: Problem,
    best: Fit,
    *,
    hidden: Callable[[Problem, Fit], HiddenPole] = hidden_pole,
    count: float,
    names: tuple[StructureName, ...],
    otherwise: Callable[[Fit], float] = lambda _: np.inf,
) -> Growth:
    """Add poles to a fit while the likelihood supports them.

    Parameters
    ----------
    problem, best : Problem, Fit
        The data, and the chosen fit to them.
    hidden : callable
        Tests a fit for one more pole, as `hidden_pole` does.
    count : float
        Independent samples.
    names : tuple of str
        Structures that may be chosen; a fit of any other is a rival at most.
    otherwise : callable
        Least objective of fits no richer than a given one, under other assumptions between the
        samples: a fit with one more pole must improve on these too.
    """
    grown: list[Fit] = []
    while True:
        test = hidden(problem, best)
        structure = best.structure
        if not test.is_significant or structure.order >= _MOST:
            return Growth(grown=tuple(grown), rivals=(), hidden=test)
        richer = one_more_pole(structure)
        starts = [float(np.sqrt(test.squared))]
        if test.squared > DEVIATIONS * test.std:  # so far off q = 0 the estimate may be poor
            starts.append(_PROBE * test.scale)
        tried: list[Fit] = []
        for lag in starts:
            least = min(fit.objective for fit in [best, *tried])
            theta = with_pole(structure, best.theta, lag)
            tried.append(fit_structure(problem, richer, theta, hopeless=least))
        found = min(tried, key=lambda fit: fit.objective)
        gain = count * float(np.log(best.objective / found.objective))
        if gain < ONE_SIDED**2:
            return Growth(grown=tuple(grown), rivals=(), hidden=test)
        may_be_chosen = richer.name != structure.name and richer.name in names
        sure = richer.order <= FEW_POLES or found.is_white
        gain = min(gain, count * float(np.log(otherwise(best) / found.objective)))
        if gain < np.log(count) or not may_be_chosen or not sure:
            return Growth(grown=tuple(grown), rivals=(found,), hidden=test)
        grown.append(found)
        best = found
