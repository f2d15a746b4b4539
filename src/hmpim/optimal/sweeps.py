"""The gentlest sweep of a family: band, extinction and gain, from rest to rest.

Band edges and extinction are searched with the simplex of J. A. Nelder and R. Mead (Computer
Journal 7, 1965): three unknowns, each trial a whole stimulus with its leads, so that what
leads cost is never left out. The gain of each trial is solved exactly.
"""

import math

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import HmpimError
from hmpim.optimal.candidate import Candidate, cost_of, try_out
from hmpim.optimal.wish import Family, Step, Wish
from hmpim.stimulus import ExponentialSweep, Limits, RestToRest, Sweep, rest_to_rest

__all__ = ["best_sweep"]

FloatArray = NDArray[np.float64]

_DEAREST = 1e3  # log of the cost of what cannot be made
_DEAR = 5.0  # power of the excess over a limit, and of what the band ends too soon
_EXTINCTIONS = (0.0, 4.0)
_LENGTHS = 6  # tried until one fills the record
_LOWEST_CYCLES = 1.0  # that a sweep makes at least, as a lead needs


def best_sweep(
    wish: Wish,
    total: float,
    *,
    family: Family = "sweep",
    start: FloatArray | None = None,
    trials: int = 60,
    step: Step | None = None,
) -> Candidate | None:
    """Find the sweep that buys the accuracy most gently in `total` seconds.

    Parameters
    ----------
    wish : Wish
        What is wanted; where it is a short duration, the least share of the limits is sought.
    total : float
        Length of the record in s, leads and tail included.
    family : {'sweep', 'exponential'}
        Linear as the paper's, or exponential.
    start : ndarray, shape (3,), optional
        Shape of an earlier candidate to begin at: logarithms of first frequency and width
        of the band (Hz), extinction.
    trials : int
        At most so many from the better start, after a third as many from each.
    step : callable, optional
        Called at each trial.

    Returns
    -------
    Candidate or None
        None if no sweep of that length can be made.
    """
    search = _Search(wish, total, family, step)
    natural = wish.model.natural_frequency
    begins = [start] if start is not None else list(_starts(natural, total, family))
    first = trials if len(begins) == 1 else max(trials // 3, 5)
    found = [_descended(search, begin, first) for begin in begins]
    cost, shape = min(found, key=lambda item: item[0])
    if len(begins) > 1 and cost < _DEAREST:  # the better start alone is followed to its end
        cost, shape = min(
            (cost, shape), _descended(search, shape, trials), key=lambda item: item[0]
        )
    return None if cost >= _DEAREST else search.candidate(shape, finer=3)


def _descended(search: "_Search", begin: FloatArray, trials: int) -> tuple[float, FloatArray]:
    """Lowest cost and its shape, by a simplex that begins at a shape."""
    simplex = begin + np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.0, 0.3]])
    ended = scipy.optimize.minimize(
        search.cost,
        begin,
        method="Nelder-Mead",
        options={"maxfev": trials, "xatol": 2e-3, "fatol": 2e-4, "initial_simplex": simplex},
    )
    return float(ended.fun), np.asarray(ended.x)


def _starts(natural: float, total: float, family: Family) -> list[FloatArray]:
    """A sweep from far below the natural frequency, and one around it."""
    slowest = max(0.1 * natural, 2.0 / total)
    extinction = 1.2 if family == "sweep" else 0.8
    return [
        np.array([math.log(low), math.log(high - low), extinction])
        for low, high in (
            (slowest, max(1.2 * natural, 2.0 * slowest)),
            (0.4 * natural, 1.4 * natural),
        )
    ]


class _Search:
    """Trials of one family at one length; remembers how long the leads of the last one were."""

    def __init__(self, wish: Wish, total: float, family: Family, step: Step | None) -> None:
        self._step = step
        self._wish = wish
        self._total = total
        self._family: Family = family
        self._leads = 0.5 / wish.model.natural_frequency

    def candidate(self, shape: FloatArray, *, finer: int = 1) -> Candidate | None:
        """Stimulus of this shape that fills the record, to its last sample where leads allow.

        Where a lead hands over jumps with the length of the sweep, so that two lengths may call
        for each other in turn: the longer of those that fit is taken then.
        """
        fits, longest = None, -math.inf
        for _ in range(_LENGTHS):
            waveform = self._led(shape)
            if waveform is None:
                break
            over = waveform.duration + self._wish.tail - self._total
            if longest < over <= 1e-9:
                fits, longest = waveform, over
            if longest > -1.5 / self._wish.fs:
                break
            self._leads += over + (0.5 / self._wish.fs if over > 0 else 0.0)
        if fits is None:
            return None
        return try_out(
            fits, self._wish, family=self._family, total=self._total, shape=shape, finer=finer
        )

    def cost(self, shape: FloatArray) -> float:
        """Logarithm of what is to be small, dearer beyond the limits."""
        if self._step is not None:
            self._step()
        waveform = self._led(shape)
        if waveform is None:
            return _DEAREST
        length = waveform.duration + self._wish.tail
        self._leads += length - self._total
        tried = cost_of(waveform, self._wish, total=length)
        if tried is None:
            return _DEAREST
        use, value, short = tried
        # the record is a little too long or short: its information goes with its length
        even = 0.5 * math.log(length / self._total) + _DEAR * math.log(short)
        if self._wish.gentle == "duration":
            return math.log(use) + even
        return math.log(value) + even + _DEAR * math.log(max(use, 1.0))

    def _led(self, shape: FloatArray) -> RestToRest | None:
        low = math.exp(min(float(shape[0]), 20.0))
        high = low + math.exp(min(float(shape[1]), 20.0))
        extinction = float(shape[2])
        length = self._total - self._wish.tail - self._leads
        inside = _EXTINCTIONS[0] <= extinction <= _EXTINCTIONS[1]
        if not inside or high > 0.45 * self._wish.fs or length <= 0.0:
            return None
        core: Sweep | ExponentialSweep
        try:
            if self._family == "exponential":
                core = ExponentialSweep(band=(low, high), duration=length, extinction=extinction)
            else:
                core = Sweep(band=(low, high), duration=length, extinction=extinction)
            if core.cycles < _LOWEST_CYCLES:
                return None
            return rest_to_rest(core, limits=Limits(unit=self._wish.limits.unit), fs=self._wish.fs)
        except HmpimError:  # this shape cannot be made; the search goes round it
            return None
