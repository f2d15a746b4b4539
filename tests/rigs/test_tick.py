"""An external tick: its time is the run's, whatever the computer's clock does."""

import os
import pty
import re
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from scipy.special import stdtrit

from hmpim.errors import RigError
from hmpim.experiment import RunOptions, run
from hmpim.rigs import (
    FakeRig,
    ManualClock,
    SerialTicks,
    TickClock,
    UdpTicks,
    pulse_bytes,
)
from hmpim.stimulus import Limits, Ramp, Stimulus
from tests_support import FALSE_ALARM, in_studies, meanwhile

RATE = 500.0
RAMP = Stimulus(waveform=Ramp(duration=1.5), fs=100.0)


def paced(block):
    return block.position[list(block.due())]


class Pulses:
    """Pulses on a clock turned by hand: off by `ppm`, late by chance, some lost."""

    modulus = 256

    def __init__(
        self, clock, *, ppm=0.0, jitter=2e-4, lost=(), until=np.inf, rate=RATE, numbered=True
    ):
        self.numbered = numbered
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
        limit, came = self.clock.now() + timeout, []
        while (
            self.at <= limit and self.at < self.until and (not came or self.at <= self.clock.now())
        ):
            self.clock.sleep_until(self.at)
            came.append((self.number + 250) % 256 if self.numbered else None)
            self.number += 1
            self._next()
        if not came:
            self.clock.sleep_until(limit)
        return came


@pytest.mark.parametrize("ppm", [30.0, *in_studies(-30.0, 2000.0)])
@pytest.mark.parametrize("lost", [(), (700, 1900, 1901)])
@pytest.mark.parametrize("numbered", [True, False])
def test_its_time_is_that_of_the_pulses_and_the_computers_drift_is_told(ppm, lost, numbered):
    computer = ManualClock()
    pulses = Pulses(computer, ppm=ppm, lost=lost, numbered=numbered)
    ticked = TickClock(pulses, rate=RATE, clock=computer)
    for k in range(1, 5001):
        ticked.sleep_until(k / RATE)
    assert computer.now() == pytest.approx(5000 * pulses.period, abs=3e-4)
    message = ticked.report().findings[0].message
    assert (f", {len(lost)} lost of 500" in message) == bool(lost)
    if numbered:
        assert drift_of(message) == pytest.approx(-ppm, abs=0.02 * abs(ppm) + 1.0)
    else:
        assert "is unknown, as its pulses hold no numbers" in message


def drift_of(message):
    return figure_of(message)[0]


def figure_of(message):
    """Drift and its standard deviation, ppm."""
    value, std = message.split("gains ")[1].split(" ppm")[0].split(" ± ")
    return float(value), float(std)


class Datagrams:
    """A sender on loopback, 30 ppm off; it sends when it is told to."""

    def __init__(self):
        self.ticks = UdpTicks("127.0.0.1", 0)
        self.out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.out.connect(("127.0.0.1", self.ticks.port))

    def send(self, number):
        self.out.send(pulse_bytes(number))

    def close(self):
        self.out.close()


class Bytes:
    """The same at the far end of a pseudo-terminal."""

    def __init__(self):
        pytest.importorskip("serial")
        self.far, self.near = pty.openpty()
        self.ticks = SerialTicks(os.ttyname(self.near))

    def send(self, number):
        os.write(self.far, bytes([number % 256]))

    def close(self):
        os.close(self.far)
        os.close(self.near)


def heard(line, numbers, *, ppm=30.0, rate=1000.0):
    """What is said of pulses that come over a real line, by a computer's clock turned by hand.

    `numbers` are those of the pulses in the order in which they are sent, each when it is due.
    """
    computer = ManualClock()
    begun, ticked = computer.now(), TickClock(line.ticks, rate=rate, clock=computer)
    rng = np.random.default_rng(1)
    try:
        for k, number in enumerate(numbers):
            due = begun + max(number, k) / (rate * (1.0 + 1e-6 * ppm)) + 5e-5 * rng.random()
            computer.sleep_until(max(due, computer.now()))
            line.send(number)
            while not ticked._take(1.0):  # a late one moves nothing on
                if number < max(numbers[:k], default=-1) or number in numbers[:k]:
                    break
    finally:
        line.ticks.close()
        line.close()
    return ticked.report().findings[0].message, ticked._count


STEADY = list(range(3000))


@pytest.mark.parametrize("line", [Datagrams, Bytes])
def test_thirty_ppm_over_a_real_line(line):
    message, count = heard(line(), STEADY)
    assert count == 2999
    assert drift_of(message) == pytest.approx(-30.0, abs=3.0)
    assert "lost" not in message


@pytest.mark.parametrize("line", [Datagrams, Bytes])
def test_pulses_lost_and_out_of_order_are_told_from_their_numbers(line):
    sent = [n for n in STEADY if n not in (5, 700, *range(1000, 1090))]
    sent[2000], sent[2001] = sent[2001], sent[2000]
    message, count = heard(line(), sent)
    assert count == 2999
    assert ", 92 lost and 1 out of order of 3000;" in message
    assert drift_of(message) == pytest.approx(-30.0, abs=3.0)


