"""A structure fitted to statistics: the iteration of the joint fit, on products of filters.

An impulse response is the response of a structure to one sample of 1 among zeros, continued between
the samples as the input is. Its derivatives are those of the joint fit's rows, in closed form.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.climb import climb
from hmpim.identify.fitting.fit import CONVERGED, Fit, bounded_for, evaluating
from hmpim.identify.fitting.held_steps import is_known_to_a_sample
from hmpim.identify.fitting.least_squares import inverted, solved
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.noise.autoregression import whitening_filter
from hmpim.identify.noise.whiteness import share_of
from hmpim.identify.statistics.products import Moments, Products, Remainder, Responses
from hmpim.identify.statistics.reach import AHEAD, Reach
from hmpim.model.dynamics import Structure
from hmpim.model.sampled import SampledInput, prepare_input
from hmpim.record import Intersample

__all__ = ["Compressed", "Fitted", "as_fitted", "fit_briefly", "follow", "pulse"]

_FINAL = 1e-10
"""Precision of the chosen fit: 1e-5 standard deviations."""

_NEAR = 0.25
"""Gain of a step, in units of σ², up to which its end is predicted and not evaluated: a parameter
then moves by half a standard deviation at most, and the error is of second order."""

_CLOSE = 4.0
"""The same where no other evaluation is allowed: two standard deviations."""

_ROUNDED = 1e-13
"""Share of the output's power below which the residual is the rounding of sums."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compressed(Problem):
    """A pulse as input, and products under a noise model in place of the output's samples."""

    products: Products
    final: ClassVar[float] = _FINAL

    @classmethod
    def of(cls, products: Products, source: SampledInput) -> "Compressed":
        """Make it from products, and a pulse prepared by `pulse`."""
        statistics = products.statistics
        return cls(
            source=source,
            y=np.broadcast_to(np.float64(0.0), (statistics.samples,)),  # takes no memory
            valid=None,
            longest_delay=float(statistics.lags),
            noise=products.noise if products.order else None,
            products=products,
        )

    @property
    def counted(self) -> int:
        """How many samples count."""
        return self.products.counted

    @property
    def spread(self) -> float:
        """Sum of squares of the output about its bias."""
        return self.products.energy

    @property
    def plain(self) -> "Compressed":
        """The same with white noise."""
        return replace(self, noise=None, products=self.products.plain)


def pulse(reach: Reach, intersample: Intersample) -> SampledInput:
    """Return a unit pulse as an input, so that the response to it is the impulse response."""
    samples = np.zeros(reach.taps)
    samples[AHEAD] = 1.0
    return prepare_input(samples, intersample)


class _SpentError(Exception):
    """All allowed evaluations were made."""


