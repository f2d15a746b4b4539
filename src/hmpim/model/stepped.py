"""The nonlinear part of a model as programs step it: from the samples alone, as they come.

`hmpim.model.nonlinear` has the whole record at hand and looks between its samples. A program has
the samples up to now: it limits the command, and turns backlash round, at the samples, and joins
the samples by straight lines where a force or friction is followed on the finer clock.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.fine import finely
from hmpim.model.nonlinear import NonlinearPart, forced, friction
from hmpim.model.operators import play, power_of, rate_limited
from hmpim.model.response import RationalDelay, per_step
from hmpim.record import Intersample

__all__ = ["SteppedPart", "stepped_part"]

_Real = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SteppedPart:
    """A nonlinear part at a rate.

    Parameters
    ----------
    part : NonlinearPart
        The part; `between` says how its command is joined: held or straight.
    system : RationalDelay
        The linear part.
    fs : float
        Rate in Hz.
    """

    part: NonlinearPart
    system: RationalDelay
    fs: float

    @property
    def denominator(self) -> _Real:
        """Of the dynamics, by rising powers of s per sample."""
        return per_step(self.system.denominator, self.fs)

    def entered(self, u: _Real) -> _Real:
        """The command as it reaches the linear part, (n,)."""
        if self.part.kind == "rate_limit":
            return rate_limited(u, self.part.size / self.fs)
        if self.part.kind == "dead_zone":
            return np.asarray(u - np.clip(u, -self.part.size, self.part.size))
        return u

    def effect(self, u: _Real, x: _Real, rest: float) -> _Real:
        """What is added to the output of the linear part, (n,), less its bias.

        Before the first sample the linear part was at `rest`.
        """
        part = self.part
        if part.at == "command":
            return np.zeros(x.size)
        if part.kind == "backlash":
            return play(np.append(rest, x), part.size)[1:] - x
        if part.kind == "friction":
            return friction(part, self.system, finely(u, part.between), self.fs)
        if part.at == "force":
            return forced(part, self.denominator, finely(x, "foh"))
        return part.weight * power_of(x, part.power, part.reach)


def stepped_part(
    part: NonlinearPart,
    system: RationalDelay,
    *,
    fs: float,
    intersample: Intersample,
    held: bool,
) -> SteppedPart:
    """Put a nonlinear part on a rate in Hz; `held` says whether the output is held.

    Raises
    ------
    ArgumentError
        If it acts behind the command, and the output is held: the output between its samples is
        known of the linear part only.
    """
    if held and part.at != "command":
        raise ArgumentError(
            f"{part.words} and a held output cannot be stepped together; set hold_period=None or "
            "nonlinear=None"
        )
    straight: Intersample = "zoh" if intersample == "zoh" else "foh"
    return SteppedPart(part=replace(part, between=straight), system=system, fs=fs)
