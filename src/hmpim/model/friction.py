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

_PARTS = 256
"""Parts of a step, to which a reversal is known."""

_FEWEST = 32
"""Steps that are at least computed at once."""

_NONE = np.empty(0)

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


def rubbed(
    x: _Real, rubbing: Rubbing, force: float, *, margin: float = 0.0
) -> tuple[_Real, NDArray[np.bool_]]:
    """Effect of friction on the output of a unit.

    Parameters
    ----------
    x : ndarray, shape (m,)
        Output of the linear part on the finer clock, without the bias.
    rubbing : Rubbing
        The dynamics.
    force : float
        Friction, as the deflection at which the restoring force equals it.
    margin : float
        Share by which friction may be larger where the unit surely moves.

    Returns
    -------
    effect, moves : ndarrays, shape (m,)
        What friction adds to x, and whether the unit moves, with so much more friction as well.

    Examples
    --------
    >>> x = np.sin(np.linspace(0.0, 20.0, 4001))
    >>> unit = Rubbing(denominator=np.array([1.0, 0.1, 0.01]), lag=0.0)
    >>> effect, moves = rubbed(x, unit, 0.1)
    >>> bool(abs(effect[-800:]).max() < 0.2), bool(moves.all())
    (True, False)
    """
    return _Unit(x, rubbing, force, (1.0 + margin) * force).follow()


