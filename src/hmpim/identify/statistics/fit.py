"""A structure fitted to statistics: the joint fit's own way down, on products of filters.

An impulse response is what a structure answers to one sample of 1 among zeros, continued between
the samples as the input is; its derivatives are known in closed form, since they are those of the
joint fit's rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.fitting.fit import Fit, climb, solved, within_reach
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.statistics.products import Moments, Products
from hmpim.identify.statistics.reach import AHEAD, Reach
from hmpim.identify.statistics.residual import Residual
from hmpim.model.dynamics import Structure
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["Fitted", "answers_of", "fit_products", "pulse"]

_SHORTEST_DELAY = -4.0

Real = NDArray[np.float64]


def pulse(reach: Reach, intersample: Intersample) -> Problem:
    """One sample of 1 among zeros, as an input: what it is answered by is an impulse response."""
    samples = np.zeros(reach.taps)
    samples[AHEAD] = 1.0
    return Problem(
        source=prepare_input(samples, intersample),
        y=np.zeros(reach.taps),
        valid=None,
        longest_delay=float(reach.lags),
    )


class _SpentError(Exception):
    """All evaluations that there may be were made."""


class _Evaluation:
    """A structure at given parameters: what is linear solved, and the way down."""

    def __init__(self, products: Products, problem: Problem, part: Part) -> None:
        self.products, self.problem, self.part = products, problem, part
        self.steady = np.zeros(part.rows.shape[0])
        self.steady[0] = 1.0 if part.structure.dc_zeros == 0 else 0.0
        self.moments = products.moments(part.rows, self.steady)
        self.linear = solved(self.moments.gram, self.moments.cross)
        floor = np.finfo(float).eps * self.moments.energy
        self.cost = max(self.moments.energy - float(self.linear @ self.moments.cross), floor)

    @property
    def thetas(self) -> list[Real]:
        """Delay and denominator."""
        return [self.part.theta]

    @property
    def slopes(self) -> Real:
        """Derivatives of the impulse response, shape (1 + order, taps)."""
        return self.part.slopes(self.linear, np.empty(0))

    @cached_property
    def all_rows(self) -> tuple[Real, Real]:
        """Derivatives by theta, then the rows; and what each makes of a constant 1."""
        steady = np.concatenate([np.zeros(self.part.theta.size), self.steady])
        return np.vstack([self.slopes, self.part.rows]), steady

    @cached_property
    def all_moments(self) -> Moments:
        """Products of derivatives by theta, then of the rows."""
        return self.products.moments(*self.all_rows)

    def normal(self) -> tuple[Real, Real]:
        """Normal equations of delay and denominator: matrix, and derivative of the cost."""
        moments, unknown = self.all_moments, self.part.theta.size
        turned, mixed = moments.gram[:unknown, :unknown], moments.gram[:unknown, unknown:]
        inner = moments.gram[unknown:, unknown:]
        left = moments.cross[:unknown] - mixed @ self.linear
        if inner.size == 1 and inner[0, 0] > 0.0:
            return turned - mixed @ mixed.T / inner[0, 0], left
        return turned - mixed @ np.linalg.lstsq(inner, mixed.T, rcond=None)[0], left


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """Where a fit ended.

    Parameters
    ----------
    fit : Fit
        As of samples, without prediction and residual; `cost` is that of `objective`.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What was assumed.
    response : ndarray, shape (taps,)
        Impulse response.
    rows, steady : ndarray, shape (q, taps) and (q,)
        Derivatives of it by theta, then by the numerator; what each makes of a constant 1.
    moments : Moments
        Products of derivatives by theta, then of the rows.
    products : Products
        What was fitted to.
    """

    fit: Fit
    intersample: Intersample
    response: Real
    rows: Real
    steady: Real
    moments: Moments
    products: Products

    @property
    def variance(self) -> float:
        """Variance of the white noise."""
        freedom = self.products.counted - self.moments.cross.size - self.moments.fixed.size
        return self.fit.objective / max(freedom, 1)

    @property
    def covariance(self) -> Real:
        """Of theta, the numerator and the mean bias: the Cramér-Rao bound."""
        gram = self.moments.gram
        if self.fit.structure.name == "static" and self.intersample == "zoh":
            # It moves in whole samples only: uniform over the one in which the delay ends.
            inverse = np.zeros_like(gram)
            inverse[1:, 1:] = _inverse(gram[1:, 1:])
            inverse[0, 0] = 1.0 / (12.0 * self.variance)
        else:
            inverse = _inverse(gram)
        slope = self.moments.bias_rows
        mixed = -inverse @ slope
        last = slope @ inverse @ slope + self.moments.bias_variance
        whole = np.block([[inverse, mixed[:, None]], [mixed[None], np.array([[last]])]])
        return np.asarray(whole * self.variance)

    def residual(self, plain: Products) -> Residual:
        """What is left over, by products without a noise model."""
        unknown = self.fit.theta.size
        fixed = self.moments.fixed - self.moments.fixed_rows[..., unknown:] @ self.fit.linear[:-1]
        return plain.residual(self.response, fixed)


def _inverse(gram: Real) -> Real:
    """Inverse of a Gram matrix, very large along a direction that is not seen."""
    size = np.diag(gram)
    scale = np.sqrt(np.where(size > 1e-200 * size.max(), size, 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    values = np.maximum(values, 1e-14 * values[-1])
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def answers_of(problem: Problem, structure: Structure, theta: Real) -> Part:
    """Impulse responses of a structure."""
    return Part(problem, structure, theta)


def fit_products(
    products: Products,
    problem: Problem,
    intersample: Intersample,
    structure: Structure,
    theta: Real,
    *,
    iterations: int = 40,
    precision: float = 1e-2,
    evaluations: int | None = None,
) -> Fitted:
    """Fit one structure from one start.

    Parameters
    ----------
    products : Products
        The data.
    problem : Problem
        From `pulse`.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What that assumes.
    structure : Structure
        What to fit; no integrator, whose memory has no end.
    theta : ndarray, shape (1 + order,)
        Start: delay in samples, parameters of the denominator's sections.
    iterations, precision
        As for `hmpim.identify.fitting.fit.fit_structure`.
    evaluations : int, optional
        How often the structure is evaluated at most, steps that lead nowhere included; as often as
        the steps ask for by default.
    """
    seen: list[_Evaluation] = []

    def bounded(moved: Sequence[Real]) -> list[Real]:
        delays = (_SHORTEST_DELAY, problem.longest_delay)
        return [within_reach(structure, t, delays=delays, samples=problem.y.size) for t in moved]

    def evaluated(thetas: Sequence[Real]) -> _Evaluation:
        if len(seen) == evaluations:
            raise _SpentError
        seen.append(_Evaluation(products, problem, answers_of(problem, structure, thetas[0])))
        return seen[-1]

    try:
        best, converged = climb(
            evaluated,
            bounded([theta]),
            structures=[structure],
            bounded=bounded,
            counted=products.counted,
            iterations=iterations,
            precision=precision,
        )
    except _SpentError:
        best, converged = min(seen, key=lambda one: one.cost), False
    rows, steady = best.all_rows
    moments, unknown = best.all_moments, best.part.theta.size
    bias = moments.bias - float(moments.bias_rows[unknown:] @ best.linear)
    nothing = np.empty(0)
    fit = Fit(
        structure=structure,
        theta=best.part.theta,
        linear=np.append(best.linear, bias),
        prediction=nothing,
        residual=nothing,
        cost=best.cost,
        objective=best.cost,
        converged=converged,
        nuisance=nothing,
        initial=nothing,
    )
    return Fitted(
        fit=fit,
        intersample=intersample,
        response=best.linear @ best.part.rows,
        rows=rows,
        steady=steady,
        moments=moments,
        products=products,
    )
