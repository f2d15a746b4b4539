"""Which channels of a file go in, come out, were asked for, or are merely kept."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from shlex import quote

from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.readers import ChannelInfo, Contents, listed
from hmpim.record import Finding

__all__ = [
    "INPUT_NAMES",
    "OUTPUT_NAMES",
    "Roles",
    "assumed_roles",
    "choose_roles",
    "find_channel",
]

INPUT_NAMES = ("u", "input", "command", "stimulus", "position")
OUTPUT_NAMES = ("y", "output", "measured", "response")


@dataclass(frozen=True, slots=True, kw_only=True)
class Roles:
    """Names of channels by what they are in the test.

    Parameters
    ----------
    inputs, outputs : tuple of str
        What moves the unit, and what it answers.
    references : tuple of str
        What a loop was asked.
    auxiliary : tuple of str
        What is kept and never fitted unless named.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    references: tuple[str, ...] = ()
    auxiliary: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All of them, in this order."""
        return (*self.inputs, *self.outputs, *self.references, *self.auxiliary)


def choose_roles(
    contents: Contents,
    file: str,
    *,
    inputs: Sequence[str] | None = None,
    outputs: Sequence[str] | None = None,
    references: Sequence[str] | None = None,
    auxiliary: Sequence[str] | None = None,
) -> Roles:
    """Choose the channels of each role: those named, those the file states, those named as usual.

    Parameters
    ----------
    contents : Contents
        What is in the file.
    file : str
        Its name, for messages.
    inputs, outputs, references, auxiliary : sequence of str, optional
        Names as the file has them, in any case.

    Raises
    ------
    FormatError
        If a channel is not there, or the file does not say which channel is which.
    ArgumentError
        If a channel is named twice.
    """
    into = _choose("input", inputs, contents, INPUT_NAMES, OUTPUT_NAMES, file)
    out = _choose("output", outputs, contents, OUTPUT_NAMES, INPUT_NAMES, file, taken=into)
    asked = _named("reference", references, contents, file)
    kept = _named("auxiliary", auxiliary, contents, file)
    # What a person names has that role, whatever the file states.
    named = {*into, *out, *asked, *kept}
    asked = asked or tuple(n for n in _stated(contents, "reference") if n not in named)
    kept = kept or tuple(n for n in _stated(contents, "auxiliary") if n not in named)
    kinds = (
        ("input", into),
        ("output", out),
        ("reference", asked),
        ("auxiliary channel", kept),
    )
    seen: dict[str, str] = {}
    for kind, names in kinds:
        for name in names:
            if name in seen:
                raise ArgumentError(
                    f"column {name!r} is named as {seen[name]} and as {kind}; it can be one"
                )
        seen.update(dict.fromkeys(names, kind))
    return Roles(
        inputs=tuple(into), outputs=tuple(out), references=tuple(asked), auxiliary=tuple(kept)
    )


def assumed_roles(
    roles: Roles,
    contents: Contents,
    *,
    inputs: Sequence[str] | None,
    outputs: Sequence[str] | None,
) -> tuple[Finding, ...]:
    """Say which channels were chosen by their names alone, neither named nor stated by the file.

    Examples
    --------
    >>> names = [ChannelInfo(name=name) for name in ("u", "y")]
    >>> told = Contents(format="text", channels=tuple(names))
    >>> roles = choose_roles(told, "a.csv")
    >>> assumed_roles(roles, told, inputs=None, outputs=["y"])[0].message[:57]
    "'u' is taken as the input, by name. Choose another channe"
    """
    assumed = [
        (names[0], kind)
        for kind, names, wanted in (
            ("input", roles.inputs, inputs),
            ("output", roles.outputs, outputs),
        )
        if not wanted and not _stated(contents, kind)
    ]
    if not assumed:
        return ()
    (first, kind), *rest = assumed
    taken = f"{first!r} is taken as the {kind}"
    taken += "".join(f" and {name!r} as the {kind}" for name, kind in rest)
    options = " or ".join(f"--{kind}" for _, kind in assumed)
    arguments = " or ".join(f"{kind}s=[...]" for _, kind in assumed)
    message = f"{taken}, by name. Choose another channel with {options} (in Python: {arguments})."
    return (Finding(code="assumed_roles", message=message, severity="info", parameters=()),)


def find_channel(wanted: str, contents: Contents) -> ChannelInfo | None:
    """Return the channel called `wanted`, with or without its unit, else in any case; or None.

    Examples
    --------
    >>> contents = Contents(format="text", channels=(ChannelInfo(name="Gyro", unit="deg/s"),))
    >>> find_channel("gyro", contents).name, find_channel("Gyro [deg/s]", contents).name
    ('Gyro', 'Gyro')
    >>> find_channel("acc", contents) is None
    True
    """
    headings = {
        c.name: (c.name, f"{c.name} [{c.unit}]", f"{c.name} ({c.unit})") for c in contents.channels
    }
    found = [c for c in contents.channels if wanted in headings[c.name]]
    if not found:
        # Columns without names are called by their number.
        called = (wanted.casefold(), f"column {wanted}")
        found = [c for c in contents.channels if c.name.casefold() in called]
    return found[0] if len(found) == 1 else None


def _stated(contents: Contents, kind: str) -> tuple[str, ...]:
    by_kind = {
        "input": contents.inputs,
        "output": contents.outputs,
        "reference": contents.references,
        "auxiliary": contents.auxiliary,
    }
    return by_kind[kind]


def _listed(contents: Contents) -> str:
    return listed([c.name for c in contents.channels])


def _named(
    kind: str, wanted: Sequence[str] | None, contents: Contents, file: str
) -> tuple[str, ...]:
    if isinstance(wanted, str):
        wanted = [wanted]
    chosen: list[str] = []
    for name in wanted or ():
        found = find_channel(name, contents)
        if found is None:
            _refuse_twins(name, contents, file)
            raise FormatError(
                f"{file!r} has no column {name!r}; its columns are {_listed(contents)}"
            )
        if found.name in chosen:
            raise ArgumentError(f"{kind} {name!r} is named twice; name it once")
        chosen.append(found.name)
    return tuple(chosen)


def _refuse_twins(wanted: str, contents: Contents, file: str) -> None:
    """Say so if several columns share a name, which readers then tell apart by their place."""
    start = f"{wanted} (column ".casefold()
    twins = [c.name for c in contents.channels if c.name.casefold().startswith(start)]
    if twins:
        raise FormatError(
            f"{file!r} has {_COUNTS.get(len(twins), len(twins))} columns {wanted!r}; "
            f"say which: {', '.join(repr(name) for name in twins)}"
        )


_OF_A_STIMULUS = {"position", "velocity", "acceleration"}
_COUNTS = {2: "two", 3: "three"}


def _choose(
    kind: str,
    wanted: Sequence[str] | None,
    contents: Contents,
    known: tuple[str, ...],
    others: tuple[str, ...],
    file: str,
    taken: tuple[str, ...] = (),
) -> tuple[str, ...]:
    """The channels of one kind: those asked for, those stated, or the one with a usual name."""
    chosen = _named(kind, wanted, contents, file) or _stated(contents, kind)
    if chosen:
        return chosen
    names = [c.name for c in contents.channels]
    usual = [name for name in names if name.casefold() in known]
    if not usual:
        for name in known:
            _refuse_twins(name, contents, file)
    if len(usual) == 1:
        return tuple(usual)
    if usual:
        raise FormatError(
            f"{file!r} has {len(usual)} columns that may be the {kind} "
            f"({', '.join(usual)}); say which with {kind}s=[...] or --{kind}"
        )
    if {re.split("[./]", name)[-1] for name in names} == _OF_A_STIMULUS:
        raise FormatError(
            f"{file!r} holds position, velocity and acceleration, as a stimulus does, and no "
            f"{kind} is named; play it with hmpim run and identify the record, or name --{kind}"
        )
    left = [name for name in names if name not in taken]
    if not left:
        raise FormatError(
            f"{file!r} has no column for the {kind}; its columns are {_listed(contents)}, and an "
            "input and an output are needed"
        )
    example = next((name for name in left if name.casefold() not in others), left[0])
    raise FormatError(
        f"{file!r} does not say which column is the {kind}; its columns are {_listed(contents)}: "
        f"name it with {kind}s=[{example!r}] or --{kind} {quote(example)}"
    )
