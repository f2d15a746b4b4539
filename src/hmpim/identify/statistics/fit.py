"""A structure fitted to statistics: the joint fit's own way down, on products of filters.

An impulse response is what a structure answers to one sample of 1 among zeros, continued between
the samples as the input is; its derivatives are known in closed form, since they are those of the
joint fit's rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.climb import climb
from hmpim.identify.fitting.fit import Fit, within_reach
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.statistics.products import Moments, Products
from hmpim.identify.statistics.reach import AHEAD, Reach
from hmpim.identify.statistics.residual import Residual
from hmpim.model.dynamics import Structure
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["Fitted", "fit_products", "follow", "pulse"]

_NEAR = 0.25
"""What a step may gain, in units of σ², so that where it leads need not be evaluated: a parameter
then moves by half a standard deviation at most, and the error of that is of the square."""

_CLOSE = 4.0
"""The same where no other evaluation is to be made: two standard deviations."""


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

    def __init__(
        self, products: Products, problem: Problem, structure: Structure, theta: Real
    ) -> None:
        self.products, self.problem = products, problem
        self.part = part = Part(problem, structure, theta)
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
    weights : ndarray, shape (q,)
        What multiplies `rows` in it: the last step, 0 where it was evaluated; the numerator.
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
    weights: Real
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
        fixed = self.moments.fixed - self.moments.fixed_rows @ self.weights
        return plain.residual(self.response, fixed)


def _inverse(gram: Real) -> Real:
    """Inverse of a Gram matrix, very large along a direction that is not seen."""
    size = np.diag(gram)
    scale = np.sqrt(np.where(size > 1e-200 * size.max(), size, 1.0))
    values, vectors = np.linalg.eigh(gram / np.outer(scale, scale))
    values = np.maximum(values, 1e-14 * values[-1])
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


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
    here = _Evaluation(products, problem, structure, _within(problem, structure, theta))
    return _climbed(
        here, intersample, iterations=iterations, precision=precision, evaluations=evaluations
    )


def follow(
    products: Products, problem: Problem, intersample: Intersample, fit: Fit, *, evaluations: int
) -> Fitted:
    """Take a fit along to more samples of the same run.

    Where these move it by a fraction of its error bars, that is one step of Gauss and Newton. Where
    it leads is foretold by the derivatives and not evaluated: it costs half of what it would.

    Parameters
    ----------
    products, problem, intersample, evaluations
        As for `fit_products`.
    fit : Fit
        Of the samples before.
    """
    here = _Evaluation(products, problem, fit.structure, fit.theta)
    normal, moment = here.normal()
    step = solved(normal, moment)
    gained, theta = float(step @ moment), fit.theta + step
    freedom = max(products.counted - step.size - here.linear.size, 1)
    held = (_within(problem, fit.structure, theta) != theta).any()
    near = fit.converged and gained * freedom < _NEAR * here.cost
    close = evaluations == 1 and gained * freedom < _CLOSE * here.cost
    if (near or close) and not held:
        return _ended(here, intersample, step, left=here.cost - gained, converged=near)
    return _climbed(here, intersample, evaluations=evaluations)


def _climbed(
    here: _Evaluation,
    intersample: Intersample,
    *,
    iterations: int = 40,
    precision: float = 1e-2,
    evaluations: int | None,
) -> Fitted:
    """The way down from the first evaluation, which counts as one."""
    products, problem, structure = here.products, here.problem, here.part.structure
    seen: list[_Evaluation] = []

    def bounded(moved: Sequence[Real]) -> list[Real]:
        return [_within(problem, structure, t) for t in moved]

    def evaluated(thetas: Sequence[Real]) -> _Evaluation:
        if len(seen) == evaluations:
            raise _SpentError
        seen.append(_Evaluation(products, problem, structure, thetas[0]) if seen else here)
        return seen[-1]

    try:
        best, converged = climb(
            evaluated,
            here.thetas,
            structures=[structure],
            bounded=bounded,
            counted=products.counted,
            iterations=iterations,
            precision=precision,
        )
    except _SpentError:
        best, converged = min(seen, key=lambda one: one.cost), False
    still = np.zeros(best.part.theta.size)
    return _ended(best, intersample, still, left=best.cost, converged=converged)


def _within(problem: Problem, structure: Structure, theta: Real) -> Real:
    """Keep parameters where they can be told."""
    delays = (problem.shortest_delay, problem.longest_delay)
    return within_reach(structure, theta, delays=delays, samples=problem.y.size)


def _ended(
    last: _Evaluation, intersample: Intersample, step: Real, *, left: float, converged: bool
) -> Fitted:
    """Where a fit ended: a step away from the last evaluation, as the derivatives foretell it."""
    (rows, steady), moments, unknown = last.all_rows, last.all_moments, step.size
    linear = last.linear
    if step.any():
        inner, mixed = moments.gram[unknown:, unknown:], moments.gram[unknown:, :unknown]
        linear = linear - solved(inner, mixed @ step)
    weights = np.concatenate([step, linear])
    bias = moments.bias - float(moments.bias_rows @ weights)
    nothing = np.empty(0)
    fit = Fit(
        structure=last.part.structure,
        theta=last.part.theta + step,
        linear=np.append(linear, bias),
        prediction=nothing,
        residual=nothing,
        cost=left,
        objective=left,
        converged=converged,
        nuisance=nothing,
        initial=nothing,
    )
    return Fitted(
        fit=fit,
        intersample=intersample,
        response=weights @ rows,
        weights=weights,
        rows=rows,
        steady=steady,
        moments=moments,
        products=last.products,
    )
