"""One more pole, at any order: chosen, left open, or excluded, as the likelihood says.

A pole much faster than the others looks like delay. With a pure delay τ - T beside it,

    e^(sT) / (1 + sT) = 1 + (sT)² / 2 + ...,

so the record sees q = T², not T. Its likelihood is quadratic in q, and a score test of q (C. R.
Rao, Proc. Camb. Phil. Soc. 44, 1948) costs one response. Where that test is passed by more than
chance, the richer structure is fitted. Schwarz's criterion chooses; a structure that is as likely,
but for the price of its pole, is a rival that the intervals cover.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Generic, Protocol, TypeVar

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import DEVIATIONS, HALF, ONE_SIDED
from hmpim.identify.fitting.derivatives import combined, products
from hmpim.identify.fitting.fit import Fit, Problem, within_reach
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.worth import MATERIAL, PART
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName, coefficients_of, theta_of

__all__ = [
    "FEW_POLES",
    "Growth",
    "HiddenPole",
    "as_if_hidden",
    "as_if_zero",
    "grow",
    "hidden_pole",
    "made_room",
    "one_more_pole",
    "response_to_square",
    "scale_of",
    "seen_by_pole",
    "with_pole",
]

_TINY = float(np.finfo(float).tiny)

_TOLD = 1e-6
"""Least share of a row's power, other rows projected out, that products give accurately."""

_PROBE = 0.3
"""Time constant, over the fit's own, by which the derivative with respect to q is taken."""

_FARTHEST = 1.0
"""Logarithm by which a time constant moves at most beside a pole that would not show."""

_ANY = 10_000_000
"""Samples that bound no time constant."""

_MOST = 7
"""Poles up to which one more is asked for."""

FEW_POLES = 4
"""Poles up to which a structure may leave more than white noise."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HiddenPole:
    """What a record says of one more pole beside a fit, T its time constant in samples.

    Parameters
    ----------
    squared, std : float
        q = T² as a score test finds it, and its standard deviation. Below 0 it stands for what
        one more pole cannot be: a zero, or a pair of poles.
    shift : ndarray, shape (p,)
        Change of the fit's vector with q.
    fit : Fit
        The fit.
    halves : ndarray, shape (2, p + 1, p + 1), or None
        Products of its derivatives and the whitened residual over either half of the record,
        from `hmpim.identify.fitting.fit.products`. None for compressed records.
    """

    squared: float
    std: float
    shift: Real
    fit: Fit
    halves: Real | None = None

    @property
    def scale(self) -> float:
        """Time in samples that the fit has: its poles' geometric mean, or without one its delay."""
        return scale_of(self.fit)

    @property
    def limit(self) -> float:
        """Longest time constant, in samples, that the record does not exclude."""
        return float(np.sqrt(max(self.squared, 0.0) + HALF * self.std))

    @property
    def is_asked_for(self) -> bool:
        """Whether the record asks for a pole by more than chance, and one that matters."""
        return self.squared > ONE_SIDED * self.std and self.squared > (MATERIAL * self.scale) ** 2

    @property
    def may_hide(self) -> bool:
        """Whether one more pole of a chain would not show, and either is long or leaned to.

        Not of two poles, which the paper's sensors have, and of a sum of modes.
        """
        far = self.limit > PART * self.scale or self.squared > self.std
        structure = self.fit.structure
        proper = structure.zeros == structure.dc_zeros
        chain = structure.order <= 1 or (structure.order > 2 and proper)
        return chain and far


class Fitted(Protocol):
    """A fit, whatever it was made from."""

    @property
    def fit(self) -> Fit:
        """Structure, parameters, and what was least."""


F = TypeVar("F", bound=Fitted)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Growth(Generic[F]):
    """Where growing ended.

    Parameters
    ----------
    grown : tuple
        Fits that beat the one before, the best last; empty if none did.
    rivals : tuple
        Fits of one more pole that are as likely, but for its price.
    hidden : HiddenPole
        What the record says of one more pole beside the best fit.
    """

    grown: tuple[F, ...]
    rivals: tuple[F, ...]
    hidden: HiddenPole


