"""What a model has besides its linear part: one nonlinearity, and its effect on the output.

x is the output of the linear part, 1/A the dynamics, z the whole output, each without the bias:

=====================  =============================================================
rate_limit             the command is followed at no more than a speed
dead_zone              the command does nothing within half a width
friction               a unit of second or third order with a constant force against its motion
hardening, softening   z = x -+ (1/A) z^3: a spring force beyond proportion, or below
asymmetry              the same with z^2, or x + x^2
curvature              x + x^3: a scale that changes with the deflection
backlash               the play operator behind the unit
=====================  =============================================================

The rows that `hmpim.identify` fits (`hmpim.identify.nonlinear.rows`) are these effects for size 1.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.driven import driven
from hmpim.model.fine import FINE, finely, joined, sampled
from hmpim.model.friction import Rubbing, rubbed
from hmpim.model.operators import play, power_of, rate_limited
from hmpim.model.response import RationalDelay, per_step
from hmpim.model.sampled import SampledInput, companion, prepare_input
from hmpim.record import Intersample

__all__ = [
    "KIND_WORDS",
    "Kind",
    "NonlinearPart",
    "Place",
    "excursion",
    "farthest",
    "followed_command",
    "force_step",
    "forced",
    "friction",
    "nonlinear_effect",
]

_Real = NDArray[np.float64]

Kind = Literal[
    "hardening",
    "softening",
    "friction",
    "backlash",
    "rate_limit",
    "saturation",
    "asymmetry",
    "curvature",
    "dead_zone",
]

KIND_WORDS: dict[Kind, str] = {
    "hardening": "a hardening spring",
    "softening": "a softening spring",
    "friction": "Coulomb friction",
    "backlash": "backlash",
    "rate_limit": "a rate limit",
    "saturation": "clipping",
    "asymmetry": "an asymmetric response",
    "dead_zone": "a dead zone of the command",
    "curvature": "a scale factor that changes with the deflection",
}

Place = Literal["command", "force", "output"]
"""Where a nonlinearity acts: in front of the dynamics, within them, or behind them."""

_POWERS: dict[Kind, int] = {"hardening": 3, "softening": 3, "asymmetry": 2, "curvature": 3}
"""Powers of the deflection."""

_FARTHEST = 10.0
"""Deflection, over the largest that a force is known up to, at which it is given up as unstable."""

_STEPS = 50
"""Newton steps after which a force that changes by half an ulp must have settled."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NonlinearPart:
    """One nonlinearity of a unit, next to its linear part.

    Parameters
    ----------
    kind : str
        Its kind; `words` says it in English.
    at : {'command', 'force', 'output'}
        Where it acts.
    size, std : float
        Half of the gap of backlash, or the deflection at which the restoring force equals friction,
        in the output's unit; half the width of a dead zone in the input's; greatest speed, in the
        input's unit per s. Otherwise the share by which the force, or the output, at a deflection
        of `reach` departs from proportion. And its standard deviation.
    reach : float
        How far it was identified: the largest deflection of the output in the record, without the
        bias. The largest command of a dead zone, and the largest speed of a command whose speed is
        limited.
    between : {'zoh', 'foh', 'bandlimited'}
        What its command does between its samples.
    lag : float
        Of friction, between the command and the force that moves the unit, s: 0 in a unit of second
        order.

    Raises
    ------
    ArgumentError
        If the size is not that of its kind, the reach is not positive, or a lag is not that of
        friction.

    Examples
    --------
    >>> gap = NonlinearPart(kind="backlash", at="output", size=0.1, std=0.01, reach=2.0)
    >>> gap.words, NonlinearPart.from_dict(gap.to_dict()) == gap
    ('backlash', True)
    """

    kind: Kind
    at: Place
    size: float
    std: float
    reach: float
    between: Intersample = "bandlimited"
    lag: float = 0.0

    def __post_init__(self) -> None:
        if self.kind not in KIND_WORDS or self.kind == "saturation":
            raise ArgumentError(f"kind = {self.kind!r} is not a nonlinearity that a model can have")
        signed = self.kind in ("asymmetry", "curvature")
        if not np.isfinite(self.size) or (self.size <= 0.0 and not signed):
            raise ArgumentError(f"size = {self.size!r} of {self.words} must be more than 0")
        if not (np.isfinite(self.reach) and self.reach > 0.0):
            raise ArgumentError(f"reach = {self.reach!r} of {self.words} must be more than 0")
        known = np.isfinite(self.lag) and self.lag >= 0.0
        if not known or (self.lag and self.kind != "friction"):
            raise ArgumentError(
                f"lag = {self.lag!r} s of {self.words} must be 0, or positive with friction"
            )

    @property
    def words(self) -> str:
        """The kind in words."""
        return KIND_WORDS[self.kind]

    @property
    def weight(self) -> float:
        """Weight of the power of the deflection in the output, or against the force."""
        return -self.size if self.kind == "softening" else self.size

    @property
    def power(self) -> int:
        """Power of the deflection."""
        return _POWERS[self.kind]

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return asdict(self)

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "NonlinearPart":
        """Read back what `to_dict` wrote."""
        return cls(**data)


def followed_command(part: NonlinearPart, u: _Real, fs: float) -> _Real:
    """The command at the samples, (n,), as a unit of limited speed follows it.

    It is followed on the finer clock, and low-passed at half the sampling rate `fs` in Hz.
    """
    return sampled(rate_limited(finely(u, part.between), part.size / (FINE * fs)))


