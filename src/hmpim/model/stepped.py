"""The nonlinear part of a model as programs step it: from the samples alone, as they come.

`hmpim.model.nonlinear` has the whole record at hand and looks between its samples. A program has
the samples up to now: it limits the command, and turns backlash round, at the samples, and joins
the samples by straight lines where a force or friction is followed on the finer clock.
"""

from dataclasses import dataclass, replace
from math import copysign, exp

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.fine import FINE, finely
from hmpim.model.friction import Rubbing
from hmpim.model.nonlinear import NonlinearPart, forced
from hmpim.model.operators import play, power_of, rate_limited
from hmpim.model.response import RationalDelay, per_step
from hmpim.record import Intersample, is_held

__all__ = ["SteppedPart", "command_step", "kept", "stepped_part"]

_Real = NDArray[np.float64]

_State = tuple[float, float, float]
"""Position, speed, and the force apart from friction, which only a unit with a lag remembers."""


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

    @property
    def rubbing(self) -> Rubbing:
        """The dynamics within which friction acts.

        Raises
        ------
        ArgumentError
            If it cannot act in them.
        """
        if self.system.numerator.size != 1:
            raise ArgumentError(
                "friction acts within a unit without zeros; the numerator here is of degree "
                f"{self.system.numerator.size - 1}"
            )
        return Rubbing(denominator=self.denominator, lag=self.part.lag * self.fs)

    def _rubbed(self, fine: _Real) -> _Real:
        """Effect of friction, from rest: the unit stepped with it and without."""
        late, at = FINE * self.system.delay * self.fs, np.arange(fine.size)
        gain = float(self.system.numerator[0])
        command = gain * np.interp(at - late, at, fine, left=fine[0])
        between = 0.5 * (command[:-1] + command[1:])
        return _stick_slip(self.rubbing, self.part.size, float(command[0]), between)[::FINE]


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
    straight: Intersample = "zoh" if is_held(intersample) else "foh"
    return SteppedPart(part=replace(part, between=straight), system=system, fs=fs)


def command_step(unit: Rubbing) -> _Real:
    """Step of a unit on the finer clock, (k, k + 1).

    It multiplies position, speed, in third order the force, and the command, which is held over
    the step. A unit that slides moves so too, with force and command less by the friction.
    """
    rates = unit.rates()
    rates[:-1, -1] = -rates[:-1, 0]  # a command is a deflection the other way
    return np.asarray(scipy.linalg.expm(rates / FINE)[:-1])


def kept(unit: Rubbing) -> float:
    """Share of w - (command - z) that is left after a step of the finer clock, while stuck.

    It is 0 in a second-order unit, whose force has no lag; w is the force apart from friction.
    """
    return exp(-1.0 / (FINE * unit.lag)) if unit.lag else 0.0


def _stick_slip(unit: Rubbing, force: float, still: float, between: _Real) -> _Real:
    """What friction adds to the position of a unit, from rest at `still`, at each step."""
    steps = _Steps(unit, force)
    held = free = (still, 0.0, 0.0)
    added = [0.0]
    for command in between.tolist():
        held, free = steps.rubbed(held, command), steps.moved(free, command, 0.0)
        added.append(held[0] - free[0])
    return np.array(added)


class _Steps:
    """Steps of a unit on the finer clock, with friction and without."""

    def __init__(self, unit: Rubbing, force: float) -> None:
        self.unit, self.force, self.kept = unit, force, kept(unit)
        step = command_step(unit)
        order = step.shape[0]
        rows = np.zeros((3, 4))  # a second-order unit has no force of its own
        rows[:order, :order], rows[:order, 3] = step[:, :-1], step[:, -1]
        self.rows = rows.tolist()

    def moved(self, state: _State, command: float, friction: float) -> _State:
        """The state after a step against a constant friction."""
        z, v, w = state
        w, driven = w - friction, command - friction
        a, b, c = (p * z + q * v + r * w + s * driven for p, q, r, s in self.rows)
        return a, b, c + friction

    def rubbed(self, state: _State, command: float) -> _State:
        """The state after a step with friction."""
        z, v, w = state
        if v == 0.0:
            pull = command - z
            w = w if self.unit.lag else pull
            if abs(w) <= self.force:
                return z, 0.0, pull + self.kept * (w - pull)
        ahead = self.moved((z, v, w), command, copysign(self.force, v or w))
        if ahead[1] * v < 0.0:
            return self._turned(state, command, ahead)
        return ahead

    def _turned(self, state: _State, command: float, ahead: _State) -> _State:
        """The state after a step in which the unit turns: it sticks, or is pulled back.

        `ahead` is the state if friction did not turn with it.
        """
        z, v, w = state
        share = v / (v - ahead[1])
        until = share / FINE
        rest = 1.0 / FINE - until
        z += 0.5 * v * until
        pull = command - z
        w = w + share * (ahead[2] - w) if self.unit.lag else pull
        if abs(w) <= self.force:
            return z, 0.0, pull + self.kept ** (1.0 - share) * (w - pull)
        friction = copysign(self.force, w)
        v = (w - friction) / self.unit.inertia * rest
        w += (1.0 - share) * (self.moved((z, 0.0, w), command, friction)[2] - w)
        return z + 0.5 * v * rest, v, w
