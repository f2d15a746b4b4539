"""What is looked at before a rig is armed: limits stated, and every stimulus inside them."""

import math
from collections.abc import Mapping

import numpy as np

from hmpim.arguments import shown
from hmpim.errors import ArgumentError, LimitsError, RigError, UnitError
from hmpim.experiment.log import RunLog
from hmpim.rigs import LimitsOfAxes, Rig
from hmpim.rigs.brake import check_stoppable
from hmpim.stimulus import Limits, Stimulus, check_inside
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import rate_unit

__all__ = [
    "check_rig",
    "check_stimuli",
    "check_watched",
    "follows_commands",
    "limits_by_axis",
    "moves",
]


def check_rig(rig: object) -> Rig:
    """Return `rig` if it is one.

    Raises
    ------
    ArgumentError
        If not; the message says what it lacks.

    Examples
    --------
    >>> check_rig(abs)
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: <built-in function abs> is not a rig: it has no name, ...
    """
    if isinstance(rig, Rig) and not isinstance(rig, type):
        return rig
    wanted = ("name", "axes", "limits", "prepare", "play", "stop", "__enter__", "__exit__")
    missing = [name for name in wanted if not hasattr(rig, name)]
    raise ArgumentError(
        f"{shown(rig)} is not a rig: it has no {', '.join(missing) or 'instance'}; see "
        "hmpim.rigs.Rig, and make a plain function one with FunctionRig(function=...)"
    )


def moves(rig: Rig) -> bool:
    """Whether something real may move; True unless the rig says that it is software.

    Examples
    --------
    >>> from hmpim.rigs import Sensor
    >>> moves(Sensor())
    False
    """
    return bool(getattr(rig, "moves", True))


def follows_commands(rig: Rig) -> bool:
    """Whether a rig plays what each block says, and not what it was prepared for.

    What moves does. A simulation computes its answer to the whole stimulus beforehand, unless it
    says `follows_commands = True`.

    Examples
    --------
    >>> from hmpim.rigs import MotionTable, Sensor
    >>> follows_commands(MotionTable()), follows_commands(Sensor())
    (True, False)
    """
    return bool(getattr(rig, "follows_commands", moves(rig)))


def check_watched(rig: Rig, *, needed: bool, log: RunLog) -> None:
    """Refuse, or note, a rig that nothing stops if this process is killed.

    Raises
    ------
    RigError
        If a watchdog is needed, and the rig moves and states none.
    """
    if not moves(rig) or getattr(rig, "watchdog", None) is not None:
        return
    what = f"{rig.name!r} has no watchdog: if this process is killed, nothing stops it"
    if needed:
        raise RigError(
            f"{what}; give its far end one and state it (watchdog = 0.1), or use --no-watchdog: a "
            "separate process then drives it, and stops it if this one is killed"
        )
    log.add("note", what)


def limits_by_axis(
    rig: Rig, stimuli: Mapping[str, Stimulus], *, stated: LimitsOfAxes = None
) -> dict[str, Limits | None]:
    """Limits of each axis that is to move; None where nothing bounds it.

    Parameters
    ----------
    rig : Rig
        With limits of its own.
    stimuli : mapping of axis to Stimulus
        What is to move.
    stated : Limits, or mapping of axis to Limits, or None
        To be kept too.

    Raises
    ------
    LimitsError
        If something moves and its limits are not stated, or limits are stated for an axis that is
        not there.
    UnitError
        If the limits stated are in no unit, and the rig's own are in one, or their dimensions
        differ.

    Examples
    --------
    >>> from hmpim.rigs import Sensor
    >>> from hmpim.stimulus import Ramp
    >>> limits_by_axis(Sensor(), {"": Stimulus(waveform=Ramp(duration=1.0), fs=10.0)})
    {'': None}
    """
    found: dict[str, Limits | None] = {}
    _check_named(rig, stimuli, stated)
    for axis in stimuli:
        whose = f"{rig.name!r}, axis {axis!r}" if axis else repr(rig.name)
        limits = _tighter(_of_axis(rig.limits, axis), _of_axis(stated, axis), whose=whose)
        if limits is None and moves(rig):
            about = f"axis {axis!r} of " if axis else ""
            raise LimitsError(
                f"{about}rig {rig.name!r} moves and states no limits; state position, velocity "
                "and acceleration, or, for software, moves = False (unlimited = true in a file)"
            )
        free = limits is None or all(math.isinf(getattr(limits, name)) for name in QUANTITIES)
        found[axis] = None if free else limits
    return found


