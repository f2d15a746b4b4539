"""First- and second-order dynamics, stepped in time exactly for any input.

The state is a chain of one-pole links. Its step from one instant to the next is the matrix
exponential, and what the input adds on the way is an integral that is refined, by halving,
wherever the input bends or jumps.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.rigs.between import ContinuousInput

__all__ = ["Poles", "first_order", "respond", "second_order", "state_after_impulse"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_GAUSS = tuple(np.polynomial.legendre.leggauss(4))
# Lobatto's rule looks at both ends of a piece, so that no bend hides beside an edge.
_LOBATTO = (
    np.array([-1.0, -math.sqrt(3 / 7), 0.0, math.sqrt(3 / 7), 1.0]),
    np.array([0.1, 49 / 90, 32 / 45, 49 / 90, 0.1]),
)
_TOLERANCE = 1e-11  # of the input's amplitude, for each piece
_HALVINGS = 45
_BLOCK = 1 << 14  # pieces in memory at a time
_MOST_PIECES = 5000  # of one interval


@dataclass(frozen=True, slots=True, kw_only=True)
class Poles:
    """Dynamics of gain 1 at DC, by one or two stable poles in rad/s; the slower one first."""

    slow: complex
    fast: complex | None = None

    @property
    def gain(self) -> float:
        """Product of the negated poles: what makes the gain 1 at DC."""
        return -self.slow.real if self.fast is None else (self.slow * self.fast).real


def first_order(time_constant: float) -> Poles:
    """Pole of 1/(1 + s T); T in s.

    Examples
    --------
    >>> first_order(0.5).slow
    (-2+0j)
    """
    return Poles(slow=complex(-1.0 / time_constant))


def second_order(natural_frequency: float, damping_ratio: float) -> Poles:
    """Poles of ωn²/(s² + 2ζωn s + ωn²); natural frequency in Hz.

    Examples
    --------
    >>> poles = second_order(1.0, 1.25)
    >>> round(poles.slow.real / math.tau, 9), round(poles.fast.real / math.tau, 9)
    (-0.5, -2.0)
    """
    omega = math.tau * natural_frequency
    if damping_ratio > 1.0:
        fast = -omega * (damping_ratio + math.sqrt(damping_ratio**2 - 1.0))
        return Poles(slow=complex(omega**2 / fast), fast=complex(fast))
    pole = omega * complex(-damping_ratio, math.sqrt(1.0 - damping_ratio**2))
    return Poles(slow=pole, fast=pole.conjugate())


def respond(
    poles: Poles, u: ContinuousInput, *, start: float, step: float, count: int, delay: float = 0.0
) -> FloatArray:
    """Output at ``start + k step``, at rest at `start`.

    Parameters
    ----------
    poles : Poles
        The dynamics, of gain 1 at DC.
    u : ContinuousInput
        The input; at rest until it begins.
    start, step : float
        First instant and interval in s; the delayed input must still rest at `start`.
    count : int
        Number of instants n.
    delay : float
        Delay of the input in s.

    Returns
    -------
    ndarray, shape (n,)
        In the input's unit. Errs by less than 1e-9 of the amplitude.

    Raises
    ------
    ArgumentError
        If the poles are so much faster than `step`, and so lightly damped, that an interval
        would take more than 5000 pieces.

    Examples
    --------
    >>> import numpy as np
    >>> jump = ContinuousInput(
    ...     at=lambda t: np.where(t >= 0, 1.0, 0.0), rest=0.0, breaks=None
    ... )
    >>> respond(first_order(0.5), jump, start=0.0, step=0.5, count=3).round(6).tolist()
    [0.0, 0.632121, 0.864665]
    """
    added = _added_by_input(poles, u, start=start, step=step, count=count, delay=delay)
    if poles.fast is None:
        first = _one_pole(poles.slow, step, added[0])
    else:
        second = _one_pole(poles.fast, step, added[1])
        carry = state_after_impulse(poles, np.array([step]))[0, 0]
        first = _one_pole(poles.slow, step, added[0] + carry * second[:-1])
    return np.asarray(u.rest + poles.gain * first.real)


def _one_pole(pole: complex, step: float, added: ComplexArray) -> ComplexArray:
    """x[k+1] = exp(pole step) x[k] + added[k], from x[0] = 0."""
    fed = np.concatenate((np.zeros(1, dtype=np.complex128), added))
    return np.asarray(scipy.signal.lfilter([1.0], [1.0, -np.exp(pole * step)], fed))


def state_after_impulse(poles: Poles, lag: FloatArray) -> ComplexArray:
    """State at times after a unit impulse.

    Parameters
    ----------
    poles : Poles
        The dynamics; times their gain the first row is the output.
    lag : ndarray, any shape
        Times in s.

    Returns
    -------
    ndarray, shape (order, ...)

    Examples
    --------
    >>> import numpy as np
    >>> state_after_impulse(first_order(0.5), np.array([0.0, 0.5])).real.round(3).tolist()
    [[1.0, 0.368]]
    """
    slow = np.exp(poles.slow * lag)
    if poles.fast is None:
        return np.asarray(slow[np.newaxis])
    # (e^(p1 t) - e^(p2 t)) / (p1 - p2), good for equal poles too.
    apart = (poles.fast - poles.slow) * lag
    tiny = np.abs(apart) < 1e-8
    ratio = np.where(tiny, 1.0 + 0.5 * apart, np.expm1(apart) / np.where(tiny, 1.0, apart))
    return np.stack((slow * lag * ratio, np.exp(poles.fast * lag)))


def _added_by_input(
    poles: Poles, u: ContinuousInput, *, start: float, step: float, count: int, delay: float
) -> ComplexArray:
    """What the input adds to the state over each interval; shape (order, count - 1)."""
    order = 1 if poles.fast is None else 2
    added = np.zeros((order, count - 1), dtype=np.complex128)
    if count < 2:
        return added
    breaks = np.empty(0) if u.breaks is None else u.breaks + delay - start
    interval, left, right = _pieces(poles, breaks, step, count)
    nodes, weights = _LOBATTO if u.breaks is None else _GAUSS
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    # How much an error of each state weighs in the output.
    weight = np.array([poles.gain, math.sqrt(abs(poles.gain))][:order])[:, np.newaxis]
    largest = 0.0

    def integral(k: NDArray[np.int64], a: FloatArray, b: FloatArray) -> ComplexArray:
        nonlocal largest
        offset = a[:, np.newaxis] + nodes * (b - a)[:, np.newaxis]
        at = (start - delay) + k[:, np.newaxis] * step + offset
        moved = u.at(at.ravel()).reshape(at.shape) - u.rest
        largest = max(largest, float(np.abs(moved).max()))
        if np.ptp(a) == 0.0 and np.ptp(b) == 0.0:  # as most are: one kernel serves all
            kernel = state_after_impulse(poles, step - offset[0])
            return np.asarray((kernel * weights) @ moved.T * (b - a))
        kernel = state_after_impulse(poles, step - offset)
        return np.asarray(np.einsum("spq,pq,q->sp", kernel, moved, weights) * (b - a))

    for block in range(0, interval.size, _BLOCK):
        part = slice(block, block + _BLOCK)
        k, a, b = interval[part], left[part], right[part]
        coarse = integral(k, a, b)
        for _ in range(_HALVINGS):
            middle = 0.5 * (a + b)
            halves = integral(k, a, middle), integral(k, middle, b)
            fine = halves[0] + halves[1]
            error = (weight * np.abs(fine - coarse)).max(axis=0)
            rough = error > _TOLERANCE * largest
            for s in range(order):
                np.add.at(added[s], k[~rough], fine[s, ~rough])
            if not rough.any():
                break
            k, a, middle, b = k[rough], a[rough], middle[rough], b[rough]
            coarse = np.concatenate((halves[0][:, rough], halves[1][:, rough]), axis=1)
            k, a, b = np.tile(k, 2), np.concatenate((a, middle)), np.concatenate((middle, b))
        else:
            for s in range(order):
                np.add.at(added[s], k, coarse[s])
    return added


def _pieces(
    poles: Poles, breaks: FloatArray, step: float, count: int
) -> tuple[NDArray[np.int64], FloatArray, FloatArray]:
    """Interval, left and right edge (s from the interval's start) of every piece.

    The pieces are short against the poles' time, as far back as the poles remember, and the
    known breaks of the input lie on their edges.
    """
    fastest = abs(poles.slow if poles.fast is None else poles.fast)
    memory = min(step, 40.0 / -poles.slow.real)
    needed = max(1, math.ceil(memory * fastest))
    if needed > _MOST_PIECES:
        raise ArgumentError(
            f"poles of {fastest / math.tau:.4g} Hz are too fast for instants {step:.4g} s apart "
            f"({needed} pieces for each, {_MOST_PIECES} at most); leave such dynamics out, "
            "or sample faster"
        )
    edges = step - np.linspace(memory, 0.0, needed + 1)[:-1]
    if memory < step:
        edges = np.concatenate(([0.0], edges))
    edges[0] = 0.0
    interval = np.repeat(np.arange(count - 1), edges.size)
    left = np.tile(edges, count - 1)
    at = np.floor(breaks / step).astype(np.int64)
    inside = (at >= 0) & (at < count - 1)
    if inside.any():
        interval = np.concatenate((interval, at[inside]))
        left = np.concatenate((left, np.clip(breaks[inside] - at[inside] * step, 0.0, step)))
        order = np.lexsort((left, interval))
        interval, left = interval[order], left[order]
    right = np.append(left[1:], step)
    right[np.append(np.diff(interval) > 0, True)] = step
    longer = right > left
    return interval[longer], left[longer], right[longer]