def test_over_datagrams_one_may_come_twice():
    message, count = heard(Datagrams(), [*STEADY[:50], 49, *STEADY[50:200]])
    assert count == 199
    assert ", 1 doubled of 200;" in message


@pytest.mark.parametrize(
    ("numbers", "why"),
    [
        (STEADY[:60], "as 60 pulses are too few, and 100 are needed"),
        (STEADY[::2], "as more than 5 % of its pulses are in disorder"),
        ([n ^ 1 for n in STEADY], "1500 out of order of 3000; .* as more than 5 % of its pulses"),
    ],
)
def test_figures_of_ragged_ticks_are_withheld_with_a_sentence(numbers, why):
    message, _ = heard(Datagrams(), numbers)
    assert "clock gains" not in message
    assert "the rate of this computer's clock against it is unknown, as" in message
    assert re.search(why, message)


def test_pulses_that_come_too_unevenly_tell_no_drift():
    computer = ManualClock()
    pulses = Pulses(computer, jitter=0.02)
    ticked = TickClock(pulses, rate=RATE, clock=computer)
    for k in range(1, 300):
        ticked.sleep_until(k / RATE)
    assert "pulses come too unevenly: the first half" in ticked.report().findings[0].message


def test_between_two_pulses_the_computers_clock_is_read_and_never_goes_beyond_the_next():
    computer = ManualClock()
    ticked = TickClock(Pulses(computer, jitter=0.0, rate=50.0), rate=50.0, clock=computer)
    ticked.sleep_until(1.0051)
    assert computer.now() == pytest.approx(1.0051, abs=1e-6)
    before = ticked.now()
    computer.advance(0.5)  # nobody looked; 25 pulses are waiting
    assert before <= ticked.now() <= before + 0.5 + 0.02


def test_while_a_pulse_is_overdue_time_goes_on_and_does_not_reach_it():
    computer = ManualClock()
    ticked = TickClock(Pulses(computer, jitter=0.0, until=0.5), rate=RATE, clock=computer)
    ticked.sleep_until(0.4)
    computer.advance(0.15)  # the last pulse is seen now, late
    shown = []
    for _ in range(400):
        computer.advance(1e-6)
        shown.append(ticked.now())
    assert np.all(np.diff(shown) > 0.0)
    assert shown[-1] < ticked._stamps[-1] + 1.0 / RATE


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

    def send(over):  # always the same: no numbers
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while not over.is_set():
                out.sendto(b"tick", ("127.0.0.1", ticks.port))
                time.sleep(0.01)

    with meanwhile(send), TickClock(ticks, rate=100.0, patience=20.0) as clock:
        record = run(FakeRig(answer=paced), RAMP, options=RunOptions(clock=clock))
        assert clock.now() >= RAMP.time[-1] - 1e-9
    said = [f.message for f in record.findings if f.code == "tick"]
    assert said[0].startswith("The run was driven by an external tick of 100 Hz")


SENDER = """
import socket, sys
from hmpim.experiment.priority import undelayed
from hmpim.rigs import SkewedClock, SystemClock, pulse_bytes

clock, rate = SkewedClock(SystemClock(), drift=float(sys.argv[2]) * 1e-6), float(sys.argv[3])
out, number = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), 0
out.connect(("127.0.0.1", int(sys.argv[1])))
begun = clock.now()
with undelayed(realtime=True):
    while True:
        clock.sleep_until(begun + number / rate)
        try:
            out.send(pulse_bytes(number))
        except ConnectionRefusedError:
            pass
        number += 1
"""


@pytest.mark.study
@pytest.mark.parametrize("ppm", [30.0, -30.0])
def test_in_real_time_over_udp_the_drift_is_found_within_its_error(ppm):
    """A sender of its own, 30 ppm off, for 10 s; the run goes by its pulses."""
    rate = 1000.0
    ticks = UdpTicks("127.0.0.1", 0)
    sender = subprocess.Popen(
        [sys.executable, "-c", SENDER, str(ticks.port), f"{ppm}", f"{rate}"], env=os.environ
    )
    try:
        with TickClock(ticks, rate=rate, patience=20.0) as clock:
            stimulus = Stimulus(waveform=Ramp(duration=10.0), fs=rate)
            computer = time.perf_counter()
            record = run(
                FakeRig(answer=paced, moves=True),
                stimulus,
                limits=Limits(position=100.0, velocity=100.0, acceleration=100.0),
                options=RunOptions(clock=clock),
            )
            computer = time.perf_counter() - computer
    finally:
        sender.kill()
        sender.wait()
    assert computer > 9.9
    (said,) = [f.message for f in record.findings if f.code == "tick"]
    print(f"\n{ppm:+g} ppm: {said}")
    found, std = figure_of(said)
    assert std < 5.0  # told apart from a clock that is right
    assert abs(found + ppm) < -stdtrit(8, FALSE_ALARM / 2) * std + 0.05  # printed to 0.1
