"""Inputs as functions of time, and what they do between the samples of a record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

__all__ = ["Between", "Drive", "Lines", "Samples"]

Between = Literal["smooth", "zoh", "foh"]
_GRACE = 1e-6  # of a sample: an instant that falls on a jump takes the new value


class Lines:
    """A band-limited, periodic signal, by its Fourier lines; asked at times 1/fs apart only."""

    def __init__(self, spectrum: np.ndarray, fs: float, samples: int, first: float = 0.0) -> None:
        self._spectrum, self._fs, self._samples, self._first = spectrum, fs, samples, first
        self._omega = 2 * np.pi * np.fft.rfftfreq(samples, 1 / fs)

    @classmethod
    def through(cls, values: np.ndarray, fs: float, first: float = 0.0) -> Lines:
        """The signal that passes through samples, the first of them at time `first`."""
        return cls(np.fft.rfft(values), fs, values.size, first)

    def __call__(self, time: np.ndarray) -> np.ndarray:
        place = (time[0] - self._first) * self._fs
        whole = int(np.floor(place))
        turn = np.exp(1j * self._omega * (place - whole) / self._fs)
        moved = np.fft.irfft(self._spectrum * turn, self._samples)
        return moved[(whole + np.arange(time.size)) % self._samples]


class Samples:
    """A sequence that stands at its first value before it and at its last after it."""

    def __init__(self, values: np.ndarray, fs: float, first: float = 0.0) -> None:
        self.values, self._fs, self._first = values, fs, first
        self._smooth: Lines | None = None

    def at_index(self, index: np.ndarray) -> np.ndarray:
        index = index - int(np.round(self._first * self._fs))
        return self.values[np.clip(index, 0, self.values.size - 1)]

    def __call__(self, time: np.ndarray) -> np.ndarray:
        """Between the samples: band-limited, the ends carried on and mirrored."""
        if self._smooth is None:
            v = self.values
            self._smooth = Lines.through(np.concatenate([v, v[::-1]]), self._fs, self._first)
        return self._smooth(time)


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """An input, known at all times.

    Parameters
    ----------
    source : callable
        Continuous input by time in s; or `Samples`, where a computer made it.
    between : {'smooth', 'zoh', 'foh'}
        What reaches the system between the samples: the source itself, or its samples held or
        joined.
    band : tuple of float
        Excited band in Hz.
    fs, samples
        Rate in Hz and length of the record.
    quiet : bool
        Whether it stands still before time 0.
    every : int
        A held or linear input changes at every so many samples.
    """

    source: Callable[[np.ndarray], np.ndarray]
    between: Between
    band: tuple[float, float]
    fs: float
    samples: int
    quiet: bool = True
    every: int = 1
    name: str = field(default="", compare=False)

    @property
    def duration(self) -> float:
        return self.samples / self.fs

    def _sampled(self, index: np.ndarray) -> np.ndarray:
        if isinstance(self.source, Samples):
            return self.source.at_index(index)
        steps = np.arange(index[0], index[-1] + 1)
        return self.source(steps / self.fs)[index - index[0]]

    def value(self, time: np.ndarray, between: Between | None = None) -> np.ndarray:
        """What reaches the system; times must be 1/fs apart."""
        between = between or self.between
        if between == "smooth":
            return self.source(time)
        place = time * self.fs
        index = np.floor(place + _GRACE).astype(int)
        if between == "zoh":
            return self._sampled(index - index % self.every)
        share = place - index
        low = self._sampled(np.append(index, index[-1] + 1))
        return low[:-1] + share * np.diff(low)

    def sampled(self, start: float = 0.0, samples: int | None = None) -> np.ndarray:
        """What the record shows of it."""
        count = self.samples if samples is None else samples
        time = start + np.arange(count) / self.fs
        if self.between == "smooth":
            return self.source(time)
        index = np.round(time * self.fs).astype(int)
        return self._sampled(index - index % self.every)
