"""One output, several inputs at once: each pair's fit with the others taken out.

Pairs are fitted in turn, each to what the others leave over, until nothing moves (backfitting:
Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2nd ed., section 9.1.1; for
least squares it ends at the joint optimum). The error bars come from all pairs' derivatives
together, so that inputs that resemble each other widen them.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.enrich import PLAIN
from hmpim.identify.fit import Problem, fit_structure, jacobian
from hmpim.identify.joint import JointFit, Trial, joint_fit
from hmpim.identify.uncertainty import covariance
from hmpim.identify.verdict import is_unrelated
from hmpim.identify.whiteness import effective_share, is_white
from hmpim.model.dynamics import StructureName
from hmpim.record import Intersample

__all__ = ["Joined", "fit_together"]

_TURNS = 12
_STILL = 1e-2
"""Stop when no pair's contribution moves by more than this share of the noise (r.m.s.)."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Joined:
    """Fits of one output to each input.

    Parameters
    ----------
    fits : tuple of JointFit
        One for each input; its output is what the other inputs leave over.
    related : tuple of bool
        Whether the output follows that input at all.
    covariances : tuple of ndarray, shape (p_i, p_i)
        Of each fit's parameters, all fits considered together.
    """

    fits: tuple[JointFit, ...]
    related: tuple[bool, ...]
    covariances: tuple[NDArray[np.float64], ...]


def fit_together(
    inputs: list[NDArray[np.float64]],
    y: NDArray[np.float64],
    *,
    valid: NDArray[np.bool_] | None,
    known: NDArray[np.bool_] | None,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> Joined:
    """Fit one output to several inputs.

    Parameters
    ----------
    inputs : list of ndarray, shape (n,)
        Uniform samples of each input.
    y : ndarray, shape (n,)
        Uniform samples of the output.
    valid, known, intersample, structures
        As for `hmpim.identify.joint.joint_fit`; `known` is for all inputs together.
    """

    def fitted(
        u: NDArray[np.float64],
        rest: NDArray[np.float64],
        names: tuple[StructureName, ...] = structures,
    ) -> JointFit:
        return joint_fit(
            u, rest, valid=valid, known=known, intersample=intersample, structures=names
        )

    count = len(inputs)
    if count == 1:
        fit = fitted(inputs[0], y)
        return Joined(fits=(fit,), related=(not is_unrelated(fit),), covariances=())
    parts = [np.zeros(y.size) for _ in range(count)]
    # With the other inputs still in it, the output does not tell rich structures from plain.
    plain = tuple(name for name in structures if name in PLAIN) or structures
    fits = [fitted(u, y, plain) for u in inputs]
    order = sorted(range(count), key=lambda i: fits[i].best.fit.cost)
    related = [True] * count
    for names in (plain, structures):  # the strongest first; then again, the others known
        for i in order:
            fits[i] = fitted(inputs[i], y - _others(parts, i), names)
            related[i] = not is_unrelated(fits[i])
            parts[i] = _part(fits[i]) if related[i] else np.zeros(y.size)
    for _ in range(_TURNS):
        moved = 0.0
        for i in order:
            if not related[i]:
                continue
            fits[i] = _again(fits[i], y - _others(parts, i))
            part = _part(fits[i])
            noise = np.sqrt(fits[i].best.fit.cost / y.size)
            moved = max(moved, float(np.sqrt(np.mean((part - parts[i]) ** 2)) / max(noise, 1e-300)))
            parts[i] = part
        if moved < _STILL:
            break
    return Joined(
        fits=tuple(fits),
        related=tuple(related),
        covariances=_covariances(fits, related),
    )


def _others(parts: list[NDArray[np.float64]], i: int) -> NDArray[np.float64]:
    total = np.zeros_like(parts[0])
    for j, part in enumerate(parts):
        if j != i:
            total = total + part
    return total


def _part(fit: JointFit) -> NDArray[np.float64]:
    """What the input contributes to the output, the bias aside."""
    best = fit.best.fit
    return np.asarray(best.prediction - best.linear[-1])


def _again(fit: JointFit, rest: NDArray[np.float64]) -> JointFit:
    """Fit the chosen structure again, to what the others leave over now."""
    problem = replace(fit.problem, y=rest)
    best = fit_structure(problem, fit.best.fit.structure, fit.best.fit.theta, precision=1e-4)
    trial = Trial(intersample=fit.best.intersample, fit=best, criterion=fit.best.criterion)
    trials = tuple(trial if t is fit.best else t for t in fit.trials)
    return replace(
        fit,
        problem=problem,
        best=trial,
        trials=trials,
        effective_share=effective_share(best.residual),
    )


def _covariances(fits: list[JointFit], related: list[bool]) -> tuple[NDArray[np.float64], ...]:
    """Covariance of each pair's parameters and the bias, from all derivatives together."""
    counted = _all_count([fit.problem for fit in fits])
    blocks, spans, start = [], [], 0
    for fit, follows in zip(fits, related, strict=True):
        rows = jacobian(fit.problem, fit.best.fit)[:-1] * counted if follows else None
        size = 0 if rows is None else rows.shape[0]
        spans.append(range(start, start + size))
        start += size
        if rows is not None:
            blocks.append(rows)
    if not blocks:
        return tuple(np.zeros((0, 0)) for _ in fits)
    stacked = np.vstack([*blocks, counted.astype(float)])
    last = next(fit for fit, follows in zip(fits, related, strict=True) if follows)
    residual = last.best.fit.residual * counted
    freedom = max(int(np.count_nonzero(counted)) - stacked.shape[0], 1)
    full = covariance(stacked, residual, freedom=freedom, white=is_white(residual[counted]))
    return tuple(
        full[np.ix_([*span, start], [*span, start])] if span else np.zeros((0, 0)) for span in spans
    )


def _all_count(problems: list[Problem]) -> NDArray[np.bool_]:
    counted = np.ones(problems[0].y.size, dtype=bool)
    for problem in problems:
        if problem.valid is not None:
            counted &= problem.valid
    return counted
