"""A bias that drifts: a slow function of time, fitted together with everything else.

Looked for where a constant bias leaves a residual that is not white, or a rich model has a free
response as slow as a drift. It is a polynomial, or what settles as a body does that warms up,
exp(-t/T). Legendre's polynomials, or the exponential and its derivative with respect to T, are
rows of the same fit, solved with bias and numerator; the error bars come from the derivatives of
all.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.polynomial.legendre import legvander

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, FALSE_ALARM, LIKELIER
from hmpim.identify.effects.disturbance import gain_by_rows, without_rows
from hmpim.identify.fitting.candidates import spans_record
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved, without
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.colour import bias_drift
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.worth import MOST, PART, TWICE
from hmpim.record import Finding

__all__ = ["Drifting", "drift_findings", "drift_rows", "is_slow", "with_drift", "with_plain_drift"]

_DEGREES = (1, 2, 3, 4, 6, 8, 12, 16)
"""Degrees of the polynomial that are weighed against each other."""

_SETTLES = (-4.0, 0.7)
"""Logarithms of the time constants, over the record, at which what settles is looked for: from
one that is over before the fifth part of a record to one of two records."""

_TRIED = 16
"""How many."""

_FEWEST = 100
"""Samples from which on a drift is told from noise: six for each degree of the polynomial."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drifting:
    """A fit with a bias that drifts.

    Parameters
    ----------
    joint : JointFit
        Fitted to the output, the drift taken off, its polynomials free to move; the bias is the
        mean over the record.
    trend : ndarray, shape (n,)
        The drift, zero on average, in the output's unit.
    steady : bool
        Whether it is a straight line.
    rate, rate_std : float
        Mean rate over the record and its standard deviation, output's unit per sample.
    rival : Fit or None
        The fit with a constant bias, where the odds against it are below 20.
    """

    joint: JointFit
    trend: Real
    steady: bool
    rate: float
    rate_std: float
    rival: Fit | None


def with_drift(
    first: JointFit,
    fitted: Callable[[Real, bool], JointFit],
    steadily: Callable[[JointFit], JointFit | None],
) -> tuple[JointFit, Drifting | None]:
    """Fit again with a drifting bias, where the first fit asks for it and gains by it.

    Parameters
    ----------
    first : JointFit
        With a constant bias.
    fitted : callable
        Makes the joint fit with rows for the drift; of the plain structures only if the second
        argument is true.
    steadily : callable
        Makes of a joint fit beside a drift the same with a constant bias, from a state that is
        free, or with a washout; None if neither leaves white noise.

    Returns
    -------
    joint : JointFit
        The fit that serves. Beside a drift the search may have found what it had missed without:
        if a free response is all that drifts, its bias is constant.
    drifting : Drifting or None
        None where a constant bias serves.
    """
    if not _asked_for(first):
        return first, None
    every = drift_rows(first.problem.y.size)
    joint = fitted(every, True)
    plainly = is_white(joint.best.fit.residual)
    if not plainly:  # else the drift takes the shape of missing dynamics
        joint = fitted(every, False)
    columns = _shape(joint, every)

    def gained(joint: JointFit) -> tuple[float, float]:
        least = -2 * CLEARLY if _passes_for_drift(first, joint) else 0.0
        return gain_by_rows(joint, len(columns), first.best.fit, first.problem), least

    gain, least = gained(joint)  # fewer rows explain no more
    if gain < least:
        return first, None
    if len(columns) < len(every):  # the structure is chosen once more, now that the drift is known
        joint = fitted(columns, plainly)
        gain, least = gained(joint)
        if gain < least:
            return first, None
    rival = first.best.fit if gain < 2 * LIKELIER else None
    return _unless_steady(joint, columns, steadily, rival)


