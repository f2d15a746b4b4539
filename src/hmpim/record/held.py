"""The grid for inputs that switch at instants of their own: theirs, so that none is moved."""

from collections.abc import Sequence

import numpy as np

from hmpim.record.clock import Clock
from hmpim.record.record import Channel, Intersample

__all__ = ["switching_clock"]

_ALIKE = 0.02
"""By which a ratio of rates may differ from a whole number: clocks of one kind differ by less."""


def switching_clock(
    inputs: Sequence[Channel],
    clocks: dict[int, Clock],
    clock: Clock,
    intersample: Intersample | None,
) -> Clock:
    """Return the clock on which held or linear inputs are what they are between the samples.

    An input that is held by one clock, and whose answer is sampled by another, switches between
    the samples: on the output's grid each switch is up to an interval off, and so is the
    delay. Outputs are smoother, so they are taken at the instants of the inputs instead.

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

    Returns
    -------
    Clock
        That of the inputs, at a multiple of its rate near the output's; the output's own where
        the inputs are smooth, have several clocks, stray, or fit no whole number of times.
    """
    own = clocks[id(inputs[0].time)]
    shared = all(clocks[id(c.time)] is own for c in inputs)
    if intersample not in ("zoh", "foh") or own is clock or not shared or own.jittered:
        return clock
    times = max(1, round(clock.fs / own.fs))
    if abs(clock.fs / own.fs - times) > _ALIKE * times:
        return clock
    # A clock that ticks at the same instants is the output's own, of which samples are missing.
    place = (own.start - clock.start) * clock.fs
    beside = abs(place - np.rint(place)) + abs(own.fs * times / clock.fs - 1.0) * clock.length
    if beside <= (own.rounding + clock.rounding) * clock.fs:
        return clock
    return Clock(
        start=own.start,
        fs=own.fs * times,
        index=own.index * times,
        deviation=own.deviation,
        resolution=own.resolution,
        jittered=False,
    )
