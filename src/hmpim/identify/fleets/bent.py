"""Records of a fleet that look bent by chance, which widens their intervals.

Units of a fleet are much alike, and so is what a nonlinearity leaves of them. So all residuals are
held against what each kind leaves of the unit in the middle, and only where one takes nearly enough
is the record asked by itself, by `hmpim.identify.nonlinear.bends`.
"""

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY
from hmpim.identify.fleets.fleet import Column, Fleet, Group, parameters_of, widen
from hmpim.identify.fleets.pole import alone_of, joint_of
from hmpim.identify.nonlinear.bends import bends, bent_shapes
from hmpim.identify.reading.spanned import spanned

__all__ = ["cover_bends", "shapes_of"]

_ASKED = 0.5 * (np.sqrt(2.0 * CLEARLY) - 0.5) ** 2
"""Log-likelihood half a deviation below CLEARLY, from which a record is asked for a nonlinearity:
what one leaves of the unit in the middle is not quite what it leaves of each."""


def shapes_of(fleet: Fleet) -> Real:
    """Return what nonlinearities leave of the unit in the middle of a fleet, shape (m, n)."""
    usual = (one for one in fleet.members if one.intersample == fleet.natural)
    member = next(usual, fleet.members[0])
    place = (member.surface.low + member.surface.high) / 2
    values = member.surface.values(place[None])[0]
    problem, best = alone_of(fleet, member, place, values[:-1] @ member.basis + values[-1])
    return bent_shapes(fleet.u, problem, best.fit, intersample=member.intersample, fs=fleet.fs)


def cover_bends(
    fleet: Fleet,
    group: Group,
    some: NDArray[np.intp],
    outputs: Real,
    *,
    shapes: Real,
    columns: dict[str, Column],
) -> Mask:
    """Let intervals cover a nonlinearity that may be there; return where no more is to be said.

    Of `some` k records of the group, with outputs (k, n), and `shapes`, (m, n), from `shapes_of`.
    What is widened is written to `columns`, which are of all records. False where a nonlinearity
    brings more than chance would, or comes beside one more pole or zero: such a record is for
    `identify`.
    """
    member = group.fit.member
    found = group.residual[some] @ shapes.T / np.sqrt(group.errors.variance[some, None])
    gains = 0.5 * np.maximum(found, 0.0).max(axis=1, initial=0.0) ** 2
    covered = np.ones(some.size, dtype=bool)
    for k in np.flatnonzero(gains > _ASKED).tolist():
        i, j = int(some[k]), int(group.some[some[k]])
        problem, best = alone_of(fleet, member, group.fit.theta[j], outputs[k])
        bent = bends(fleet.u, problem, best.fit, intersample=member.intersample, fs=fleet.fs)
        if not bent:
            continue
        covered[k] = not bent[0].certain and not group.has_tail(i)
        if covered[k]:
            own = parameters_of(group.alone, i)
            wide = spanned(
                own,
                joint_of(problem, best),
                fs=fleet.fs,
                highest=fleet.highest,
                bent=[(one.fit, one.farthest) for one in bent],
            )
            widen(columns, j, own, wide)
    return covered
