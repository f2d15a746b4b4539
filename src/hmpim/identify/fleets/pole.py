"""One more pole or zero for single records of a fleet, most of which need it by chance.

The record itself is fitted, starting from the common fit, with poles added as in
`hmpim.identify.fitting.joint`, and its intervals are widened as for any record.
"""

from dataclasses import replace

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.fit import fit_structure
from hmpim.identify.fitting.growth import grow
from hmpim.identify.fitting.rows import Problem
from hmpim.identify.fitting.trial import JointFit, trial_of
from hmpim.identify.fleets.learnt import Fleet, Member, theta_at
from hmpim.identify.reading.spanned import spanned
from hmpim.identify.result import Parameters
from hmpim.identify.signals import longest_lag
from hmpim.model.dynamics import STRUCTURES

__all__ = ["alone_of", "with_tails"]


def with_tails(
    fleet: Fleet, member: Member, place: Real, y: Real, own: Parameters
) -> tuple[Parameters, float | None] | None:
    """Fit one more pole to a record, (n,); None if the likelihood pays for it.

    `place`, (3,), is the record's point on the member's surface, and `own` are the parameters
    without the pole. Returned are parameters with intervals that cover one more pole or zero where
    the record supports it by more than chance; and the delay, in s, with a pole that is as likely
    except for its price.
    """
    joint = alone_of(fleet, member, place, y)
    growth = grow(joint.problem, joint.best.fit, count=float(y.size), names=tuple(STRUCTURES))
    if growth.grown:
        return None
    rivals = tuple(trial_of(member.intersample, fit, y.size) for fit in growth.rivals)
    joint = replace(joint, rivals=rivals, hidden=growth.hidden)
    delay = rivals[0].fit.delay / fleet.fs if rivals else None
    return spanned(own, joint, fs=fleet.fs, highest=fleet.highest), delay


def alone_of(fleet: Fleet, member: Member, place: Real, y: Real) -> JointFit:
    """Fit one record by itself, starting from the common fit, without rivals."""
    longest = longest_lag(y.size) + 2.0  # as for every record
    problem = Problem(source=member.source, y=y, valid=None, longest_delay=longest)
    fit = fit_structure(problem, fleet.structure, theta_at(place))
    best = trial_of(member.intersample, fit, y.size)
    return JointFit(
        problem=problem,
        weighed=problem,
        best=best,
        trials=(best,),
        forgotten=0,
        effective_share=1.0,
        related=True,
    )
