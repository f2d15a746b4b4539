"""Coulomb friction within a unit: what a constant force against the motion adds to its output.

x is the output of the linear part, z that of the unit with friction, its dynamics are
D = 1 + d₁s + d₂s² (+ d₃s³), and F is the friction as a deflection::

    D z = command - (1 + τs) F sign ż

τ is the lag between the command and the force, such as that of a motor's current or a valve: it
delays what restores the unit, not the friction. A second-order unit has none. With α = d₂, or d₃/τ
with a lag, the force apart from friction is w::

    α z̈ = w - F sign ż          τ ẇ = command - z - d₁ż - (d₂/α)w - (1 - d₂/α) F sign ż

While the unit slides, the force is constant, and z - x moves as the linear unit does from any
state: in closed form up to the next reversal. While it sticks, z is constant and w approaches
command - z; the unit moves again once |w| exceeds F.
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.fine import FINE

__all__ = ["Rubbing", "rubbed"]

_Real = NDArray[np.float64]

_AHEAD = 512
"""Steps that are computed at once."""

_STEP = 1.0 / FINE

_PARTS = 16
"""Parts of a step, between which the motion is taken as straight."""

_AT_REST = 1e-3
"""Speed below which a unit is at rest at the start, over its greatest."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Rubbing:
    """Dynamics of a unit with friction, per sample.

    Parameters
    ----------
    denominator : ndarray, shape (3,) or (4,)
        By rising powers of s per sample, 1 first.
    lag : float
        Between command and force, in samples; 0 for a second-order unit.

    Raises
    ------
    ArgumentError
        If friction cannot act in such dynamics.
    """

    denominator: _Real
    lag: float

    def __post_init__(self) -> None:
        order = self.denominator.size - 1
        if order not in (2, 3):
            raise ArgumentError(
                "friction acts within a unit of second or third order; the denominator here is of "
                f"degree {order}"
            )
        if self.denominator[0] != 1.0:
            raise ArgumentError("friction acts within a unit that returns to its command")
        if (self.lag > 0.0) != (order == 3):
            raise ArgumentError(
                f"lag = {self.lag:g} samples of the force: it must be positive in a unit of third "
                "order, and 0 in one of second order"
            )

    @property
    def inertia(self) -> float:
        """α: force over acceleration."""
        return float(self.denominator[-1] / (self.lag or 1.0))

    def rates(self) -> _Real:
        """Derivatives of z - x, its speed, w less that of x, and the friction, (k, k)."""
        alpha, d = self.inertia, self.denominator
        if not self.lag:
            return np.array(
                [[0.0, 1.0, 0.0], [-1.0 / alpha, -d[1] / alpha, -1.0 / alpha], [0.0] * 3]
            )
        share = d[2] / alpha
        force = np.array([-1.0, -d[1], -share, share - 1.0]) / self.lag
        speed = np.array([0.0, 0.0, 1.0, -1.0]) / alpha
        return np.stack([[0.0, 1.0, 0.0, 0.0], speed, force, [0.0] * 4])


def rubbed(x: _Real, rubbing: Rubbing, force: float) -> tuple[_Real, NDArray[np.bool_]]:
    """Effect of friction on the output of a unit.

    Parameters
    ----------
    x : ndarray, shape (m,)
        Output of the linear part on the finer clock, without the bias.
    rubbing : Rubbing
        The dynamics.
    force : float
        Friction, as the deflection at which the restoring force equals it.

    Returns
    -------
    effect, moves : ndarrays, shape (m,)
        What friction adds to x, and whether the unit moves.

    Examples
    --------
    >>> x = np.sin(np.linspace(0.0, 20.0, 4001))
    >>> unit = Rubbing(denominator=np.array([1.0, 0.1, 0.01]), lag=0.0)
    >>> effect, moves = rubbed(x, unit, 0.1)
    >>> bool(abs(effect[-800:]).max() < 0.2), bool(moves.all())
    (True, False)
    """
    return _Unit(x, rubbing, force).follow()


