"""A slow tail: one more pole, much slower than the others, with a zero close to it.

With integral action in a loop, a creeping bearing or a self-heating sensor, the last per cent or so
of a response settles slowly:

    (1 + (1 + d) sT) / (1 + sT) = 1 + d - d / (1 + sT).

A sweep has only a few bins at frequencies around 1/T, too few for the test of lack of fit. For a
given T the log-likelihood is quadratic in d, and a score test of d (C. R. Rao, Proc. Camb. Phil.
Soc. 44, 1948) takes one response.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import searched
from hmpim.identify.fitting.candidates import best_of
from hmpim.identify.fitting.derivatives import products
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.growth import one_more_pole, with_pole
from hmpim.identify.fitting.least_squares import scores
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.kept import kept
from hmpim.identify.worth import MUCH, WORTH
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName
from hmpim.model.response import slowest_time_constant

__all__ = ["Tail", "fit_with_tail", "hidden_tail", "with_tail"]

_STEP = 3.0
"""Ratio of successive time constants that are tested: their responses are almost alike."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Tail:
    """A tail that a fit lacks: its time constant in samples, and its size |d|."""

    lag: float
    size: float


def hidden_tail(problem: Problem, fit: Fit, *, share: float = 1.0) -> Tail | None:
    """Test a fit for a slow tail; None without evidence, or if it is too small to matter.

    Parameters
    ----------
    problem, fit : Problem, Fit
        The data, and a fit to them. A tail cannot be distinguished from an integrator, a washout
        or the free response of a record that does not begin at rest: the result is then None.
    share : float
        Independent samples per sample.
    """
    excluded = fit.structure.integrators or fit.structure.dc_zeros
    if excluded or fit.initial.size or not _lags(fit).size:
        return None
    lags, gains, sizes = _scores(problem, fit)
    k = int(np.argmax(gains))
    if sizes[k] <= WORTH or share * gains[k] <= searched(lags.size):
        return None
    return Tail(lag=float(lags[k]), size=float(sizes[k]))


def fit_with_tail(
    problem: Problem, fits: list[Fit], structures: tuple[StructureName, ...]
) -> Fit | None:
    """Add a slow pole and its zero to the best fit; None if the record shows no tail.

    Parameters
    ----------
    problem : Problem
        The data.
    fits : list of Fit
        All fits to them so far.
    structures : tuple of str
        Structures that may be tried.
    """
    best = min(fits, key=lambda fit: fit.objective)
    richer = with_tail(best.structure, structures)
    tail = None if richer is None else hidden_tail(problem, best)
    if richer is None or tail is None:
        return None
    return best_of(problem, richer, [_start(best, tail.lag)], fits)


def with_tail(
    structure: Structure, structures: tuple[StructureName, ...] = tuple(STRUCTURES)
) -> Structure | None:
    """Return the structure with one more pole and at least one more zero; None if there is none.

    It has as few zeros as possible.

    Examples
    --------
    >>> with_tail(STRUCTURES["static"]).name, with_tail(STRUCTURES["second_order"]).name
    ('first_order_zero', 'third_order_zero')
    """
    if structure.integrators or structure.dc_zeros or structure.parallel or structure.sampled:
        return None
    sections, zeros = one_more_pole(structure).sections, structure.zeros + 1
    known = [STRUCTURES[name] for name in structures]
    alike = [s for s in known if s.sections == sections and not (s.parallel or s.dc_zeros)]
    enough = [s for s in alike if s.zeros >= zeros and not s.integrators]
    return min(enough, key=lambda s: s.zeros, default=None)


def _lags(fit: Fit) -> Real:
    """Time constants in samples, from thrice the fit's slowest to 0.3 of the record, (q,)."""
    slowest = max(slowest_time_constant(fit.denominator), 1.0)
    steps = np.log(max(MUCH * fit.residual.size / slowest, 1.0)) / np.log(_STEP)
    return np.asarray(slowest * _STEP ** np.arange(1.0, int(steps) + 1.0))


def _start(fit: Fit, lag: float) -> Real:
    """Parameters of the fit with a slow pole in addition."""
    return np.append(fit.theta[0], with_pole(fit.structure, fit.theta, lag)[1:])


@kept
def _scores(problem: Problem, fit: Fit) -> tuple[Real, Real, Real]:
    """Time constants in samples, the gain in log-likelihood of each, and the size |d|, all (q,)."""
    lags = _lags(fit)
    part = part_of(problem, fit.structure, fit.theta)
    moved = part.driven(fit.linear[:-1])
    residual = problem.innovations(fit.prediction, fit.residual)
    rows = [_lagging(moved, lag) for lag in lags]
    gram = products(problem, fit, residual, *rows, part=part)[0]
    weights, _, shares, _ = scores(gram, lags.size, least=np.finfo(float).eps)
    return lags, -0.5 * problem.counted * np.log1p(-shares), np.abs(weights)


def _lagging(x: Real, lag: float) -> Real:
    """Response of 1/(1 + sT) to a signal less its first value, linear between samples, (n,)."""
    decay = float(np.exp(-1.0 / lag))
    weights = [1.0 - lag * (1.0 - decay), lag * (1.0 - decay) - decay]
    return np.asarray(scipy.signal.lfilter(weights, [1.0, -decay], x - x[0]))
