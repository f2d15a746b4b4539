"""Many outputs of one stimulus fitted at once under one assumption, with their covariances.

Each output is a few numbers in the basis from `learnt.py`. Gauss-Newton steps in delay and poles
are taken for all outputs at once; the gain is solved exactly.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.data import shifted
from hmpim.identify.fleets.learnt import Fleet, Member
from hmpim.identify.fleets.surface import Surface
from hmpim.identify.worth import FEW

__all__ = ["Errors", "Fits", "descended", "errors_of", "fitted_all"]

_STEPS = 12

_NEGLIGIBLE = 1e-6
"""Gain of a step, as a share of the noise's variance, below which the fit has converged."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fits:
    """All records fitted under one assumption; first axis: the record."""

    member: Member
    theta: Real
    gain: Real
    cost: Real
    left: Real  # residual inside the basis
    figures: Mapping[str, Real]


def fitted_all(fleet: Fleet, centred: Real, means: Real, power: Real) -> list[Fits]:
    """Fit all records under each assumption of the fleet, in the order of its members.

    Given are outputs less their means, (N, n), those means, and the powers of the outputs, (N,).
    """
    sizes = np.cumsum([member.basis.shape[0] for member in fleet.members])
    every = centred @ np.concatenate([member.basis for member in fleet.members]).T
    found: list[Fits] = []
    for member, z in zip(fleet.members, np.split(every, sizes[:-1], axis=1), strict=True):
        low, high = member.surface.low, member.surface.high
        start = np.tile((low + high) / 2, (means.size, 1))
        if found:  # the same units, shifted to another assumption
            first = found[0].member
            away = shifted(np.zeros(low.size), first.intersample, member.intersample)
            inside = first.surface.holds(found[0].theta)[:, None]
            start = np.where(inside, found[0].theta + away, start)
        outside = np.maximum(power - np.vecdot(z, z), 0.0)
        start = np.clip(start, low, high)
        theta = descended(member.surface, z, outside, start, samples=fleet.u.size)
        value = member.surface.values(theta)
        g = value[:, :-1]
        gain = np.vecdot(z, g) / np.vecdot(g, g)
        left = z - gain[:, None] * g
        figures = dict(zip(fleet.names, fleet.figures.values(theta).T, strict=True))
        figures |= {"scale_factor": gain, "bias": means - gain * value[:, -1]}
        cost = outside + np.vecdot(left, left)
        found.append(
            Fits(member=member, theta=theta, gain=gain, cost=cost, left=left, figures=figures)
        )
    return found


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Errors:
    """Errors of the fits of some records; first axis of an array: the record."""

    rows: Real  # derivatives by place and gain, in the basis
    inner: Real  # inverse of their Gram matrix
    variance: Real
    freedom: int
    deviations: Mapping[str, Real]
    exact: Mask  # whether the polynomials of the figures are exact enough


def errors_of(fleet: Fleet, fit: Fits, some: NDArray[np.intp]) -> Errors:
    """Standard deviations of all figures, to first order."""
    n, theta, gain = fleet.u.size, fit.theta[some], fit.gain[some]
    value, slope = fit.member.surface.at(theta)
    size = theta.shape[1]
    freedom = n - size - 2
    variance = fit.cost[some] / freedom
    rows = np.concatenate([gain[:, None, None] * slope[:, :, :-1], value[:, None, :-1]], axis=1)
    inner = np.linalg.pinv(rows @ rows.transpose(0, 2, 1), rcond=1e-13, hermitian=True)
    covariance = variance[:, None, None] * inner
    _, steep = fleet.figures.at(theta)
    spread = np.sum(steep * (covariance[:, :size, :size] @ steep), axis=1)
    deviations = np.sqrt(np.maximum(spread, 0.0))
    # The bias is the mean less the mean of the model; the mean has its own error.
    by_mean = -np.concatenate([gain[:, None] * slope[:, :, -1], value[:, -1:]], axis=1)
    of_bias = np.vecdot(by_mean, (covariance @ by_mean[:, :, None])[:, :, 0]) + variance / n
    return Errors(
        rows=rows,
        inner=inner,
        variance=variance,
        freedom=freedom,
        deviations={
            **dict(zip(fleet.names, deviations.T, strict=True)),
            "scale_factor": np.sqrt(covariance[:, size, size]),
            "bias": np.sqrt(of_bias),
        },
        exact=(fleet.figures.error <= FEW * deviations + 1e-12).all(axis=1),
    )


def descended(surface: Surface, z: Real, outside: Real, start: Real, *, samples: int) -> Real:
    """Gauss-Newton for all records at once, the gain solved exactly at each step.

    A record that has converged is dropped from later steps. The surface gives coordinates in a
    basis, and the mean in the last column, for responses of unit gain; `z`, (k, r), are the records
    in that basis, `outside`, (k,), is their power outside it, and `start`, (k, p), the first point.
    """
    low, high = surface.low, surface.high
    best, least = start.copy(), np.full(z.shape[0], np.inf)
    theta, step, share = start.copy(), np.zeros_like(start), np.ones(z.shape[0])
    on = np.arange(z.shape[0])
    for _ in range(_STEPS):
        cost, fresh, gained = _step(surface, theta, z[on], outside[on])
        better = cost < least[on]
        best[on[better]], least[on[better]] = theta[better], cost[better]
        step = np.where(better[:, None], fresh, step)
        share = np.where(better, 1.0, share / 4)
        stay = gained >= _NEGLIGIBLE * cost / samples
        on, step, share = on[stay], step[stay], share[stay]
        if on.size == 0:
            break
        theta = np.clip(best[on] + share[:, None] * step, low, high)
    return best


def _step(surface: Surface, theta: Real, z: Real, outside: Real) -> tuple[Real, Real, Real]:
    """Cost of each record, its next step, and by how much the step lowers the cost."""
    value, slope = surface.at(theta)
    g, dg = value[:, :-1], slope[:, :, :-1]
    square = np.vecdot(g, g)
    gain = np.vecdot(z, g) / square
    left = z - gain[:, None] * g
    # The slopes are projected on the complement of g, to which the residual is orthogonal.
    moment = gain[:, None] * (dg @ left[:, :, None])[:, :, 0]
    along = (dg @ g[:, :, None])[:, :, 0]
    gram = dg @ dg.transpose(0, 2, 1) - along[:, :, None] * (along / square[:, None])[:, None, :]
    gram *= (gain**2)[:, None, None]
    gram += 1e-9 * np.einsum("iaa->ia", gram)[:, :, None] * np.eye(gram.shape[1])
    fresh = np.asarray(np.linalg.solve(gram, moment[:, :, None])[:, :, 0], dtype=np.float64)
    return outside + np.vecdot(left, left), fresh, np.vecdot(fresh, moment)
