"""A served rig comes to rest whatever fails."""

import errno

import numpy as np

from hmpim.rigs import ManualClock
from hmpim.rigs.wire import Command, Datagram, FarEnd, Hello, Kind, State, pack, serve, unpack
from wire_support import Lag, hello

RATE = 500.0


class Driver:
    """A near end that arms the far end and moves it on steadily, tick by tick."""

    def __init__(self, clock):
        self.clock, self.number, self.said = clock, 0, []
        self.outbox = [self._packed(Kind.HELLO, text=Hello().to_json()), self._packed(Kind.ARM)]
        self.answers = []

    def _packed(self, kind, **more):
        return pack(Datagram(kind=kind, session=7, **more))

    def receive(self, timeout):
        if self.outbox:
            return self.outbox.pop(0), "near"
        self.clock.sleep_until(self.clock.now() + timeout)
        if timeout > 0.0:
            t = self.number / RATE
            still = np.zeros(2)
            command = Command(
                position=np.array([10.0 * t * t, 0.0]),
                velocity=np.array([20.0 * t, 0.0]),
                acceleration=np.array([20.0, 0.0]) if t else still,
            )
            self.outbox.append(self._packed(Kind.COMMAND, number=self.number, command=command))
            self.number += 1
        return None

    def send(self, data, to):
        self.answers.append(unpack(data))


def served(plant, trace=None, ticks=400):
    clock = ManualClock()
    farend, driver, count = FarEnd(hello(rate=RATE)), Driver(clock), [0]

    def until():
        count[0] += 1
        return count[0] >= ticks

    serve(driver, farend, plant, clock=clock, until=until, trace=trace)
    return farend, driver


class Failing(Lag):
    """Its driver raises what is no error of ours."""

    ticks = 0

    def advance(self, order):
        self.ticks += 1
        if self.ticks == 200:
            raise OSError("the amplifier does not answer")
        return super().advance(order)


def test_an_error_of_the_driver_brakes_the_rig_and_is_said():
    farend, driver = served(Failing(2, RATE))
    assert farend.state is State.FAULT
    said = [answer.text for answer in driver.answers if answer.kind is Kind.REFUSED]
    assert said == ["OSError: the amplifier does not answer"]
    responses = [answer.response for answer in driver.answers if answer.response is not None]
    speed = np.diff([response.position[0] for response in responses]) * RATE
    assert speed.max() > 2.0
    assert np.abs(np.diff(speed)).max() * RATE < 4000.0 * 1.01
    assert speed[-1] == 0.0


def test_a_trace_that_cannot_be_written_stops_nothing_but_itself():
    class Full:
        rows = 0

        def add(self, *_):
            self.rows += 1
            if self.rows == 100:
                raise OSError(errno.ENOSPC, "No space left on device")

    trace = Full()
    farend, driver = served(Lag(2, RATE), trace)
    assert trace.rows == 100
    assert driver.number > 300
    assert farend.fault == "the server was told to end"
    assert farend.state is State.FAULT


def test_a_flood_of_datagrams_does_not_put_a_tick_off():
    class Flooded(Driver):
        def receive(self, timeout):
            self.clock.advance(1e-5)
            return super().receive(timeout) or (b"noise", "somebody")

    clock = ManualClock()
    farend, count = FarEnd(hello(rate=RATE)), [0]

    def until():
        count[0] += 1
        return count[0] >= 50

    serve(Flooded(clock), farend, Lag(2, RATE), clock=clock, until=until)
    assert count[0] == 50
