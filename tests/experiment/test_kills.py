"""What ends a run, with real processes: the table comes to rest, and the record is kept."""

import os
import signal
import time
from collections import deque
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from farends import (
    AXIS,
    SWEEP,
    Cable,
    OvertakenError,
    Table,
    Ticks,
    begin,
    check_rest,
    moving_since,
    wait_for,
)
from forking import PATIENCE, Nursery
from hmpim.formats.recording import read_recording
from hmpim.identify import identify
from tests_support import in_studies

KINDS = ("kill", "interrupt", "cable", "exception")
SHARES = (0.6, 0.15, 0.15, 0.1)
LANES = 4
AGAIN = 1000
"""Added to the number of a run that is begun again."""


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    table = Table(tmp_path_factory.mktemp("table"))
    yield table
    table.close()


def ended(table, folder, kind, at, nursery=None):
    """Begin a run, end it in some way `at` s into the motion, and return all that was done."""
    cable = Cable(table.port) if kind == "cable" else None
    process = begin(
        folder,
        table.port if cable is None else cable.port,
        raises_at=at if kind == "exception" else None,
        nursery=nursery,
    )
    try:
        try:
            parts = moving_since(table, 0.5 * at if kind == "exception" else at, process)
        except OvertakenError as error:
            check_rest(Ticks.joined([*error.parts, table.until_rest()]), ended=None)
            raise
        if kind == "exception":
            wait_for((folder / "raised.txt").exists)
        elif cable is not None:
            now = cable.pull()
        else:
            os.kill(process.pid, signal.SIGKILL if kind == "kill" else signal.SIGINT)
            now = time.perf_counter()
        _, said = process.communicate(timeout=PATIENCE)
        if kind == "exception":
            now = float((folder / "raised.txt").read_text())
    finally:
        process.kill()
        process.wait()
        if cable is not None:
            cable.close()
    parts.append(table.until_rest())
    return Ticks.joined(parts), now, process.returncode, said


def check(table, folder, kind, at, nursery=None):
    ticks, now, code, said = ended(table, folder, kind, at, nursery)
    check_rest(ticks, ended=now)
    moving = ticks.time[ticks.state == "MOVING"]
    kept = read_recording(folder / "r.h5")
    assert not kept.complete
    assert [f.code for f in kept.record.findings if f.code == "incomplete"]
    for channel in (*kept.record.inputs, *kept.record.outputs):
        assert channel.time[-1] - channel.time[0] > moving[-1] - moving[0] - 0.5
    assert kept.rig == "table"
    assert kept.stimuli[0].axis == AXIS
    if kind == "kill":
        assert code == -signal.SIGKILL
    elif kind == "interrupt":
        assert code == 130
        assert "ended early (Ctrl-C)" in str(kept.record.findings)
        assert "table was commanded to stop" in (folder / "run.log").read_text()
    elif kind == "exception":
        assert code == 1
        assert "ZeroDivisionError: from a watcher" in said
        words = "a subscriber failed: ZeroDivisionError: from a watcher"
        assert f"ended early ({words})" in str(kept.record.findings)
        log = (folder / "run.log").read_text()
        assert f"fault  {words}" in log or f"fault {words}" in log
        assert "commanded to stop" in log
    else:
        assert code == 2
        assert "its watchdog" in said or "stopped by itself" in said  # who sees it first
    return kept.record


def check_identified(record):
    """What is found of the part that was kept is right: held at rest, the table follows exactly."""
    pair = identify(record)[f"{AXIS}.position", f"{AXIS}.command"]
    assert pair.parameters.scale_factor.value == pytest.approx(1.0, abs=0.03)
    assert pair.fit_percent > 95


@pytest.mark.parametrize(
    ("kind", "at"),
    [("kill", 2.6), ("cable", 0.8), *in_studies(("interrupt", 0.8), ("exception", 0.8))],
)
def test_at_rest_inside_the_limits_and_the_record_kept_and_identified(table, tmp_path, kind, at):
    for number in range(5):
        (place := tmp_path / str(number)).mkdir()
        try:
            record = check(table, place, kind, at)
            break
        except OvertakenError:  # the computer was held up: at rest and in limits all the same
            continue
    else:
        pytest.fail("overtaken five times")
    if kind == "kill":  # the others in the study
        check_identified(record)


def worked_through(lane, jobs, nursery, folder):
    """End one run after the other on a table of its own; records of two seconds and more."""
    (place := folder / f"table-{lane}").mkdir()
    table, kept = Table(place), []
    try:
        while jobs:
            number, kind, at = jobs.popleft()
            (place := folder / str(number)).mkdir()
            try:
                if kind == "kill" and at < 0.6:  # nothing needs to be on the disk yet
                    ticks, now, *_ = ended(table, place, kind, at, nursery)
                    check_rest(ticks, ended=now)
                    continue
                record = check(table, place, kind, max(at, 0.6), nursery)
            except OvertakenError:
                assert number < AGAIN * 5, "overtaken five times"
                jobs.append((number + AGAIN, kind, at))
                continue
            except BaseException as error:
                error.add_note(f"run {number}: {kind} at {at:.4f} s")
                raise
            if at > 2.0:
                kept.append(record)
    finally:
        table.close()
    return kept


def number_of_runs():
    return int(os.environ.get("HMPIM_KILLS", "200"))


@pytest.mark.study
def test_at_any_moment(tmp_path):
    """200 moments drawn at random, on four tables; identified wherever two seconds were kept."""
    rng = np.random.default_rng(int(os.environ.get("HMPIM_KILLS_SEED", "0")))
    jobs = deque(
        (
            number,
            KINDS[int(rng.choice(4, p=SHARES))],
            rng.uniform(0.0, SWEEP.samples / SWEEP.fs - 0.6),
        )
        for number in range(number_of_runs())
    )
    nursery = Nursery()
    with ThreadPoolExecutor(LANES) as lanes:  # one that fails is told before anything else
        works = [lanes.submit(worked_through, k, jobs, nursery, tmp_path) for k in range(LANES)]
    errors = [error for work in works if (error := work.exception()) is not None]
    if errors:
        raise BaseExceptionGroup(f"{len(errors)} of {LANES} lanes", errors)
    kept = [record for work in works for record in work.result()]
    nursery.close()
    again = sum(int(path.name) >= AGAIN for path in tmp_path.iterdir() if path.name.isdigit())
    print(f"{again} runs were overtaken and begun again; {len(kept)} records are identified")
    for record in kept:
        check_identified(record)
