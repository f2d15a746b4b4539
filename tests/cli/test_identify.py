"""`hmpim identify`: what it prints and writes, and how it refuses."""

import json
import math
import re
import subprocess
import sys
from dataclasses import replace

import pytest
from typer.testing import CliRunner

import hmpim
from hmpim.cli.main import app
from hmpim.identify import Identification
from tests_support import in_studies

RUNNER = CliRunner()
NAMED = ["--input", "u", "--output", "y"]

REASONS = {
    "unequal_lengths": r"line 201|cells|columns|fields|values",
    "three_samples": r"\b3 samples",
    "constant_output": r"constant at 1",
    "missing_column": r"'y'",
    "time_starts_again": r"starts again",
    "empty": r"empty",
    "binary": r"text|binary|UTF-8",
    "absent": r"absent\.csv",
    "folder": r"folder|directory",
}


def run(*arguments):
    return RUNNER.invoke(app, [str(a) for a in arguments])


def check_refusal(code, output, error, reason):
    assert code == 2
    assert output == ""
    assert error.startswith("hmpim: ")
    assert error.endswith("\n")
    assert error.count("\n") == 1
    assert "Traceback" not in error
    assert re.search(reason, error), error


def test_bad_input_is_refused_in_one_line(bad, tmp_path):
    name, path = bad
    target = tmp_path / "r.json"
    done = run("identify", path, *NAMED, "--json", target)
    check_refusal(done.exit_code, done.stdout, done.stderr, REASONS[name])
    assert not target.exists()


@pytest.mark.parametrize(
    "bad", ["binary", *in_studies(*(name for name in REASONS if name != "binary"))], indirect=True
)
def test_the_program_itself_refuses_in_one_line(bad):
    name, path = bad
    done = subprocess.run(
        [sys.executable, "-m", "hmpim.cli.main", "identify", str(path), *NAMED],
        capture_output=True,
        text=True,
        check=False,
    )
    check_refusal(done.returncode, done.stdout, done.stderr, REASONS[name])


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--fs", "abc"], "'abc'"),
        (["--fs", "-5"], "-5"),
        (["--intersample", "spline"], "spline"),
        (["--holdout", "1.5"], r"--holdout 1\.5 is not a share"),
        (["--holdout", "0.999"], r"samples"),
        (["--json", "/no/such/r.json"], r"--json: folder /no/such does not exist"),
        (["--report", "/tmp"], r"--report: /tmp is a folder"),
        (["--unknown"], "--unknown"),
        (["--input", "nope"], "nope"),
    ],
)
def test_bad_options_are_refused_in_one_line(good, arguments, reason):
    done = run("identify", good, "--output", "y", *arguments)
    check_refusal(done.exit_code, done.stdout, done.stderr, reason)


def test_a_good_record_is_printed_and_written(good, tmp_path):
    saved, page = tmp_path / "r.json", tmp_path / "r.html"
    stated = ("--intersample", "bandlimited")
    done = run("identify", good, *NAMED, *stated, "--json", saved, "--report", page)
    assert done.exit_code == 0, done.stderr
    assert done.stderr == ""
    assert "u → y" in done.stdout
    result = Identification.from_dict(json.loads(saved.read_text()))
    pair = result["y", "u"]
    assert pair.delay.value == pytest.approx(0.1, abs=5 * pair.delay.spread)
    assert pair.scale_factor.value == pytest.approx(2.0, abs=5 * pair.scale_factor.spread)
    assert f"{pair.bias.value:.3f}" in done.stdout
    assert page.read_text().startswith("<!DOCTYPE html>")


def test_quiet_prints_nothing(good):
    done = run("identify", good, *NAMED, "--quiet")
    assert (done.exit_code, done.stdout) == (0, "")


