"""Each kind of rig, found against true: the table of docs/rigs.md.

python benchmarks/rigs_found.py [sensor | table | udp | serial | can | mounted | python | process |
fmu | tracker | seeker]
"""

from __future__ import annotations

import math
import os
import select
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np

import hmpim
from hmpim.identify import Estimate, PairIdentification
from hmpim.record import Record
from hmpim.rigs import CarriedSensor, MotionTable, Mounted, SystemClock
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.seeker import SeekerRig
from hmpim.rigs.table import exact_bandwidth
from hmpim.rigs.tracker import Camera, Scene, TrackerRig
from hmpim.rigs.wire import CanServer, FarEnd, Hello, SerialServer, serve
from hmpim.rigs.wire.farend import Order
from hmpim.rigs.wire.transport import UdpServer
from hmpim.stimulus import Limits, Stimulus

Row = tuple[str, Estimate | None, float, float, str]
"""What, found, true, factor to the unit, unit."""

RATE, LATE, LAG = 200.0, 3, 0.05
PYTHON = """
class Filter:
    def __init__(self):
        self.y, self.waiting = 0.0, [0.0] * 4

    def __call__(self, u):
        self.waiting.append(u)
        self.y += 0.2 * (self.waiting.pop(0) - self.y)
        return self.y
"""
PROCESS = """
print("ready", flush=True)
input_line, late = input, [0.0] * 4
y = 0.0
first = True
while (line := input_line()) != "end":
    if line.startswith("hmpim"):
        continue
    late.append(float(line))
    y += 0.2 * (late.pop(0) - y)
    print(repr(y), flush=True)
"""


def swept(fs: float = RATE, *, top: float = 8.0, axis: str = "") -> Stimulus:
    limits = Limits(position=4, velocity=100, acceleration=2500, unit="deg")
    return hmpim.design(band=(0.3, top), duration=5, fs=fs, limits=limits, axis=axis)


def rows_of(pair: PairIdentification, **truth: float) -> list[Row]:
    """One row for each parameter, times in ms."""
    rows: list[Row] = []
    for name, true in truth.items():
        timed = name in ("delay", "time_constant", "hold_period")
        unit = "ms" if timed else "Hz" if "band" in name or "freq" in name else ""
        words = name.replace("_", " ").replace("bandwidth phase90", "−90° bandwidth")
        found = getattr(pair.parameters, name)
        rows.append((words, found, true, 1e3 if timed else 1.0, unit))
    return rows


def sensor() -> list[Row]:
    truth = {"delay": 0.012, "natural_frequency": 8.0, "damping_ratio": 0.5}
    unit = hmpim.Sensor(noise_std=0.01, **truth)
    return rows_of(hmpim.identify(hmpim.run(unit, swept(top=20.0), rng=1)).pairs[0], **truth)


def table() -> list[Row]:
    unit = MotionTable(friction=False)
    limits = unit.limits_of("yaw", travel=5.0, share=0.5)
    sweep = hmpim.design(band=(0.3, 60), duration=5, fs=1000, limits=limits, axis="yaw")
    pair = hmpim.identify(hmpim.run(unit, sweep, rng=1))["yaw.position", "yaw.command"]
    return rows_of(pair, bandwidth_phase90=exact_bandwidth(unit, axis="yaw", fs=1000.0))


class Lag:
    """An axis that follows its orders late and with a first-order lag, exact for held orders."""

    def __init__(self) -> None:
        self.position = np.zeros(1)
        self.queue = [np.zeros(1) for _ in range(LATE)]
        self.share = 1.0 - math.exp(-1.0 / (RATE * LAG))
        self.rng = np.random.default_rng(0)

    def advance(self, order: Order) -> np.ndarray:
        read = self.position + 0.003 * self.rng.standard_normal(1)
        self.queue.append(order.position)
        self.position = self.position + self.share * (self.queue.pop(0) - self.position)
        return np.asarray(read)

    def truth(self) -> np.ndarray:
        return self.position


@contextmanager
def serving(server: UdpServer | SerialServer | CanServer) -> Iterator[None]:
    """A far end in a thread of its own."""
    over = threading.Event()
    said = Hello(
        name="lag", axes=("roll",), units=("deg",), rate=RATE, watchdog=1.0, intersample="zoh",
        limits={"roll": Limits(position=20, velocity=200, acceleration=4000, unit="deg")},
        source="a lag",
    )  # fmt: skip

    def far() -> None:
        with server:
            serve(server, FarEnd(said), Lag(), clock=SystemClock(), until=over.is_set)

    thread = threading.Thread(target=far)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


@contextmanager
def cable() -> Iterator[tuple[str, str]]:
    """Two pseudo-terminals, what goes into one comes out of the other."""
    pairs, over = [os.openpty() for _ in range(2)], threading.Event()
    masters = [master for master, _ in pairs]

    def carry() -> None:
        while not over.is_set():
            for one in select.select(masters, [], [], 0.05)[0]:
                os.write(masters[1 - masters.index(one)], os.read(one, 4096))

    thread = threading.Thread(target=carry)
    thread.start()
    try:
        yield os.ttyname(pairs[0][1]), os.ttyname(pairs[1][1])
    finally:
        over.set()
        thread.join()


def over(kind: str) -> list[Row]:
    """The lag at the far end of a line, in real time."""
    times: dict[str, float | str] = {"stale": 5.0, "answer": 20.0}
    with ExitStack() as stack:
        if kind == "udp":
            server = UdpServer("127.0.0.1", 0)
            where = f"udp://127.0.0.1:{server.address[1]}"
            stack.enter_context(serving(server))
        elif kind == "serial":
            near, far = stack.enter_context(cable())
            stack.enter_context(serving(SerialServer(far)))
            where = f"serial:{near}"
        else:
            stack.enter_context(serving(CanServer("rigs", interface="virtual")))
            where, times = "can:rigs", times | {"interface": "virtual"}
        rig = find_rig(where, description=describe({"options": times})).rig
        record = hmpim.run(rig, swept(axis="roll"))
    pair = hmpim.identify(record)["roll.position", "roll.command"]
    return rows_of(pair, delay=LATE / RATE, time_constant=LAG)