def nonlinear_effect(
    part: NonlinearPart, system: RationalDelay, u: _Real, source: SampledInput, fs: float
) -> _Real:
    """What a nonlinearity adds to the output of the linear part.

    Parameters
    ----------
    part : NonlinearPart
        The nonlinearity; a limited speed adds nothing here, see `followed_command`.
    system : RationalDelay
        The linear part.
    u : ndarray, shape (n,)
        Input samples.
    source : SampledInput
        The same, prepared for the linear part.
    fs : float
        Rate in Hz.

    Returns
    -------
    ndarray, shape (n,)
        In the output's unit.

    Raises
    ------
    ArgumentError
        If the dynamics are none in which it can act, or a force does not bring the unit back.
    """
    if part.kind == "rate_limit":
        return np.zeros(u.size)
    if part.kind == "dead_zone":
        inside = sampled(np.clip(finely(u, part.between), -part.size, part.size))
        return -driven(system, prepare_input(inside, "bandlimited"), fs)
    if part.at == "output" and part.kind != "backlash":
        return part.weight * power_of(driven(system, source, fs), part.power, part.reach)
    if part.kind == "friction":
        return friction(part, system, source, fs)
    x = _driven_finely(system, source, fs)
    if part.kind == "backlash":
        return np.asarray((play(x, part.size) - x)[::FINE])
    return forced(part, per_step(system.denominator, fs), x)


def excursion(
    part: NonlinearPart, system: RationalDelay, u: _Real, fs: float, intersample: Intersample
) -> float:
    """How far an input, (n,), takes the unit, to be compared with `part.reach`.

    Raises
    ------
    ArgumentError
        As `nonlinear_effect` does.
    """
    if part.at == "command":
        fine = finely(u, part.between)
        if part.kind == "rate_limit":
            return float(np.max(np.abs(np.diff(fine)))) * FINE * fs
        return float(np.max(np.abs(fine)))
    source = prepare_input(u, intersample)
    z = driven(system, source, fs)
    effect = nonlinear_effect(part, system, u, source, fs) if part.at == "force" else None
    return farthest(part, z, effect)


def farthest(part: NonlinearPart, linear: _Real, effect: _Real | None) -> float:
    """Largest deflection by a part that is not in front of the dynamics, from what it adds."""
    if effect is None or part.at != "force" or part.kind == "friction":
        return float(np.max(np.abs(linear)))
    return float(np.max(np.abs(linear + effect)))


def friction(part: NonlinearPart, system: RationalDelay, source: SampledInput, fs: float) -> _Real:
    """Effect of friction at the samples, at a rate in Hz.

    Raises
    ------
    ArgumentError
        If the dynamics are not those of a unit of second or third order that returns to its
        command.
    """
    below = per_step(system.denominator, fs)
    unit = Rubbing(denominator=below / (below[0] or 1.0), lag=part.lag * fs)
    effect, _ = rubbed(_driven_finely(system, source, fs), unit, part.size)
    return np.asarray(effect[::FINE])


def _driven_finely(system: RationalDelay, source: SampledInput, fs: float) -> _Real:
    """Output of the linear part on the finer clock."""
    parts = [driven(system, source, fs, early=k / FINE) for k in range(FINE)]
    return joined(np.stack(parts, axis=1))


def forced(part: NonlinearPart, denominator: _Real, x: _Real) -> _Real:
    """Effect of a force by a power of the whole output, at the samples.

    The linear part `x` is on the finer clock, and the denominator by rising powers of s per sample.

    The force is straight over each step, so that its end depends on the deflection there: a
    scalar equation, which Newton's method solves.
    """
    if denominator[0] == 0.0:
        raise ArgumentError(f"{part.words} needs a restoring force, which an integrator lacks")
    step, first, last = force_step(denominator)
    now, level = _settled(part, float(x[0]), 0.0, 1.0)
    state = [0.0] * len(first)
    out = [now - float(x[0])]
    force = 0.0  # above that at rest
    for target in x[1:].tolist():
        state = [
            sum(a * s for a, s in zip(row, state, strict=True)) + b * force
            for row, b in zip(step, first, strict=True)
        ]
        known = state[0] if state else 0.0
        gain = last[0] if state else 1.0
        now, whole = _settled(part, target + level + known - gain * level, now, gain)
        force = whole - level
        for i, share in enumerate(last if state else ()):
            state[i] += share * force
        out.append(now - target)
    return np.array(out[::FINE])


def force_step(denominator: _Real) -> tuple[list[list[float]], list[float], list[float]]:
    """Step of the states of 1/A, deflection first, under a force that is straight over it.

    It is one of the finer clock; the denominator is by rising powers of s per sample. The second
    and third value multiply the force at its beginning and at its end.
    """
    below = per_step(denominator, FINE)
    order = below.size - 1
    if not order:
        return [], [], []
    moved = scipy.linalg.expm(companion(below, 2))[:order]
    held, rising = moved[:, order], moved[:, order + 1]
    return moved[:, :order].tolist(), (held - rising).tolist(), rising.tolist()


def _settled(part: NonlinearPart, known: float, near: float, gain: float) -> tuple[float, float]:
    """Deflection z = known + gain f(z), by Newton's method from nearby, and the force f(z)."""
    weight, power, reach = part.weight, part.power, part.reach
    z, limit = near, _FARTHEST * reach
    for _ in range(_STEPS):
        share = z / reach
        force = -weight * reach * share**power
        slope = 1.0 + gain * weight * power * share ** (power - 1)
        change = (known + gain * force - z) / slope if slope > 0.0 else np.inf
        z += change
        if not abs(z) < limit:
            break
        if abs(change) <= 1e-12 * reach:
            return z, -weight * reach * (z / reach) ** power
    raise ArgumentError(
        f"{part.words}, known up to a deflection of {reach:.4g}, does not bring the unit back from "
        f"{abs(near):.4g}; keep the input smaller"
    )
