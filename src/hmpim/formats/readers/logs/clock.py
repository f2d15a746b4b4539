"""Which column of a table of numbers is its time, and what its numbers mean."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import FormatError, UnitError
from hmpim.formats.readers.text import TIME_NAMES, named, unlikely_seconds
from hmpim.record import Finding
from hmpim.units import conversion_factor

__all__ = ["ClockColumn", "clock_column", "is_time", "seconds_since"]

_UNIX = ((1e17, "ns"), (1e14, "us"), (1e11, "ms"), (1e9, "s"))
"""Smallest number that is taken as Unix time in a unit: after 1973, or 2001 in s."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockColumn:
    """A column of time.

    Parameters
    ----------
    name : str
        Its name.
    unit : str
        What its numbers count; empty where that is not stated.
    """

    name: str
    unit: str = ""

    def seconds(
        self, values: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], float | None, tuple[Finding, ...]]:
        """Return stamps in s, the Unix time at which they are 0 if they tell, and what is said.

        Examples
        --------
        >>> time, origin, said = ClockColumn(name="t").seconds(np.array([1.7e12, 1.7e12 + 5]))
        >>> time.tolist(), origin, said[0].code
        ([0.0, 0.005], 1700000000.0, 'time_unit')
        """
        finite = values[np.isfinite(values)]
        size = float(np.median(np.abs(finite))) if finite.size else 0.0
        unix = next((unit for least, unit in _UNIX if size >= least), None)
        unit = self.unit or unix or "s"
        factor = conversion_factor(unit, to="s")
        if unix is None or (self.unit and size * factor < _UNIX[-1][0]):
            return (
                _scaled(values, factor),
                None,
                () if self.unit else unlikely_seconds(self.name, values),
            )
        base = float(np.floor(finite.min()))
        told = Finding(
            code="time_unit",
            message=(
                f"{self.name!r} states no unit; its size is that of Unix time in {unit}, and it is "
                "read so"
            ),
            severity="info",
            parameters=(),
        )
        return _scaled(values - base, factor), base * factor, () if self.unit else (told,)


def clock_column(
    columns: Sequence[tuple[str, str]], *, wanted: str | None, bare: bool, file: str
) -> ClockColumn | None:
    """Choose the column of time: the one asked for, else the one called so.

    Parameters
    ----------
    columns : sequence of (str, str)
        Names and units.
    wanted : str or None
        Name that a person gives, with or without the unit.
    bare : bool
        True if there is no other time, so that one is looked for by name.
    file : str
        Name of the file, for messages.

    Raises
    ------
    FormatError
        If several may be it, or its unit is none of time.

    Examples
    --------
    >>> clock_column([("u", "V"), ("/log/time_ms", "")], wanted=None, bare=True, file="a.mat")
    ClockColumn(name='/log/time_ms', unit='ms')
    """
    if wanted is not None:
        plain, unit = named(wanted)
        for name, given in ((wanted, ""), (plain, unit)):
            found = [c for c in columns if c[0] == name]
            if len(found) == 1:
                return _checked(name, given or found[0][1] or named(_last(name))[1], file)
        return None
    if not bare:
        return None
    usual = [(name, unit) for name, unit in columns if is_time(name)]
    if len(usual) > 1:
        exact = [(n, u) for n, u in usual if named(_last(n))[0].casefold() in ("time", "t")]
        usual = exact if len(exact) == 1 else usual
    if len(usual) > 1:
        raise FormatError(
            f"{file!r} has several time channels ({', '.join(n for n, _ in usual[:8])}); "
            "say which with time=... or --time"
        )
    if not usual:
        return None
    name, unit = usual[0]
    return _checked(name, unit or named(_last(name))[1], file)


def seconds_since(ticks: NDArray[np.integer], base: int, *, per_second: int) -> NDArray[np.float64]:
    """Return whole ticks as s since `base`, rounded once.

    Examples
    --------
    >>> seconds_since(np.array([1_000_000_001_500_000]), 1_000_000_000_000_000, per_second=10**6)
    array([1.5])
    """
    since = ticks.astype(np.int64) - np.int64(base)
    return np.asarray(since / per_second)


def _scaled(values: NDArray[np.float64], factor: float) -> NDArray[np.float64]:
    whole = round(1 / factor) if factor < 1 else 0
    exact = whole > 0 and abs(whole * factor - 1) < 1e-12
    return values / whole if exact else values * factor


def _last(name: str) -> str:
    """The last part of a path: '/log/time' is called 'time'."""
    return re.split(r"[./\\]", name)[-1]


def is_time(path: str) -> bool:
    """Say whether a channel is called as time is.

    Examples
    --------
    >>> is_time('/log/time_ms'), is_time('log.tout'), is_time('timer')
    (True, True, False)
    """
    name = _last(path)
    plain = named(name)[0].casefold()
    return plain in TIME_NAMES or name.casefold() in TIME_NAMES or plain in ("tout", "timestamps")


def _checked(name: str, unit: str, file: str) -> ClockColumn:
    if unit:
        try:
            conversion_factor(unit, to="s")
        except UnitError as error:
            raise FormatError(f"{file!r}: {name!r} cannot be the time: {error}") from None
    return ClockColumn(name=name, unit=unit)
