"""``hmpim table``: the simulated motion table served over UDP, in real time."""

import signal
from contextlib import nullcontext
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, cast

import typer

from hmpim.cli.files import check_files
from hmpim.cli.terminal import say
from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from hmpim.rigs.table import CommandMode
    from hmpim.rigs.wire import Hello, Plant

__all__ = ["table"]


def table(
    udp: Annotated[
        str,
        typer.Option(
            "--udp",
            metavar="HOST:PORT",
            help="Address to serve at; 127.0.0.1 keeps it on this computer. Port 0: any free one.",
        ),
    ],
    rate: Annotated[
        float, typer.Option("--rate", metavar="HZ", help="Commands and samples per second.")
    ] = 1000.0,
    mode: Annotated[
        str,
        typer.Option("--mode", metavar="P|PV|PVA", help="Commands sent to the servos."),
    ] = "P",
    load: Annotated[
        str,
        typer.Option("--load", metavar="NAME", help="Load on the table: acceptance, bracket, ..."),
    ] = "acceptance",
    sensor: Annotated[
        Path | None,
        typer.Option(
            "--sensor",
            metavar="FILE",
            help="Serve the sensor that this rig file describes, on one axis that follows "
            "exactly, in place of the table.",
        ),
    ] = None,
    watchdog: Annotated[
        float,
        typer.Option(
            "--watchdog",
            metavar="S",
            help="Time without a command after which it brakes, at most 0.1 s.",
        ),
    ] = 0.08,
    seed: Annotated[
        int | None, typer.Option("--seed", min=0, help="Seed of the encoders' noise.")
    ] = (None),
    trace: Annotated[
        Path | None,
        typer.Option(
            "--trace", metavar="FILE", help="Write the true motion at every tick, as CSV."
        ),
    ] = None,
    clock_offset: Annotated[
        float,
        typer.Option(
            "--clock-offset", metavar="S", help="Set the table's clock ahead by this much."
        ),
    ] = 0.0,
    clock_drift: Annotated[
        float,
        typer.Option(
            "--clock-drift",
            metavar="PPM",
            help="Let the table's clock gain this many µs per second.",
        ),
    ] = 0.0,
) -> None:
    """Serve the simulated five-axis table, or a sensor, over UDP until Ctrl-C.

    It checks every command against Fig. 4's limits, brakes when no command arrives
    within the watchdog's time, and comes to rest inside its limits.
    """
    from hmpim.experiment.priority import undelayed
    from hmpim.rigs import SkewedClock, SystemClock
    from hmpim.rigs.wire import FarEnd, Trace, UdpServer, parse_address, serve

    if mode not in ("P", "PV", "PVA"):
        raise ArgumentError(f"--mode {mode!r} is not known; use P, PV or PVA")
    if not 0.0 < watchdog <= 0.1:
        raise ArgumentError(f"--watchdog {watchdog:g} s must be more than 0 and at most 0.1")
    check_files(reads={"--sensor": sensor}, writes={"--trace": trace})
    if sensor is None:
        hello, plant = _table(mode, load, rate=rate, watchdog=watchdog, seed=seed)
        what = f"Table at udp://{{}}:{{}}, {rate:g} Hz, {mode}, {load}"
    else:
        hello, plant = _sensor(sensor, rate=rate, watchdog=watchdog, seed=seed)
        what = f"Sensor {hello.name!r} at udp://{{}}:{{}}, {rate:g} Hz"
    farend = FarEnd(hello)
    clock = SkewedClock(SystemClock(), offset=clock_offset, drift=1e-6 * clock_drift)
    host, port = parse_address(udp)
    ended: list[int] = []

    def end(number: int, _frame: FrameType | None) -> None:
        ended.append(number)

    with UdpServer(host, port) as server:
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, end)
        at = server.address
        say(f"{what.format(at[0], at[1])}; Ctrl-C ends it")
        every = max(1, round(0.1 * rate))
        writing = None if trace is None else Trace(trace, hello.axes, every=every)
        with undelayed(realtime=True) as scheduling, writing or nullcontext():
            say(f"It has {scheduling}")
            serve(server, farend, plant, clock=clock, until=lambda: bool(ended), trace=writing)
    say("Table at rest" if sensor is None else "At rest")


def _table(
    mode: str, load: str, *, rate: float, watchdog: float, seed: int | None
) -> "tuple[Hello, Plant]":
    """The five-axis table."""
    import numpy as np

    from hmpim.rigs import MotionTable
    from hmpim.rigs.table import both_loads
    from hmpim.rigs.table.served import TablePlant, table_hello

    uut, target = both_loads(load)
    moved = MotionTable(mode=cast("CommandMode", mode), uut_load=uut, target_load=target)
    hello = table_hello(moved, rate=rate, watchdog=watchdog)
    return hello, TablePlant(moved, rate=rate, rng=np.random.default_rng(seed))


def _sensor(path: Path, *, rate: float, watchdog: float, seed: int | None) -> "tuple[Hello, Plant]":
    """The sensor of a rig file, on an axis of its own."""
    import numpy as np

    from hmpim.rigs import Sensor
    from hmpim.rigs.catalogue import find_rig, read_description
    from hmpim.rigs.wire import SensorPlant, sensor_hello
    from hmpim.stimulus import Limits

    found = find_rig("", description=read_description(path))
    if not isinstance(found.rig, Sensor):
        raise ArgumentError(
            f"--sensor {str(path)!r} describes {found.description.rig!r}, and a sensor is needed: "
            'rig = "sensor"'
        )
    stated = found.description.rate
    if stated is not None and stated != rate:
        raise ArgumentError(
            f"--rate {rate:g} Hz, and {str(path)!r} states rate = {stated:g}; make them agree"
        )
    if found.limits is not None and not isinstance(found.limits, Limits):
        raise ArgumentError(
            f"{str(path)!r} states limits of {', '.join(found.limits)}; a sensor is served on one "
            "axis, so state them under [limits]"
        )
    limits = Limits() if found.limits is None else found.limits
    hello = sensor_hello(found.rig, rate=rate, watchdog=watchdog, limits=limits)
    return hello, SensorPlant(found.rig, rate=rate, rng=np.random.default_rng(seed))
