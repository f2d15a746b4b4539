"""What is not linear, as operators on a signal: each output follows from the past of its input.

A clock is not part of them: speeds and gaps are those of the signal's own samples. On the finer
clock of `hmpim.model.fine` they are near enough to what happens between the samples of a record.
"""

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.model.fine import FINE
from hmpim.model.poles import rational_response
from hmpim.model.sampled import prepare_input

__all__ = [
    "command_step",
    "gap_crossed",
    "play",
    "power_of",
    "pushed",
    "rate_limited",
    "reversals",
    "rubbed",
    "stick_slip",
]

_Real = NDArray[np.float64]


def reversals(x: _Real) -> NDArray[np.intp]:
    """Reversals of a signal, and its end: only there must the output of backlash be computed."""
    way = np.sign(np.diff(x))
    return np.asarray(np.append(np.flatnonzero(way[1:] * way[:-1] <= 0.0) + 1, x.size - 1))


def play(x: _Real, half_gap: float, turns: NDArray[np.intp] | None = None) -> _Real:
    """Output of backlash: it follows `x`, (n,), half a gap behind, and waits at each reversal.

    Examples
    --------
    >>> play(np.array([0.0, 1.0, 2.0, 1.5, 0.0]), 0.5).tolist()
    [0.0, 0.5, 1.5, 1.5, 0.5]
    """
    turns = reversals(x) if turns is None else turns
    before, now = [], float(x[0])
    for turn in x[turns].tolist():
        before.append(now)
        now = min(max(now, turn - half_gap), turn + half_gap)
    held = np.repeat(before, np.diff(turns, prepend=-1))
    return np.asarray(np.clip(held, x - half_gap, x + half_gap))


def gap_crossed(x: _Real, half_gap: float) -> NDArray[np.bool_]:
    """Samples from which on `x`, (n,), has been so far to either side that its play is known.

    Examples
    --------
    >>> gap_crossed(np.array([0.0, 0.5, -0.5, 0.0]), 0.5).tolist()
    [False, False, True, True]
    """
    return np.asarray(np.maximum.accumulate(x) - np.minimum.accumulate(x) >= 2.0 * half_gap)


def rate_limited(x: _Real, step: float) -> _Real:
    """Follow `x`, moving by no more than `step` from sample to sample.

    Examples
    --------
    >>> rate_limited(np.array([0.0, 3.0, 3.0, 3.0]), 1.0).tolist()
    [0.0, 1.0, 2.0, 3.0]
    """
    target, reached = x.tolist(), 0
    out, late = x.copy(), target.copy()
    fast = np.flatnonzero(np.abs(np.diff(x)) > step).tolist()
    for lost in fast:
        if lost < reached:
            continue  # already behind
        now = target[lost]
        for reached in range(lost + 1, len(target)):  # until it has caught up
            ahead = target[reached] - now
            if ahead > step:
                now += step
            elif ahead < -step:
                now -= step
            else:
                break
            late[reached] = now
        else:
            break
    for begin in fast[:1]:
        out[begin : reached + 1] = late[begin : reached + 1]
    return out


def rubbed(
    fine: _Real, *, delay: float, denominator: _Real, gain: float, force: float
) -> tuple[_Real, _Real, NDArray[np.bool_]]:
    """Output of a second-order unit with Coulomb friction, and without, from rest.

    Parameters
    ----------
    fine : ndarray, shape (m,)
        Its command on the finer clock.
    delay, denominator, gain : float, ndarray of shape (3,), float
        Pure delay in samples, dynamics by rising powers of s per sample, and scale factor.
    force : float
        Friction, as the deflection at which the restoring force equals it.

    Returns
    -------
    rubbed, free, moves : ndarrays, shape (m,)
        Output with friction and without, and whether it moves.
    """
    at = np.arange(fine.size)
    command = gain * np.interp(at - FINE * delay, at, fine, left=fine[0])
    between = 0.5 * (command[:-1] + command[1:])
    step, still = command_step(denominator), command[0]
    top, below = scipy.signal.ss2tf(step[:, :2], step[:, 2:], np.eye(1, 2), np.zeros((1, 1)))
    free = scipy.signal.lfilter(top[0], below, np.append(between, command[-1]) - still) + still
    held, moves = stick_slip(step, between, still, force, float(denominator[2]))
    return held, free, moves


def command_step(denominator: _Real) -> _Real:
    """Step of position and speed of a second-order unit on the finer clock, (2, 3).

    It multiplies position, speed and the command, which is held over the step.
    """
    _, damping, inertia = denominator
    rates = np.array([[0.0, 1.0, 0.0], [-1.0, -damping, 1.0], [0.0, 0.0, 0.0]])
    rates[1] /= inertia
    return np.asarray(scipy.linalg.expm(rates / FINE)[:2])


def stick_slip(
    step: _Real, between: _Real, still: float, force: float, inertia: float
) -> tuple[_Real, NDArray[np.bool_]]:
    """Output of a unit with friction, and whether it moves, from rest at `still`.

    `step`, (2, 3), takes position, speed and the command of a step to the next position and speed.
    In the step in which it turns, it is followed to its reversal and from there.
    """
    (p, q, r), (s, t, o) = step.tolist()
    z, v = still, 0.0
    positions, moving = [z], [False]
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
        moving.append(v != 0.0)
    return np.array(positions), np.array(moving)


def pushed(forces: _Real, denominator: _Real) -> _Real:
    """Deflections of dynamics 1/A, without delay, by forces, (..., n); at rest before them.

    The denominator is by rising powers of s per sample of the forces.
    """
    first = forces[..., :1]
    source = prepare_input(forces - first, "foh")
    answer = rational_response(source, delay=0.0, numerator=np.ones(1), denominator=denominator)
    return np.asarray(answer + first)


def power_of(x: _Real, power: int, largest: float) -> _Real:
    """A power of a signal, equal to the signal where that is `largest`.

    Examples
    --------
    >>> power_of(np.array([1.0, 2.0, -4.0]), 2, 2.0).tolist()
    [0.5, 2.0, 8.0]
    """
    return np.asarray(largest * (x / largest) ** power)
