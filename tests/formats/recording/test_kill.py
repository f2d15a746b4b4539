"""``kill -9`` at random moments: the file opens, and all but what was being written is there."""

import os
import random
import signal
import struct
import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import hmpim

# A process that forks writers, so that the packages are imported once. Each writer appends blocks
# of one to forty samples to a file that has to grow twice, and notes after each append when it
# returned and how many samples there are: a plain write, which a kill does not undo.
WRITERS = """
import os, struct, sys, time
from pathlib import Path
import numpy as np
from hmpim.formats.recording import RecordWriter
from hmpim.rigs import ChannelSpec, Layout, Samples

LAYOUT = Layout(channels=(
    ChannelSpec(name="u", role="input"),
    ChannelSpec(name="y", role="output"),
    ChannelSpec(name="heat", role="auxiliary"),
))

def write(folder, seed):
    rng = np.random.default_rng(seed)
    notes = os.open(folder / "notes", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    first = 0
    with RecordWriter(folder / "run.h5", LAYOUT, fs=1000.0, samples=600) as writer:
        while first < 2500:
            k = np.arange(first, min(2500, first + rng.integers(1, 41)))
            part = Samples(time=k / 1000.0, values=np.sqrt(k))
            slow = k[k % 100 == 0]
            heat = Samples(time=slow / 1000.0, values=slow / 7)
            writer.append({"u": part, "y": part, "heat": heat})
            first = int(k[-1]) + 1
            os.write(notes, struct.pack("<dq", time.monotonic(), first))
            time.sleep(0.0005)
    os.write(notes, struct.pack("<dq", time.monotonic(), -1))

for line in sys.stdin:
    folder, seed = line.rsplit(" ", 1)
    child = os.fork()
    if child == 0:
        try:
            write(Path(folder), int(seed))
        finally:
            os._exit(0)
    print(child, flush=True)
    sys.stdin.readline()  # not waited for before it was killed, so that its number stays its own
    os.waitpid(child, 0)
    print("ended", flush=True)
"""


class Writers:
    """The process above, and how long one of its writers takes."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", WRITERS],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        self.process.stdout.close()
        self.process.wait(timeout=60)

    def write(self, folder: Path, seed: int, *, kill_after: float | None) -> tuple[float, float]:
        """Start a writer, kill it after so many seconds; return when it was killed, and ended."""
        folder.mkdir()
        print(f"{folder} {seed}", file=self.process.stdin, flush=True)
        child = int(self.process.stdout.readline())
        begun = time.monotonic()
        if kill_after is not None:
            time.sleep(kill_after)
            killed = time.monotonic()
            os.kill(child, signal.SIGKILL)
        print("wait", file=self.process.stdin, flush=True)
        assert self.process.stdout.readline() == "ended\n"
        ended = time.monotonic()
        return ended if kill_after is None else killed, ended - begun


def noted(folder: Path) -> list[tuple[float, int]]:
    notes = folder / "notes"
    return list(struct.iter_unpack("<dq", notes.read_bytes())) if notes.exists() else []


def check(folder: Path, killed: float) -> str:
    """What a kill left: every append that had returned, nothing that was not appended."""
    notes = noted(folder)
    counts = [count for _, count in notes if count > 0]
    path = folder / "run.h5"
    if notes and notes[-1][1] == -1:
        found = hmpim.load(path)
        assert found.findings == ()
        assert found.samples == 2500
        return "closed"
    if not path.exists():
        assert not counts
        return "before"
    if max(counts, default=0) <= 1:  # a single sample is no record
        return "before"
    found = hmpim.load(path)
    assert not found.findings or [f.code for f in found.findings] in (
        ["incomplete"],
        ["incomplete", "channel_missing"],
    )
    half_a_second_before = max((n for t, n in notes if n > 0 and t < killed - 0.5), default=0)
    assert found.outputs[0].values.size >= half_a_second_before
    # Stronger: all that was appended, and of the append under way at most some channels.
    for channel in found.channels:
        k = np.arange(0, 2500, 100 if channel.name == "heat" else 1)[: channel.values.size]
        np.testing.assert_array_equal(channel.time, k / 1000.0)
        truth = k / 7 if channel.name == "heat" else np.sqrt(k)
        np.testing.assert_array_equal(channel.values, truth)
        if channel.name != "heat":
            assert max(counts, default=0) <= channel.values.size <= max(counts, default=0) + 40
    with h5py.File(path) as file:  # as any other program opens it
        assert file.attrs["complete"] in (0, 1)
    return "closing" if counts and counts[-1] == 2500 else "midway"


def kill_often(folder: Path, kills: int, seed: int) -> dict[str, int]:
    """Kill until so many writers were killed midway; count in which state each was."""
    chance = random.Random(seed)
    states = {"before": 0, "midway": 0, "closing": 0, "closed": 0}
    with Writers() as writers:
        _, whole = writers.write(folder / "whole", seed, kill_after=None)
        assert check(folder / "whole", 0.0) == "closed"
        for number in range(20 * kills):
            place = folder / str(number)
            killed, _ = writers.write(place, number, kill_after=chance.uniform(0.0, 1.1 * whole))
            state = check(place, killed)
            states[state] += 1
            if states["midway"] + states["closing"] >= kills:
                break
    return states


@pytest.mark.skipif(not hasattr(os, "fork"), reason="kill -9 and fork are of POSIX systems")
def test_kills_at_random_moments(tmp_path):
    states = kill_often(tmp_path, 4, seed=1)
    assert states["midway"] + states["closing"] >= 4, states


@pytest.mark.study
@pytest.mark.skipif(not hasattr(os, "fork"), reason="kill -9 and fork are of POSIX systems")
def test_kills_at_random_moments_study(tmp_path):
    states = kill_often(tmp_path, 200, seed=2)
    assert states["midway"] + states["closing"] >= 200, states