@cache
def one_more_pole(structure: Structure) -> Structure:
    """Return a structure with one more pole; a real pole that is alone gets it as partner.

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
    return _named(richer) or richer


def _named(structure: Structure) -> Structure | None:
    """The structure that has these poles and zeros and a name."""
    return next(
        (known for known in STRUCTURES.values() if replace(structure, name=known.name) == known),
        None,
    )


def with_pole(structure: Structure, theta: Real, lag: float) -> Real:
    """Parameters of `one_more_pole(structure)`: a pole of time constant `lag` for as much delay.

    Parameters
    ----------
    structure : Structure
        Before.
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
    problem : Problem
        The data.
    fit : Fit
        Any fit to them but a filter in z.
    """
    row = response_to_square(problem, fit)
    left = problem.innovations(fit.prediction, fit.residual)
    halves = products(problem, fit, left, row, edges=(left.size // 2,))
    gram = halves.sum(axis=0)
    freedom, told = max(problem.counted - gram.shape[0] + 1, 1), np.delete(np.arange(len(gram)), -2)
    shift = -solved(gram[:-2, :-2], gram[:-2, -2])
    # Of what no other parameter can do: its power, and its product with the residual.
    power, along = (float(gram[-2, k] + shift @ gram[:-2, k]) for k in (-2, -1))
    white = is_white(problem.counting(left))
    variance = float(gram[-1, -1]) / freedom / max(power, _TINY)
    if not white or power <= _TOLD * gram[-2, -2]:  # the difference of products is too small
        own = combined(problem, fit, shift, row)
        power, along = max(float(own @ own), _TINY), float(own @ left)
        variance = float(covariance(own[None], left, freedom=freedom, white=white)[0, 0])
    return HiddenPole(
        squared=along / power,
        std=float(np.sqrt(variance)),
        shift=shift,
        fit=fit,
        halves=halves[:, told[:, None], told],
    )


def seen_by_pole(problem: Problem, hidden: HiddenPole, richer: Fit) -> float | None:
    """Independent samples that one more pole's response sees in the noise; None in white noise.

    Colour that lies elsewhere in the spectrum costs it none. The noise is what the fit with the
    pole leaves: what the pole explains is no noise.

    Parameters
    ----------
    problem : Problem
        The data.
    hidden : HiddenPole
        What the test said of the pole.
    richer : Fit
        The fit that has it.
    """
    if hidden.halves is None:
        return None
    left = problem.innovations(richer.prediction, richer.residual)
    if is_white(problem.counting(left)):
        return None
    freedom = max(problem.counted - hidden.shift.size - 1, 1)
    own = combined(problem, hidden.fit, hidden.shift, response_to_square(problem, hidden.fit))
    variance = float(covariance(own[None], left, freedom=freedom, white=False)[0, 0])
    power = max(float(own @ own), _TINY)
    if_white = float(left @ left) / freedom / power
    return float(problem.counted * if_white / max(variance, _TINY))


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
    else:  # what was predicted, less what is beside the input
        here = fit.prediction - fit.linear[-1]
        if problem.nuisance is not None:
            here = here - fit.nuisance @ problem.nuisance
    return np.asarray((there - here) / lag**2)


def scale_of(fit: Fit) -> float:
    """Time in samples that a fit has: its poles', or its delay."""
    order = fit.structure.order
    if not order:
        return max(fit.delay, 0.1)
    return float(fit.denominator[fit.structure.order] ** (1.0 / order))


def as_if_hidden(fit: Fit, hidden: HiddenPole) -> Fit:
    """Return a fit with the longest pole that the record does not exclude, the rest moved along.

    Parameters
    ----------
    fit : Fit
        Without it.
    hidden : HiddenPole
        What `hidden_pole` says of it.
    """
    moved = made_room(fit, hidden)
    return replace(
        moved,
        structure=one_more_pole(fit.structure),
        theta=with_pole(fit.structure, moved.theta, hidden.limit),
    )


