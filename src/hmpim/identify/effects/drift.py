"""A bias that drifts: a slow polynomial of time, fitted together with everything else.

Looked for only where a constant bias leaves a residual that is not white. The polynomial is
found by backfitting: what the model leaves over is given to model and polynomial together, by
one step of least squares, then the model is fitted to the rest, until neither moves. That ends
at the joint optimum, and the error bars come from the derivatives of both.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy.fft import rfft

from hmpim.identify.effects.colour import bias_drift
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Problem, fit_structure, jacobian
from hmpim.identify.fitting.joint import JointFit, Trial
from hmpim.identify.fitting.unrelated import is_unrelated
from hmpim.identify.uncertainty import covariance
from hmpim.identify.whiteness import effective_share, is_white
from hmpim.model import slowest_time_constant
from hmpim.record import Finding

__all__ = ["Drifting", "drift_finding", "with_drift"]

_DEGREES = (1, 2, 3, 4, 6, 8, 12, 16)
"""Degrees of the polynomial that are weighed against each other."""

_CERTAIN = 1e-5
"""Chance below which a slope is not chance."""

_STEEP = 80.0
"""Power of the slowest motion over that a little faster: 1/f noise has about 20."""

_SLOW = 0.25
"""Time constant of the model, over the record's length, that may be a drift in disguise."""

_POOR = 0.3
"""Share of the output's power left over from which a drift is looked for in any case."""

_BEHIND_LEVELS = 0.3
"""Gain per sample, in the criterion, that a drift of a clipped output must bring."""

