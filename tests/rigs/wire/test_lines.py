"""A rig over a pseudo-terminal and over a CAN bus: found as it is, in real time."""

import os
import select
import time
from contextlib import ExitStack, contextmanager

import pytest

from hmpim.errors import ArgumentError, RigError
from hmpim.experiment import run
from hmpim.identify import identify
from hmpim.rigs import SystemClock
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.wire import CanServer, FarEnd, SerialServer, UdpClient, UdpServer, WireRig, serve
from hmpim.rigs.wire.serial import SerialClient
from hmpim.stimulus import Limits, design
from tests_support import meanwhile
from wire_support import Lag, hello

RATE = 100.0
LATE, TIME_CONSTANT = 3, 0.05
SWEEP = design(
    band=(0.3, 8), duration=4, fs=RATE, axis="roll",
    limits=Limits(position=4, velocity=100, acceleration=2500, unit="deg"),
)  # fmt: skip


@contextmanager
def cable():
    """Two pseudo-terminals, what goes into one comes out of the other; yields their names."""
    masters, ends = [], []
    for _ in range(2):
        master, end = os.openpty()
        masters.append(master)
        ends.append(end)

    def carry(over):
        while not over.is_set():
            for one in select.select(masters, [], [], 0.05)[0]:
                os.write(masters[1 - masters.index(one)], os.read(one, 4096))

    try:
        with meanwhile(carry):
            yield tuple(map(os.ttyname, ends))
    finally:
        for each in (*masters, *ends):
            os.close(each)


def serving(server, said):
    """A far end in a thread of its own."""

    def far(over):
        plant = Lag(1, RATE, late=LATE, time_constant=TIME_CONSTANT, noise_std=0.003)
        with server:
            serve(server, FarEnd(said), plant, clock=SystemClock(), until=over.is_set)

    return meanwhile(far)


@pytest.mark.parametrize("kind", ["serial", "can"])
def test_the_rig_is_found_over_the_line(kind):
    pytest.importorskip(kind)
    said = hello(rate=RATE, watchdog=5.0, axes=("roll",))  # a busy computer is not what is tested
    with ExitStack() as stack:
        times = {"stale": 10.0, "answer": 20.0}
        if kind == "serial":
            near, far = stack.enter_context(cable())
            stack.enter_context(serving(SerialServer(far), said))
            rig = find_rig(f"serial:{near}", description=describe({"options": times})).rig
        else:
            stack.enter_context(serving(CanServer("rigs", interface="virtual"), said))
            options = times | {"interface": "virtual"}
            rig = find_rig("can:rigs", description=describe({"options": options})).rig
        assert isinstance(rig, WireRig)
        record = run(rig, SWEEP)
    pair = identify(record)["roll.position", "roll.command"]
    for name, truth in (("delay", LATE / RATE), ("time_constant", TIME_CONSTANT)):
        found = getattr(pair.parameters, name)
        assert abs(found.value - truth) < max(4.5 * found.std, 2e-4), name
    assert "clocks" in {finding.code for finding in record.findings}


def test_what_is_not_there_is_said():
    pytest.importorskip("serial")
    with pytest.raises(
        RigError, match=r"serial:/dev/no_such_port cannot be opened: .*No such file"
    ):
        run(find_rig("serial:/dev/no_such_port").rig, SWEEP)
    pytest.importorskip("can")
    with pytest.raises(RigError, match=r"can:none .no_such_thing. cannot be opened"):
        run(
            find_rig(
                "can:none", description=describe({"options": {"interface": "no_such_thing"}})
            ).rig,
            SWEEP,
        )


def test_a_serial_port_is_for_one_run_at_a_time():
    pytest.importorskip("serial")
    master, end = os.openpty()
    line = SerialClient(os.ttyname(end))
    try:
        line.open()
        with pytest.raises(RigError, match=r"cannot be opened: .*exclusively lock"):
            SerialClient(os.ttyname(end)).open()
    finally:
        line.close()
        os.close(master)
        os.close(end)


@pytest.mark.parametrize(
    ("written", "words"),
    [
        (b"", r"is it on, and are the port and the baud rate \(9600\) right\?"),
        (b"noise" * 20, r"100 bytes came, and no datagram: is the baud rate \(9600\) right\?"),
    ],
)
def test_a_line_at_the_wrong_rate_is_told_from_one_that_is_silent(written, words):
    pytest.importorskip("serial")
    master, end = os.openpty()
    try:
        options = {"baud": 9600, "answer": 0.3}
        rig = find_rig(f"serial:{os.ttyname(end)}", description=describe({"options": options})).rig

        def talk(over):
            while not over.wait(0.1):
                if written and not sent:
                    sent.append(os.write(master, written))

        sent = []
        with meanwhile(talk), pytest.raises(RigError, match=words):
            run(rig, SWEEP)
    finally:
        os.close(master)
        os.close(end)


@pytest.mark.parametrize(
    ("kind", "options", "words"),
    [
        ("serial:x", {"baud": "fast"}, "baud = 'fast' is not a whole number"),
        ("can:x", {"bitrate": 1.5}, "bitrate = 1.5 is not a whole number"),
        ("can:x", {"interface": 3}, "interface = 3 is not a text"),
    ],
)
def test_options_of_a_line_of_the_wrong_type_are_refused(kind, options, words):
    with pytest.raises(ArgumentError, match=words):
        find_rig(kind, description=describe({"options": options}))


def test_wait_for_a_datagram_is_not_rounded_to_milliseconds():
    """Rounded, none would end earlier; on a busy machine most end later, but not one in 10 000."""

    def waited(timeout):
        begun = time.perf_counter()
        assert client.receive(timeout) is None
        return time.perf_counter() - begun

    with UdpServer("127.0.0.1", 0) as silent:
        client = UdpClient(*silent.address)
        client.open()
        assert any(waited(1e-4) < 0.5e-3 for _ in range(10_000))
        client.close()
