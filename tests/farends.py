"""The served table and runs over it as processes of their own; what was done is read from files."""

import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from forking import PATIENCE
from hmpim.formats.stimulus_files import save_stimulus
from hmpim.rigs import MotionTable
from hmpim.stimulus import design

HMPIM = [sys.executable, "-m", "hmpim.cli.main"]
RATE = 500.0
AXIS = "azimuth"
LIMITS = MotionTable().limits_of(AXIS)
SWEEP = design(
    band=(0.4, 10), duration=5, fs=RATE, axis=AXIS,
    limits=MotionTable().limits_of(AXIS, travel=10.0, share=0.95),
)  # fmt: skip


def wait_for(condition, seconds=PATIENCE):
    deadline = time.monotonic() + seconds
    while not (found := condition()):
        assert time.monotonic() < deadline, "nothing happened"
        time.sleep(0.03)
    return found


class Table:
    """`hmpim table`, and its trace."""

    def __init__(self, folder):
        self.trace = folder / "trace.csv"
        said = folder / "table.txt"
        with said.open("w") as out:
            self.process = subprocess.Popen(
                [*HMPIM, "table", "--udp", "127.0.0.1:0", "--rate", f"{RATE:g}",
                 "--trace", str(self.trace)],
                stdout=out, env=os.environ | {"PYTHONUNBUFFERED": "1"},
            )  # fmt: skip
        try:
            wait_for(lambda: "udp://" in said.read_text())
        except BaseException:  # left alone, it would run on for ever, before all others
            self.process.kill()
            self.process.wait()
            raise
        self.port = int(said.read_text().split("udp://127.0.0.1:")[1].split(",")[0])
        self.read_to = 0

    def close(self):
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(PATIENCE)
        finally:
            self.process.kill()
            self.process.wait()
        assert code == 0

    def rows(self):
        """What it has done since the last call, as far as whole lines are written."""
        with self.trace.open() as file:
            first = file.readline()
            head = first.strip().split(",")
            if self.read_to:
                file.seek(self.read_to)
            text = file.read() if first.endswith("\n") else ""
            whole = text[: text.rfind("\n") + 1]
            self.read_to = (self.read_to or file.tell() - len(text)) + len(whole)
        rows = [line.split(",") for line in whole.splitlines()]
        column = {name: k for k, name in enumerate(head)}
        return Ticks(
            time=np.array([float(r[column["time"]]) for r in rows]),
            state=np.array([r[column["state"]] for r in rows]),
            order=np.array([float(r[column[f"{AXIS}.order"]]) for r in rows]),
            rate=np.array([float(r[column[f"{AXIS}.rate"]]) for r in rows]),
            true=np.array([float(r[column[f"{AXIS}.true"]]) for r in rows]),
        )

    def until_rest(self, *, within=PATIENCE):
        """All that it does until it stands."""
        parts = []

        def there():
            part = self.rows()
            parts.append(part)
            return part.state.size and part.state[-1] in ("AT_REST", "FAULT", "IDLE")

        wait_for(there, within)
        return Ticks.joined(parts)


@dataclass(frozen=True, kw_only=True)
class Ticks:
    time: np.ndarray
    state: np.ndarray
    order: np.ndarray
    rate: np.ndarray
    true: np.ndarray

    @classmethod
    def joined(cls, parts):
        names = ("time", "state", "order", "rate", "true")
        return cls(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in names})


RELAY = """
import os, select, socket, sys, time
near = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
near.bind(("127.0.0.1", 0))
far = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
far.connect(("127.0.0.1", int(sys.argv[1])))
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))
except (AttributeError, OSError):
    pass
print(near.getsockname()[1], flush=True)
peer = None
while True:
    came = select.select([0, near, far], [], [])[0]
    if 0 in came:
        print(time.perf_counter(), flush=True)
        break
    if near in came:
        data, peer = near.recvfrom(65507)
        far.send(data)
    if far in came:
        near.sendto(far.recv(65507), peer)
while True:
    time.sleep(1)
"""


class Cable:
    """UDP passed on from one port to another, until it is pulled; in a process of its own."""

    def __init__(self, port):
        self.process = subprocess.Popen(
            [sys.executable, "-S", "-c", RELAY, str(port)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        self.port = int(self.process.stdout.readline())

    def pull(self):
        """Pull it; return when nothing passed any more, s of the clock."""
        self.process.stdin.close()
        return float(self.process.stdout.readline())

    def close(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()
        self.process.stdin.close()  # of one that was not pulled


RAISING = """
import sys, time
from hmpim.experiment import RunLog, run
from hmpim.formats.stimulus_files import read_stimuli
from hmpim.rigs.catalogue import find_rig

def watch(played):
    if played.block.time[-1] >= float(sys.argv[2]):
        open("raised.txt", "w").write(repr(time.perf_counter()))
        raise ZeroDivisionError("from a watcher")

with RunLog("run.log") as log:
    run(
        find_rig("udp://127.0.0.1:" + sys.argv[1]).rig, read_stimuli("s.csv")[0],
        path="r.h5", subscribers=[watch], log=log,
    )
"""


def begin(folder, port, *, raises_at=None, nursery=None):
    """Begin `hmpim run` of the sweep, its record in r.h5.

    With `raises_at`, a program of one's own instead, whose watcher raises at this time (s).
    """
    save_stimulus(SWEEP, folder / "s.csv")
    if raises_at is not None:
        source, arguments = RAISING, [str(port), str(raises_at)]
    else:
        source = None
        arguments = ["run", "--rig", f"udp://127.0.0.1:{port}", "--axis", AXIS, "s.csv"]
        arguments += ["-o", "r.h5", "--log", "run.log"]
    if nursery is not None:
        return nursery.begin(folder, *arguments, source=source)
    return subprocess.Popen(
        [*HMPIM, *arguments] if source is None else [sys.executable, "-c", source, *arguments],
        cwd=folder, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True,
    )  # fmt: skip


class OvertakenError(Exception):
    """The computer was held up: the far end stopped the run of itself, or it was over already."""

    def __init__(self, said, parts):
        super().__init__(said)
        self.parts = parts


def moving_since(table, at, process):
    """Ticks so far once the table has moved for `at` s."""
    parts = []

    def enough():
        if process.poll() is not None:
            said = str(process.communicate(timeout=PATIENCE)[1])
            assert "stopped by itself" in said or process.returncode == 0, said
            raise OvertakenError(said, parts)
        parts.append(table.rows())
        ticks = Ticks.joined(parts)
        moving = ticks.time[ticks.state == "MOVING"]
        return moving.size and time.perf_counter() >= moving[0] + at

    wait_for(enough)
    return parts


def check_rest(ticks, *, ended):
    """From `ended` (s of the clock) on: braked in time, smoothly, to rest, inside all limits.

    Where the far end stopped of itself, `ended` is None.
    """
    assert np.abs(ticks.order).max() <= LIMITS.position
    assert np.abs(ticks.true).max() <= LIMITS.position
    moving = np.flatnonzero(ticks.state == "MOVING")
    after = np.flatnonzero(ticks.state[moving[0] :] != "MOVING")
    assert after.size
    first = moving[0] + after[0]  # braking; or at rest at once, where it was just turning round
    assert ended is None or ticks.time[first] - ended < 0.1
    change = np.abs(np.diff(ticks.rate[first - 1 :])) * RATE
    assert change.max() < 1.01 * LIMITS.acceleration
    assert ticks.rate[-1] == 0.0
    return ticks.time[first]


def folder_of(path: Path, name: str) -> Path:
    folder = path / name
    folder.mkdir()
    return folder
