"""Model exchange: the equations of an FMU integrated here, its events found and handled.

FMPy's own loop holds an input between its samples while the solver steps past them, which moves
the answer by a part of a sample. Here the input is joined linearly, and the solver begins anew at
each sample, where the input bends.
"""

from collections.abc import Callable
from ctypes import POINTER, c_double
from functools import partial
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import RigError

__all__ = ["exchanged"]

FloatArray = NDArray[np.float64]

_EVENTS = 1000  # in one interval; more never end


def exchanged(
    fmu: Any,
    described: Any,
    fed: FloatArray,
    *,
    fs: float,
    taken: int,
    read: int,
    tolerance: float,
) -> FloatArray:
    """Output at k/fs of an FMU whose initialisation is over, the input joined linearly.

    Parameters
    ----------
    fmu : FMU2Model or FMU3Model of FMPy
        In event mode.
    described : ModelDescription of FMPy
        How many states and event indicators there are.
    fed : ndarray, shape (n,)
        Input at k/fs.
    fs : float
        Rate in Hz.
    taken, read : int
        Value references of input and output.
    tolerance : float
        Relative, of DOP853.

    Raises
    ------
    RigError
        If the FMU ends the simulation, the integration fails, or events do not end.
    """
    equations = _Equations(fmu, described, taken=taken, read=read)
    equations.settle()
    values = np.empty(fed.size)
    times = np.arange(fed.size) / fs
    for k in range(fed.size):
        if k:
            line = (times[k - 1], fed[k - 1], (fed[k] - fed[k - 1]) * fs)
            equations.advance(times[k - 1], times[k], line, tolerance)
        else:
            equations.put(0.0, fed[0])
        values[k] = equations.value()
    return values


class _Equations:
    """States and derivatives of an FMU as arrays, in either version of FMI."""

    def __init__(self, fmu: Any, described: Any, *, taken: int, read: int) -> None:
        two = hasattr(fmu, "getReal")
        self._fmu = fmu
        self._taken, self._read = [taken], [read]
        self._set, self._get = (
            (fmu.setReal, fmu.getReal) if two else (fmu.setFloat64, fmu.getFloat64)
        )
        self._slopes = fmu.getDerivatives if two else fmu.getContinuousStateDerivatives
        self._update = fmu.newDiscreteStates if two else fmu.updateDiscreteStates
        self._states = _Vector(described.numberOfContinuousStates)
        self._derivatives = _Vector(self._states.array.size)
        self._indicators = _Vector(described.numberOfEventIndicators)
        self._due: float | None = None

    def settle(self) -> None:
        """Leave event mode, once nothing discrete changes any more."""
        for _ in range(_EVENTS):
            again, ended, _, _, defined, due = self._update()
            if ended:
                raise RigError("the FMU ended the simulation")
            if not again:
                self._due = due if defined else None
                self._fmu.enterContinuousTimeMode()
                if self._states.array.size:
                    self._fmu.getContinuousStates(*self._states.call)
                return
        raise RigError(f"more than {_EVENTS} discrete updates at one instant")

    def put(self, time: float, value: float) -> None:
        """Set time, input and states."""
        self._fmu.setTime(time)
        self._set(self._taken, [float(value)])
        if self._states.array.size:
            self._fmu.setContinuousStates(*self._states.call)

    def value(self) -> float:
        """Output as things stand."""
        return float(self._get(self._read)[0])

    def advance(
        self, start: float, end: float, line: tuple[float, float, float], tolerance: float
    ) -> None:
        """Go from one sample to the next, over all events between them."""
        begin, level, slope = line

        def fed(t: float) -> float:
            return level + slope * (t - begin)

        time = start
        for _ in range(_EVENTS):
            until = end if self._due is None else min(end, max(self._due, time))
            time, happened = self._integrated(time, until, fed, tolerance)
            self.put(time, fed(time))
            wished, ended = self._fmu.completedIntegratorStep()
            if ended:
                raise RigError(f"the FMU ended the simulation at {time:.6g} s")
            if happened or wished or (self._due is not None and time >= self._due):
                self._fmu.enterEventMode()
                self.settle()
            if time >= end:
                return
        raise RigError(f"more than {_EVENTS} events between {start:.6g} s and {end:.6g} s")

    def _integrated(
        self, start: float, end: float, fed: Callable[[float], float], tolerance: float
    ) -> tuple[float, bool]:
        """Integrate to the end or to the first event; return where, and whether it is one."""
        if end <= start:
            return end, False
        if not self._states.array.size:
            return end, False

        def slopes(t: float, x: FloatArray) -> FloatArray:
            self._states.array[:] = x
            self.put(t, fed(t))
            self._slopes(*self._derivatives.call)
            return self._derivatives.array.copy()

        def indicators(t: float, x: FloatArray) -> FloatArray:
            self._states.array[:] = x
            self.put(t, fed(t))
            self._fmu.getEventIndicators(*self._indicators.call)
            return self._indicators.array.copy()

        watched = self._indicators.array.size > 0
        solver = scipy.integrate.DOP853(
            slopes, start, self._states.array.copy(), end, rtol=tolerance,
            atol=1e-3 * tolerance, first_step=end - start,
        )  # fmt: skip
        before = indicators(start, solver.y) if watched else np.empty(0)
        while solver.status == "running":
            past = solver.t
            said = solver.step()
            if said is not None:
                raise RigError(f"its equations cannot be integrated past {past:.6g} s: {said}")
            if watched:
                after = indicators(solver.t, solver.y)
                crossed = np.flatnonzero((before > 0) != (after > 0))
                if crossed.size:
                    dense = solver.dense_output()

                    def crossing(i: int, t: float, x: Callable[..., FloatArray] = dense) -> float:
                        return float(indicators(t, x(t))[i])

                    at = min(
                        _crossing(partial(crossing, i), past, solver.t) for i in crossed.tolist()
                    )
                    self._states.array[:] = dense(at)
                    return at, True
                before = after
        self._states.array[:] = solver.y
        return end, False


def _crossing(function: Callable[[float], float], low: float, high: float) -> float:
    """First instant behind the change of sign, to a millionth of a millionth of the step."""
    if function(low) == 0.0 or (function(low) > 0) == (function(high) > 0):
        return high
    at = float(scipy.optimize.brentq(function, low, high, xtol=1e-12 * (high - low) + 1e-15))
    past = min(high, at + 1e-9 * (high - low))
    return past if (function(past) > 0) == (function(high) > 0) else high


class _Vector:
    """An array, and how C is handed it."""

    def __init__(self, size: int) -> None:
        self.array = np.zeros(size)
        self.call = (self.array.ctypes.data_as(POINTER(c_double)), size)
