"""`hmpim validate`: exit code 0, 1 and 2."""

import json
from dataclasses import replace

import numpy as np
import pytest
from nonlinear_predictions import chirp, moved, recorded
from scipy.signal import lfilter

import hmpim
from hmpim.cli.main import app

SENSOR = hmpim.Sensor(delay=0.1, time_constant=0.05, scale_factor=2.0, noise_std=0.02)
LIMITS = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
SWEEP = hmpim.design(band=(0.1, 10), duration=8, fs=100, limits=LIMITS)


def run(*words: object) -> int:
    return app([str(w) for w in words], standalone_mode=False)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("validate")
    slower = replace(SENSOR, delay=0.103)
    hmpim.save(hmpim.identify(hmpim.run(SENSOR, SWEEP, rng=1)), place / "old.json")
    hmpim.save(hmpim.identify(hmpim.run(slower, SWEEP, rng=2)), place / "new.json")
    hmpim.save(hmpim.run(SENSOR, SWEEP, rng=3), place / "right.csv")
    hmpim.save(hmpim.run(slower, SWEEP, rng=4), place / "late.csv")
    return place


def test_a_record_that_is_predicted_is_exit_0(folder, capsys):
    assert run("validate", folder / "old.json", folder / "right.csv", "--fit", "90") == 0
    shown = capsys.readouterr().out
    assert "Passed." in shown
    assert "coverage" in shown
    assert "at least 90 %" in shown


def test_a_record_that_is_not_is_exit_1_and_says_why(folder, capsys, tmp_path):
    words = ("--json", tmp_path / "v.json")
    assert run("validate", folder / "old.json", folder / "late.csv", *words) == 1
    shown = capsys.readouterr().out
    assert "Not passed." in shown
    assert "below 0.0001" in shown
    figures = json.loads((tmp_path / "v.json").read_text())
    failed = {c["name"] for c in figures["outputs"][0]["checks"] if not c["passed"]}
    assert "follows_input" in failed
    assert figures["passed"] is False


def test_a_record_is_read_as_identify_reads_it(folder, capsys, tmp_path):
    rows = [line.split(",") for line in (folder / "right.csv").read_text().splitlines()[2:]]
    bare = 2 * [f"{1000 * float(t)},{u},{y}" for t, u, y in rows]
    log = tmp_path / "log.csv"
    log.write_text("stamp,u,y\n" + "\n".join(bare) + "\n")
    assert run("validate", folder / "old.json", log, "--time", "stamp [ms]") == 2
    assert "choose one with --sweep N" in capsys.readouterr().err
    words = ("--time", "stamp [ms]", "--sweep", "2")
    assert run("validate", folder / "old.json", log, *words) == 0
    assert "Passed." in capsys.readouterr().out
    units = ("--unit", "u=deg", "--unit", "y=rad")
    assert run("validate", folder / "old.json", log, *words, *units) == 2
    assert "numbers are not converted" in capsys.readouterr().err


def test_an_older_result_is_compared_within_both_bars(folder, capsys):
    assert run("validate", folder / "new.json", "--against", folder / "old.json") == 1
    shown = capsys.readouterr().out
    (line,) = [x for x in shown.splitlines() if " delay " in x]
    assert "changed" in line
    (line,) = [x for x in shown.splitlines() if " time_constant " in x]
    assert "changed" not in line
    assert run("validate", folder / "old.json", "--against", folder / "old.json") == 0


def test_both_at_once(folder):
    old, new = folder / "old.json", folder / "new.json"
    assert run("validate", old, folder / "right.csv", "--against", old) == 0
    assert run("validate", old, folder / "right.csv", "--against", new) == 1


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["old.json"], "nothing to compare the result with"),
        (["old.json", "nowhere.csv"], "nowhere.csv"),
        (["old.json", "--against", "new.json", "--fit", "90"], "--fit is about a record"),
        (["old.json", "--against", "new.json", "--stamps", "log"], "--stamps is about a record"),
        (["old.json", "right.csv", "--sweep", "0"], "greater than or equal to 1"),
        (["right.csv", "right.csv"], "not a result"),
        (["old.json", "right.csv", "--noise-ratio", "0.5"], "noise_ratio = 0.5"),
        (["old.json", "right.csv", "--json", "old.json"], "old.json"),
    ],
)
def test_bad_input_is_exit_2_and_one_line(words, said, folder, capsys):
    words = [folder / w if w.endswith((".json", ".csv")) else w for w in words]
    assert run("validate", *words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1


def test_a_filter_read_back_from_its_file_is_held_against_another_record(tmp_path, capsys):
    rng = np.random.default_rng(1)
    for name in ("a.csv", "b.csv"):
        u = rng.standard_normal(800)
        y = lfilter([0.0, 0.3], [1.0, -0.7], u)
        hmpim.save(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0), tmp_path / name)
    found = hmpim.identify(hmpim.load(tmp_path / "a.csv"), intersample="sampled")
    hmpim.save(found, tmp_path / "r.json")
    assert run("validate", tmp_path / "r.json", tmp_path / "b.csv") != 2
    assert "fs = None" not in capsys.readouterr().err


def test_an_input_beyond_the_identified_amplitude_is_said(capsys, tmp_path):
    within, beyond = chirp(), chirp(1.4)
    hmpim.save(hmpim.identify(recorded(within, moved("backlash", within), 1)), tmp_path / "r.json")
    hmpim.save(recorded(beyond, moved("backlash", beyond), 2), tmp_path / "loud.csv")
    words = ("--json", tmp_path / "v.json")
    assert run("validate", tmp_path / "r.json", tmp_path / "loud.csv", *words) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert "'u' moves the output by up to 2.85" in shown
    (output,) = json.loads((tmp_path / "v.json").read_text())["outputs"]
    assert [finding["code"] for finding in output["findings"]] == ["beyond_reach"]


def test_an_older_result_in_other_units_is_converted_or_refused(folder, capsys, tmp_path):
    words = ("--unit", "u=rad", "--unit", "y=rad", "--json")
    rows = [line.split(",") for line in (folder / "right.csv").read_text().splitlines()[2:]]
    turned = [f"{t},{np.radians(float(u))},{np.radians(float(y))}" for t, u, y in rows]
    (tmp_path / "rad.csv").write_text("time,u,y\n" + "\n".join(turned) + "\n")
    channels = ("--input", "u", "--output", "y")
    result = tmp_path / "rad.json"
    assert run("identify", tmp_path / "rad.csv", *channels, *words, result) == 0
    capsys.readouterr()
    assert run("validate", result, "--against", folder / "old.json") == 0
    (line,) = [x for x in capsys.readouterr().out.splitlines() if " noise_std " in x]
    assert "rad" in line
    assert "deg" not in line
    volts = tmp_path / "volts.json"
    words = ("--unit", "u=rad", "--unit", "y=V", "--json")
    assert run("identify", tmp_path / "rad.csv", *channels, *words, volts) == 0
    capsys.readouterr()
    assert run("validate", volts, "--against", folder / "old.json") == 2
    assert "cannot be converted; compare results in like units" in capsys.readouterr().err
