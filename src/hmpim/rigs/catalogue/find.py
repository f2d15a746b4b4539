"""From what stands on the command line to a rig: a name, a kind, or an address."""

import re
from dataclasses import dataclass
from pathlib import Path

from hmpim.errors import FormatError, RigError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.catalogue.kinds import KINDS, load_builder, offered_kinds
from hmpim.rigs.catalogue.named import named_rigs
from hmpim.rigs.protocol import LimitsOfAxes, Rig

__all__ = ["FoundRig", "check_rig", "find_rig"]


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
        """Limits that the description states; to be kept beside the rig's own."""
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
                f"the rig file is about {described.rig!r}, and {text!r} is asked for; "
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
