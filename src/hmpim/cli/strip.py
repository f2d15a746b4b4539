"""A strip chart in the terminal: command and response of each axis while a run goes on."""

import os
import time
from collections import deque
from collections.abc import Callable
from typing import TextIO

import numpy as np
from numpy.typing import NDArray

from hmpim.experiment import Played
from hmpim.rigs import Layout, Samples

__all__ = ["Strip", "drawn"]

FloatArray = NDArray[np.float64]

_SPAN = 3.0  # s of the run that are seen
_WIDTH = 64  # characters at most, two columns of dots each
_LEAST = 8  # characters at least: names are cut rather
_NUMBER = 10  # characters of the value beside it
_USUAL = (80, 24)  # columns and lines of a terminal that does not say
_EVERY = 0.2  # s between two drawings: the run has better things to do
_HEIGHT = 8  # lines for all channels together, one each at least
_DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])


def drawn(samples: Samples, *, end: float, span: float, size: tuple[int, int]) -> list[str]:
    """Draw samples as lines of Braille dots.

    Parameters
    ----------
    samples : Samples
        Of one channel.
    end, span : float
        The last `span` s before `end` are drawn.
    size : tuple of int
        Characters across and lines.

    Returns
    -------
    list of str
        From top to bottom; the range of the values fills the height.

    Examples
    --------
    >>> t = np.arange(400) / 400
    >>> for line in drawn(Samples(time=t, values=t), end=1.0, span=1.0, size=(8, 2)):
    ...     print(line)
    ⠀⠀⠀⠀⣀⡤⠖⠋
    ⣠⠴⠚⠉⠁⠀⠀⠀
    """
    width, height = size
    dots = np.zeros((4 * height, 2 * width), dtype=bool)
    inside = samples.time > end - span
    column = np.floor((samples.time[inside] - (end - span)) / span * 2 * width).astype(np.int64)
    values = samples.values[inside]
    kept = (column >= 0) & (column < 2 * width) & np.isfinite(values)
    column, values = column[kept], values[kept]
    if values.size:
        low, high = float(values.min()), float(values.max())
        level = (values - low) / (high - low) if high > low else np.full(values.size, 0.5)
        row = np.rint((1.0 - level) * (4 * height - 1)).astype(np.int64)
        top = np.full(2 * width, 4 * height)
        bottom = np.full(2 * width, -1)
        np.minimum.at(top, column, row)
        np.maximum.at(bottom, column, row)
        rows = np.arange(4 * height)[:, None]
        dots = (rows >= top) & (rows <= bottom)
    cells = dots.reshape(height, 4, width, 2)
    codes = 0x2800 + np.einsum("hiwj,ij->hw", cells, _DOTS)
    return ["".join(map(chr, line)) for line in codes.tolist()]


class Strip:
    """A subscriber of a run that draws its last seconds.

    Parameters
    ----------
    to : text stream
        The terminal.
    clock : callable
        Tells the time in s; drawn at most five times a second of it.
    """

    def __init__(self, to: TextIO, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._to, self._clock = to, clock
        self._next = clock()
        self._kept: dict[str, deque[Samples]] = {}
        self._lines = 0

    def __call__(self, played: Played) -> None:
        """Take a block."""
        shown = _shown(played.layout)
        end = float(played.block.time[-1])
        if played.block.start == 0:
            self._kept, self._lines = {}, 0
        for name in shown:
            kept = self._kept.setdefault(name, deque())
            if name in played.samples:
                kept.append(played.samples[name])
            while kept and kept[0].time.size and kept[0].time[-1] < end - _SPAN:
                kept.popleft()
        now = self._clock()
        if now >= self._next or played.block.last:
            self._next = now + _EVERY
            self._draw(shown, end=end, seconds=played.seconds)

    def _draw(self, shown: list[str], *, end: float, seconds: float) -> None:
        columns, rows = _room(self._to)
        shown = shown[: max(rows - 2, 1)]
        height = max(1, min(_HEIGHT, rows - 2) // len(shown))
        wide = min(max(map(len, shown)), max(columns - 2 - _NUMBER - _LEAST, 1))
        across = max(min(_WIDTH, columns - 2 - _NUMBER - wide), 1)
        lines = []
        for name in shown:
            parts = self._kept[name] or [Samples(time=np.empty(0), values=np.empty(0))]
            all_of_it = Samples.joined(list(parts))
            strip = drawn(all_of_it, end=end, span=_SPAN, size=(across, height))
            now = f"{all_of_it.values[-1]:+{_NUMBER}.3f}" if all_of_it.values.size else ""
            margins = [f"{name[:wide]:<{wide}} "] + [" " * (wide + 1)] * (height - 1)
            ends = [now] + [""] * (height - 1)
            lines += [a + b + c for a, b, c in zip(margins, strip, ends, strict=True)]
        lines.append(f"{'':<{wide}} {end:.1f} of {seconds:.1f} s"[: columns - 1])
        up = f"\x1b[{self._lines}A" if self._lines else ""
        self._to.write(up + "".join(f"\r\x1b[K{line}\n" for line in lines))
        self._to.flush()
        self._lines = len(lines)


def _room(to: TextIO) -> tuple[int, int]:
    """Columns and lines of a terminal: a line that is wrapped could not be drawn over."""
    try:
        size = os.get_terminal_size(to.fileno())
    except (OSError, ValueError):  # no terminal
        return _USUAL
    return size.columns or _USUAL[0], size.lines or _USUAL[1]


def _shown(layout: Layout) -> list[str]:
    """Channels to draw: each input, and the outputs of its axis under it."""
    inputs, outputs = layout.of("input"), layout.of("output")
    names: list[str] = []
    for one in inputs:
        names.append(one.name)
        names += [other.name for other in outputs if other.axis == one.axis]
    return names + [other.name for other in outputs if other.name not in names]
