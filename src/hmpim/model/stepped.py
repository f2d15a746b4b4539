"""The nonlinear part of a model as programs step it: from the samples alone, as they come.

`hmpim.model.nonlinear` has the whole record at hand and looks between its samples. A program has
the samples up to now: it limits the command, and turns backlash round, at the samples, and joins
the samples by straight lines where a force or friction is followed on the finer clock.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.fine import FINE, finely
from hmpim.model.nonlinear import NonlinearPart, forced
from hmpim.model.operators import play, power_of, rate_limited
from hmpim.model.response import RationalDelay, per_step
from hmpim.record import Intersample

__all__ = ["SteppedPart", "command_step", "stepped_part"]

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
            return self._rubbed(finely(u, part.between))
        if part.at == "force":
            return forced(part, self.denominator, finely(x, "foh"))
        return part.weight * power_of(x, part.power, part.reach)

    def _rubbed(self, fine: _Real) -> _Real:
        """Effect of friction on a second-order unit, from rest: stepped with it and without."""
        if self.denominator.size != 3:
            raise ArgumentError(
                "programs step friction within a second-order unit; the denominator here is of "
                f"degree {self.denominator.size - 1}"
            )
        late, at = FINE * self.system.delay * self.fs, np.arange(fine.size)
        gain = float(self.system.numerator[0])
        command = gain * np.interp(at - late, at, fine, left=fine[0])
        between = 0.5 * (command[:-1] + command[1:])
        step, still = command_step(self.denominator), command[0]
        top, below = scipy.signal.ss2tf(step[:, :2], step[:, 2:], np.eye(1, 2), np.zeros((1, 1)))
        free = scipy.signal.lfilter(top[0], below, np.append(between, command[-1]) - still) + still
        held = stick_slip(step, between, still, self.part.size, float(self.denominator[2]))
        return np.asarray((held - free)[::FINE])


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


def command_step(denominator: _Real) -> _Real:
    """Step of position and speed of a second-order unit on the finer clock, (2, 3).

    It multiplies position, speed and the command, which is held over the step.
    """
    _, damping, inertia = denominator
    rates = np.array([[0.0, 1.0, 0.0], [-1.0, -damping, 1.0], [0.0, 0.0, 0.0]])
    rates[1] /= inertia
    return np.asarray(scipy.linalg.expm(rates / FINE)[:2])


def stick_slip(step: _Real, between: _Real, still: float, force: float, inertia: float) -> _Real:
    """Output of a unit with friction, from rest at `still`.

    `step`, (2, 3), takes position, speed and the command of a step to the next position and speed.
    In the step in which it turns, it is followed to its reversal and from there.
    """
    (p, q, r), (s, t, o) = step.tolist()
    z, v = still, 0.0
    positions = [z]
    for command in between.tolist():
        ahead = command - z if v == 0.0 else v
        if v or abs(ahead) > force:
            driven = command - (force if ahead > 0.0 else -force)
            further, faster = p * z + q * v + r * driven, s * z + t * v + o * driven
            if faster * v < 0.0:
                until = v / (v - faster) / FINE
                further = z + 0.5 * v * until
                pull, rest, faster = command - further, 1.0 / FINE - until, 0.0
                if abs(pull) > force:
                    faster = (pull - (force if pull > 0.0 else -force)) / inertia * rest
                    further += 0.5 * faster * rest
            z, v = further, faster
        positions.append(z)
    return np.array(positions)
