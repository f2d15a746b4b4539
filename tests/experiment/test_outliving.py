"""A rig in a process of its own: the same record, and a stop even where the run is killed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from carriage import LIMITS, Carriage
from forking import PATIENCE
from hmpim.errors import RigError
from hmpim.experiment import OutlivingRig, RunLog, RunOptions, run
from hmpim.formats.recording import read_recording
from hmpim.identify import identify
from hmpim.stimulus import Sine, Stimulus
from tests_support import in_studies

SHORT = Stimulus(waveform=Sine(amplitude=0.15, frequency=2.0, duration=0.5), fs=200.0, unit="deg")


def traced(path):
    """Time, position, velocity, shape (n, 3), and whether it came to rest."""
    lines = path.read_text().rpartition("\n")[0].splitlines()  # the last may be half written
    rows = [[float(cell) for cell in line.split()] for line in lines if line != "rest"]
    return np.array(rows).reshape(-1, 3), lines[-1:] == ["rest"]


def wait_for(condition, process=None):
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert process is None or process.poll() is None, "the run ended before it was killed"
        assert time.monotonic() < deadline, "nothing happened"
        time.sleep(0.01)


def reached(path):
    """Time in the run of the last command, 0 before the first."""
    rows, _ = traced(path)
    return rows[-1, 0] if rows.size else 0.0


def check_rest(rows):
    """Inside the limits all the time, smoothly, and standing still in the end."""
    assert np.abs(rows[:, 1]).max() <= LIMITS.position
    assert abs(rows[-1, 2]) < 1e-9
    slope = np.abs(np.diff(rows[:, 2])) / np.maximum(np.diff(rows[:, 0]), 1e-4)
    assert slope.max() < 1.1 * LIMITS.acceleration


def test_the_record_is_the_same_as_without_and_the_stop_is_in_the_child(tmp_path):
    rig = OutlivingRig(Carriage, str(tmp_path / "there.txt"))
    record = run(rig, SHORT)
    alone = run(Carriage(tmp_path / "here.txt"), SHORT)
    assert np.array_equal(record.outputs[0].values, alone.outputs[0].values)
    assert np.array_equal(record.inputs[0].values, alone.inputs[0].values)
    timing = [f for f in record.findings if f.code == "timing"]
    assert "of 100 commands were a period or more late" in timing[0].message
    rows, rest = traced(tmp_path / "there.txt")
    assert rest
    check_rest(rows)


def test_an_error_in_the_child_is_the_rigs(tmp_path):
    with pytest.raises(RigError, match=r"FileNotFoundError: .*no/t.txt"):
        run(OutlivingRig(Carriage, str(tmp_path / "no" / "t.txt")), SHORT)


def killed(folder, number, at):
    """Run the carriage in processes of their own, kill the run at `at` s, wait for rest."""
    trace, path = folder / "t.txt", folder / "r.h5"
    script = Path(__file__).parents[1] / "carriage.py"
    process = subprocess.Popen([sys.executable, str(script), str(trace), str(path)])
    try:
        wait_for(lambda: trace.exists() and reached(trace) >= at, process)
        os.kill(process.pid, number)
        there = reached(trace)
        process.wait(PATIENCE)
        wait_for(lambda: traced(trace)[1])
    finally:
        process.kill()
        process.wait()
    rows, _ = traced(trace)
    check_rest(rows)
    kept = read_recording(path)
    assert not kept.complete
    assert kept.record.outputs[0].time[-1] > there - 0.5
    return kept, rows, there


@pytest.mark.parametrize("number", [signal.SIGKILL, *in_studies(signal.SIGINT, signal.SIGTERM)])
def test_killed_it_comes_to_rest_and_the_record_is_kept_and_identified(tmp_path, number):
    kept, rows, there = killed(tmp_path, number, at=2.2)
    # However busy the computer: it plays what it had been handed, 0.1 s, and then brakes.
    assert rows[-1, 0] < there + 1.0
    pair = identify(kept.record)["y", "u"]
    found = pair.parameters.time_constant
    assert abs(found.value - 0.05) < 4 * found.spread


def test_where_a_watchdog_is_needed_a_rig_without_one_is_refused(tmp_path):
    rig = Carriage(tmp_path / "t.txt")
    with pytest.raises(RigError, match=r"'carriage' has no watchdog: .* or use --no-watchdog"):
        run(rig, SHORT, options=RunOptions(watchdog=True))
    assert (tmp_path / "t.txt").read_text() == ""
    log = RunLog()
    run(rig, SHORT, log=log)
    assert any("'carriage' has no watchdog" in event.message for event in log.events)
    rig.watchdog = 0.1
    run(rig, SHORT, options=RunOptions(watchdog=True))