class _Evaluation:
    """A structure at given parameters: the linear parameters solved, and the next step."""

    def __init__(self, problem: Compressed, structure: Structure, theta: Real) -> None:
        self.problem, self.products = problem, problem.products
        self.part = part = Part(problem, structure, theta)
        self.own = self._responses(part.rows, constant=part.structure.dc_zeros == 0)
        self.moments = self.products.moments(self.own)
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
        slopes = self.part.slopes(self.linear, np.empty(0))
        if self.problem.shortest_delay == self.problem.longest_delay:
            slopes[0] = 0.0  # the delay is fixed
        return slopes

    def _responses(self, rows: Real, *, constant: bool) -> Responses:
        """Impulse responses of this structure; `constant` if the first has a gain of 1 at DC."""
        if self.part.structure.integrators:
            return Responses.integrating(rows)
        steady = np.zeros(rows.shape[0])
        steady[0] = float(constant)
        return Responses.ending(rows, steady)

    @cached_property
    def all_responses(self) -> Responses:
        """Derivatives by theta, then the rows."""
        return self._responses(self.slopes, constant=False).and_also(self.own)

    @cached_property
    def all_moments(self) -> Moments:
        """Products of derivatives by theta, then of the rows."""
        return self.products.moments(self.all_responses)

    def normal(self) -> tuple[Real, Real]:
        """Normal equations of delay and denominator: matrix, and derivative of the cost."""
        moments, unknown = self.all_moments, self.part.theta.size
        turned, mixed = moments.gram[:unknown, :unknown], moments.gram[:unknown, unknown:]
        inner = moments.gram[unknown:, unknown:]
        left = moments.cross[:unknown] - mixed @ self.linear
        return turned - mixed @ solved(inner, mixed.T), left

    def fits(self, *, converged: bool) -> "list[Fit]":
        """The fit here."""
        return [self.stepped(np.zeros(self.part.theta.size), left=self.cost, converged=converged)]

    def stepped(self, step: Real, *, left: float, converged: bool) -> "Fitted":
        """Return the fit one step away, as the derivatives predict it."""
        responses, moments, unknown = self.all_responses, self.all_moments, step.size
        left = max(left, np.finfo(float).eps * moments.energy)  # a prediction may be below 0
        linear = self.linear
        if step.any():
            inner, mixed = moments.gram[unknown:, unknown:], moments.gram[unknown:, :unknown]
            linear = linear - solved(inner, mixed @ step)
        weights = np.concatenate([step, linear])
        bias = moments.bias - float(moments.bias_rows @ weights)
        nothing = np.empty(0)
        return Fitted(
            structure=self.part.structure,
            theta=self.part.theta + step,
            linear=np.append(linear, bias),
            prediction=nothing,
            residual=self.problem.y,
            cost=left,
            objective=left,
            converged=converged,
            nuisance=nothing,
            initial=nothing,
            response=weights @ responses.rows,
            weights=weights,
            responses=responses,
            moments=moments,
            problem=self.problem,
        )


@evaluating.register
def _(
    first: Compressed, problems: Sequence[Problem], structures: Sequence[Structure]
) -> Callable[[Sequence[Real]], _Evaluation]:
    """Evaluate by products of impulse responses."""
    return lambda thetas: _Evaluation(first, structures[0], thetas[0])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Residual:
    """The residual of a fit, not whitened."""

    power: float  # mean square
    counted: int  # samples that `power` is the mean of
    innovation: float  # mean square of the error with which its past predicts it
    share: float  # independent samples per sample
    noise: Real  # autoregression, 1 first; 1 alone where it is white


