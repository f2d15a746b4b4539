"""Runs over a wire as docs/rigs.md and docs/live.md show them: two programs, on loopback."""

import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from contextlib import contextmanager
from functools import cache

import pytest
from typer.testing import CliRunner

import hmpim
from docs_following import execute, lines_of, snippet
from hmpim.cli.main import app
from hmpim.formats.stimulus_files import read_stimulus
from hmpim.rigs import SystemClock, pulse_bytes
from hmpim.rigs.catalogue import find_rig
from tests_support import in_studies, meanwhile

HMPIM = (sys.executable, "-m", "hmpim.cli.main")


@cache
def port(printed: int) -> int:
    """The port that is printed, or another where it is taken on this computer."""
    for wish in (printed, 0):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            try:
                line.bind(("127.0.0.1", wish))
            except OSError:
                continue
            return line.getsockname()[1]
    raise AssertionError("no port is free")


def here(text):
    return re.sub(r"(?<=127\.0\.0\.1:)\d+", lambda found: str(port(int(found[0]))), text)


@contextmanager
def serving(line):
    """What serves a rig, in a process of its own; it ends as by Ctrl-C."""
    environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
    command = [*HMPIM, *shlex.split(line)[1:]]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert "Ctrl-C ends it" in process.stdout.readline()
            yield
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(30.0)
    assert process.returncode == 0


LATE = re.compile(r"^hmpim: .*no (command|sample|pulse).* came", re.MULTILINE)


def played(line, *, apart):
    """Whether a line that is run, apart in a process of its own, played to its end.

    A computer that is too busy for real time is told so by the far end, which brakes: that it did
    is all that can be asked for then. Apart, it is tried again.
    """
    for _ in range(3 if apart else 1):
        if apart:
            done = subprocess.run([*HMPIM, *shlex.split(line)[1:]], capture_output=True, text=True,
                                  check=False, timeout=120)  # fmt: skip
            code, said = done.returncode, done.stderr
        else:
            invoked = CliRunner().invoke(app, shlex.split(line)[1:])
            code, said = invoked.exit_code, invoked.stderr
        if code == 0:
            return True
        assert LATE.search(said), said
    assert not apart, said
    return False


def ticking(to, rate):
    """Numbered pulses, one datagram each."""
    clock = SystemClock()

    def send(over):
        begun = clock.now()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for number in range(10**6):
                if over.is_set():
                    return
                clock.sleep_until(begun + number / rate)
                out.sendto(pulse_bytes(number), ("127.0.0.1", to))

    return meanwhile(send)


WHOLE = pytest.mark.parametrize("whole", [False, *in_studies(True)], ids=["small", "printed"])


@WHOLE
def test_the_table_is_run_over_a_wire_and_by_a_tick(whole, tmp_path, monkeypatch):
    """In `make test` nothing moves: the bench is found, and its limits take the sweep."""
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    table, design, run = lines_of(here(snippet("rigs.md", "hmpim table --udp")))
    tick = here(snippet("rigs.md", "hmpim run --rig bench --tick"))
    bench = here(snippet("rigs.md", 'rig = "udp://')).replace("[limits]", "[rigs.bench.limits]")
    (tmp_path / "hmpim.toml").write_text(f"[rigs.bench]\n{bench}", encoding="utf-8")
    execute(design)
    if not whole:
        (stimulus,), limits = read_stimulus("s.csv"), find_rig("bench").limits
        for what in ("position", "velocity", "acceleration"):
            assert abs(getattr(stimulus, what)).max() < getattr(limits, what)
        return
    with serving(table):
        assert played(run, apart=True)
        record = hmpim.load(tmp_path / "run.h5")
        assert [channel.name for channel in record.outputs] == ["pitch.position"]
        assert "  arm  " in (tmp_path / "run.log").read_text(encoding="utf-8")
        assert "pitch.position" in (tmp_path / "run.html").read_text(encoding="utf-8")
        with ticking(port(5006), 1000.0):
            assert played(tick, apart=True)
    found = [f.message for f in hmpim.load(tmp_path / "run.h5").findings if f.code == "tick"]
    assert found[0].startswith("The run was driven by an external tick of 1000 Hz")


@WHOLE
def test_a_run_over_a_wire_ends_when_it_is_sure(whole, tmp_path, monkeypatch):
    """In `make test` two of its sweeps alone, which are too few to be sure."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "unit.toml").write_text(snippet("live.md", 'rig = "sensor"'), encoding="utf-8")
    design, *_ = lines_of(snippet("live.md", "$ hmpim design"))
    assert "--duration 10 " in design
    small = design.replace("--duration 10 ", "--duration 1.2 ")
    execute((design if whole else small).removeprefix("$ "))
    table, run = lines_of(here(snippet("live.md", "hmpim table --udp")))
    with serving(table):
        done = played(run, apart=whole)
    if done:
        stopping = hmpim.load(tmp_path / "run.h5").stopping
        assert (stopping is not None) == whole
