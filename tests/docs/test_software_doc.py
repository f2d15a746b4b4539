"""docs/software.md: its programs and FMU run; its protocol and options are the code's."""

import dataclasses
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import hmpim
from docs_following import execute, lines_of, snippet
from fmu_support import build_fmu
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.software import FmuRig, ProcessRig
from hmpim.rigs.software.process import _GREETING
from tests_support import c_compiler

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "software.md").read_text(encoding="utf-8")


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder with the examples, a stimulus, and Python on the path."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    (tmp_path / "examples").symlink_to(ROOT / "examples")
    execute("hmpim design --band 0.5 40 --duration 1 --fs 200 --amplitude 2 --unit deg -o s.csv")


@pytest.mark.usefixtures("clone")
def test_programs_run_and_speak_the_protocol_of_the_code(tmp_path):
    c_compiler()
    for line in lines_of(snippet("software.md", "cc -std=c99")):
        execute(line)
    record = hmpim.load(tmp_path / "r.h5")
    assert "smoother.py" in record.source
    assert record.intersample == "sampled"

    shown = [line.split("  ")[0] for line in snippet("software.md", "> hmpim 1").splitlines()]
    sent = [line[2:] for line in shown if line.startswith(">") and line != "> ..."]
    told = subprocess.run(
        ["python", "examples/software/smoother.py"], input="\n".join(sent) + "\n", text=True,
        capture_output=True, check=True,
    )  # fmt: skip
    assert told.stdout.splitlines() == [line[2:] for line in shown if line.startswith("<")]
    assert sent[0].startswith(f"{_GREETING} rate=")
    defaults = {f.name: f.default for f in dataclasses.fields(ProcessRig)}
    assert f"within {defaults['answer']:g} s (option `answer`" in TEXT
    assert f"for the greeting, {defaults['startup']:g} s" in TEXT


@pytest.mark.usefixtures("clone")
def test_an_fmu_runs_with_and_without_its_rig_file(tmp_path):
    pytest.importorskip("fmpy")
    build_fmu(tmp_path / "axis.fmu", 2)
    execute(snippet("software.md", "hmpim run --rig fmu:axis.fmu"))
    assert hmpim.load(tmp_path / "r.h5").intersample is None
    (tmp_path / "axis.toml").write_text(snippet("software.md", 'rig = "fmu:axis.fmu"'))
    execute(snippet("software.md", "hmpim run --rig-file axis.toml"))
    assert hmpim.load(tmp_path / "r.h5").intersample == "foh"
    (tolerance,) = (f.default for f in dataclasses.fields(FmuRig) if f.name == "tolerance")
    assert tolerance == 1e-8


def test_the_trackers_rig_file_is_taken():
    text = snippet("software.md", 'rig = "tracker"')
    tracker = find_rig("", description=describe(tomllib.loads(text))).rig
    assert (tracker.camera.dropped, tracker.scene.noise_std) == (0.05, 3.0)


def test_its_tables_are_filled_and_its_files_there():
    for name in ("software", "tracker", "seeker"):
        part = TEXT.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end of {name} -->")[0]
        assert part.count("\n|") >= 3, name
    for path in re.findall(r"(?:examples|benchmarks|tests)/[\w/]+\.\w+", TEXT):
        assert (ROOT / path).is_file(), path


def test_the_seeker_found_its_quarter_turn():
    part = TEXT.partition("<!-- seeker -->\n")[2].partition("<!-- end of seeker -->")[0]
    rows = [re.findall(r"([\d.]+)(?: ± [\d.e-]+)?(?: \(doubtful\))? Hz", line)
            for line in part.splitlines()[2:]]  # fmt: skip
    assert rows
    for steps, closed, fitted, behind in rows:
        assert abs(float(steps) / float(closed) - 1) < 0.05
        assert abs(float(fitted) / float(behind) - 1) < 0.05