def mounted() -> list[Row]:
    carrier = MotionTable()
    truth = {"delay": 0.012, "natural_frequency": 8.0, "damping_ratio": 0.5}
    unit = CarriedSensor(
        hmpim.rigs.Sensor(noise_std=0.01, name="unit", output_name="angle", **truth),
        fs=230.0,
        clock_offset=0.020,
        clock_drift=5e-5,
    )
    limits = carrier.limits_of("yaw", travel=3.0, share=0.9)
    sweep = hmpim.design(band=(0.5, 40), duration=5, fs=1000, axis="yaw", limits=limits)
    record = hmpim.run(Mounted(carrier, unit), sweep, rng=1)
    seen = hmpim.identify(record.with_roles(inputs=["yaw.position"], outputs=["angle"]))
    return rows_of(seen["angle", "yaw.position"], **truth)


def software(rig: str) -> list[Row]:
    """Four samples late and a pole at 0.8, sample over sample."""
    record: Record = hmpim.run(find_rig(rig).rig, swept())
    pair = hmpim.identify(record).pairs[0]
    return rows_of(pair, delay=4 / RATE, time_constant=-1.0 / (RATE * math.log(0.8)))


def python() -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        (path := Path(folder) / "filter.py").write_text(PYTHON)
        return software(f"python:{path}:Filter")


def process() -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        (path := Path(folder) / "filter.py").write_text(PROCESS)
        return software(f"process:{sys.executable} {path}")


def fmu() -> list[Row]:
    """The sensor's model, written as an FMU and found again."""
    truth = {"delay": 0.0, "natural_frequency": 8.0, "damping_ratio": 0.5}
    unit = hmpim.Sensor(noise_std=0.001, **truth)
    model = hmpim.identify(hmpim.run(unit, swept(top=20.0), rng=1))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "unit.fmu"
        hmpim.export(model, to="fmu", path=path)
        record = hmpim.run(find_rig(f"fmu:{path}").rig, swept(top=20.0))
    written, pair = model.pairs[0].parameters, hmpim.identify(record).pairs[0]
    known = {"natural_frequency": written.natural_frequency, "damping_ratio": written.damping_ratio}
    return rows_of(pair, **{name: each.value for name, each in known.items() if each is not None})


def brightness(frame: np.ndarray) -> tuple[float, float]:
    """A tracker that errs by the noise alone: centre of all that is above the background."""
    above = np.clip(frame.astype(float) - 90.0, 0.0, None)
    return float(above.sum(axis=0) @ (np.arange(frame.shape[1]) + 0.5) / above.sum()), 60.0


def tracker() -> list[Row]:
    limits = Limits(position=2, velocity=30, unit="deg")
    sweep = hmpim.design(band=(0.1, 5), duration=8, fs=480, limits=limits)
    unit = TrackerRig(
        tracker=brightness, camera=Camera(latency=2 / 60), scene=Scene(clutter_std=0.0)
    )
    pair = hmpim.identify(hmpim.run(unit, sweep, rng=1)).pairs[0]
    return rows_of(pair, delay=2 / 60, hold_period=1 / 60, scale_factor=1.0)


def seeker() -> list[Row]:
    limits = Limits(position=3, velocity=15, acceleration=700, unit="deg")
    sweep = hmpim.design(band=(0.1, 6), duration=20, fs=500, limits=limits, axis="azimuth")
    unit = SeekerRig(track_gain=4.0, camera=Camera(latency=0.05))
    pair = hmpim.identify(hmpim.run(unit, sweep, rng=1)).pairs[0]
    return rows_of(pair, bandwidth_phase90=unit.bandwidth(hold="removed"))


RIGS: dict[str, tuple[str, Callable[[], list[Row]]]] = {
    "sensor": ("`sensor`", sensor),
    "table": ("`table`, friction off", table),
    "udp": ("`udp://`", lambda: over("udp")),
    "serial": ("`serial:`, pseudo-terminal", lambda: over("serial")),
    "can": ("`can:`, virtual bus", lambda: over("can")),
    "mounted": ("`Mounted`", mounted),
    "python": ("`python:`", python),
    "process": ("`process:`", process),
    "fmu": ("`fmu:`", fmu),
    "tracker": ("`tracker`", tracker),
    "seeker": ("`seeker`", seeker),
}


def _error(estimate: Estimate, factor: float) -> str:
    """Standard error; where there is none, the interval."""
    if estimate.std is not None:
        return f" ± {factor * estimate.std:.2g}"
    if estimate.ci95 is None or None in estimate.ci95:
        return ""
    return " ({:.5g} to {:.5g})".format(*(factor * end for end in estimate.ci95))


def lines(name: str) -> Iterator[str]:
    """Rows of a rig, as they stand in the document."""
    words, found = RIGS[name]
    for what, estimate, true, factor, unit in found():
        if estimate is None:
            cell = "–"
        else:
            cell = f"{factor * estimate.value:.5g}{_error(estimate, factor)}"
            cell += "" if estimate.verdict == "ok" else " (doubtful)"
        yield (
            f"| {words} | {what}{f', {unit}' if unit else ''} | {cell} | {factor * true:.5g} | "
            f"`{name}` |"
        )


if __name__ == "__main__":
    for wanted in sys.argv[1:] or list(RIGS):
        for line in lines(wanted):
            print(line, flush=True)
