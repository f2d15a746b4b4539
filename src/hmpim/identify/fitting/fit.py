"""Maximum likelihood for one structure: delay, dynamics, scale factor and bias together.

With white Gaussian noise the likelihood is greatest where the sum of squares of the
residual is least. Delay and denominator enter nonlinearly, numerator and bias linearly;
the linear ones are solved exactly at each step (variable projection: G. H. Golub and
V. Pereyra, SIAM J. Numer. Anal. 10, 1973), the others by Levenberg-Marquardt.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.fft import irfft, rfft

from hmpim.model.dynamics import Structure, coefficients_of, denominator_of
from hmpim.model.sampled import SampledInput, delayed_response

__all__ = ["Fit", "Problem", "basis_rows", "fit_structure", "jacobian", "moved_by"]

_STEP = 1e-6
"""Step of the derivatives, relative to a parameter above 1: its square is below rounding."""

_LONGEST_TIME_CONSTANT = 2.0
"""In record lengths; a slower pole cannot be told from an integrator."""

_SHORTEST_TIME_CONSTANT = 0.02
"""In samples; a faster pole cannot be told from none."""


_SHAPES = (1e-4, 1e6)
"""Bounds of 1 / (4ζ²): from a second pole 10 000 times as fast as the first, to ζ = 0.0005."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One input, one output, and which samples of the output count.

    Parameters
    ----------
    source : SampledInput
        The prepared input.
    y : ndarray, shape (n,)
        Output samples.
    valid : ndarray of bool, shape (n,), or None
        Samples that count; None when all do.
    longest_delay : float
        Greatest delay to try, in samples.
    whitening : ndarray, shape (n // 2 + 1,), or None
        Gain at each bin of the transform after which the noise is white; residuals and
        derivatives then are those of the whitened output. None for noise that is white.
    """

    source: SampledInput
    y: NDArray[np.float64]
    valid: NDArray[np.bool_] | None
    longest_delay: float
    whitening: NDArray[np.float64] | None = None

    @property
    def counted(self) -> int:
        """How many samples count."""
        return self.y.size if self.valid is None else int(np.count_nonzero(self.valid))

    def masked(self, rows: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return `rows`, (k, n) or (n,), samples that do not count set to 0, noise whitened."""
        counted = rows if self.valid is None else rows * self.valid
        if self.whitening is None:
            return counted
        return np.asarray(irfft(rfft(counted) * self.whitening, rows.shape[-1]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fit:
    """Where a fit ended.

    Parameters
    ----------
    structure : Structure
        What was fitted.
    theta : ndarray, shape (1 + order,)
        Delay in samples, then the parameters of the denominator's sections (`coefficients_of`),
        time in samples.
    linear : ndarray, shape (zeros + 2,)
        Numerator coefficients by rising power of s (the first is the scale factor), bias.
    prediction : ndarray, shape (n,)
        Output of the fitted model.
    residual : ndarray, shape (n,)
        Output less prediction; 0 where a sample does not count.
    cost : float
        Sum of squares of the residual.
    converged : bool
        Whether the last step was negligible.
    """

    structure: Structure
    theta: NDArray[np.float64]
    linear: NDArray[np.float64]
    prediction: NDArray[np.float64]
    residual: NDArray[np.float64]
    cost: float
    converged: bool

    @property
    def delay(self) -> float:
        """Pure delay in samples."""
        return float(self.theta[0])

    @property
    def denominator(self) -> NDArray[np.float64]:
        """A(s) by rising powers of s per sample, shape (order + 1,)."""
        return denominator_of(self.structure, coefficients_of(self.structure, self.theta[1:]))


def basis_rows(
    problem: Problem, structure: Structure, theta: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Responses that the linear parameters multiply, shape (zeros + 1, n)."""
    return _responses(problem, structure, theta, structure.zeros + 1)


def _responses(
    problem: Problem, structure: Structure, theta: NDArray[np.float64], powers: int
) -> NDArray[np.float64]:
    """Responses of s^i e^(-sτ) / A(s), the level before the record included."""
    rows = delayed_response(
        problem.source,
        delay=float(theta[0]),
        denominator=denominator_of(structure, coefficients_of(structure, theta[1:])),
        powers=powers,
    )
    level = problem.source.first
    if structure.integrators and level:
        # What the level before the record adds up to from its first sample on.
        since = np.maximum(np.arange(problem.y.size) - float(theta[0]), 0.0)
        rows[0] += level * since
        if powers > 1:
            rows[1] += level * (since > 0)
    else:
        rows[0] += level
    return rows


def _solve_linear(problem: Problem, structure: Structure, theta: NDArray[np.float64]) -> Fit:
    """Best numerator and bias at given delay and denominator."""
    basis = basis_rows(problem, structure, theta)
    rows = np.vstack([basis, np.ones(problem.y.size)])
    counted = problem.masked(rows)
    y = problem.masked(problem.y)
    linear = _least_squares(counted @ counted.T, counted @ y)
    prediction = linear @ rows
    residual = problem.masked(problem.y - prediction)
    return Fit(
        structure=structure,
        theta=theta,
        linear=linear,
        prediction=prediction,
        residual=residual,
        cost=float(residual @ residual),
        converged=False,
    )


def _least_squares(
    gram: NDArray[np.float64], moment: NDArray[np.float64], damping: float = 0.0
) -> NDArray[np.float64]:
    """Solve normal equations, scaled to unit diagonal; directions without content stay 0."""
    diagonal = np.diag(gram)
    scale = np.sqrt(np.where(diagonal > 1e-200 * diagonal.max(), diagonal, 1.0))
    scaled = gram / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    keep = values > 1e-13 * values[-1]
    projected = (vectors.T @ (moment / scale))[keep] / (values[keep] + damping)
    return np.asarray(vectors[:, keep] @ projected / scale)


def jacobian(problem: Problem, fit: Fit) -> NDArray[np.float64]:
    """Derivatives of the prediction with respect to theta, then to the linear parameters.

    Returns
    -------
    ndarray, shape (1 + order + zeros + 2, n)
        Zero where a sample does not count.
    """
    weights, theta, structure = fit.linear[:-1], fit.theta, fit.structure
    rows = np.empty((theta.size + fit.linear.size, problem.y.size))
    # d/dτ of e^(-sτ) is -s: one more power of s, whose responses come at little cost.
    dynamic = structure.order + structure.integrators > 0
    responses = _responses(problem, structure, theta, structure.zeros + (2 if dynamic else 1))
    basis = responses[: weights.size]
    here = weights @ basis
    for i in range(theta.size):
        if i == 0 and dynamic:
            rows[0] = -(weights @ responses[1:])
            continue
        moved = theta.copy()
        step = _STEP * max(1.0, abs(theta[i]))
        moved[i] += step
        rows[i] = (weights @ basis_rows(problem, structure, moved) - here) / step
    rows[theta.size : -1] = basis
    rows[-1] = 1.0
    return problem.masked(rows)


def _bounded(
    problem: Problem,
    structure: Structure,
    theta: NDArray[np.float64],
    shortest_delay: float,
) -> NDArray[np.float64]:
    """Keep delay and time constants where the record can tell them."""
    bounded = theta.copy()
    bounded[0] = np.clip(theta[0], shortest_delay, problem.longest_delay)
    start = 1
    for order in structure.sections:
        longest = np.log(_LONGEST_TIME_CONSTANT * problem.y.size)
        bounded[start] = np.clip(theta[start], np.log(_SHORTEST_TIME_CONSTANT), longest)
        if order == 2:
            bounded[start + 1] = np.clip(theta[start + 1], *_SHAPES)
        start += order
    return bounded


def moved_by(problem: Problem, fit: Fit, step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return theta after a step, no coefficient changed beyond recognition, within bounds."""
    share = _limited(fit.structure, fit.theta, step)
    return _bounded(problem, fit.structure, fit.theta + share * step, -4.0)


def _limited(structure: Structure, theta: NDArray[np.float64], step: NDArray[np.float64]) -> float:
    """Share of a step to take so that no coefficient changes beyond recognition."""
    share, start = 1.0, 1
    for order in structure.sections:
        share = min(share, 1.0 / max(abs(step[start]), 1e-300))
        if order == 2:
            room = max(1.0, theta[start + 1])
            share = min(share, room / max(abs(step[start + 1]), 1e-300))
        start += order
    return share


def fit_structure(
    problem: Problem,
    structure: Structure,
    theta: NDArray[np.float64],
    *,
    iterations: int = 40,
    precision: float = 1e-2,
    shortest_delay: float = -4.0,
) -> Fit:
    """Fit one structure from one start.

    Parameters
    ----------
    problem : Problem
        The data.
    structure : Structure
        What to fit.
    theta : ndarray, shape (1 + order,)
        Start: delay in samples, parameters of the denominator's sections.
    iterations : int
        At most so many steps.
    precision : float
        Stop when a step lowers the sum of squares by less than this, in units of σ²; a
        parameter then is within about the root of it, in standard deviations.
    shortest_delay : float
        Least delay to try, in samples; below 0 an input column stamped late shows.

    Returns
    -------
    Fit
        `converged` is False if the steps ran out.
    """
    fit = _solve_linear(problem, structure, _bounded(problem, structure, theta, shortest_delay))
    damping = 1e-4
    unknown = fit.theta.size
    freedom = max(problem.counted - unknown - fit.linear.size, 1)
    for _ in range(iterations):
        rows = jacobian(problem, fit)
        gram, moment = rows @ rows.T, rows @ fit.residual
        negligible = precision * fit.cost / freedom
        undamped = _damped_step(gram, moment, unknown, 0.0)
        if float(undamped @ moment[:unknown]) < negligible:  # Newton's decrement
            return replace(fit, converged=True)
        while True:
            step = _damped_step(gram, moment, unknown, damping)
            step = _limited(structure, fit.theta, step) * step
            trial = _solve_linear(
                problem,
                structure,
                _bounded(problem, structure, fit.theta + step, shortest_delay),
            )
            if trial.cost < fit.cost:
                damping = max(damping / 10, 1e-9)
                break
            if damping > 1e6:  # no way down: a kink, a bound, or the arithmetic's own floor
                return replace(fit, converged=True)
            damping *= 10
        fell, fit = fit.cost - trial.cost, trial
        if fell < negligible and damping < 1e-3:
            return replace(fit, converged=True)
    return fit


def _damped_step(
    gram: NDArray[np.float64], moment: NDArray[np.float64], unknown: int, damping: float
) -> NDArray[np.float64]:
    """Levenberg-Marquardt step of the nonlinear parameters, the linear ones projected out."""
    nonlinear, mixed, linear = (
        gram[:unknown, :unknown],
        gram[:unknown, unknown:],
        gram[unknown:, unknown:],
    )
    projected = nonlinear - mixed @ np.linalg.lstsq(linear, mixed.T, rcond=None)[0]
    return _least_squares(projected, moment[:unknown], damping)