def test_without_a_time_column_the_rate_is_needed_and_used(good, tmp_path):
    rows = [line.partition(",")[2] for line in good.read_text().splitlines()]
    path = tmp_path / "untimed.csv"
    path.write_text("\n".join(rows) + "\n")
    refused = run("identify", path, *NAMED)
    check_refusal(refused.exit_code, refused.stdout, refused.stderr, "--fs|fs")
    saved = tmp_path / "r.json"
    stated = ("--intersample", "bandlimited")
    done = run("identify", path, *NAMED, *stated, "--fs", "100", "--json", saved)
    assert done.exit_code == 0, done.stderr
    delay = json.loads(saved.read_text())["pairs"][0]["parameters"]["delay"]
    assert delay["value"] == pytest.approx(0.1, abs=5 * delay["std"])


def test_holdout_fits_the_first_part_and_scores_the_rest(good, tmp_path):
    saved, page = tmp_path / "r.json", tmp_path / "r.html"
    done = run("identify", good, *NAMED, "--holdout", "0.5", "--json", saved, "--report", page)
    assert done.exit_code == 0, done.stderr
    assert json.loads(saved.read_text())["record"]["samples"] == 300
    line = next(line for line in done.stdout.splitlines() if line.startswith("Held out"))
    assert line in page.read_text(encoding="utf-8")
    fit = float(re.search(r"fit of ([\d.]+) %", line)[1])
    # Noise of 0.01 on an output of about 1.4 r.m.s. leaves 99.3 %.
    assert 98.5 < fit < 99.6


def test_gain_and_phase_at_chosen_frequencies(good):
    done = run("identify", good, *NAMED, "--at", "0.5", "--at", "45")
    assert done.exit_code == 0, done.stderr
    near, far = (line for line in done.stdout.splitlines() if line.startswith("y from u at"))
    found = re.search(r"measured ([-\d.]+) ± \S+ dB, ([-\d.]+) ± \S+°; the model ([-\d.]+)", near)
    assert float(found[1]) == pytest.approx(20 * math.log10(2.0), abs=0.05)
    assert float(found[2]) == pytest.approx(-0.5 * 360 * 0.1, abs=0.5)
    assert float(found[3]) == pytest.approx(20 * math.log10(2.0), abs=0.05)
    assert "not measured there; the model" in far
    done = run("identify", good, *NAMED, "--at", "-3")
    check_refusal(done.exit_code, done.stdout, done.stderr, "-3 Hz is not positive")
    done = run("identify", good, *NAMED, "--at", "900")
    check_refusal(done.exit_code, done.stdout, done.stderr, "beyond the Nyquist frequency 50 Hz")


def test_a_doubtful_pair_without_a_model_has_no_gain_and_phase_and_no_prediction(
    good, tmp_path, monkeypatch
):
    """A weak coupling lacks its delay: it is said, and the other pairs are still read."""
    identified = hmpim.identify

    def weak(*words, **options):
        found = identified(*words, **options)
        (pair,) = found.pairs
        known = replace(pair.parameters, delay=None)
        return replace(found, pairs=(replace(pair, parameters=known, verdict="doubtful"),))

    monkeypatch.setattr(sys.modules["hmpim.identify"], "identify", weak)
    done = run("identify", good, *NAMED, "--at", "0.5", "--holdout", "0.4")
    assert done.exit_code == 0, done.stderr
    said = " ".join(done.stdout.split())
    assert "y from u has no model with error bars: no gain, no phase." in said
    assert "no model to predict with" in said


def test_a_failure_while_writing_leaves_the_old_file(good, tmp_path, monkeypatch):
    saved = tmp_path / "r.json"
    saved.write_text("old")

    def full(place, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", full)
    done = run("identify", good, *NAMED, "--quiet", "--json", saved)
    check_refusal(done.exit_code, done.stdout, done.stderr, "No space left on device")
    assert saved.read_text() == "old"


@pytest.mark.study
@pytest.mark.real_data
def test_a_held_input_of_a_real_circuit_predicts_what_it_has_not_seen(measured, tmp_path):
    files = sorted(measured.glob("rcrc/prbs.csv"))
    done = run("identify", files[0], "--holdout", "0.75", "--report", tmp_path / "r.html")
    assert done.exit_code == 0, done.stderr
    fit = float(re.search(r"fit of ([\d.]+) %", done.stdout)[1])
    assert fit > 98.0
