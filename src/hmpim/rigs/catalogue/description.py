"""A rig described in a file: address, rate, axes, units, limits, watchdog, load.

The same keys are used in a separate file (``--rig-file``) and under ``[rigs.NAME]`` in
``hmpim.toml``; an unknown key is refused by name.
"""

import math
import tomllib
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from hmpim.errors import FormatError
from hmpim.stimulus import Limits
from hmpim.units import check_unit

__all__ = ["Description", "StatedLimits", "describe", "read_description"]

_Positive = Annotated[float, Field(gt=0)]


class StatedLimits(BaseModel):
    """Limits of an axis as a file states them; what is left out is not limited."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    position: _Positive = math.inf
    velocity: _Positive = math.inf
    acceleration: _Positive = math.inf
    jerk: _Positive = math.inf
    unit: str | None = None

    def limits(self, unit: str) -> Limits:
        """Return them as `Limits`, in their own unit or else in `unit`."""
        return Limits(
            position=self.position,
            velocity=self.velocity,
            acceleration=self.acceleration,
            jerk=self.jerk,
            unit=unit if self.unit is None else self.unit,
        )


class Description(BaseModel):
    """What a file says about a rig.

    Parameters
    ----------
    rig : str
        What it is and where: 'table', 'udp://127.0.0.1:5005', 'serial:/dev/ttyUSB0', and so on.
    rate : float or None
        Commands a second that it takes, Hz.
    axes : tuple of str
        Names of its axes.
    unit : str
        Of positions and limits that state none.
    limits : mapping of str to StatedLimits
        Of each axis; of all alike under the empty name, which a file leaves out.
    unlimited : bool
        True for software: nothing moves, and no limits are needed.
    watchdog : float or None
        Seconds of silence after which the far end brakes by itself; None if it does not.
    load : str
        What it carries, for rigs that care.
    options : mapping
        Whatever else this kind of rig takes.

    Examples
    --------
    >>> described = describe({"rig": "sensor", "unlimited": True, "options": {"delay": 0.1}})
    >>> described.rig, described.options
    ('sensor', {'delay': 0.1})
    """

    model_config = ConfigDict(extra="forbid", frozen=True)

    rig: str = ""
    rate: _Positive | None = None
    axes: tuple[str, ...] = ()
    unit: str = ""
    limits: dict[str, StatedLimits] | None = None
    unlimited: bool = False
    watchdog: _Positive | None = None
    load: str = ""
    mode: Literal["P", "PV", "PVA"] | None = None
    options: dict[str, Any] = Field(default_factory=dict)

    @model_validator(mode="before")
    @classmethod
    def _one_or_several(cls, data: Any) -> Any:
        """Tell limits of all axes alike from those of each: the values are tables then."""
        if isinstance(data, dict) and isinstance(data.get("limits"), dict):
            stated = data["limits"]
            several = bool(stated) and all(isinstance(value, dict) for value in stated.values())
            return {**data, "limits": stated if several else {"": stated}}
        return data

    @model_validator(mode="after")
    def _consistent(self) -> "Description":
        check_unit(self.unit)
        twice = sorted({axis for axis in self.axes if self.axes.count(axis) > 1})
        if twice or "" in self.axes:
            fault = f"{twice[0]!r} is there twice" if twice else "one has no name"
            raise ValueError(f"axes {self.axes}: {fault}; give each its own name")
        if self.unlimited and self.limits is not None:
            raise ValueError("unlimited = true and limits contradict each other; state one")
        if self.limits is not None and self.axes:
            strange = sorted(set(self.limits) - {"", *self.axes})
            if strange:
                raise ValueError(f"limits of {strange[0]!r}, which is none of axes {self.axes}")
        return self

    def stated_limits(self) -> Limits | dict[str, Limits] | None:
        """Limits as rigs take them; all infinite for software, None where none are stated."""
        if self.unlimited:
            return Limits(unit=self.unit)
        if self.limits is None:
            return None
        if "" in self.limits:
            return self.limits[""].limits(self.unit)
        return {axis: stated.limits(self.unit) for axis, stated in self.limits.items()}


def describe(data: Any, *, where: str = "the description") -> Description:
    """Check what a file says about a rig.

    Parameters
    ----------
    data : mapping
        As read from TOML.
    where : str
        Where it stands, for messages.

    Raises
    ------
    FormatError
        If a key is not known or a value is of the wrong kind; the message names the first.

    Examples
    --------
    >>> describe({"rig": "table", "rte": 100})
    Traceback (most recent call last):
    hmpim.errors.FormatError: the description: 'rte' is not known; known are axes, limits, ...
    """
    try:
        return Description.model_validate(data)
    except ValidationError as error:
        raise FormatError(f"{where}: {_first(error)}") from None


def _first(error: ValidationError) -> str:
    """Say what is wrong first, in one line."""
    wrong = error.errors()[0]
    place = ".".join(str(part) for part in wrong["loc"] if part != "")
    if wrong["type"] == "extra_forbidden":
        model = Description if "." not in place else StatedLimits
        known = ", ".join(sorted(model.model_fields))
        return f"{place!r} is not known; known are {known}"
    message = wrong["msg"].removeprefix("Value error, ").replace("valid tuple", "list [...]")
    if not place:
        return message
    return f"{place} = {wrong['input']!r}: {message[0].lower()}{message[1:]}"


def read_description(path: str | PathLike[str]) -> Description:
    """Read a rig file.

    Raises
    ------
    FormatError
        If it cannot be read, is no TOML, or says something that is not known.

    Examples
    --------
    >>> read_description("nowhere.toml")
    Traceback (most recent call last):
    hmpim.errors.FormatError: 'nowhere.toml' cannot be read: ...
    """
    return describe(read_toml(path), where=repr(str(path)))


def read_toml(path: str | PathLike[str]) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    FormatError
        If it cannot be read or is no TOML.
    """
    try:
        return tomllib.loads(Path(path).read_bytes().decode())
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{str(path)!r} cannot be read: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"{str(path)!r} is not valid TOML: {error}") from error