@dataclass(frozen=True, kw_only=True, eq=False)
class Fitted(Fit):
    """A fit to products; it predicts no samples, and `cost` equals `objective`."""

    response: Real  # (taps,): impulse response, less its final value
    # (q,): factors of `responses` in it: the last step, 0 if its end was evaluated; the numerator
    weights: Real
    responses: Responses  # derivatives of the impulse response by theta, then by the numerator
    moments: Moments  # products of `responses`
    problem: Compressed  # the data

    @property
    def products(self) -> Products:
        """The data, under the noise model of the fit."""
        return self.problem.products

    @property
    def whitening(self) -> Products:
        """Products that whiten the residual."""
        products = self.products
        white = products.order or self.is_white
        return products if white else products.whitened(self.left.noise)

    @property
    def is_white(self) -> bool:
        """Whether the residual passes for white."""
        return self.left.noise.size == 1

    @property
    def is_steady(self) -> bool:
        """Whether the residual keeps its level: assumed, since that cannot be tested here."""
        return True

    @property
    def share(self) -> float:
        """Independent samples per sample of the residual."""
        return self.left.share

    @property
    def variance(self) -> float:
        """Variance of the white noise."""
        freedom = self.products.counted - self.moments.cross.size - self.moments.fixed.size
        return self.objective / max(freedom, 1)

    @property
    def covariance(self) -> Real:
        """Covariance of theta, the numerator and the mean bias: the Cramér-Rao bound."""
        gram = self.moments.gram
        if is_known_to_a_sample(self.problem.source, self.structure):
            # In a static model the delay is uniform over the sample in which it ends; otherwise
            # figures are read at both ends of that sample.
            inverse = np.zeros_like(gram)
            inverse[1:, 1:] = inverted(gram[1:, 1:])
            inverse[0, 0] = 0.0 if self.structure.order else 1.0 / (12.0 * self.variance)
        else:
            inverse = inverted(gram)
        slope = self.moments.bias_rows
        mixed = -inverse @ slope
        last = slope @ inverse @ slope + self.moments.bias_variance
        whole = np.block([[inverse, mixed[:, None]], [mixed[None], np.array([[last]])]])
        return np.asarray(whole * self.variance)

    @cached_property
    def remainder(self) -> Remainder:
        """Products and ends of the residual, not whitened."""
        fixed = self.moments.fixed - self.moments.fixed_rows @ self.weights
        kept = float(self.responses.kept @ self.weights)
        return self.products.plain.left_over(self.response, kept, fixed)

    @cached_property
    def left(self) -> _Residual:
        """Power, colour and autoregression of the residual."""
        products = self.products
        gram, count = self.remainder.gram, self.remainder.counted
        if gram[0, 0] <= _ROUNDED * products.plain.energy:
            least, noise = self.objective / products.counted, np.ones(1)
            return _Residual(power=least, counted=count, innovation=least, share=1.0, noise=noise)
        power = float(gram[0, 0])
        rho = gram[0, 1 : max(min(gram.shape[0], count // 4), 1)] / power
        lags = np.arange(1, rho.size + 1)
        box = count * (count + 2.0) * float(np.sum(rho**2 / (count - lags)))
        white = rho.size == 0 or scipy.special.chdtrc(rho.size, box) > FALSE_ALARM
        noise = np.ones(1) if white else whitening_filter(gram, count)
        if white and not products.order:
            power, count = self.objective, products.counted
        return _Residual(
            power=power / count,
            counted=count,
            innovation=float(noise @ gram[: noise.size, : noise.size] @ noise) / count,
            share=1.0 if white else share_of(rho, count),
            noise=noise,
        )


def as_fitted(fit: Fit) -> Fitted:
    """Narrow the type of a fit that was made to products."""
    if not isinstance(fit, Fitted):
        raise TypeError("the fit was made to samples, not to statistics")
    return fit


def follow(problem: Compressed, fit: Fit, *, evaluations: int) -> Fitted:
    """Update a fit to more samples of the same run, with a limited number of evaluations.

    Where these samples move it by a fraction of its error bars, one step of Gauss and Newton is
    enough. Its end is predicted by the derivatives and not evaluated, which halves the cost.
    """
    structure = fit.structure
    here = _Evaluation(problem, structure, fit.theta)
    normal, moment = here.normal()
    step = solved(normal, moment)
    gained, theta = float(step @ moment), fit.theta + step
    freedom = max(problem.counted - step.size - here.linear.size, 1)
    held = (bounded_for(problem, structure, theta) != theta).any()
    near = fit.converged and gained * freedom < _NEAR * here.cost
    close = evaluations == 1 and gained * freedom < _CLOSE * here.cost
    if (near or close) and not held:
        return here.stepped(step, left=here.cost - gained, converged=near)
    return _climbed(here, evaluations)


def fit_briefly(
    problem: Compressed, structure: Structure, theta: Real, *, evaluations: int
) -> Fitted:
    """Fit one structure from one start with a limited number of evaluations."""
    here = _Evaluation(problem, structure, bounded_for(problem, structure, theta))
    return _climbed(here, evaluations)


def _climbed(here: _Evaluation, evaluations: int) -> Fitted:
    """Iterate from the first evaluation, which counts as one."""
    problem, structure = here.problem, here.part.structure
    made: list[_Evaluation] = []

    def evaluated(thetas: Sequence[Real]) -> _Evaluation:
        if len(made) == evaluations:
            raise _SpentError
        made.append(_Evaluation(problem, structure, thetas[0]) if made else here)
        return made[-1]

    try:
        best, converged = climb(
            evaluated,
            here.thetas,
            structures=[structure],
            bounded=lambda thetas: [bounded_for(problem, structure, theta) for theta in thetas],
            counted=problem.counted,
            iterations=evaluations,
            precision=CONVERGED,
        )
    except _SpentError:
        best, converged = min(made, key=lambda evaluation: evaluation.cost), False
    return as_fitted(best.fits(converged=converged)[0])
