"""`hmpim demo`: the whole way from limits to a page, with the truth beside."""

import json

import numpy as np
import pytest
from scipy.optimize import brentq
from typer.testing import CliRunner

from hmpim.cli.demo import TRUTH
from hmpim.cli.main import app

RUNNER = CliRunner()


def test_the_derived_truths_follow_from_the_others():
    fn, damping, delay = TRUTH["natural_frequency"], TRUTH["damping_ratio"], TRUTH["delay"]

    def lag(f, late):
        return 360 * f * late + np.degrees(np.arctan2(2 * damping * f / fn, 1 - (f / fn) ** 2))

    def gain(f):
        return 1 / np.hypot(1 - (f / fn) ** 2, 2 * damping * f / fn)

    closed_forms = {
        "bandwidth_phase90": brentq(lambda f: lag(f, delay) - 90, 0.1, 5),
        "bandwidth_phase90_without_delay": brentq(lambda f: lag(f, 0) - 90, 0.1, 30),
        "bandwidth_3db": brentq(lambda f: gain(f) - np.sqrt(0.5), 10, 30),
        "peak_gain_db": 20 * np.log10(gain(fn * np.sqrt(1 - 2 * damping**2))),
        "delay_low_frequency": delay + 2 * damping / (2 * np.pi * fn),
    }
    for name, value in closed_forms.items():
        assert TRUTH[name] == pytest.approx(value, rel=5e-5), name


@pytest.fixture(scope="module")
def shown(tmp_path_factory):
    """The demonstration's folder, which did not exist, and what it printed."""
    folder = tmp_path_factory.mktemp("shown") / "new" / "demo"
    done = RUNNER.invoke(app, ["demo", "--out", str(folder), "--seed", "3"])
    assert done.exit_code == 0, done.stderr
    return folder, done.stdout


def test_the_truth_is_found_within_its_error_bars(shown):
    folder, said = shown
    assert str(folder / "report.html") in said
    pair = json.loads((folder / "result.json").read_text())["pairs"][0]
    assert pair["verdict"] == "ok"
    assert pair["structure"] == "second_order"
    for name, truth in TRUTH.items():
        estimate = pair["parameters"][name]
        assert abs(estimate["value"] - truth) < 4 * estimate["std"], name
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert "Stimulus and its limits" in page


def test_one_seed_gives_one_result(shown, tmp_path):
    folder, _ = shown
    RUNNER.invoke(app, ["demo", "--out", str(tmp_path), "--seed", "3"])
    assert (tmp_path / "result.json").read_text() == (folder / "result.json").read_text()


def test_a_folder_that_cannot_be_made_is_refused_in_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    done = RUNNER.invoke(app, ["demo", "--out", str(tmp_path / "file" / "demo")])
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
