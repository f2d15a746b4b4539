"""What has come in of the run that goes on, kept for every window that looks on."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hmpim.record import Intersample
from hmpim.workbench.work.driving import Begun, Block

__all__ = ["Channel", "Live", "thinned"]

FloatArray = NDArray[np.float64]
_FIRST = 4096  # samples that a channel has room for at first


def thinned(x: FloatArray, y: FloatArray, most: int) -> tuple[FloatArray, FloatArray]:
    """Take at most so many samples, highest and lowest of every stretch among them.

    Parameters
    ----------
    x, y : ndarray, shape (n,)
        Samples; x rises.
    most : int
        At least 4.

    Examples
    --------
    >>> y = np.zeros(100_000)
    >>> y[12_345] = 1.0
    >>> x, few = thinned(np.arange(1e5), y, 400)
    >>> few.size, float(few.max())
    (400, 1.0)
    """
    if y.size <= most:
        return x, y
    from tsdownsample import MinMaxDownsampler

    thinner = MinMaxDownsampler()  # type: ignore[no-untyped-call, unused-ignore]
    kept = thinner.downsample(np.ascontiguousarray(y), n_out=most - most % 2)
    return x[kept], y[kept]


@dataclass(slots=True)
class Channel:
    """One channel: what it is, and its samples so far in arrays that grow by doubling."""

    name: str
    role: str
    axis: str
    unit: str
    size: int = 0
    _time: FloatArray = field(default_factory=lambda: np.empty(_FIRST))
    _values: FloatArray = field(default_factory=lambda: np.empty(_FIRST))

    @property
    def time(self) -> FloatArray:
        """Times so far, s."""
        return self._time[: self.size]

    @property
    def values(self) -> FloatArray:
        """Values so far."""
        return self._values[: self.size]

    def add(self, time: FloatArray, values: FloatArray) -> None:
        """Add samples at the end."""
        wanted = self.size + values.size
        if wanted > self._values.size:
            room = max(wanted, 2 * self._values.size)
            self._time = np.concatenate([self.time, np.empty(room - self.size)])
            self._values = np.concatenate([self.values, np.empty(room - self.size)])
        self._time[self.size : wanted] = time
        self._values[self.size : wanted] = values
        self.size = wanted

    def last(self, seconds: float, *, end: float, most: int) -> tuple[FloatArray, FloatArray]:
        """Return the last seconds before `end`, thinned."""
        first = int(np.searchsorted(self.time, end - seconds))
        return thinned(self.time[first:], self.values[first:], most)


class Live:
    """The samples of a run that goes on, by channel."""

    def __init__(self) -> None:
        self.channels: dict[str, Channel] = {}
        self.limits: dict[str, float] = {}
        self.intersample: Intersample | None = None
        self.end = 0.0
        self.seconds = 0.0
        self.blocks = 0

    def begin(self, begun: Begun) -> None:
        """Start anew, with these channels."""
        self.channels = {
            name: Channel(name=name, role=role, axis=axis, unit=unit)
            for name, role, axis, unit in begun.channels
        }
        self.limits, self.intersample = begun.limits, begun.intersample
        self.end, self.seconds, self.blocks = 0.0, begun.seconds, 0

    def take(self, block: Block) -> None:
        """Add a block."""
        self.end = block.end
        self.blocks += 1
        for name, (time, values) in block.samples.items():
            if name in self.channels and values.size:
                self.channels[name].add(time, values)

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes that move, in order."""
        return tuple(dict.fromkeys(c.axis for c in self.channels.values() if c.role == "input"))

    def of(self, axis: str) -> Mapping[str, Channel]:
        """Command and responses of an axis by role: its first input and its first output."""
        found: dict[str, Channel] = {}
        for channel in self.channels.values():
            if channel.role in ("input", "output") and channel.axis == axis:
                found.setdefault(channel.role, channel)
        if "output" not in found:  # a sensor's output belongs to no axis
            for channel in self.channels.values():
                if channel.role == "output":
                    found.setdefault("output", channel)
        return found