class _Unit:
    """A unit with friction, followed from one reversal to the next.

    Its state is that of z - x, and the friction, at a step.
    """

    def __init__(self, x: _Real, rubbing: Rubbing, force: float, most: float) -> None:
        self.x, self.force, self.most, self.lag = x, force, most, rubbing.lag
        self.last = x.size - 1
        rates = rubbing.rates()
        self.speed = np.gradient(x, _STEP)
        self.thrust = rubbing.inertia * np.gradient(self.speed, _STEP)  # w of the linear part
        self.pull = self._pull(rubbing, self.thrust)
        within = _powers(scipy.linalg.expm(rates * (_STEP / _PARTS)), _PARTS)
        moved = _powers(within[_PARTS], _AHEAD)
        self.within: list[_Real] = list(within)  # a list is indexed faster
        self.moved: list[_Real] = list(moved)
        self.shifts, self.speeds = (np.ascontiguousarray(moved[:, k]) for k in (0, 1))
        self.against = -self.speed  # speed of z - x at which the unit is at rest
        self.fades = np.exp(-_STEP / self.lag) if self.lag else 0.0
        self.unsure = 0  # step up to which more friction would hold the unit
        self.usual = _AHEAD  # steps from one reversal to the next, roughly
        self.effect = np.zeros(x.size)
        self.moves = np.ones(x.size, dtype=bool)

    def _pull(self, rubbing: Rubbing, thrust: _Real) -> _Real:
        """W while the unit sticks, plus its deflection, (m,), once the lag is over."""
        d = rubbing.denominator
        if not self.lag:
            return np.asarray(thrust + d[1] * self.speed + self.x)
        given = self.x + d[1] * self.speed + (d[2] / rubbing.inertia - 1.0) * thrust
        keeps = np.exp(-_STEP / self.lag)
        start = np.array([keeps * given[0]])
        late, _ = scipy.signal.lfilter([1.0 - keeps], [1.0, -keeps], given, zi=start)
        return np.asarray(thrust + late)

    def follow(self) -> tuple[_Real, NDArray[np.bool_]]:
        """The effect, and where the unit moves."""
        state = np.zeros(self.shifts.shape[1])
        if abs(self.speed[0]) <= _AT_REST * float(np.max(np.abs(self.speed))):
            at, state = self._stick(0, 0.0, float(self.x[0]), 0.0, state)
        else:
            state[-1], at = np.copysign(self.force, self.speed[0]), 0
        while at < self.last:
            at, state = self._slide(at, state)
        if at == self.last:
            self.effect[at] = state[0]
        return self.effect, self.moves

    def _slide(self, at: int, state: _Real) -> tuple[int, _Real]:
        """Follow the unit to its next reversal and from there."""
        begun, is_back = at, np.less if state.item(-1) > 0.0 else np.greater
        while True:
            ahead = min(self.usual, self.last - at)
            speeds = self.speeds[1 : ahead + 1].dot(state)
            back = is_back(speeds, self.against[at + 1 : at + 1 + ahead])
            turn = back.argmax().item()
            found = back.item(turn)
            passed = turn if found else ahead
            self.shifts[: passed + 1].dot(state, out=self.effect[at : at + passed + 1])
            state = self.moved[passed].dot(state)
            at += passed
            if found:
                self.usual = min(max(2 * (at - begun), _FEWEST), _AHEAD)
                return self._turn(at, state, speeds.item(turn) + self.speed.item(at + 1))
            if at == self.last:
                return at, state
            self.usual = min(2 * self.usual, _AHEAD)

    def _turn(self, at: int, state: _Real, beyond: float) -> tuple[int, _Real]:
        """Slide back or stick after a reversal within the next step; `beyond` is the speed then."""
        now = self.speed.item(at) + state.item(1)
        share = now / (now - beyond) if now * beyond < 0.0 else 0.0
        state = self._later(state, share)
        state[1] = -_between(self.speed, at, share)
        z, pull = _between(self.x, at, share) + state.item(0), _between(self.pull, at, share)
        w = _between(self.thrust, at, share) + state.item(2) if self.lag else pull - z
        if abs(w) <= self.force:
            return self._stick(at + 1, w - (pull - z), z, 1.0 - share, state)
        if abs(w) <= self.most and at + 1 >= self.unsure:
            self._doubt(at + 1, _NONE, at + 1, w - (pull - z), z, 1.0 - share)
        state[-1] = self.force if w > 0.0 else -self.force
        return at + 1, self._later(state, 1.0 - share)

    def _stick(
        self, at: int, excess: float, z: float, share: float, state: _Real
    ) -> tuple[int, _Real]:
        """Hold the unit at z until w exceeds the friction; the rest as for `_held`."""
        first = at
        at, now, before, sizes = self._held(first, first, excess, z, share, self.force)
        self.moves[first:at] = False
        if first >= self.unsure and self.most > self.force:
            self._doubt(at, sizes, first, excess, z, share)
        np.subtract(z, self.x[first:at], out=self.effect[first:at])
        if at == self.x.size:
            return at, state
        begin, passed, rest = at, 0.0, 0.0
        if at > first:
            begin, passed = at - 1, (self.force - abs(before)) / (abs(now) - abs(before))
            rest = 1.0 - passed
        force = self.force if now > 0.0 else -self.force
        state[0] = z - _between(self.x, begin, passed)
        state[1] = -_between(self.speed, begin, passed)
        if self.lag:
            state[2] = force - _between(self.thrust, begin, passed)
        state[-1] = force
        return at, self._later(state, rest)

    def _doubt(
        self, at: int, sizes: _Real, first: int, excess: float, z: float, share: float
    ) -> None:
        """Steps from `at` on for which more friction would hold the unit.

        `sizes`, (m,), are |w| at the first of them, as far as known; the rest is as for `_held`.
        """
        beyond = sizes > self.most
        k = beyond.argmax().item() if sizes.size else 0
        if sizes.size and beyond.item(k):
            self.unsure = at + k
        else:
            late = at + sizes.size
            self.unsure, *_ = self._held(late, first, excess, z, share, self.most)
        self.moves[at : self.unsure] = False

    def _held(
        self, at: int, first: int, excess: float, z: float, share: float, force: float
    ) -> tuple[int, float, float, _Real]:
        """Step from `at` on at which w exceeds a force, w there and before, and |w| from there on.

        The unit is held at z since `first`, `excess` is w beyond what it tended to then, and
        `share` the part of a step that had passed. The number of steps if w never exceeds it.
        """
        ahead, before = _FEWEST, force
        while at < self.x.size:
            w = self.pull[at : at + ahead] - z
            if excess:
                w += excess * self.fades ** (at - first + share + np.arange(w.size))
            sizes = np.abs(w)
            beyond = sizes > force
            k = beyond.argmax().item()
            if beyond.item(k):
                return at + k, w.item(k), w.item(k - 1) if k else before, sizes[k:]
            at += w.size
            ahead, before = 2 * ahead, w.item(-1)
        return at, 0.0, before, _NONE

    def _later(self, state: _Real, share: float) -> _Real:
        """The state after a share of a step."""
        later: _Real = self.within[round(share * _PARTS)].dot(state)
        return later


def _between(values: _Real, at: int, share: float) -> float:
    """Value a share of a step later."""
    now: float = values.item(at)
    return now + share * (values.item(at + 1) - now) if share else now


def _powers(step: _Real, most: int) -> _Real:
    """Powers of a matrix from 0 to `most`, a power of two: (most + 1, k, k)."""
    out = np.empty((most + 1, *step.shape))
    out[0] = np.eye(step.shape[0])
    out[1] = step
    known = 1
    while known < most:
        out[known + 1 : 2 * known + 1] = out[1 : known + 1] @ out[known]
        known *= 2
    return out
