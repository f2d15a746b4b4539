"""A plan expanded into cases, each with its stimuli; refused before anything moves."""

from dataclasses import replace
from itertools import product

from hmpim.campaign.case import Case
from hmpim.campaign.plan import Plan
from hmpim.campaign.rig import CampaignRig
from hmpim.errors import ArgumentError, HmpimError
from hmpim.stimulus import Limits, Stimulus, design

__all__ = ["check_wanted", "expand", "prepare", "scaled"]


def expand(plan: Plan) -> tuple[Case, ...]:
    """Return every case of a plan, in the order in which they are run.

    Examples
    --------
    >>> from hmpim.campaign.plan import read_plan
    >>> from hmpim.campaign.shipped import shipped_plan
    >>> [case.id for case in expand(read_plan(shipped_plan("example")))][0]
    'rates.acceptance.P.250Hz.0.5.inner'
    """
    cases = []
    for test in plan.tests:
        moved = (test.axes,) if test.together else tuple((axis,) for axis in test.axes)
        for load, mode, rate, level, axes in product(
            test.loads, test.modes, test.rates, test.levels, moved
        ):
            cases.append(
                Case(
                    test=test.name,
                    axes=axes,
                    mode=mode,
                    rate=rate,
                    level=level,
                    load=load,
                    together=test.together,
                    levels_of=test.levels_of,
                )
            )
    return tuple(cases)


def check_wanted(plan: Plan, cases: tuple[Case, ...]) -> None:
    """Refuse a specification that fits no case, before any of them is run.

    Raises
    ------
    ArgumentError
        If there is one; names it by its place in the plan.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from hmpim.campaign.plan import read_plan
    >>> from hmpim.campaign.shipped import shipped_plan
    >>> plan = read_plan(shipped_plan("example"))
    >>> wanted = replace(plan.specifications[0], mode="PVA")
    >>> plan = replace(plan, specifications=(wanted,))
    >>> check_wanted(plan, expand(plan))
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: specification[1] fits no case of the plan; change or drop it
    """
    for number, wanted in enumerate(plan.specifications, start=1):
        if not any(
            wanted.test in (None, case.test)
            and (wanted.axis is None or wanted.axis in case.axes)
            and wanted.mode in (None, case.mode)
            and wanted.load in (None, case.load)
            and wanted.rate in (None, case.rate)
            for case in cases
        ):
            raise ArgumentError(
                f"specification[{number}] fits no case of the plan; change or drop it"
            )


def prepare(plan: Plan, case: Case, rig: CampaignRig) -> tuple[Stimulus, ...]:
    """Design the stimuli of a case inside their limits, and have the rig check them.

    Several axes at once get stimuli that one record can tell apart, in all as long as the
    plan's duration; one axis alone gets the paper's sweep of that duration, leads on top.

    Raises
    ------
    HmpimError
        If limits, band and duration cannot all be met, or the rig refuses; names the case.
    """
    from hmpim.stimulus.axes import AxisPlan, design_axes

    try:
        wishes = [plan.axis(name, test=case.test) for name in case.axes]
        limits = [scaled(rig.limits(case, wish), case.level, case.levels_of) for wish in wishes]
        if case.together:
            stimuli = design_axes(
                [
                    AxisPlan(axis=wish.name, limits=bound, band=wish.band)
                    for wish, bound in zip(wishes, limits, strict=True)
                ],
                duration=plan.duration,
                fs=case.rate,
            )
        else:
            stimuli = tuple(
                design(
                    band=wish.band,
                    duration=plan.duration,
                    fs=case.rate,
                    limits=bound,
                    axis=wish.name,
                )
                for wish, bound in zip(wishes, limits, strict=True)
            )
        rig.check(case, stimuli)
    except HmpimError as error:
        raise type(error)(f"case {case.id}: {error}") from error
    return stimuli


def scaled(
    limits: Limits, level: float, quantities: tuple[str, ...] = ("velocity", "acceleration")
) -> Limits:
    """Limits with a share of some of them.

    Examples
    --------
    >>> scaled(Limits(position=5.0, velocity=8.0), 0.5).velocity
    4.0
    """
    velocity = level if "velocity" in quantities else 1.0
    acceleration = level if "acceleration" in quantities else 1.0
    return replace(
        limits,
        velocity=velocity * limits.velocity,
        acceleration=acceleration * limits.acceleration,
    )
