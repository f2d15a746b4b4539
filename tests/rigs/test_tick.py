"""An external tick: its time is the run's, whatever the computer's clock does."""

import socket
import threading
import time

import numpy as np
import pytest

from hmpim.errors import RigError
from hmpim.experiment import RunOptions, run
from hmpim.rigs import FakeRig, ManualClock, TickClock, UdpTicks
from hmpim.stimulus import Ramp, Stimulus

RATE = 500.0
RAMP = Stimulus(waveform=Ramp(duration=1.5), fs=100.0)


def paced(block):
    return block.position[list(block.due())]


class Pulses:
    """Pulses on a clock turned by hand: off by `ppm`, late by chance, some lost."""

    def __init__(self, clock, *, ppm=0.0, jitter=2e-4, lost=(), until=np.inf, rate=RATE):
        self.clock, self.lost, self.until = clock, set(lost), until
        self.period = 1.0 / (rate * (1.0 + 1e-6 * ppm))  # in the computer's time
        self.rng, self.jitter, self.number = np.random.default_rng(0), jitter, 0
        self.begun = clock.now()
        self._next()

    def _next(self):
        while self.number in self.lost:
            self.number += 1
        late = self.jitter * self.rng.random()
        self.at = self.begun + self.number * self.period + late

    def wait(self, timeout):
        limit, came = self.clock.now() + timeout, 0
        while (
            self.at <= limit and self.at < self.until and (not came or self.at <= self.clock.now())
        ):
            self.clock.sleep_until(self.at)
            self.number, came = self.number + 1, came + 1
            self._next()
        if not came:
            self.clock.sleep_until(limit)
        return came


@pytest.mark.parametrize("ppm", [30.0, -30.0, 2000.0])
@pytest.mark.parametrize("lost", [(), (700, 1900, 1901)])
def test_its_time_is_that_of_the_pulses_and_the_computers_drift_is_told(ppm, lost):
    computer = ManualClock()
    pulses = Pulses(computer, ppm=ppm, lost=lost)
    ticked = TickClock(pulses, rate=RATE, clock=computer)
    for k in range(1, 5001):
        ticked.sleep_until(k / RATE)
    assert computer.now() == pytest.approx(5000 * pulses.period, abs=3e-4)
    message = ticked.report().findings[0].message
    drift = float(message.split("gains ")[1].split(" ppm")[0])
    assert drift == pytest.approx(-ppm, abs=0.02 * abs(ppm) + 1.0)
    assert (f", {len(lost)} of" in message) == bool(lost)


def test_between_two_pulses_the_computers_clock_is_read_and_never_goes_beyond_the_next():
    computer = ManualClock()
    ticked = TickClock(Pulses(computer, jitter=0.0, rate=50.0), rate=50.0, clock=computer)
    ticked.sleep_until(1.0051)
    assert computer.now() == pytest.approx(1.0051, abs=1e-6)
    before = ticked.now()
    computer.advance(0.5)  # nobody looked; 25 pulses are waiting
    assert before <= ticked.now() <= before + 0.5 + 0.02


def test_a_tick_that_stops_is_said_and_time_goes_on_so_that_a_rig_can_be_stopped():
    computer = ManualClock()
    ticked = TickClock(Pulses(computer, until=computer.now() + 1.0), rate=RATE, clock=computer)
    with pytest.raises(RigError, match="no pulse of the external tick came for 1 s; is it on"):
        ticked.sleep_until(1.5)
    computer.advance(2.0)
    before = ticked.now()
    computer.advance(2.0)
    assert ticked.now() == pytest.approx(before + 2.0, abs=1e-3)


def test_pulses_over_udp():
    ticks = UdpTicks("127.0.0.1", 0)
    over = threading.Event()

    def send():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while not over.is_set():
                out.sendto(b"tick", ("127.0.0.1", ticks.port))
                time.sleep(0.01)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with TickClock(ticks, rate=100.0, patience=20.0) as clock:
            record = run(FakeRig(answer=paced), RAMP, options=RunOptions(clock=clock))
            assert clock.now() >= RAMP.time[-1] - 1e-9
        said = [f.message for f in record.findings if f.code == "tick"]
        assert said[0].startswith("The run was driven by an external tick of 100 Hz")
    finally:
        over.set()
        thread.join()
