"""Maximum likelihood for an output that was clipped, or held.

A clipped sample says only that the output was beyond the level. Its likelihood is the probability
of that (J. Tobin, Econometrica 26, 1958), so clipped values bias neither the model nor the noise.
If the noise was added after the clipping, the prediction is clipped instead, and the squared
residuals count. A held output is compared with the model at the instants of its updates.

Newton's method on all parameters and ln σ together; the derivatives of the logarithm of a
normal tail are A. C. Cohen's, Technometrics 1, 1959.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.effects.held import held_prediction, rows_at_updates
from hmpim.identify.effects.hold import Updates
from hmpim.identify.effects.saturation import Saturation
from hmpim.identify.fitting.fit import Fit, Problem, bounded_for, fit_structure
from hmpim.identify.fitting.least_squares import inverted
from hmpim.identify.noise.autoregression import autoregression, spectrum_of_filter
from hmpim.identify.noise.whiteness import is_white

__all__ = ["CensoredFit", "fit_censored"]

_LARGEST_STEP = 0.5
"""Largest change of a parameter of the dynamics in one step, relative to its size above 1."""

_MOST_STEPS = 50
"""Largest number of steps."""

_NEGLIGIBLE = 1e-6
"""The search ends when Newton's step predicts a smaller rise of the log-likelihood."""

_FAR = 1e9
"""Standard deviations from a level up to which the normal tail can be computed."""