_TURNS = 12
_STEPS = 3
_STILL = 1e-3
"""Stop when the polynomial moves by less than this share of the noise (r.m.s.)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Drifting:
    """A fit with a bias that drifts.

    Parameters
    ----------
    joint : JointFit
        Fitted to the output without the drift; its bias is the mean over the record.
    trend : ndarray, shape (n,)
        The drift, zero on average, in the output's unit.
    covariance : ndarray, shape (p, p)
        Of theta and the linear parameters, the drift being unknown too.
    degree : int
        Of the polynomial.
    rate, rate_std : float
        Mean rate over the record and its standard deviation, output's unit per sample.
    """

    joint: JointFit
    trend: NDArray[np.float64]
    covariance: NDArray[np.float64]
    degree: int
    rate: float
    rate_std: float


def with_drift(
    first: JointFit,
    y: NDArray[np.float64],
    fitted: Callable[[NDArray[np.float64], bool], JointFit],
    *,
    clipped: bool = False,
) -> Drifting | None:
    """Fit again with a drifting bias, where the first fit asks for it and gains by it.

    Parameters
    ----------
    first : JointFit
        With a constant bias.
    y : ndarray, shape (n,)
        Output.
    fitted : callable
        Makes the joint fit of another output; of the plain structures only if the second
        argument is true.
    clipped : bool
        Whether samples beyond a level were left out: that alone makes the residual slow, so a
        drift must then explain more.

    Returns
    -------
    Drifting or None
        None where a constant bias serves.
    """
    if not _asked_for(first):
        return None
    columns = _polynomials(y.size, _DEGREES[-1])
    begun = fitted(y - _regressed(columns, y, first.problem.valid), True)
    joint, weights = _backfitted(begun, y, columns)
    plainly = is_white(joint.best.fit.residual)
    degree = _degree(joint, columns, weights)
    columns = columns[:degree]
    if not is_unrelated(joint):  # the structure is chosen once more, now that the drift is known
        joint = fitted(y - weights[:degree] @ columns, plainly)
    joint, weights = _backfitted(joint, y, columns)
    if _gain(joint, degree, first, 0) < (_BEHIND_LEVELS * joint.problem.counted if clipped else 0):
        return None
    return _described(joint, columns, weights)


def drift_finding(drifting: Drifting, fs: float, unit: str) -> Finding:
    """Say how the bias drifts."""
    rate, std = drifting.rate * fs, drifting.rate_std * fs
    per = f" {unit}/s" if unit else " per s"
    span = f"{float(np.ptp(drifting.trend)):.3g} {unit}".rstrip()
    shape = "steadily" if drifting.degree == 1 else "not steadily"
    return Finding(
        code="drift",
        message=f"The bias drifts {shape}, by {span} over the record, on average by "
        f"{rate:.3g} ± {std:.2g}{per}; the drift is taken out, and the bias stated is the mean "
        "over the record. Let the unit warm up, or measure the bias before and after.",
        severity="info",
        parameters=("bias",),
    )


def _asked_for(joint: JointFit) -> bool:
    """Whether what a fit leaves over is slow, or its model is as slow as a drift."""
    fit, problem = joint.best.fit, joint.problem
    slow = slowest_time_constant(fit.denominator) > _SLOW * problem.y.size
    if slow or fit.structure.integrators:  # the model may have taken the drift for its own
        return True
    if is_white(fit.residual):
        return False
    if joint.forgotten:  # it may be the drift that parts the beginning from the rest
        return True
    spread = problem.masked(problem.y - problem.y.mean())
    if fit.cost > _POOR * float(spread @ spread):
        return True
    counted = np.arange(problem.y.size) if problem.valid is None else np.flatnonzero(problem.valid)
    residual = fit.residual[counted]
    if counted.size < 100:
        return False
    steep = _STEEP if fit.structure.name in PLAIN else _STEEP / 5  # a rich model hides some
    if _steepness(residual) > steep:
        return True
    return bias_drift(residual, counted.astype(np.float64)).probability < _CERTAIN


def _steepness(residual: NDArray[np.float64]) -> float:
    """Mean power of the four slowest polynomials over that of bins 8 to 40."""
    columns = _polynomials(residual.size, _DEGREES[-1])
    columns = columns / np.linalg.norm(columns, axis=1)[:, None]
    weights = columns @ (residual - residual.mean())
    power = np.abs(rfft(residual - residual.mean() - weights @ columns)) ** 2 / residual.size
    level = float(np.mean(power[8:41]))
    return float(np.mean(weights[:4] ** 2)) / max(level, np.finfo(float).tiny)


def _polynomials(size: int, degree: int) -> NDArray[np.float64]:
    """Legendre polynomials 1 … degree over the record, zero on average, shape (degree, n)."""
    at = (2.0 * np.arange(size) + 1.0 - size) / size
    columns = legvander(at, degree).T[1:]
    return np.asarray(columns - columns.mean(axis=1, keepdims=True))


def _regressed(
    columns: NDArray[np.float64], y: NDArray[np.float64], valid: NDArray[np.bool_] | None
) -> NDArray[np.float64]:
    """Polynomial closest to `y`, zero on average."""
    counts = slice(None) if valid is None else valid
    rows = np.vstack([columns, np.ones(y.size)])[:, counts]
    weights = _solved(rows, y[counts])[:-1]
    return np.asarray(weights @ columns)


def _solved(rows: NDArray[np.float64], target: NDArray[np.float64]) -> NDArray[np.float64]:
    """Least squares through normal equations scaled to unit diagonal."""
    gram = rows @ rows.T
    scale = np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    solution = np.linalg.lstsq(gram / np.outer(scale, scale), (rows @ target) / scale, rcond=1e-12)
    return np.asarray(solution[0] / scale)


def _backfitted(
    joint: JointFit, y: NDArray[np.float64], columns: NDArray[np.float64]
) -> tuple[JointFit, NDArray[np.float64]]:
    """Model and polynomial in turn, from a joint fit of `y` less some polynomial."""
    weights = _solved(columns, y - joint.problem.y)
    for _ in range(_TURNS):
        problem, fit = joint.problem, joint.best.fit
        rows = np.vstack([jacobian(problem, fit), problem.masked(columns)])
        step = _solved(rows, fit.residual)[-columns.shape[0] :]
        weights = weights + step
        joint = _again(joint, y - weights @ columns)
        noise = float(np.sqrt(fit.cost / problem.counted))
        if float(np.sqrt(np.mean((step @ columns) ** 2))) <= _STILL * noise:
            break
    return joint, weights


def _again(joint: JointFit, y: NDArray[np.float64]) -> JointFit:
    """Fit the chosen structure to another output, from where it ended."""
    problem: Problem = replace(joint.problem, y=y)
    begun = joint.best.fit
    fit = fit_structure(problem, begun.structure, begun.theta, iterations=_STEPS, precision=1e-3)
    fit = replace(fit, converged=begun.converged or fit.converged)
    best = Trial(intersample=joint.best.intersample, fit=fit, criterion=joint.best.criterion)
    return replace(
        joint,
        problem=problem,
        best=best,
        trials=tuple(best if trial is joint.best else trial for trial in joint.trials),
        effective_share=effective_share(fit.residual),
    )


def _degree(joint: JointFit, columns: NDArray[np.float64], weights: NDArray[np.float64]) -> int:
    """Least degree that serves, by Schwarz's criterion on model's residual and polynomial."""
    problem = joint.problem
    counts = slice(None) if problem.valid is None else problem.valid
    left = (joint.best.fit.residual + problem.masked(weights @ columns[: weights.size]))[counts]
    count = problem.counted  # of a wander, the more is taken out the better
    best = (np.inf, 1)
    for degree in _DEGREES:
        if degree > weights.size:
            break
        rows = np.vstack([columns[:degree], np.ones(problem.y.size)])[:, counts]
        rest = left - _solved(rows, left) @ rows
        cost = max(float(rest @ rest), np.finfo(float).tiny)
        best = min(best, (count * float(np.log(cost)) + degree * float(np.log(count)), degree))
    return best[1]


def _gain(one: JointFit, degree: int, other: JointFit, other_degree: int) -> float:
    """Schwarz's criterion of another fit less that of one, per sample that counts in either."""
    count = max(one.problem.counted, other.problem.counted)

    def criterion(joint: JointFit, order: int) -> float:
        fit = joint.best.fit
        cost = max(fit.cost, np.finfo(float).tiny) / joint.problem.counted
        return float(count * np.log(cost) + (fit.structure.parameters + order) * np.log(count))

    return criterion(other, other_degree) - criterion(one, degree)


def _described(
    joint: JointFit, columns: NDArray[np.float64], weights: NDArray[np.float64]
) -> Drifting:
    problem, fit = joint.problem, joint.best.fit
    rows = np.vstack([jacobian(problem, fit), problem.masked(columns)])
    counts = slice(None) if problem.valid is None else problem.valid
    full = covariance(
        rows,
        fit.residual,
        freedom=max(problem.counted - rows.shape[0], 1),
        white=is_white(fit.residual[counts]),
    )
    unknown = rows.shape[0] - columns.shape[0]
    across = (columns[:, -1] - columns[:, 0]) / (problem.y.size - 1)
    return Drifting(
        joint=joint,
        trend=weights @ columns,
        covariance=full[:unknown, :unknown],
        degree=columns.shape[0],
        rate=float(across @ weights),
        rate_std=float(np.sqrt(max(float(across @ full[unknown:, unknown:] @ across), 0.0))),
    )
