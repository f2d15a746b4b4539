"""A workbench that is served in a process of its own, for the tests of its pages."""

import os
import re
import secrets
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import hmpim
from docs_following import snippet
from hmpim.experiment.readiness import LIGHTS
from hmpim.workbench.desks import AxisRow, Checked, Desk, Desks, Wish
from hmpim.workbench.work.design import digest
from tests_support import designed_once

LIMITS = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
ROLL = Wish(
    rows=(
        AxisRow(
            name="roll", low=0.5, high=20.0, velocity=800.0, acceleration=30000.0, amplitude=5.0
        ),
    ),
    duration=300.0,
    fs=100.0,
)
"""A design for one axis of the table, longer than any test waits."""


@dataclass
class Served:
    """A workbench: its address, its folder, its process."""

    url: str
    runs: Path
    process: subprocess.Popen

    @property
    def port(self) -> int:
        return int(re.search(r":(\d+)/", self.url).group(1))

    @property
    def token(self) -> str:
        return self.url.rstrip("/").rsplit("/", 1)[1]


def serve(folder: Path, *options: str) -> Served:
    """Start a workbench on an empty folder, by the command that docs/workbench.md shows."""
    program, *words = snippet("workbench.md", "hmpim workbench").split()
    assert program == "hmpim"
    assert words == ["workbench", "--runs", "runs", "--rig", "table"]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "XDG_CONFIG_HOME": str(folder)}
    with (folder / "errors.txt").open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "hmpim.cli.main", *words, "--no-browser", *options],
            cwd=folder, stdout=subprocess.PIPE, stderr=errors,
            text=True, env=environment,
        )  # fmt: skip
    line = process.stdout.readline()
    found = re.search(r"http://\S+", line)
    assert found, (line, (folder / "errors.txt").read_text())
    return Served(url=found.group(), runs=folder / "runs", process=process)


def ended(served: Served) -> None:
    """Stop a workbench as Ctrl-C does."""
    if served.process.poll() is None:
        served.process.send_signal(signal.SIGINT)
        try:
            served.process.wait(30.0)
        except subprocess.TimeoutExpired:
            served.process.kill()
    served.process.stdout.close()
    served.process.wait()


def wait_until(true, *, page, seconds: float = 60.0) -> None:
    """Wait until something outside the browser is so; the page goes on meanwhile."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come true"
        page.wait_for_timeout(50)


def desk_of(served: Served, desk: Desk | None = None) -> str:
    """Put a desk there, a fresh one by default; return its name."""
    given = Desk(name=secrets.token_hex(8)) if desk is None else desk
    return Desks(served.runs / ".workbench").put(given).name


def go(page, served: Served, name: str, desk: str = "") -> None:
    """Open a page of the workbench at a desk, a fresh one by default."""
    page.goto(f"{served.url}{name}?desk={desk or desk_of(served)}")
    page.wait_for_selector("main")
    page.wait_for_function("() => window.did_handshake === true")  # before it clicks are lost


def checked(wish: Wish, rig: str) -> Desk:
    """A desk at which all lights are green for a design on a rig."""
    done = Checked(rig=rig, digest=digest(wish, rig), green=LIGHTS)
    return Desk(name=secrets.token_hex(8), wish=wish, rig=rig, checked=done)


def kept(served: Served, rig: str) -> list[Path]:
    """Records of a rig in the folder of the runs, in the order in which they were made."""
    found = served.runs.glob(f"*_{rig}*/run.h5")
    return sorted(found, key=lambda path: path.parent.stat().st_ctime_ns)


def recorded(delay: float = 0.15, *, rng: int = 1) -> hmpim.Record:
    """The paper's sensor under a sweep of 10 s."""
    stimulus = designed_once(band=(0.1, 20), duration=10, fs=200, limits=LIMITS)
    sensor = hmpim.Sensor(
        delay=delay, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    return hmpim.run(sensor, stimulus, rng=rng)
