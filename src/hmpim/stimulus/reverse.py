"""A waveform run backwards: from its end to its start."""

from dataclasses import dataclass, replace

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.stimulus.motion import FloatArray, Motion, Piecewise, Scalable, Waveform

__all__ = ["Reversed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reversed:
    """The same motion, last instant first: a sweep from high to low frequencies.

    Parameters
    ----------
    waveform : Waveform
        What to run backwards.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.stimulus.sweep import Sweep
    >>> sweep = Sweep(band=(0.1, 10.0), duration=10.0)
    >>> back, forth = Reversed(waveform=sweep), np.array([3.0])
    >>> bool(back.motion(10.0 - forth).velocity == -sweep.motion(forth).velocity)
    True
    """

    waveform: Waveform

    @property
    def duration(self) -> float:
        """Length in seconds."""
        return self.waveform.duration

    @property
    def band(self) -> tuple[float, float] | None:
        """Excited band in Hz, low to high."""
        return self.waveform.band

    @property
    def breaks(self) -> tuple[float, ...]:
        """Times in seconds at which one piece hands over to the next."""
        if not isinstance(self.waveform, Piecewise):
            return ()
        return tuple(self.duration - t for t in reversed(self.waveform.breaks))

    def scaled(self, factor: float) -> "Reversed":
        """Return the same waveform, `factor` times as large."""
        if not isinstance(self.waveform, Scalable):
            raise ArgumentError(f"a {type(self.waveform).__name__} has no scale to change")
        return replace(self, waveform=self.waveform.scaled(factor))

    def motion(self, time: FloatArray) -> Motion:
        """Position, velocity, acceleration and jerk at `time` (s, shape (n,))."""
        t = np.asarray(time, dtype=np.float64)
        at = self.waveform.motion(self.duration - t)
        return Motion(
            time=t,
            position=at.position,
            velocity=0.0 - at.velocity,  # and not -v, which would make a negative zero
            acceleration=at.acceleration,
            jerk=None if at.jerk is None else 0.0 - at.jerk,
        )