_LEAST_NOISE = 1e-9
"""Smallest standard deviation of the noise, relative to that of the output."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CensoredFit:
    """A fit to a clipped or held output."""

    # Its prediction includes the hold but no clipping. Its residual is the expected difference
    # given the samples: 0 on average, smaller where clipped. Its cost is `noise_std` squared, times
    # samples less parameters.
    fit: Fit
    # standard deviation of the noise, and of that estimate, in the output's unit
    noise_std: float
    noise_std_std: float
    covariance: Real  # (p, p): of `fit.theta` and `fit.linear`; widened if the residual is coloured
    log_likelihood: float
    index: NDArray[np.intp]  # (m,): samples that were used


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Data:
    """The samples that are used, and which of them are clipped."""

    problem: Problem
    arrivals: Updates
    y: Real
    low: Mask
    high: Mask
    low_edge: Real
    high_edge: Real
    noise_after: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _State:
    """Parameters, and value and derivatives of the log-likelihood there.

    `slope` and `bend` are the first and the negative second derivative with respect to the
    prediction, (m,). `rows` are the derivatives of the prediction with respect to the parameters,
    less their means `level`: at an input far from 0, gain and bias would otherwise look alike.
    `inside` marks the samples that are not clipped.
    """

    fit: Fit
    log_sigma: float
    prediction: Real
    rows: Real
    level: Real
    value: float
    slope: Real
    bend: Real
    inside: Mask
    score: Real
    information: Real


def fit_censored(
    problem: Problem,
    fit: Fit,
    saturation: Saturation | None,
    *,
    arrivals: Updates | None = None,
    drift: Real | None = None,
) -> CensoredFit:
    """Fit one structure to an output that was clipped or held.

    `valid` of the problem excludes invalid samples, but no clipped ones. `fit` has the structure
    and the starting values; a fit to the samples that are not clipped is enough. `saturation` is
    None for an output that was only held, `arrivals` for one that is updated at every sample.
    `drift`, (n,), was removed from the output, and moves the levels. Too few samples inside the
    range are a `RecordError`.
    """
    data = _data(problem, saturation, arrivals, drift)
    state = _start(data, fit)
    damping, converged = 1e-4, False
    for _ in range(_MOST_STEPS):
        step = _step(state, 0.0)
        if 0.0 <= float(step @ state.score) < _NEGLIGIBLE:
            converged = True
            break
        while damping < 1e8:
            trial = _moved(data, state, _step(state, damping))
            if trial is not None and trial.value > state.value:
                state, damping = trial, max(damping / 10, 1e-12)
                break
            damping *= 10
        else:  # no step increases it: the limit of floating-point arithmetic
            converged = True
            break
    return _finished(data, state, converged)


def _data(
    problem: Problem,
    saturation: Saturation | None,
    arrivals: Updates | None,
    drift: Real | None,
) -> _Data:
    n = problem.y.size
    counted = np.ones(n, dtype=bool) if problem.valid is None else problem.valid
    if arrivals is None:
        index = np.flatnonzero(counted)
        arrivals = Updates(index=index, age=np.zeros(index.size))
    else:
        keep = counted[arrivals.index]
        arrivals = replace(arrivals, index=arrivals.index[keep], age=arrivals.age[keep])
    low = high = np.zeros(arrivals.index.size, dtype=bool)
    moved = np.zeros(arrivals.index.size) if drift is None else drift[arrivals.index]
    low_edge, high_edge, after = moved - np.inf, moved + np.inf, False
    if saturation is not None:
        after = saturation.noise == "after"
        if saturation.low is not None:
            low = saturation.low.at[arrivals.index]
            low_edge = saturation.low.level + saturation.tolerance - moved
        if saturation.high is not None:
            high = saturation.high.at[arrivals.index]
            high_edge = saturation.high.level - saturation.tolerance - moved
    return _Data(
        problem=problem,
        arrivals=arrivals,
        y=problem.y[arrivals.index],
        low=low,
        high=high,
        low_edge=low_edge,
        high_edge=high_edge,
        noise_after=after,
    )


def _start(data: _Data, fit: Fit) -> _State:
    """Return the state of a fit to the samples inside the range, started from the given fit."""
    inside = ~(data.low | data.high)
    unknown = fit.theta.size + fit.linear.size + 1
    if np.count_nonzero(inside) <= 2 * unknown:
        raise RecordError(
            f"{np.count_nonzero(inside)} of {inside.size} samples are inside the range, too few "
            f"for {unknown} parameters; drive the unit less hard, or record longer"
        )
    valid = np.zeros(data.problem.y.size, dtype=bool)
    valid[data.arrivals.index[inside]] = True
    begun = fit_structure(replace(data.problem, valid=valid), fit.structure, fit.theta)
    rows = rows_at_updates(data.problem, begun, data.arrivals)
    residual = (data.y - begun.linear @ rows[begun.theta.size :])[inside]
    sigma = max(float(np.std(residual)), _LEAST_NOISE * float(np.std(data.y)))
    return _evaluated(data, begun, float(np.log(sigma)))


def _evaluated(data: _Data, fit: Fit, log_sigma: float) -> _State:
    """Return the log-likelihood and its derivatives."""
    rows = rows_at_updates(data.problem, fit, data.arrivals)
    prediction = fit.linear @ rows[fit.theta.size :]
    level = rows.mean(axis=1)
    level[-1] = 0.0
    rows = rows - level[:, None]
    sigma = float(np.exp(log_sigma))
    if data.noise_after:
        z = (data.y - np.clip(prediction, data.low_edge, data.high_edge)) / sigma
        inside = (prediction > data.low_edge) & (prediction < data.high_edge)
        slope, bend, cross = inside * z / sigma, inside / sigma**2, inside * 2 * z / sigma
    else:
        inside = ~(data.low | data.high)
        z = (data.y - prediction) / sigma
        slope, bend, cross = z / sigma, np.full(z.size, sigma**-2), 2 * z / sigma
    value, by_sigma, bend_sigma = -0.5 * z**2 - log_sigma, z**2 - 1.0, 2 * z**2
    if not data.noise_after:
        for where, edge, sign in ((data.low, data.low_edge, -1), (data.high, data.high_edge, 1)):
            if not where.any():
                continue
            a = np.clip(sign * (edge[where] - prediction[where]) / sigma, -_FAR, _FAR)
            tail = scipy.stats.norm.logsf(a)
            hazard = np.exp(scipy.stats.norm.logpdf(a) - tail)
            value[where] = tail + 0.5 * np.log(2 * np.pi)
            slope[where] = sign * hazard / sigma
            bend[where] = hazard * (hazard - a) / sigma**2
            cross[where] = sign * hazard * (1 + a * (hazard - a)) / sigma
            by_sigma[where] = a * hazard
            bend_sigma[where] = a * hazard * (1 + a * (hazard - a))
    inner = (rows * bend) @ rows.T
    mixed = rows @ cross
    return _State(
        fit=fit,
        log_sigma=log_sigma,
        prediction=prediction,
        rows=rows,
        level=level,
        value=float(np.sum(value)),
        slope=slope,
        bend=bend,
        inside=inside,
        score=np.append(rows @ slope, np.sum(by_sigma)),
        information=np.block(
            [[inner, mixed[:, None]], [mixed[None, :], np.array([[np.sum(bend_sigma)]])]]
        ),
    )


def _step(state: _State, damping: float) -> Real:
    """Return Newton's damped step, with all parameters scaled to unit curvature."""
    diagonal = np.abs(np.diag(state.information))  # may be negative far from a maximum
    scale = np.sqrt(np.where(diagonal > 1e-200 * diagonal.max(), diagonal, 1.0))
    scaled = state.information / np.outer(scale, scale)
    values, vectors = np.linalg.eigh(scaled)
    # Away from a maximum, the magnitude of the curvature still sets the step.
    values = np.maximum(np.abs(values), 1e-12 * np.abs(values).max()) + damping
    return np.asarray(vectors @ ((vectors.T @ (state.score / scale)) / values) / scale)


