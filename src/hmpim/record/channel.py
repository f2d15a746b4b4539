"""One signal on its own clock, and what it may do between its samples."""

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.arguments import checked
from hmpim.equality import ByValue
from hmpim.errors import RecordError
from hmpim.tables import shortened
from hmpim.units import check_unit

__all__ = [
    "BETWEEN",
    "INTERSAMPLE_WORDS",
    "Channel",
    "Intersample",
    "frozen_samples",
    "in_seconds",
    "is_held",
]

Intersample = Literal["zoh", "foh", "bandlimited", "feedforward", "sampled"]
"""Held, linear or band-limited between its samples; held together with its derivatives, which are
commanded too; or software, which sees the samples alone."""

BETWEEN: tuple[Intersample, ...] = ("zoh", "foh", "bandlimited")
"""What a signal in continuous time may do between its samples: held, linear or band-limited."""

INTERSAMPLE_WORDS: dict[Intersample, str] = {
    "zoh": "held",
    "foh": "linear",
    "bandlimited": "band-limited",
    "feedforward": "held with its derivatives",
    "sampled": "sampled (software)",
}
"""What an input does between its samples, in words a reader knows."""


def is_held(intersample: Intersample) -> bool:
    """Whether an input stands still between its samples.

    Examples
    --------
    >>> is_held("feedforward"), is_held("foh")
    (True, False)
    """
    return intersample in ("zoh", "feedforward")


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Channel(ByValue):
    """One measured signal on its own clock.

    Samples that a masked array hides are left out: a gap in this channel alone.

    Parameters
    ----------
    name : str
        Name of the channel, unique in its record.
    time : ndarray, shape (n,)
        Time stamps in seconds, strictly increasing.
    values : ndarray, shape (n,)
        Samples, in `unit`.
    unit : str
        Unit of the values; empty for none.

    Raises
    ------
    RecordError
        For NaN or infinite values, unequal lengths, or time that does not increase.
    """

    name: str
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    unit: str = ""

    def __post_init__(self) -> None:
        check_unit(self.unit)
        hidden = _hidden(self.time), _hidden(self.values)
        time = frozen_samples(f"{self.name} (time)", self.time)
        values = frozen_samples(self.name, self.values)
        if time.size != values.size:
            raise RecordError(
                f"channel {self.name!r} has {values.size} samples and {time.size} time stamps; "
                "they must be as many"
            )
        if any(mask is not None for mask in hidden):
            seen = ~np.logical_or.reduce([mask for mask in hidden if mask is not None])
            time, values = (
                frozen_samples(self.name, time[seen]),
                frozen_samples(self.name, values[seen]),
            )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "values", values)
        if values.size < 2:
            raise RecordError(f"channel {self.name!r} has {values.size} samples; at least 2 needed")
        for label, array in ((self.name, values), (f"{self.name} (time)", time)):
            bad = np.flatnonzero(~np.isfinite(array))
            if bad.size:
                raise RecordError(
                    f"channel {label!r} holds {array[bad[0]]} at sample {bad[0]} "
                    f"({bad.size} in all); cut them out or fill them before identifying"
                )
        with np.errstate(over="ignore", invalid="ignore"):
            step = np.diff(time - time[0])  # stamps of a damaged file may lie too far apart to tell
        onward = (step > 0) & (step < np.inf)
        if not onward.all():
            k = int(np.argmin(onward))
            raise RecordError(
                f"time of channel {self.name!r} does not increase at sample {k + 1}: "
                f"{time[k]:.9g} s is followed by {time[k + 1]:.9g} s; sort the record, "
                "or cut it there"
            )

    def __repr__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s"
        return f"Channel({shortened([self.name])}{unit}, {self.values.size} samples, {span})"


def frozen_samples(name: str, values: ArrayLike) -> NDArray[np.float64]:
    """Return samples as real numbers, shape (n,), that nobody can write to; `name` says whose."""
    if np.iscomplexobj(values):
        raise RecordError(
            f"channel {name!r} is complex; give real numbers: the real part, or two channels"
        )
    if getattr(values, "dtype", np.dtype(float)).kind in "mM":
        raise RecordError(
            f"channel {name!r} holds dates or durations; give numbers, of a time in s, such as "
            "(time - time[0]) / np.timedelta64(1, 's')"
        )
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise RecordError(f"channel {name!r} is not numeric ({error}); give real numbers") from None
    if array.ndim != 1:
        raise RecordError(
            f"channel {name!r} has shape {array.shape}; give one dimension of samples, shape (n,)"
        )
    array.setflags(write=False)
    return array


def in_seconds(time: ArrayLike) -> NDArray[Any]:
    """Return dates in s since the first, durations in s, and numbers as they are.

    Examples
    --------
    >>> in_seconds(np.array(["2026-03-01T12:00:00.000", "2026-03-01T12:00:00.005"], "datetime64"))
    array([0.   , 0.005])
    >>> in_seconds(np.array([5], "timedelta64[ms]")), in_seconds([0.5])
    (array([0.005]), array([0.5]))
    """
    array = np.asanyarray(time)
    if array.dtype.kind == "M":
        array = array - array[:1]
    return array / np.timedelta64(1, "s") if array.dtype.kind == "m" else array


def _hidden(values: ArrayLike) -> NDArray[np.bool_] | None:
    """What a masked array hides, shape (n,); None if nothing."""
    if not isinstance(values, np.ma.MaskedArray) or not np.ma.is_masked(values):
        return None
    return np.ma.getmaskarray(values)
