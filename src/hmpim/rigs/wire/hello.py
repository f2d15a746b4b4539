"""What the two ends tell each other before anything moves, and whether they agree.

HELLO and WELCOME carry the same JSON object. The far end states all of it; the near end states
what it expects, and may leave out what it does not care about::

    {"protocol": "hmpim/wire/1", "name": "table", "axes": ["roll", "yaw"], "units": ["deg", "deg"],
     "rate": 1000.0, "watchdog": 0.08, "intersample": "zoh", "source": "...",
     "limits": {"roll": {"position": 110.0, "velocity": 800.0, "unit": "deg"}, ...}}

A limit that is not there does not bind. ``watchdog`` is the silence in s after which the far end
brakes by itself, null if it does not.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, cast, get_args

from hmpim.errors import HmpimError, RigError, UnitError
from hmpim.record import Intersample
from hmpim.stimulus import Limits
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import check_unit

__all__ = ["PROTOCOL", "Hello", "check_agreement"]

PROTOCOL = "hmpim/wire/1"
_SAME = 1e-6  # relative: numbers that went through JSON and a unit are the same up to rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Hello:
    """What an end states.

    Parameters
    ----------
    name : str
        Of the rig.
    axes, units : tuple of str
        Axes in the order of the datagrams, and the units of their positions; empty: not stated.
    rate : float or None
        Commands and responses a second, Hz; None: not stated.
    limits : mapping of axis to Limits
        Of each axis, in its unit.
    watchdog : float or None
        Silence in s after which the far end brakes.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the position in force does between samples.
    source : str
        What it is, for people.

    Examples
    --------
    >>> limits = {"roll": Limits(position=5.0, unit="deg")}
    >>> said = Hello(name="t", axes=("roll",), units=("deg",), rate=500.0, limits=limits)
    >>> Hello.from_json(said.to_json()) == said
    True
    """

    name: str = ""
    axes: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    rate: float | None = None
    limits: Mapping[str, Limits] = field(default_factory=dict)
    watchdog: float | None = None
    intersample: Intersample | None = None
    source: str = ""

    def to_json(self) -> str:
        """Return it as the text of a datagram."""
        limits = {
            axis: {
                name: getattr(bound, name)
                for name in QUANTITIES
                if math.isfinite(getattr(bound, name))
            }
            | {"unit": bound.unit}
            for axis, bound in self.limits.items()
        }
        data = {
            "protocol": PROTOCOL,
            "name": self.name,
            "axes": list(self.axes),
            "units": list(self.units),
            "rate": self.rate,
            "watchdog": self.watchdog,
            "intersample": self.intersample,
            "source": self.source,
            "limits": limits,
        }
        return json.dumps(data, allow_nan=False)

    @classmethod
    def from_json(cls, text: str) -> "Hello":
        """Read the text of a datagram.

        Raises
        ------
        RigError
            If it is no such object.
        """
        try:
            data: dict[str, Any] = json.loads(text)
            if data["protocol"] != PROTOCOL:
                raise RigError(
                    f"the other end speaks {data['protocol']!r}, this one {PROTOCOL!r}; "
                    "update the older one"
                )
            axes, units = tuple(data["axes"]), tuple(data["units"])
            if not all(isinstance(axis, str) and axis for axis in axes):
                raise RigError(f"the hello names axes {axes!r}; give each a name")
            if units and len(units) != len(axes):
                raise RigError(f"the hello states {len(axes)} axes and {len(units)} units")
            for unit in units:
                check_unit(unit)
            between = data.get("intersample")
            if between not in (None, *get_args(Intersample)):
                raise RigError(f"intersample = {between!r} is not known")
            return cls(
                name=str(data["name"]),
                axes=axes,
                units=units,
                rate=_number(data.get("rate")),
                limits={axis: Limits(**bounds) for axis, bounds in data.get("limits", {}).items()},
                watchdog=_number(data.get("watchdog")),
                intersample=cast("Intersample | None", between),
                source=str(data.get("source", "")),
            )
        except RigError:
            raise
        except (ValueError, KeyError, TypeError, AttributeError, HmpimError) as error:
            raise RigError(
                f"the hello of the other end cannot be understood: {type(error).__name__}: {error}"
            ) from error


def _number(value: object) -> float | None:
    if value is None:
        return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not value > 0:
        raise ValueError(f"{value!r} is not a positive number")
    return float(value)


def check_agreement(expected: Hello, stated: Hello) -> None:
    """Refuse a far end that is not what the near end expects.

    Parameters
    ----------
    expected : Hello
        From the rig file and the stimulus; what it leaves out may be anything.
    stated : Hello
        From the far end.

    Raises
    ------
    RigError
        If axes, units, rate or limits differ, units cannot be compared, or the watchdog is slower
        than expected; the message says both.
        If the far end leaves one of the first three out.

    Examples
    --------
    >>> there = Hello(name="table", axes=("roll",), units=("deg",), rate=1000.0)
    >>> check_agreement(Hello(axes=("roll",), units=("rad",)), there)
    Traceback (most recent call last):
    hmpim.errors.RigError: 'table' says that roll is in 'deg', and 'rad' is expected; ...
    """
    who = repr(stated.name)
    if not stated.axes or len(stated.units) != len(stated.axes) or stated.rate is None:
        raise RigError(
            f"{who} states axes {stated.axes}, units {stated.units} and rate {stated.rate}; the "
            "far end must state its axes, a unit for each, and its rate"
        )
    if expected.rate is not None and not _same(expected.rate, stated.rate):
        raise RigError(
            f"{who} runs at {stated.rate:g} Hz, and {expected.rate:g} Hz is expected; design the "
            "stimulus at its rate, or start it at the stimulus's"
        )
    silence, allowed = stated.watchdog, expected.watchdog
    if silence is not None and allowed is not None and silence > allowed * (1.0 + _SAME):
        raise RigError(
            f"{who} brakes after {silence:g} s of silence, and a watchdog of {allowed:g} s is "
            "expected; correct the rig file"
        )
    for k, axis in enumerate(expected.axes):
        if axis not in stated.axes:
            raise RigError(
                f"{who} has no axis {axis!r}, which is expected; it has {', '.join(stated.axes)}"
            )
        unit = stated.units[stated.axes.index(axis)]
        if expected.units and expected.units[k] != unit:
            raise RigError(
                f"{who} says that {axis} is in {unit!r}, and {expected.units[k]!r} is expected; "
                "make the rig file agree with it"
            )
    for axis, wanted in expected.limits.items():
        if axis not in stated.axes:
            raise RigError(f"{who} has no axis {axis!r}, for which limits are expected")
        unit = stated.units[stated.axes.index(axis)]
        try:
            there, here = stated.limits.get(axis, Limits()).to(unit), wanted.to(unit)
        except UnitError as error:
            raise RigError(f"{who} and the limits expected of {axis}: {error}") from None
        for name in QUANTITIES:
            mine, theirs = getattr(here, name), getattr(there, name)
            # Narrower than the rig's is a wish; wider would be a mistake about the rig.
            if math.isfinite(mine) and mine > theirs * (1.0 + _SAME):
                raise RigError(
                    f"{who} states a {name} limit of {theirs:g} for {axis}, and {mine:g} is "
                    f"expected ({unit}); correct the rig file"
                )


def _same(one: float, other: float | None) -> bool:
    return other is not None and abs(one - other) <= _SAME * abs(one)
