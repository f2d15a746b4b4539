"""A far end and a network in one process, on clocks that are turned by hand."""

import heapq
import itertools
import math

import numpy as np

from hmpim.rigs import SkewedClock
from hmpim.rigs.wire import FarEnd, Hello
from hmpim.stimulus import Limits

LIMITS = {
    "roll": Limits(position=20.0, velocity=200.0, acceleration=4000.0, unit="deg"),
    "yaw": Limits(position=60.0, velocity=180.0, acceleration=1000.0, unit="deg"),
}


def hello(rate=500.0, watchdog=0.08, axes=("roll", "yaw")):
    return Hello(
        name="bench",
        axes=axes,
        units=tuple("deg" for _ in axes),
        rate=rate,
        limits={axis: LIMITS[axis] for axis in axes},
        watchdog=watchdog,
        intersample="zoh",
        source="a bench",
    )


class Lag:
    """Axes that follow their orders late and with a first-order lag, exact for held orders."""

    def __init__(self, axes, rate, *, late=5, time_constant=0.02, noise_std=0.0, seed=0):
        self.position = np.zeros(axes)
        self.queue = [np.zeros(axes) for _ in range(late)]
        self.share = 1.0 - math.exp(-1.0 / (rate * time_constant))
        self.noise_std, self.rng = noise_std, np.random.default_rng(seed)

    def advance(self, order):
        read = self.position + self.noise_std * self.rng.standard_normal(self.position.size)
        self.queue.append(order.position)
        self.position = self.position + self.share * (self.queue.pop(0) - self.position)
        return read

    def truth(self):
        return self.position


class Network:
    """A transport whose other end is simulated along with it.

    `there` and `back` say how long the n-th datagram takes, in s; None loses it. A list of times
    brings it as often.
    """

    def __init__(
        self,
        clock,
        farend=None,
        plant=None,
        *,
        there=None,
        back=None,
        offset=0.0,
        drift=0.0,
        phase=0.37,
    ):
        self.clock = clock
        self.farend = FarEnd(hello()) if farend is None else farend
        said = self.farend.hello
        self.plant = Lag(len(said.axes), said.rate) if plant is None else plant
        self.far = SkewedClock(clock, offset=offset, drift=drift)
        self.period = 1.0 / said.rate / (1.0 + drift)  # on the near clock
        self.delays = (there or (lambda _n: 2e-4), back or (lambda _n: 2e-4))
        self.counts = (itertools.count(), itertools.count())
        self.events, self.order = [], itertools.count()
        self.plugged = True
        self.orders = []
        self.states = []
        self.name, self.doubt = "simulated", "is it on?"
        self.ticks = itertools.count()
        self.begun = clock.now() + phase * self.period
        self._push(self.begun, "tick", None)

    def _push(self, time, what, data):
        heapq.heappush(self.events, (time, next(self.order), what, data))

    def _carry(self, way, data):
        number = next(self.counts[way])
        takes = self.delays[way](number)
        if takes is None or not self.plugged:
            return
        for seconds in takes if isinstance(takes, list) else [takes]:
            self._push(self.clock.now() + seconds, ("far", "near")[way], data)

    def open(self):
        pass

    def close(self):
        pass

    def send(self, data):
        self._carry(0, data)

    def receive(self, timeout):
        limit = self.clock.now() + max(timeout, 0.0)
        while self.events and self.events[0][0] <= limit:
            time, _, what, data = heapq.heappop(self.events)
            self.clock.sleep_until(time)
            if what == "near":
                return data
            if what == "far":
                for answer in self.farend.receive(data, now=round(self.far.now() * 1e9)):
                    self._carry(1, answer)
            else:
                self._tick()
        self.clock.sleep_until(limit)
        return None

    def _tick(self):
        number = next(self.ticks)
        self._push(self.begun + (number + 1) * self.period, "tick", None)
        order = self.farend.tick()
        self.orders.append(order)
        self.states.append(self.farend.state)
        measured = self.plant.advance(order)
        for said in self.farend.pending():
            self._carry(1, said)
        now = round(self.far.now() * 1e9)
        response = self.farend.respond(measured, sampled=now, now=now)
        if response is not None:
            self._carry(1, response)
