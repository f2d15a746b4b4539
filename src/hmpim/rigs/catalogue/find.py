"""Find the rig that the command line names: by name, kind or address."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hmpim.errors import ArgumentError, FormatError, RigError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.catalogue.kinds import KINDS, load_builder, offered_kinds
from hmpim.rigs.catalogue.named import named_rigs
from hmpim.rigs.protocol import LimitsOfAxes, Rig
from hmpim.stimulus import Stimulus
from hmpim.units import conversion_factor

__all__ = ["FoundRig", "check_described", "check_rig", "find_rig"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FoundRig:
    """A rig, and what its description says beside.

    Parameters
    ----------
    rig : Rig
        Not connected yet.
    description : Description
        As read.
    """

    rig: Rig
    description: Description

    @property
    def limits(self) -> LimitsOfAxes:
        """Limits that the description states, in addition to the rig's own."""
        return self.description.stated_limits()


def find_rig(
    text: str, *, description: Description | None = None, start: Path | None = None
) -> FoundRig:
    """Make the rig that is meant.

    Parameters
    ----------
    text : str
        A name from ``hmpim.toml``, a kind ('sensor', 'table'), or a kind with what it needs
        ('udp://127.0.0.1:5005'); empty if the description says it.
    description : Description or None
        From a rig file.
    start : Path or None
        Folder from which ``hmpim.toml`` is looked for; None for the current one.

    Raises
    ------
    RigError
        If there is no such rig; the message lists those there are.
    FormatError
        If a description is wrong or contradicts what is asked for.

    Examples
    --------
    >>> from hmpim.rigs.catalogue import describe
    >>> find_rig("sensor", description=describe({"options": {"delay": 0.1}})).rig.delay
    0.1
    >>> find_rig("warp drive")
    Traceback (most recent call last):
    hmpim.errors.RigError: there is no rig 'warp drive'; there are ...
    """
    if description is None:
        named = named_rigs(start).get(text)
        if named is not None and named.description is None:
            raise FormatError(named.fault)
        described = Description() if named is None else named.description
        assert described is not None
        if named is not None:
            text = described.rig
    else:
        described = description
        if text and described.rig and text != described.rig:
            raise FormatError(
                f"the rig file describes {described.rig!r}, but the command names {text!r}; "
                "leave one of them out"
            )
        text = text or described.rig
    if not text:
        raise RigError('no rig is named; give --rig, or rig = "..." in the rig file')
    kind, argument = _parted(text)
    builder = load_builder(kind)
    if builder is None:
        raise _unknown(text, start)
    return FoundRig(rig=builder(argument, described), description=described)


def check_described(stimuli: Sequence[Stimulus], found: FoundRig) -> None:
    """Refuse stimuli of another rate, axis or unit than a rig's description states.

    Parameters
    ----------
    stimuli : sequence of Stimulus
        What is to be played.
    found : FoundRig
        The rig. One that moves, or has axes, is commanded in units of its own, and what is
        comparable is converted; software is fed the samples as they are.

    Raises
    ------
    ArgumentError
        If one of the three differs; the message says both.
    UnitError
        If the units cannot be compared.

    Examples
    --------
    >>> from hmpim.rigs.catalogue import describe
    >>> from hmpim.stimulus import Ramp
    >>> found = find_rig("sensor", description=describe({"unit": "rad"}))
    >>> check_described([Stimulus(waveform=Ramp(duration=1.0), fs=10.0, unit="deg")], found)
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: the stimulus is in 'deg', and the rig's description states ...
    """
    stated, rig = found.description, found.rig
    converts = getattr(rig, "moves", True) or bool(rig.axes)
    correct = "or correct the description"
    for one in stimuli:
        if stated.rate is not None and one.fs != stated.rate:
            raise ArgumentError(
                f"the stimulus has {one.fs:g} Hz, and the rig's description states rate = "
                f"{stated.rate:g} Hz; design the stimulus at this rate, {correct}"
            )
        if stated.axes and one.axis not in stated.axes:
            names = f"is for axis {one.axis!r}" if one.axis else "names no axis"
            raise ArgumentError(
                f"the stimulus {names}, and the rig's description states axes "
                f"{', '.join(stated.axes)}; name one of them (--axis, or Stimulus.axis), {correct}"
            )
        if not stated.unit:
            continue
        alike = one.unit != "" and conversion_factor(one.unit, to=stated.unit) == 1.0
        if not alike and not (converts and one.unit):
            has = f"in {one.unit!r}" if one.unit else "in no unit"
            raise ArgumentError(
                f"the stimulus is {has}, and the rig's description states unit = "
                f"{stated.unit!r}; design the stimulus in this unit, {correct}"
            )


def check_rig(text: str, *, start: Path | None = None) -> None:
    """Refuse the name of a rig that is not there; nothing is built.

    Parameters
    ----------
    text, start
        As `find_rig` takes them.

    Raises
    ------
    RigError
        If there is no such rig; the message lists those there are.
    """
    if text not in named_rigs(start) and load_builder(_parted(text)[0]) is None:
        raise _unknown(text, start)


def _unknown(text: str, start: Path | None) -> RigError:
    return RigError(f"there is no rig {text!r}; there are {', '.join(_known(start))}")


def _parted(text: str) -> tuple[str, str]:
    """Kind, and what stands behind ``:`` or ``://``."""
    parts = re.fullmatch(r"([^:]*)(?::(?://)?(.*))?", text, flags=re.DOTALL)
    assert parts is not None  # anything matches
    return parts[1], parts[2] or ""


def _known(start: Path | None) -> list[str]:
    offered = [kind.name for kind in offered_kinds() if not kind.fault]
    return [*named_rigs(start), *(kind.form for kind in KINDS), *offered]
