"""A simulated unit that a carrier moves: a sensor with a rate and a clock of its own."""

from collections.abc import Mapping
from types import TracebackType
from typing import Self

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RigError
from hmpim.rigs.block import ChannelSpec, RunReport, Samples
from hmpim.rigs.mounted.arrivals import Arrivals
from hmpim.rigs.sensor import Sensor

__all__ = ["CarriedSensor"]

FloatArray = NDArray[np.float64]

_FINER = 4  # steps of the dynamics between two samples of the encoder
_KEPT = 64  # samples of the encoder that are kept for the spline: some on either side of its use
_EDGE = 8  # of these, the last are used only once more have come: a spline is worst at its end


class CarriedSensor:
    """A simulated sensor on a carrier: a seeker on a table, for instance.

    What it measures is what the carrier's encoder reads, joined by a spline. It takes readings
    at a rate of its own, stamps them with its own clock, and sends them; they arrive later.

    Parameters
    ----------
    sensor : Sensor
        Its delay, dynamics, scale factor, bias, noise, range and steps. Its noise must be white,
        and it holds nothing.
    axis : str or None
        Axis of the carrier that it sees; None for the only one that moves.
    fs : float or None
        Readings a second, Hz; None for as many as the encoder's.
    clock_offset, clock_drift : float
        Its clock is ahead of the run's by so many s at the start, and gains so many s in one.
    on_the_way, jitter : float
        Time that a reading takes to us, s: at least the one, and up to the other more.
    states_way : bool
        Whether the shortest time on the way is known, and taken out.

    Raises
    ------
    ArgumentError
        If the sensor holds its output or has coloured noise, or a time is negative.
    """

    def __init__(
        self,
        sensor: Sensor,
        *,
        axis: str | None = None,
        fs: float | None = None,
        clock_offset: float = 0.0,
        clock_drift: float = 0.0,
        on_the_way: float = 1e-3,
        jitter: float = 1e-3,
        states_way: bool = True,
    ) -> None:
        if sensor.hold_period is not None or sensor.noise_colour != 0.0:
            raise ArgumentError(
                f"hold_period = {sensor.hold_period!r} and noise_colour = "
                f"{sensor.noise_colour!r} are not simulated on a carrier; leave them out"
            )
        for name, value in (("on_the_way", on_the_way), ("jitter", jitter)):
            if not value >= 0.0:
                raise ArgumentError(f"{name} = {value!r} s must be 0 or positive")
        if fs is not None and not fs > 0.0:
            raise ArgumentError(f"fs = {fs!r} Hz must be positive")
        self._sensor, self._axis, self._fs = sensor, axis, fs
        self._offset, self._rate = clock_offset, 1.0 + clock_drift
        self._on_the_way, self._jitter, self._states_way = on_the_way, jitter, states_way
        self._rng = np.random.default_rng()
        self._sent: FloatArray = np.empty((3, 0))  # on the way: time, value, arrival
        self._begin()

    @property
    def name(self) -> str:
        """Name of the sensor."""
        return self._sensor.name

    def seed(self, rng: np.random.Generator, /) -> None:
        """Draw from `rng` from now on."""
        self._rng = rng

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self.stop()

    def prepare(self, encoders: Mapping[str, ChannelSpec], /) -> tuple[ChannelSpec, ...]:
        """Find the axis that it sees.

        Raises
        ------
        RigError
            If it does not move, or several do and none is chosen.
        """
        axis = next(iter(encoders)) if self._axis is None and len(encoders) == 1 else self._axis
        if axis is None or axis not in encoders:
            raise RigError(
                f"{self.name!r} sees axis {axis!r}, and the carrier measures "
                f"{', '.join(encoders) or 'none'}; state axis"
            )
        self._begin()
        self._seen = axis
        unit = self._sensor.output_unit
        self._channel = ChannelSpec(
            name=self._sensor.output_name,
            role="output",
            unit=encoders[axis].unit if unit is None else unit,
            clock=self.name,
        )
        return (self._channel,)

    def read(self, now: float, moved: Mapping[str, Samples], /) -> dict[str, Samples]:
        """Go on with what the encoder has read; return what has arrived by `now`."""
        if self._seen in moved and moved[self._seen].time.size:
            self._take(moved[self._seen])
        there = self._sent[2] <= now
        if not there.any():
            return {}
        came = self._sent[:, there]
        self._sent = self._sent[:, ~there]
        stamps = self._offset + self._rate * came[0]
        self._heard.add(stamps, came[2])
        return {self._channel.name: Samples(time=stamps, values=came[1])}

    def stop(self) -> None:
        """Nothing more comes."""

    def report(self) -> RunReport:
        """Put the clock right."""
        return self._heard.report()

    def _begin(self) -> None:
        self._seen = ""
        self._heard = Arrivals(self.name, on_the_way=self._on_the_way if self._states_way else None)
        self._encoder = Samples(time=np.empty(0), values=np.empty(0))
        self._sent = np.empty((3, 0))
        self._step = 0.0
        self._done = 0  # steps of the dynamics so far
        self._next = 0  # number of the next reading
        self._start = 0.0
        self._filter: tuple[FloatArray, FloatArray, FloatArray] | None = None
        self._before: FloatArray = np.empty(0)  # what the dynamics gave at the last steps

    def _take(self, came: Samples) -> None:
        """Step the dynamics as far as the encoder is known on both sides."""
        self._encoder = Samples.joined((self._encoder, came))
        if self._encoder.time.size < _KEPT:
            return
        time, values = self._encoder.time, self._encoder.values
        if self._step == 0.0:
            self._step = float(np.median(np.diff(time))) / _FINER
            self._start = float(time[0])
            self._filter = self._dynamics(float(values[0]))
        known = float(time[-1 - _EDGE])
        last = int(np.floor((known + self._sensor.delay - self._start) / self._step))
        if last <= self._done:
            return
        at: FloatArray = self._start + np.arange(self._done, last, dtype=np.float64) * self._step
        spline = scipy.interpolate.make_interp_spline(time, values, k=5)
        u = np.asarray(spline(np.maximum(at - self._sensor.delay, self._start)))
        self._readings(at, self._moved(u))
        self._done = last
        since = max(0, int(np.searchsorted(time, at[-1] - self._sensor.delay)) - _KEPT)
        self._encoder = Samples(time=time[since:], values=values[since:])

    def _dynamics(self, rest: float) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Filter of a step, linear between steps, at rest at `rest`."""
        poles = self._sensor.poles
        if poles is None:
            return np.ones(1), np.ones(1), np.empty(0)
        roots = [poles.slow] if poles.fast is None else [poles.slow, poles.fast]
        denominator = np.real(np.poly(roots))
        b, a, _ = scipy.signal.cont2discrete(
            ([denominator[-1]], denominator), self._step, method="foh"
        )
        b = np.asarray(b).ravel()
        # The state in which a constant input gives a constant output.
        state = np.zeros(a.size - 1)
        for k in range(a.size - 2, -1, -1):
            state[k] = (b[k + 1] - a[k + 1]) * rest + (state[k + 1] if k + 1 < state.size else 0.0)
        return b, np.asarray(a), state

    def _moved(self, u: FloatArray) -> FloatArray:
        assert self._filter is not None
        b, a, state = self._filter
        if state.size == 0:
            return u
        y, state = scipy.signal.lfilter(b, a, u, zi=state)
        self._filter = (b, a, state)
        return np.asarray(y)

    def _readings(self, at: FloatArray, y: FloatArray) -> None:
        """Take the readings that fall into these steps, and send them."""
        whole = np.concatenate((self._before, y))
        times = self._start + np.arange(self._done - self._before.size, self._done + at.size) * (
            self._step
        )
        fs = self._fs or 1.0 / (_FINER * self._step)
        last = int(np.floor((times[-3] - self._start) * fs))
        self._before = whole[-_KEPT:]
        if last <= self._next or whole.size < 8:
            return
        taken = self._start + np.arange(self._next, last) / fs
        self._next = last
        sensor = self._sensor
        moved = scipy.interpolate.make_interp_spline(times, whole, k=3)(taken)
        read = sensor.scale_factor * moved + sensor.bias
        read = sensor.digitised(read + sensor.noise_std * self._rng.standard_normal(taken.size))
        arrives = taken + self._on_the_way + self._jitter * self._rng.random(taken.size)
        sent = np.concatenate((self._sent, np.stack((taken, read, arrives))), axis=1)
        sent[2] = np.maximum.accumulate(sent[2])  # none overtakes another
        self._sent = sent
