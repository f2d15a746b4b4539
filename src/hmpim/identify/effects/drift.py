"""A bias that drifts: a slow function of time, fitted together with the model.

It is tried if the residual with a constant bias is not white, or if a rich model has a free
response as slow as a drift. Its shape is a polynomial, or exp(-t/T) as of a body that warms up.
Legendre polynomials, or the exponential and its derivative with respect to T, are rows of the same
fit, solved with bias and numerator; the error bars come from the derivatives of all.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.polynomial.legendre import legvander

from hmpim.identify.arrays import Real
from hmpim.identify.effects.disturbance import criterion_gain, without_rows
from hmpim.identify.fitting.candidates import spans_record
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved, without
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.worth import MOST, PART, TWICE
from hmpim.record import Finding

__all__ = ["Drifting", "drift_findings", "drift_rows", "is_slow", "with_drift", "with_plain_drift"]

_DEGREES = (1, 2, 3, 4, 6, 8, 12, 16)
"""Degrees of the polynomial that are compared."""

_SETTLES = (-4.0, 0.7)
"""Range of the logarithm of the time constant over the record length: from one that settles within
the first fifth of the record to two records."""

_TRIED = 16
"""Number of time constants tried in that range."""

_FEWEST = 100
"""Fewest samples that distinguish drift from noise: six for each degree of the polynomial."""

_Begun = Callable[[Real], tuple[Problem, Fit]]
_Fitted = Callable[[Real, bool], JointFit]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drifting:
    """A fit with a bias that drifts."""

    trend: Real  # (n,): the drift, zero on average, in the output's unit
    steady: bool  # whether the drift is a straight line
    # mean rate over the record and its standard deviation, in the output's unit per sample
    rate: float
    rate_std: float


def with_drift(first: JointFit, fitted: _Fitted) -> tuple[JointFit, Drifting | None]:
    """Fit again with a drifting bias, if the first fit suggests one and the criterion improves.

    `first` has a constant bias. `fitted` makes the joint fit with rows for the drift, of plain
    structures only if its second argument is true.

    Returns the chosen fit and the drift; None for the drift if a constant bias is enough.
    """
    if not _may_drift(first):
        return first, None
    every = drift_rows(first.problem.y.size)
    joint = fitted(every, True)
    plainly = is_white(joint.best.fit.residual)
    if not plainly:
        known = first.best.fit
        if is_white(known.residual) and known.structure.name in PLAIN:
            return first, None  # plain dynamics suffice without a drift
        joint = fitted(every, False)  # a drift can imitate missing dynamics
    columns = _shape(joint.problem, joint.best.fit, every)

    gain = criterion_gain(joint, len(columns), first.best.fit, first.problem)
    if gain < 0.0:  # fewer rows explain no more
        return first, None
    if len(columns) < len(every):  # choose again, with the drift known
        joint = fitted(columns, plainly)
        gain = criterion_gain(joint, len(columns), first.best.fit, first.problem)
        if gain < 0.0:
            return first, None
    return _without_drift(joint, columns)


def with_plain_drift(
    problem: Problem, fit: Fit, begun: _Begun, fitted: Callable[[Real], JointFit]
) -> tuple[JointFit, Drifting] | None:
    """Add a drift to plain dynamics; keep it if that leaves white noise.

    `problem` and `fit` are the data and the best plain fit with a constant bias. `begun` makes the
    plain fits with rows for the drift and returns the best of them and its data; `fitted` makes the
    joint fit of plain structures. The values are as for `with_drift`.

    None if a constant bias is enough, if the model is as slow as a drift, or if the residual is not
    white.
    """
    every = drift_rows(problem.y.size)
    data, free = begun(every)
    if data.counted < max(_FEWEST, MOST * problem.counted) or not free.is_white:
        return None
    columns = _shape(data, free, every)
    joint = fitted(columns)
    if spans_record(joint.best.fit) or not is_white(joint.best.fit.residual):
        return None
    if criterion_gain(joint, len(columns), fit, problem) < 0.0:
        return None
    return _without_drift(joint, columns)


def _without_drift(joint: JointFit, columns: Real) -> tuple[JointFit, Drifting]:
    """Subtract the drift from the fit."""
    weighed, fit = joint.weighed, joint.best.fit
    weights = fit.nuisance[: len(columns)]
    others = jacobian(replace(weighed, nuisance=weighed.fixed()[1 + len(columns) :]), fit)
    slopes = without(weighed.masked(columns), others)
    residual = weighed.innovations(fit.prediction, fit.residual)
    errors = covariance(
        slopes,
        residual,
        freedom=max(weighed.counted - slopes.shape[0] - others.shape[0], 1),
        white=is_white(residual),
    )
    across = (columns[:, -1] - columns[:, 0]) / (weighed.y.size - 1)
    drifting = Drifting(
        trend=weights @ columns,
        steady=len(columns) == 1,
        rate=float(across @ weights),
        rate_std=float(np.sqrt(max(float(across @ errors @ across), 0.0))),
    )
    # The rows of the drift stay free; the bias is the mean.
    return without_rows(joint, slice(len(columns))), drifting


def drift_findings(drifting: Drifting, fs: float, unit: str, *, white: bool) -> Iterator[Finding]:
    """Report how the bias drifts, and doubt the noise if the residual is not `white`."""
    rate, std = drifting.rate * fs, drifting.rate_std * fs
    per = f" {unit}/s" if unit else " per s"
    span = f"{float(np.ptp(drifting.trend)):.3g} {unit}".rstrip()
    shape = "steadily" if drifting.steady else "unsteadily"
    yield Finding(
        code="drift",
        message=f"The bias drifts {shape}, by {span} over the record, on average by "
        f"{rate:.3g} ± {std:.2g}{per}; the drift is removed, and the bias stated is the mean "
        "over the record. Let the unit warm up, or measure the bias before and after.",
        severity="info",
        parameters=("bias",),
    )
    if not white:
        yield Finding(
            code="drift_or_noise",
            message="The residual is not white once the drift is removed: slow parts of it may be "
            "drift rather than noise. Let the unit warm up, and repeat the test.",
            severity="doubt",
            parameters=("noise_std",),
        )


def _may_drift(joint: JointFit) -> bool:
    """Whether the residual is slow, or the model is as slow as a drift."""
    fit, problem = joint.best.fit, joint.problem
    if spans_record(fit) or joint.lingers:
        return True  # the model may explain a drift
    if is_white(fit.residual):
        return False
    return fit.cost > PART * problem.spread or is_slow(problem, fit)


def is_slow(problem: Problem, fit: Fit) -> bool:
    """Whether the residual varies slowly."""
    residual = problem.counting(fit.residual)
    if residual.size < _FEWEST:
        return False
    # In 1/f noise, polynomial k has the power of bin k / 2.
    flicker = np.mean(2.0 / np.arange(1, 5)) / np.mean(1.0 / np.arange(8, 41))  # 20.4
    return bool(_steepness(residual) > TWICE**2 * flicker)


def _steepness(residual: Real) -> float:
    """Ratio of the mean power of the four slowest polynomials to that of bins 8 to 40."""
    columns = drift_rows(residual.size)
    columns = columns / np.linalg.norm(columns, axis=1)[:, None]
    centred = residual - residual.mean()
    weights = columns @ centred
    power = np.abs(scipy.fft.rfft(centred - weights @ columns)) ** 2 / residual.size
    level = float(np.mean(power[8:41]))
    return float(np.mean(weights[:4] ** 2)) / max(level, np.finfo(float).tiny)


def drift_rows(size: int) -> Real:
    """Legendre polynomials, zero on average, shape (k, n): the rows of every drift tried."""
    at = (2.0 * np.arange(size) + 1.0 - size) / size
    columns = legvander(at, _DEGREES[-1]).T[1:]
    return np.asarray(columns - columns.mean(axis=1, keepdims=True))


def _shape(problem: Problem, fit: Fit, columns: Real) -> Real:
    """Choose the rows of the drift by Schwarz's criterion, shape (k, n).

    They are fitted to the residual plus the drift so far. The initial state stays free, as it
    resembles the beginning of a drift.
    """
    counts = slice(None) if problem.valid is None else problem.valid
    target = (fit.residual + problem.masked(fit.nuisance[: len(columns)] @ columns))[counts]
    count = problem.counted  # all samples: of a random walk, the more is removed the better
    free = part_of(problem, fit.structure, fit.theta).free
    always = np.vstack([free, np.ones(problem.y.size)])

    def cost(shapes: Real) -> float:
        rows = np.vstack([shapes, always])[:, counts]
        rest = target - solved(rows @ rows.T, rows @ target) @ rows
        return count * float(np.log(max(float(rest @ rest), np.finfo(float).tiny)))

    settling = _settling(problem.y.size, _slowness(problem.y.size, cost))
    found = [columns[:degree] for degree in _DEGREES] + [settling]
    return min(found, key=lambda rows: cost(rows) + len(rows) * float(np.log(count)))


def _slowness(size: int, cost: Callable[[Real], float]) -> float:
    """Time constant in samples of a drift that settles: the best of a grid, then refined."""

    def depth(log_time: float) -> float:
        return cost(_settling(size, float(np.exp(log_time)))[:1])

    grid = np.log(size) + np.linspace(*_SETTLES, _TRIED)
    near = grid[int(np.argmin([depth(t) for t in grid]))]
    step = grid[1] - grid[0]
    best = scipy.optimize.minimize_scalar(
        depth, bounds=(near - step, near + step), method="bounded"
    )
    return float(np.exp(best.x))


def _settling(size: int, time_constant: float) -> Real:
    """exp(-t/T) and its derivative with respect to log T, zero on average, shape (2, n)."""
    at = np.arange(size) / time_constant
    rows = np.vstack([np.exp(-at), at * np.exp(-at)])
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))