class _Unit:
    """A unit with friction, followed from one reversal to the next."""

    def __init__(self, x: _Real, rubbing: Rubbing, force: float) -> None:
        self.x, self.force, self.lag = x, force, rubbing.lag
        self.rates = rubbing.rates()
        self.speed = np.gradient(x, _STEP)
        self.thrust = rubbing.inertia * np.gradient(self.speed, _STEP)  # w of the linear part
        self.pull = self._pull(rubbing)
        self.moved = _powers(scipy.linalg.expm(self.rates * _STEP))
        parts = np.arange(_PARTS + 1)[:, None, None] * _STEP / _PARTS
        self.within = scipy.linalg.expm(self.rates * parts)
        self.fades = np.exp(-_STEP / self.lag) if self.lag else 0.0
        self.effect = np.zeros(x.size)
        self.moves = np.zeros(x.size, dtype=bool)

    def _pull(self, rubbing: Rubbing) -> _Real:
        """W while the unit sticks, plus its deflection, (m,), once the lag is over."""
        d = rubbing.denominator
        if not self.lag:
            return np.asarray(self.thrust + d[1] * self.speed + self.x)
        given = self.x + d[1] * self.speed + (d[2] / rubbing.inertia - 1.0) * self.thrust
        keeps = np.exp(-_STEP / self.lag)
        start = np.array([keeps * given[0]])
        late, _ = scipy.signal.lfilter([1.0 - keeps], [1.0, -keeps], given, zi=start)
        return np.asarray(self.thrust + late)

    def follow(self) -> tuple[_Real, NDArray[np.bool_]]:
        """The effect, and where the unit moves."""
        state = np.zeros(self.rates.shape[0])
        if abs(self.speed[0]) <= _AT_REST * float(np.max(np.abs(self.speed))):
            at = self._stick(0, 0.0, float(self.x[0]), 0.0, state)
        else:
            state[-1], at = np.copysign(self.force, self.speed[0]), 0
        while at < self.x.size - 1:
            at = self._slide(at, state)
        if at < self.x.size:
            self.effect[-1], self.moves[-1] = state[0], True
        return self.effect, self.moves

    def _slide(self, at: int, state: _Real) -> int:
        """Follow the unit to its next reversal and from there; `state` is changed in place.

        The first and the last value are steps at which the state is known.
        """
        most, sign = self.x.size - 1, np.sign(state[-1])
        while True:
            ahead = min(_AHEAD, most - at)
            speeds = self.moved[1 : ahead + 1, 1] @ state + self.speed[at + 1 : at + 1 + ahead]
            back = speeds * sign < 0.0
            turn = int(back.argmax())
            found = bool(back[turn])
            passed = turn if found else ahead
            self.effect[at : at + passed + 1] = self.moved[: passed + 1, 0] @ state
            self.moves[at : at + passed + 1] = True
            state[:] = self.moved[passed] @ state
            at += passed
            if found:
                return self._turn(at, state, float(speeds[turn]))
            if at == most:
                return at

    def _turn(self, at: int, state: _Real, beyond: float) -> int:
        """Slide back or stick after a reversal within the next step; `beyond` is the speed then."""
        now = float(self.speed[at] + state[1])
        share = now / (now - beyond) if now * beyond < 0.0 else 0.0
        state += share * (self.moved[1] @ state - state)
        x, speed, thrust, pull = self._between(at, share)
        state[1] = -speed
        z = x + float(state[0])
        w = thrust + float(state[2]) if self.lag else pull - z
        if abs(w) <= self.force:
            return self._stick(at + 1, w - (pull - z), z, 1.0 - share, state)
        state[-1] = np.copysign(self.force, w)
        self._move(state, 1.0 - share)
        return at + 1

    def _stick(self, at: int, excess: float, z: float, share: float, state: _Real) -> int:
        """Hold the unit at z until w exceeds the friction.

        `excess` is w beyond what it tends to, `share` the part of a step that has passed since.
        """
        first, ahead = at, _AHEAD // 4
        while True:
            ahead = min(2 * ahead, self.x.size - at)
            w = self.pull[at : at + ahead] - z
            if excess:
                w += excess * self.fades ** (at - first + share + np.arange(ahead))
            beyond = np.abs(w) > self.force
            k = int(beyond.argmax())
            if beyond[k]:
                break
            at += ahead
            if at == self.x.size:
                self.effect[first:] = z - self.x[first:]
                return at
        at += k
        self.effect[first:at] = z - self.x[first:at]
        before = float(w[k - 1]) if k else self.force
        passed = (self.force - abs(before)) / (abs(float(w[k])) - abs(before)) if k else 1.0
        x, speed, thrust, _ = self._between(at - 1 if k else at, passed if k else 0.0)
        sign = np.sign(w[k])
        state[:2] = z - x, -speed
        state[2:-1] = sign * self.force - thrust
        state[-1] = sign * self.force
        self._move(state, 1.0 - passed)
        return at

    def _between(self, at: int, share: float) -> list[float]:
        """x, speed, thrust and pull between a step and the next."""
        after = min(at + 1, self.x.size - 1)
        every = (self.x, self.speed, self.thrust, self.pull)
        return [float(known[at] + share * (known[after] - known[at])) for known in every]

    def _move(self, state: _Real, share: float) -> None:
        """Move the state, in place, by a share of a step."""
        part = min(int(share * _PARTS), _PARTS - 1)
        first, second = self.within[part : part + 2]
        state[:] = (first + (share * _PARTS - part) * (second - first)) @ state


def _powers(step: _Real) -> _Real:
    """Powers of a matrix from 0 to `_AHEAD`, (_AHEAD + 1, k, k)."""
    out = np.empty((_AHEAD + 1, *step.shape))
    out[0] = np.eye(step.shape[0])
    out[1] = step
    known = 1
    while known < _AHEAD:
        out[known + 1 : 2 * known + 1] = out[1 : known + 1] @ out[known]
        known *= 2
    return out