def _check_named(rig: Rig, stimuli: Mapping[str, Stimulus], stated: LimitsOfAxes) -> None:
    """Refuse limits of an axis that is not there, which would bound nothing."""
    if not isinstance(stated, Mapping):
        return
    has = tuple(rig.axes)
    strange = [axis for axis in stated if axis not in has] if has else []
    if strange:
        raise LimitsError(
            f"limits are stated for axis {strange[0]!r}, and rig {rig.name!r} has "
            f"{', '.join(has)}; correct the name"
        )
    missed = [axis for axis in stimuli if axis not in stated] if not has else []
    if missed:
        whose = f"is for axis {missed[0]!r}" if missed[0] else "names no axis"
        raise LimitsError(
            f"limits are stated for {', '.join(stated)}, and the stimulus {whose}; name its axis, "
            "or state limits without an axis"
        )


def _of_axis(limits: LimitsOfAxes, axis: str) -> Limits | None:
    return limits.get(axis) if isinstance(limits, Mapping) else limits


def _tighter(own: Limits | None, stated: Limits | None, *, whose: str) -> Limits | None:
    """Return the smaller of two limits in each quantity, in the unit of the first."""
    if own is None or stated is None:
        return stated if own is None else own
    if all(math.isinf(getattr(stated, name)) for name in QUANTITIES):
        return own
    try:
        there = stated.to(own.unit)
    except UnitError as error:
        raise UnitError(f"the limits stated for {whose}: {error}") from None
    return Limits(
        position=min(there.position, own.position),
        velocity=min(there.velocity, own.velocity),
        acceleration=min(there.acceleration, own.acceleration),
        jerk=min(there.jerk, own.jerk),
        unit=own.unit,
    )


def check_stimuli(
    stimuli: Mapping[str, Stimulus], limits: Mapping[str, Limits | None], *, rig: Rig, log: RunLog
) -> None:
    """Refuse a stimulus beyond a limit, and say in the log what was looked at.

    Raises
    ------
    LimitsError
        If a true peak, between samples too, is beyond a limit, or some instant leaves no smooth
        stop inside the limits.
    UnitError
        If the units of stimulus and limits cannot be compared.
    """
    samples = max(stimulus.samples for stimulus in stimuli.values())
    for axis, stimulus in stimuli.items():
        whose = axis if axis and len(rig.axes) > 1 else repr(rig.name)
        bounds = limits[axis]
        if bounds is None:
            log.add("check", f"{whose}: no limits")
            continue
        check_inside(stimulus, bounds, whose=whose, samples=samples, from_rest=moves(rig))
        there = bounds.to(stimulus.unit)
        motion = stimulus.motion(np.arange(samples) / stimulus.fs)
        reach = check_stoppable(motion.time, motion.position, motion.velocity, there, whose=whose)
        log.add(
            "check",
            f"{whose}: "
            + ", ".join(
                f"{name} {getattr(stimulus.peaks, name):.6g} of {getattr(there, name):.6g} "
                f"{rate_unit(stimulus.unit, order)}".rstrip()
                for order, name in enumerate(QUANTITIES)
                if math.isfinite(getattr(there, name))
            )
            + (f"; braking reaches {reach:.6g}" if math.isfinite(there.position) else ""),
        )