def with_plain_drift(
    problem: Problem,
    fit: Fit,
    fitted: Callable[[Real, bool], JointFit],
    steadily: Callable[[JointFit], JointFit | None],
) -> tuple[JointFit, Drifting | None] | None:
    """Add a drift to plain dynamics; keep it if white noise is left.

    Parameters
    ----------
    problem, fit
        The data, and the best plain fit with a constant bias.
    fitted : callable
        Makes the joint fit of the plain structures with rows for the drift; if the second argument
        is true, whether it leaves white noise is all that is asked.
    steadily : callable
        As for `with_drift`.

    Returns
    -------
    joint : JointFit
        The fit that serves, beside the drift or with a constant bias.
    drifting : Drifting or None
        None where a free response is all that drifts.

    None where a constant bias serves, where the model that a drift is added to is slow itself, and
    where more than white noise is left.
    """
    columns = drift_rows(problem.y.size)
    joint = fitted(columns, True)
    told = joint.problem.counted
    if told < max(_FEWEST, MOST * problem.counted) or not is_white(joint.best.fit.residual):
        return None
    columns = _shape(joint, columns)
    joint = fitted(columns, False)
    if spans_record(joint.best.fit) or not is_white(joint.best.fit.residual):
        return None
    gain = gain_by_rows(joint, len(columns), fit, problem)
    if gain < 0.0:
        return None
    return _unless_steady(joint, columns, steadily, fit if gain < 2 * LIKELIER else None)


def _unless_steady(
    joint: JointFit,
    columns: Real,
    steadily: Callable[[JointFit], JointFit | None],
    rival: Fit | None,
) -> tuple[JointFit, Drifting | None]:
    """The fit beside a drift, or that with a constant bias which explains as much."""
    steady = steadily(joint)
    if steady and gain_by_rows(joint, len(columns), steady.best.fit, steady.problem) < 0.0:
        return steady, None
    drifting = _described(joint, columns, rival=rival)
    return drifting.joint, drifting


def _passes_for_drift(first: JointFit, drifting: JointFit) -> bool:
    """Whether a rich model has a pole as slow as the record where plain dynamics and a drift do.

    Of the two the drift leaves gain and bandwidths what they are.
    """
    fit, plain = first.best.fit, drifting.best.fit
    slow = spans_record(fit) and drifting.problem.counted >= _FEWEST  # fewer have no shape
    rich = fit.structure.parameters > plain.structure.parameters
    return slow and rich and plain.structure.name in PLAIN and is_white(plain.residual)


def drift_findings(drifting: Drifting, fs: float, unit: str, *, white: bool) -> tuple[Finding, ...]:
    """Say how the bias drifts, and doubt the noise where what is left is not `white`."""
    rate, std = drifting.rate * fs, drifting.rate_std * fs
    per = f" {unit}/s" if unit else " per s"
    span = f"{float(np.ptp(drifting.trend)):.3g} {unit}".rstrip()
    shape = "steadily" if drifting.steady else "unsteadily"
    drifts = Finding(
        code="drift",
        message=f"The bias drifts {shape}, by {span} over the record, on average by "
        f"{rate:.3g} ± {std:.2g}{per}; the drift is removed, and the bias stated is the mean "
        "over the record. Let the unit warm up, or measure the bias before and after.",
        severity="info",
        parameters=("bias",),
    )
    if white:
        return (drifts,)
    unsure = Finding(
        code="drift_or_noise",
        message="The residual is not white once the drift is removed: slow parts of it may be "
        "drift rather than noise. Let the unit warm up, and repeat the test.",
        severity="doubt",
        parameters=("noise_std",),
    )
    return drifts, unsure


def _asked_for(joint: JointFit) -> bool:
    """Whether what a fit leaves over is slow, or its model is as slow as a drift."""
    fit, problem = joint.best.fit, joint.problem
    if spans_record(fit) or joint.lingers:
        return True  # the model may have taken the drift for its own
    if is_white(fit.residual):
        return False
    spread = problem.masked(problem.y - problem.y.mean())
    return fit.cost > PART * float(spread @ spread) or is_slow(problem, fit)


def is_slow(problem: Problem, fit: Fit) -> bool:
    """Whether what a fit leaves over is slow."""
    counted = np.arange(problem.y.size) if problem.valid is None else np.flatnonzero(problem.valid)
    residual = fit.residual[counted]
    if counted.size < _FEWEST:
        return False
    # Of 1/f noise: polynomial k has the power of bin k / 2.
    flicker = np.mean(2.0 / np.arange(1, 5)) / np.mean(1.0 / np.arange(8, 41))  # 20.4
    if _steepness(residual) > TWICE**2 * flicker:
        return True
    return bias_drift(residual, counted.astype(np.float64)).probability < FALSE_ALARM