def made_room(fit: Fit, hidden: HiddenPole) -> Fit:
    """Return the fit to which that pole comes, still without it.

    Parameters
    ----------
    fit, hidden
        As for `as_if_hidden`.
    """
    moved = hidden.limit**2 * hidden.shift
    moved[1 : fit.theta.size] = np.clip(moved[1 : fit.theta.size], -_FARTHEST, _FARTHEST)
    theta, linear = np.split(np.concatenate([fit.theta, fit.linear]) + moved, [fit.theta.size])
    theta = within_reach(fit.structure, theta, delays=(-np.inf, np.inf), samples=_ANY)
    return replace(fit, theta=theta, linear=linear)


def as_if_zero(fit: Fit, hidden: HiddenPole) -> Fit:
    """Return a fit with the longest zero that q below 0 may stand for, its delay longer by as much.

    Parameters
    ----------
    fit : Fit
        Without it.
    hidden : HiddenPole
        What `hidden_pole` says of it.
    """
    lead = float(np.sqrt(max(-hidden.squared, 0.0) + HALF * hidden.std))
    moved = -(lead**2) * hidden.shift
    theta, linear = np.split(np.concatenate([fit.theta, fit.linear]) + moved, [fit.theta.size])
    theta[0] += lead
    numerator = np.convolve(linear[:-1], [1.0, lead])
    return replace(
        fit,
        structure=replace(fit.structure, zeros=fit.structure.zeros + 1),
        theta=within_reach(fit.structure, theta, delays=(-np.inf, np.inf), samples=_ANY),
        linear=np.append(numerator, linear[-1]),
    )


def grow(
    best: F,
    *,
    hidden: Callable[[F], HiddenPole],
    refit: Callable[[Structure, Real], F],
    count: Callable[[HiddenPole, F], float],
    names: tuple[StructureName, ...],
    white: Callable[[F], bool],
    otherwise: Callable[[F], float] = lambda _: np.inf,
) -> Growth[F]:
    """Add poles to a fit as long as the likelihood pays for them.

    Parameters
    ----------
    best : Fitted
        The chosen fit.
    hidden : callable
        Tests a fit for one more pole.
    refit : callable
        Fits a structure from a start.
    count : callable
        Independent samples that a tested pole sees, the fit that has it given.
    names : tuple of str
        Structures that may be chosen; of others a fit is a rival at most.
    white : callable
        Whether a fit leaves white noise, as one of many poles must.
    otherwise : callable
        Least objective of the fits that are no richer than a given one, under other assumptions
        between the samples: a fit with one more pole must improve on these too.
    """
    grown: list[F] = []
    while True:
        test = hidden(best)
        structure = best.fit.structure
        if not test.is_asked_for or structure.order >= _MOST:
            return Growth(grown=tuple(grown), rivals=(), hidden=test)
        richer = one_more_pole(structure)
        starts = [float(np.sqrt(test.squared))]
        if test.squared > DEVIATIONS * test.std:  # so far away the test's own figure may be far off
            starts.append(_PROBE * test.scale)
        tried = [refit(richer, with_pole(structure, best.fit.theta, lag)) for lag in starts]
        found = min(tried, key=lambda f: f.fit.objective)
        seen = count(test, found)
        gain = seen * float(np.log(best.fit.objective / found.fit.objective))
        if gain < ONE_SIDED**2:
            return Growth(grown=tuple(grown), rivals=(), hidden=test)
        may_be_chosen = richer.name != structure.name and richer.name in names
        sure = richer.order <= FEW_POLES or white(found)
        gain = min(gain, seen * float(np.log(otherwise(best) / found.fit.objective)))
        if gain < np.log(seen) or not may_be_chosen or not sure:
            return Growth(grown=tuple(grown), rivals=(found,), hidden=test)
        grown.append(found)
        best = found
