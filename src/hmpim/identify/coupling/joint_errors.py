"""Error bars with several inputs: from the derivatives of one output with respect to all pairs."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import UNSEEN, without
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit

__all__ = ["common", "covariances", "derivatives", "gained_by"]


def common(masks: Iterable[Mask | None]) -> Mask | None:
    """Samples that count in all masks, shape (n,); None if all do."""
    known = [mask for mask in masks if mask is not None]
    counted = np.logical_and.reduce(known) if known else np.ones(1, dtype=bool)
    return None if counted.all() else np.asarray(counted)


def derivatives(fits: list[JointFit], whitening: Real | None) -> tuple[Problem, list[Real], Real]:
    """Derivatives by each pair's parameters without the bias, and by the bias, where all count.

    Other unknowns, the drift and the initial states, are projected out of all.
    """
    problem = replace(
        fits[-1].problem,
        valid=common(f.problem.valid for f in fits),
        whitening=whitening,
        begins=None,
    )
    blocks, others, bias = [], [], problem.masked(np.ones((1, problem.y.size)))
    for fit in fits:
        own = replace(problem, source=fit.problem.source, begins=fit.problem.begins)
        part = part_of(own, fit.best.fit.structure, fit.best.fit.theta)
        alone = replace(own, begins=None, nuisance=None)
        blocks.append(jacobian(alone, fit.best.fit, part=part)[:-1])
        others.append(part.free)
    if problem.nuisance is not None:
        others.append(problem.nuisance)
    given = problem.masked(np.vstack(others))
    if given.shape[0]:
        edges = np.cumsum([block.shape[0] for block in blocks])
        *blocks, bias = np.split(without(np.vstack([*blocks, bias]), given), edges)
    return problem, blocks, bias


def covariances(problem: Problem, last: JointFit, blocks: list[Real], bias: Real) -> list[Real]:
    """Covariance of each pair's parameters and the bias, from all derivatives together."""
    rows = np.vstack([*blocks, bias])
    residual = problem.masked(last.best.fit.residual)
    # Without whitening, the noise is white already.
    full = _joint_covariance(rows, residual, freedom=max(problem.counted - rows.shape[0], 1))
    end, start, out = rows.shape[0] - 1, 0, []
    for block in blocks:
        span = [*range(start, start + block.shape[0]), end]
        own = full[np.ix_(span, span)]
        if last.best.fit.structure.sampled:  # its delay is a known number of samples
            own[0], own[:, 0] = 0.0, 0.0
        out.append(own)
        start += block.shape[0]
    return out


def gained_by(problems: Sequence[Problem], fits: Sequence[Fit], i: int) -> float:
    """Log-likelihood that one pair's gain adds, with all other parameters free.

    Half of b' C⁻¹ b, with b the pair's numerator and C its covariance. Poles and delay of the pair
    are fixed: they mean nothing without a gain.
    """
    blocks = []
    for j, (p, f) in enumerate(zip(problems, fits, strict=True)):
        rows = jacobian(p, f)[:-1]
        blocks.append(rows[f.theta.size :] if j == i else rows)
    rows = np.vstack([*blocks, problems[0].masked(np.ones(problems[0].y.size))])
    residual = problems[i].masked(fits[i].residual)
    full = _joint_covariance(rows, residual, freedom=problems[i].counted)
    start = sum(block.shape[0] for block in blocks[:i])
    span = slice(start, start + blocks[i].shape[0])
    b = fits[i].linear[:-1]
    return float(0.5 * b @ np.linalg.pinv(full[span, span], hermitian=True) @ b)


def _joint_covariance(rows: Real, residual: Real, *, freedom: int) -> Real:
    """Covariance for white noise; a direction that is not determined affects no other one.

    `rows` are the derivatives of the prediction, (p, n), the bias's the last. The bias is projected
    out of the others first: if an input is far from zero, the derivative by its gain is nearly the
    same.
    """
    bias, mean = rows[-1], rows[:-1] @ rows[-1]
    power = max(float(bias @ bias), np.finfo(float).tiny)
    mean = mean / power
    moved = rows[:-1] - mean[:, None] * bias
    scale = np.sqrt(np.maximum(np.sum(moved**2, axis=1), np.finfo(float).tiny ** 0.5))
    scaled = moved / scale[:, None]
    values, vectors = np.linalg.eigh(scaled @ scaled.T)
    spread = vectors / np.sqrt(np.maximum(values, UNSEEN * values[-1]))
    inner = spread @ spread.T / np.outer(scale, scale)
    mixed = -inner @ mean
    last = np.array([[1.0 / power - mean @ mixed]])
    full = np.block([[inner, mixed[:, None]], [mixed[None], last]])
    return np.asarray(full * float(residual @ residual) / freedom)
