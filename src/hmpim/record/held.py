"""Inputs that are held, or linear, by a clock of their own: what they truly were at any instant.

Such an input has its corners between the samples of the output. No samples on the output's clock
show them: a hold that is said to switch at the next of these is up to an interval late, and one
that is averaged over each interval is smoothed. The waveform itself is known, though. Here it is
made on a fine clock, and what of it lies below half the output's rate is brought onto the output's
clock by the symmetric filter of `hmpim.record.resample`, which moves nothing. What lies above, the
images of the hold, folds back in the output; identification takes it out by the model it finds.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.record.channel import Channel, Intersample
from hmpim.record.clock import Clock
from hmpim.record.resample import band_limited

__all__ = ["Waveform", "switches_beside", "waveform_of"]

_FINE = 16
"""Steps of the fine clock in an interval of the input: 1/32 of one is the most a corner is off,
and as much to either side."""

_MOST = 4_000_000
"""Steps of the fine clock at most; of a record that needs more they are wider, 4 at the least."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Waveform:
    """A held or linear input on a fine clock.

    Parameters
    ----------
    name : str
        Of the channel.
    start, fs : float
        Instant of the first value, s, and values in a second.
    values : ndarray, shape (n,)
        Held: the mean over the step that begins there. Linear: the value there.
    intersample : {'zoh', 'foh'}
        Which of the two.
    """

    name: str
    start: float
    fs: float
    values: NDArray[np.float64]
    intersample: Literal["zoh", "foh"]

    @property
    def time(self) -> NDArray[np.float64]:
        """Instants at which the steps begin, s, shape (n,)."""
        return np.asarray(self.start + np.arange(self.values.size) / self.fs)

    def below_half(self, grid: NDArray[np.float64], *, fs: float) -> NDArray[np.float64]:
        """Return what of it lies below half a lower rate, at instants of a grid (s)."""
        middle = 0.5 if self.intersample == "zoh" else 0.0  # a mean stands for its step's middle
        place = (grid - self.start) * self.fs - middle
        return band_limited(self.values, place, ratio=fs / self.fs)


def switches_beside(
    inputs: Sequence[Channel],
    clocks: dict[int, Clock],
    clock: Clock,
    intersample: Intersample | None,
) -> bool:
    """Whether a held or linear input has corners beside the instants of a clock.

    Parameters
    ----------
    inputs : sequence of Channel
        The inputs.
    clocks : dict of int to Clock
        Clock of each time array, by its identity.
    clock : Clock
        Clock of the first output.
    intersample : {'zoh', 'foh', 'bandlimited'} or None
        What the inputs do between their samples.
    """
    if intersample not in ("zoh", "foh"):
        return False
    return any(_beside(clocks[id(channel.time)], clock) for channel in inputs)


def _beside(own: Clock, clock: Clock) -> bool:
    if own.jittered or clock.jittered:
        return True
    if own is clock:
        return False
    # Each of its instants is one of the other clock's: the first, the last and so all between.
    ratio = clock.fs / own.fs
    place = (own.start - clock.start) * clock.fs
    drift = abs(ratio - np.rint(ratio)) * own.length
    away = abs(place - np.rint(place)) + drift
    return bool(away > (own.rounding + clock.rounding) * clock.fs)


def waveform_of(channel: Channel, clock: Clock, intersample: Literal["zoh", "foh"]) -> Waveform:
    """Return what a held or linear input was, on a fine clock.

    Parameters
    ----------
    channel : Channel
        The input.
    clock : Clock
        The clock laid through its stamps.
    intersample : {'zoh', 'foh'}
        What it does between its samples, which are where their stamps say.

    Examples
    --------
    >>> from hmpim.record.clock import fit_clock
    >>> stamps = np.array([0.0, 0.1, 0.225, 0.3])
    >>> u = Channel(name="u", time=stamps, values=[0.0, 1.0, 3.0, 3.0])
    >>> held = waveform_of(u, fit_clock(stamps), "zoh")
    >>> held.values[:17:8].tolist()
    [0.0, 0.0, 1.0]
    """
    fine = int(np.clip(_MOST // clock.length, 4, _FINE))
    step = 1.0 / (clock.fs * fine)
    own = channel.time if clock.jittered else clock.start + clock.index / clock.fs
    start, count = float(own[0]), int(np.ceil((own[-1] - own[0]) / step - 1e-6)) + fine
    edges = start + np.arange(count + 1) * step
    if intersample == "foh":
        values = np.interp(edges[:-1], own, channel.values)
    else:
        area = np.concatenate([[0.0], np.cumsum(channel.values[:-1] * np.diff(own))])
        held = np.clip(np.searchsorted(own, edges + 1e-6 * step, side="right") - 1, 0, None)
        until = area[held] + channel.values[held] * (edges - own[held])
        same = held[:-1] == held[1:]
        corner = np.isclose(own[held[1:]], edges[1:], rtol=0.0, atol=1e-6 * step)
        alone = same | (corner & (held[1:] == held[:-1] + 1))
        # Where nothing is switched inside a step the value stays as it is, to the last digit.
        values = np.where(alone, channel.values[held[:-1]], np.diff(until) / step)
    return Waveform(
        name=channel.name, start=start, fs=1.0 / step, values=values, intersample=intersample
    )