def _moved(data: _Data, state: _State, step: Real) -> _State | None:
    """The state after a step, shortened if it changes the dynamics too much; None out of reach."""
    fit, unknown = state.fit, state.fit.theta.size
    room = _LARGEST_STEP * np.maximum(1.0, np.abs(fit.theta))
    room[0] = 10.0
    excess = max(float(np.max(np.abs(step[:unknown]) / room)), abs(float(step[-1])) / 2.0, 1.0)
    step = step / excess
    step[-2] -= float(state.level @ step[:-1])
    theta = fit.theta + step[:unknown]
    theta[1:] = bounded_for(data.problem, fit.structure, theta)[1:]
    moved = replace(fit, theta=theta, linear=fit.linear + step[unknown:-1])
    if not data.problem.shortest_delay <= moved.delay <= data.problem.longest_delay:
        return None
    floor = np.log(_LEAST_NOISE * max(float(np.std(data.y)), np.finfo(float).tiny))
    return _evaluated(data, moved, max(state.log_sigma + float(step[-1]), float(floor)))


def _covariance(state: _State, *, white: bool) -> Real:
    """Covariance of all parameters and ln σ."""
    size = state.rows.shape[0]
    own = np.eye(size + 1)
    own[size - 1, :size] -= state.level
    inverse = inverted(state.information)
    if not white:
        middle = np.zeros(inverse.shape)
        middle[:size, :size], fewer = _coloured_scores(state)
        middle[-1, -1] = state.information[-1, -1] * fewer
        inverse = inverse @ middle @ inverse
    return np.asarray(own @ inverse @ own.T)


def _coloured_scores(state: _State) -> tuple[Real, float]:
    """Covariance of the scores, sized as for white noise and correlated as measured.

    The second value is the factor 1 + 2 Σ ρ² by which correlation reduces the number of samples
    that determine the noise (M. S. Bartlett, 1946).
    """
    weighted = state.rows * np.sqrt(np.maximum(state.bend, 0.0))
    length = scipy.fft.next_fast_len(2 * state.slope.size, real=True)
    spectra = scipy.fft.rfft(weighted, length)
    omega = 2 * np.pi * np.arange(spectra.shape[1]) / length
    power = spectrum_of_filter(autoregression(state.slope, state.inside), omega)
    both_signs = np.concatenate([power, power[1:-1]])
    mean = np.mean(both_signs)
    power /= mean
    fewer = float(np.mean((both_signs / mean) ** 2))
    power[1 : (length + 1) // 2] *= 2.0  # both signs of frequency
    return np.asarray(((spectra * power) @ spectra.conj().T).real / length), fewer


def _finished(data: _Data, state: _State, converged: bool) -> CensoredFit:
    fit, counted = state.fit, state.slope.size
    freedom = max(counted - fit.theta.size - fit.linear.size, 1)
    noise_std = float(np.exp(state.log_sigma)) / float(np.sqrt(freedom / counted))
    expected = state.slope * float(np.exp(2 * state.log_sigma))
    residual = np.zeros(data.problem.y.size)
    residual[data.arrivals.index] = expected
    cov = _covariance(state, white=is_white(expected))
    covariance = cov[:-1, :-1].copy()
    covariance[0, 0] += data.arrivals.age_std**2  # an error that all ages share
    return CensoredFit(
        fit=replace(
            fit,
            prediction=held_prediction(state.prediction, data.arrivals, data.problem.y.size),
            residual=residual,
            cost=noise_std**2 * freedom,
            converged=converged,
        ),
        noise_std=noise_std,
        noise_std_std=noise_std * float(np.sqrt(max(cov[-1, -1], 0.0))),
        covariance=covariance,
        log_likelihood=state.value - 0.5 * counted * float(np.log(2 * np.pi)),
        index=data.arrivals.index,
    )
