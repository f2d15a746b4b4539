"""``hmpim run`` and ``hmpim rigs``: as a user types them."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app
from hmpim.formats import load
from hmpim.formats.recording import read_recording
from hmpim.formats.stimulus_files import save_stimulus
from hmpim.stimulus import Limits, design
from tests_support import designed_once

LIMITS = Limits(position=10, velocity=300, acceleration=5000, unit="deg")
RIG = """
rig = "sensor"
unit = "deg"
limits = {position = 10.0, velocity = 300.0, acceleration = 5000.0}
[options]
delay = 0.02
natural_frequency = 15.0
damping_ratio = 0.6
noise_std = 0.01
"""


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("platformdirs.user_config_path", lambda *_a, **_k: tmp_path / "nobody")
    save_stimulus(designed_once(band=(0.1, 20), duration=4, fs=200, limits=LIMITS), "s.csv")
    (tmp_path / "rig.toml").write_text(RIG)
    (tmp_path / "hmpim.toml").write_text("[rigs.eye]\n" + RIG.replace("[opt", "[rigs.eye.opt"))
    return tmp_path


def test_from_a_file_to_the_record_the_result_and_the_page(folder):
    out = run(
        *("run", "--rig", "eye", "s.csv", "-o", "r.csv", "--log", "run.log", "--seed", "3"),
        *("--json", "r.json", "--report", "r.html"),
    )
    assert out.exit_code == 0, out.output
    record = load("r.csv")
    assert record.samples >= 800
    assert np.abs(record.inputs[0].values).max() <= 10.0
    (pair,) = json.loads((folder / "r.json").read_text())["pairs"]
    delay = pair["parameters"]["delay"]
    assert abs(delay["value"] - 0.02) < 4 * delay["std"]
    assert "<html" in (folder / "r.html").read_text()[:200]
    stages = re.findall(r"(\w+) [\d.]+ s \([\d.]+ s of processor\)", out.output)
    assert stages == ["run", "identification", "page"]
    kinds = [line.split()[2] for line in (folder / "run.log").read_text().splitlines()[1:]]
    assert kinds == ["check", "arm", "start", "done", "stop"]
    same = run("run", "--rig-file", "rig.toml", "s.csv", "-o", "again.csv", "--seed", "3")
    assert same.exit_code == 0, same.output
    assert load("again.csv").sha256 == record.sha256


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rig", "eye", "s.csv"], "the run would not be saved; name a file with -o"),
        (["--rig", "eye", "s.csv", "-o", "s.csv"], "-o s.csv is the stimulus itself"),
        (
            ["--rig", "eye", "s.csv", "-o", "r.csv", "--log", "r.csv"],
            "-o r.csv and --log r.csv are one file",
        ),
        (["--rig-file", "rig.toml", "s.csv", "--json", "rig.toml"], "is the rig's file itself"),
        (["--rig", "eye", "s.csv", "-o", "r.doc"], "-o r.doc must end in one of .h5, .hdf5, .csv"),
        (["--rig", "eye", "s.csv", "--json", "r.txt"], "--json r.txt must end in .json"),
        (["--rig", "eye", "s.csv", "-o", "no/r.csv"], "folder no does not exist"),
        (["--rig", "eye", "none.csv", "-o", "r.csv"], "there is no file 'none.csv'"),
        (["--rig", "eel", "s.csv", "-o", "r.csv"], "there is no rig 'eel'; there are eye,"),
        (["s.csv", "-o", "r.csv"], "no rig is named; give --rig"),
        (["--rig-file", "no.toml", "s.csv", "-o", "r.csv"], "'no.toml' cannot be read"),
    ],
)
def test_what_is_refused_in_one_line(folder, arguments, words):
    out = run("run", *arguments)
    assert out.exit_code == 2
    assert words in out.stderr
    assert out.stderr.count("\n") == 1
    assert not (folder / "r.csv").exists()


def test_a_stimulus_beyond_the_stated_limits_is_refused(folder):
    (folder / "rig.toml").write_text(RIG.replace("position = 10.0", "position = 9.0"))
    out = run("run", "--rig-file", "rig.toml", "s.csv", "-o", "r.csv", "--log", "run.log")
    assert out.exit_code == 2
    assert "peak position 9.99962 deg is beyond the limit 9 deg of 'sensor'" in out.stderr
    assert "fault  peak position 9.99962 deg" in (folder / "run.log").read_text()


def test_rigs_are_listed_and_the_broken_named(folder):
    with (folder / "hmpim.toml").open("a") as file:
        file.write('[rigs.bad]\nrig = "sensor"\nspeed = 3\n')
    out = run("rigs", "--json", "rigs.json")
    assert out.exit_code == 0, out.output
    data = json.loads((folder / "rigs.json").read_text())
    assert [(one["name"], one["rig"]) for one in data["named"]] == [
        ("eye", "sensor"),
        ("bad", None),
    ]
    assert "'speed' is not known" in data["named"][1]["fault"]
    assert {"sensor", "table"} <= {kind["name"] for kind in data["kinds"]}
    for words in ("eye", "simulated sensor of Fig. 1", "skipped:"):
        assert words in out.output


def test_a_rig_without_a_watchdog_is_refused_unless_that_is_said(folder, monkeypatch):
    class Bare:
        name, axes, limits = "bare", (), LIMITS
        prepared = False

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def prepare(self, stimulus):
            Bare.prepared = True

        def play(self, block):
            return 0.5 * block.position

        def stop(self):
            pass

    monkeypatch.setattr("hmpim.rigs.catalogue.find.load_builder", lambda _kind: lambda *_: Bare())
    out = run("run", "--rig", "bare", "s.csv", "-o", "r.h5")
    assert out.exit_code == 2
    assert "'bare' has no watchdog: if this process is killed, nothing stops it" in out.stderr
    assert not Bare.prepared
    (folder / "bare.toml").write_text('rig = "bare"\nwatchdog = 0.1\n')
    out = run("run", "--rig-file", "bare.toml", "s.csv", "-o", "r.h5", "--feel")
    assert out.exit_code == 0, out.output
    assert {f.code for f in load("r.h5").findings} == {"felt"}


def test_the_axis_is_that_of_the_stimulus_or_asked_for_or_the_only_one_described(folder):
    pytest.importorskip("mujoco")
    slow = Limits(position=0.5, velocity=20, acceleration=300, unit="deg")
    save_stimulus(design(band=(0.5, 10), duration=1, fs=500, limits=slow), "s.csv")
    out = run("run", "--rig", "table", "s.csv", "-o", "r.csv")
    assert out.exit_code == 2
    assert "the stimulus names no axis, and 'table' has roll, yaw, pitch, azimuth" in out.stderr
    assert run("run", "--rig", "table", "--axis", "pitch", "s.csv", "-o", "r.h5").exit_code == 0
    assert load("r.h5").inputs[0].name == "pitch.command"
    (folder / "t.toml").write_text('rig = "table"\naxes = ["yaw"]\n')
    assert run("run", "--rig-file", "t.toml", "s.csv", "-o", "r.h5").exit_code == 0
    assert load("r.h5").inputs[0].name == "yaw.command"
    save_stimulus(design(band=(0.5, 10), duration=1, fs=500, limits=slow, axis="roll"), "s.csv")
    out = run("run", "--rig", "table", "--axis", "pitch", "s.csv", "-o", "r.h5")
    assert "--axis pitch: the stimulus is for roll already; leave it out" in out.stderr


def test_ctrl_c_says_what_there_is_of_the_run(folder, monkeypatch):
    """A subscriber stands for the person who has seen enough."""

    def enough(played):
        if played.block.start > 100:
            raise KeyboardInterrupt

    monkeypatch.setattr("hmpim.cli.run._watching", lambda live: [enough])
    out = run("run", "--rig", "eye", "s.csv", "-o", "r.h5")
    assert out.exit_code == 130
    assert "stopped by Ctrl-C; what was recorded until then is in r.h5" in out.stderr
    assert not read_recording(folder / "r.h5").complete
    out = run("run", "--rig", "eye", "s.csv", "--json", "r.json")
    assert out.exit_code == 130
    assert "stopped by Ctrl-C; nothing was kept" in out.stderr


@pytest.mark.parametrize(
    ("stated", "words"),
    [
        ("rate = 123", "states rate = 123 Hz; design the stimulus at this rate"),
        ('unit = "rad"', "the stimulus is in 'deg', and the rig's description states unit = 'rad'"),
        ('axes = ["roll", "yaw"]', "the stimulus names no axis, and the rig's description states"),
        ("[limits.roll]\nposition = 5.0", "limits are stated for roll, and the stimulus names no"),
    ],
)
def test_a_stimulus_that_is_not_what_the_rig_states_is_refused(folder, stated, words):
    (folder / "unit.toml").write_text(f'rig = "sensor"\n{stated}\n')
    out = run("run", "--rig-file", "unit.toml", "s.csv", "-o", "r.h5")
    assert out.exit_code == 2
    assert words in out.stderr
    assert not (folder / "r.h5").exists()


def test_a_stimulus_is_for_one_of_the_axes_that_the_rig_states(folder):
    (folder / "unit.toml").write_text('rig = "sensor"\nunit = "°"\naxes = ["roll", "yaw"]\n')
    assert (
        run("run", "--rig-file", "unit.toml", "s.csv", "--axis", "yaw", "-o", "r.h5").exit_code == 0
    )
    out = run("run", "--rig-file", "unit.toml", "s.csv", "--axis", "nod", "-o", "r.h5")
    assert out.exit_code == 2
    assert (
        "the stimulus is for axis 'nod', and the rig's description states axes roll" in out.stderr
    )


@pytest.mark.parametrize("code", ["", "3"])
def test_software_that_exits_does_not_choose_the_exit_code(folder, code):
    (folder / "unit.py").write_text(f"import sys\n\n\ndef leaves(u):\n    sys.exit({code})\n")
    out = run("run", "--rig", "python:unit.py:leaves", "s.csv", "-o", "r.h5")
    assert out.exit_code == 2
    assert out.stderr.startswith(f"hmpim: the rig called sys.exit({code or None})")


def test_a_run_that_breaks_off_says_in_its_one_line_what_is_kept(folder):
    (folder / "unit.py").write_text(
        "from itertools import count\n\nCALLS = count()\n\n\n"
        "def breaks(u):\n"
        "    if next(CALLS) == 500:\n"
        "        raise ValueError('boom')\n"
        "    return u\n"
    )
    out = run("run", "--rig", "python:unit.py:breaks:sample", "s.csv", "-o", "r.h5")
    assert out.exit_code == 2
    assert out.stderr.count("\n") == 1
    assert "boom; what was recorded until then is in r.h5" in out.stderr
    assert load("r.h5").samples == 500
