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

from hmpim.workbench.desks import Desk, Desks


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
    """Start a workbench on an empty folder."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "XDG_CONFIG_HOME": str(folder)}
    with (folder / "errors.txt").open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", "hmpim.cli.main", "workbench", "--no-browser",
             "--runs", str(folder / "runs"), *options],
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


def wait_until(true, *, seconds: float = 30.0) -> None:
    """Wait until something is so."""
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end, "it did not come true"
        time.sleep(0.05)


def desk_of(served: Served, desk: Desk | None = None) -> str:
    """Put a desk there, a fresh one by default; return its name."""
    given = Desk(name=secrets.token_hex(8)) if desk is None else desk
    return Desks(served.runs / ".workbench").put(given).name


def go(page, served: Served, name: str, desk: str = "") -> None:
    """Open a page of the workbench at a desk, a fresh one by default."""
    page.goto(f"{served.url}{name}?desk={desk or desk_of(served)}")
    page.wait_for_selector("main")
    page.wait_for_function("() => window.did_handshake === true")  # before it clicks are lost