def _steepness(residual: Real) -> float:
    """Mean power of the four slowest polynomials over that of bins 8 to 40."""
    columns = drift_rows(residual.size)
    columns = columns / np.linalg.norm(columns, axis=1)[:, None]
    weights = columns @ (residual - residual.mean())
    power = (
        np.abs(scipy.fft.rfft(residual - residual.mean() - weights @ columns)) ** 2 / residual.size
    )
    level = float(np.mean(power[8:41]))
    return float(np.mean(weights[:4] ** 2)) / max(level, np.finfo(float).tiny)


def drift_rows(size: int) -> Real:
    """Rows of any drift that is looked for: Legendre polynomials, zero on average, shape (k, n)."""
    at = (2.0 * np.arange(size) + 1.0 - size) / size
    columns = legvander(at, _DEGREES[-1]).T[1:]
    return np.asarray(columns - columns.mean(axis=1, keepdims=True))


def _shape(joint: JointFit, columns: Real) -> Real:
    """Rows that serve, by Schwarz's criterion on model's residual and polynomial, shape (k, n).

    The state that the record begins with gives way: it looks like a beginning of the drift.
    """
    problem, fit = joint.problem, joint.best.fit
    counts = slice(None) if problem.valid is None else problem.valid
    left = (fit.residual + problem.masked(fit.nuisance[: len(columns)] @ columns))[counts]
    count = problem.counted  # of a wander, the more is taken out the better
    free = part_of(problem, fit.structure, fit.theta).free
    always = np.vstack([free, np.ones(problem.y.size)])

    def cost(shapes: Real) -> float:
        rows = np.vstack([shapes, always])[:, counts]
        rest = left - solved(rows @ rows.T, rows @ left) @ rows
        return count * float(np.log(max(float(rest @ rest), np.finfo(float).tiny)))

    settling = _settling(problem.y.size, _slowness(problem.y.size, cost))
    found = [columns[:degree] for degree in _DEGREES] + [settling]
    return min(found, key=lambda rows: cost(rows) + len(rows) * float(np.log(count)))


def _slowness(size: int, cost: Callable[[Real], float]) -> float:
    """Time constant in samples of what settles, from a grid and then to its best."""
    grid = np.log(size) + np.linspace(*_SETTLES, _TRIED)
    near = grid[int(np.argmin([cost(_settling(size, float(np.exp(t)))[:1]) for t in grid]))]
    step = grid[1] - grid[0]
    best = scipy.optimize.minimize_scalar(
        lambda t: cost(_settling(size, float(np.exp(t)))[:1]),
        bounds=(near - step, near + step),
        method="bounded",
    )
    return float(np.exp(best.x))


def _settling(size: int, slowness: float) -> Real:
    """exp(-t/T) and its derivative with respect to log T, zero on average, shape (2, n)."""
    at = np.arange(size) / slowness
    rows = np.vstack([np.exp(-at), at * np.exp(-at)])
    return np.asarray(rows - rows.mean(axis=1, keepdims=True))


def _described(joint: JointFit, columns: Real, *, rival: Fit | None) -> Drifting:
    """The fit with the drift taken off the output, its polynomials still free to move."""
    problem, weighed, fit = joint.problem, joint.weighed, joint.best.fit
    own = fit.nuisance[: len(columns)]
    trend = own @ columns
    others = jacobian(replace(weighed, nuisance=weighed.fixed()[1 + len(columns) :]), fit)
    slopes = without(weighed.masked(columns), others)
    left = weighed.innovations(fit.prediction, fit.residual)
    weights = covariance(
        slopes,
        left,
        freedom=max(weighed.counted - slopes.shape[0] - others.shape[0], 1),
        white=is_white(left),
    )
    across = (columns[:, -1] - columns[:, 0]) / (problem.y.size - 1)
    return Drifting(
        joint=without_rows(joint, slice(len(columns))),
        trend=trend,
        steady=len(columns) == 1,
        rate=float(across @ own),
        rate_std=float(np.sqrt(max(float(across @ weights @ across), 0.0))),
        rival=rival,
    )
