"""Builders of the simulated rigs: a description's options become a rig's."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from hmpim.errors import FormatError
from hmpim.rigs.catalogue.description import Description
from hmpim.rigs.sensor import Sensor
from hmpim.rigs.table import AXES, MotionTable, TablePosition, both_loads

__all__ = ["build_sensor", "build_table", "made_of", "take_options"]

T = TypeVar("T")


def build_sensor(argument: str, description: Description) -> Sensor:
    """Make a `Sensor`; its parameters are the description's options.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_sensor("", describe({"options": {"delay": 0.1}})).delay
    0.1
    """
    _nothing_behind("sensor", argument)
    known = _fields(Sensor) - {"limits"}
    options = take_options(description, known, kind="sensor", instead={"limits": "limits"})
    return made_of(Sensor, options, kind_name="sensor")


def build_table(argument: str, description: Description) -> MotionTable:
    """Make a `MotionTable`; `load` and `mode` are the description's, the rest its options.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> build_table("", describe({"load": "bracket", "mode": "PV"})).uut_load
    'bracket'
    """
    _nothing_behind("table", argument)
    own = {"load": "load", "uut_load": "load", "target_load": "load", "mode": "mode"}
    known = _fields(MotionTable) - {"specs", "base", *own}
    options = take_options(description, known, kind="table", instead=own, loaded=True)
    if "start" in options:
        options["start"] = _start(options["start"])
    if description.load:
        options["uut_load"], options["target_load"] = both_loads(description.load)
    if description.mode is not None:
        options["mode"] = description.mode
    for axis in description.axes:
        if axis not in AXES:
            raise FormatError(f"axis {axis!r} is none of the table's; it has {', '.join(AXES)}")
    if description.unlimited:
        raise FormatError("unlimited = true: the table has limits, those of Fig. 4; leave it out")
    return made_of(MotionTable, options, kind_name="table")


def made_of(kind: Callable[..., T], options: Mapping[str, Any], *, kind_name: str) -> T:
    """Make a rig of options, and say as a fault of the file what is of the wrong type.

    Raises
    ------
    FormatError
        If a value is of a type that the rig cannot take.

    Examples
    --------
    >>> made_of(Sensor, {"delay": 0.1}, kind_name="sensor").delay
    0.1
    """
    try:
        return kind(**options)
    except TypeError as error:
        raise FormatError(f"options {dict(options)!r} make no {kind_name}: {error}") from error


def take_options(
    description: Description,
    known: set[str],
    *,
    kind: str,
    instead: Mapping[str, str] | None = None,
    loaded: bool = False,
) -> dict[str, Any]:
    """Return a description's options, refusing those that this kind does not take.

    Parameters
    ----------
    description : Description
        What the file says.
    known : set of str
        Options there are.
    kind : str
        For the message.
    instead : mapping of str to str, optional
        Options that stand elsewhere in the description, and the key they have there.
    loaded : bool
        Whether the description's `load` and `mode` mean something to this kind.

    Raises
    ------
    FormatError
        If an option is not known, or a load or mode is stated that means nothing.

    Examples
    --------
    >>> from hmpim.rigs.catalogue.description import describe
    >>> take_options(describe({"options": {"dealy": 1}}), {"delay"}, kind="sensor")
    Traceback (most recent call last):
    hmpim.errors.FormatError: option 'dealy' is not known for a sensor; known are delay
    """
    for name, value in (("load", description.load), ("mode", description.mode)):
        if value and not loaded:
            raise FormatError(f"{name} = {value!r} does not apply to a {kind}; leave it out")
    for name in description.options:
        if instead and name in instead:
            raise FormatError(
                f"option {name!r} of a {kind} belongs outside the options, as {instead[name]!r}"
            )
        if name not in known:
            raise FormatError(
                f"option {name!r} is not known for a {kind}; known are {', '.join(sorted(known))}"
            )
    return dict(description.options)


def _fields(kind: type[Any]) -> set[str]:
    return {field.name for field in dataclasses.fields(kind) if field.init}


def _start(given: Any) -> TablePosition:
    if not isinstance(given, Mapping) or not set(given) <= set(AXES):
        raise FormatError(
            f"option 'start' = {given!r} must be a table of angles in deg, such as "
            "start = {yaw = 20.0}"
        )
    try:
        return TablePosition(**{axis: float(angle) for axis, angle in given.items()})
    except (TypeError, ValueError) as error:
        raise FormatError(f"option 'start' = {given!r} holds no angles: {error}") from None


def _nothing_behind(kind: str, argument: str) -> None:
    if argument:
        raise FormatError(f"{kind}:{argument}: a {kind} takes no argument; write {kind}")
