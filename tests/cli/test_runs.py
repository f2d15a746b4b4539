"""`hmpim runs`: records and results of a folder joined, filtered and compared."""

import json
import os

import numpy as np
import pytest
from typer.testing import CliRunner

import hmpim
from hmpim.cli.main import app
from hmpim.errors import ArgumentError
from hmpim.formats.runs import filter_runs, find_runs


def run(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def bench(delay, seed):
    """A record of a sensor with a delay, noise and nothing else."""
    t = np.arange(600) / 100.0
    wave = lambda s: np.sin(2 * np.pi * (0.3 * s + 0.6 * s**2)) * (s > 0)  # noqa: E731
    y = wave(t - delay) + 0.05 * np.random.default_rng(seed).standard_normal(t.size)
    channels = ({"u": wave(t)}, {"y": y})
    return hmpim.Record.from_arrays(*channels, fs=100.0, intersample="bandlimited")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("runs")
    (place / "roll").mkdir()
    for name, delay in (("a", 0.050), ("roll/b", 0.050), ("c", 0.080)):
        record = bench(delay, len(name))
        hmpim.save(record, place / f"{name}.h5")
        hmpim.save(hmpim.identify(record), place / f"{name}-result.json")
    hmpim.save(bench(0.01, 9), place / "alone.csv")
    (place / "torn.h5").write_bytes((place / "a.h5").read_bytes()[:1500])
    (place / "notes.txt").write_text("not a run")
    (place / "other.json").write_text('{"a": 1}')
    return place


def test_a_record_and_its_result_are_one_run(folder):
    found = find_runs(folder)
    assert sorted(r.name for r in found.runs) == ["a.h5", "alone.csv", "c.h5", "roll/b.h5"]
    by_name = {r.name: r for r in found.runs}
    assert by_name["a.h5"].found["y", "u"].delay.value == pytest.approx(0.05, abs=1e-3)
    assert by_name["alone.csv"].found is None
    assert by_name["c.h5"].duration == pytest.approx(6.0)
    assert [name for name, _ in found.unreadable] == ["torn.h5"]


@pytest.mark.parametrize(
    ("conditions", "names"),
    [
        (["delay > 60ms"], {"c.h5"}),
        (["delay <= 0.06"], {"a.h5", "roll/b.h5"}),
        (["name = roll/*"], {"roll/b.h5"}),
        (["verdict != ?*", "fs = 100"], {"alone.csv"}),
        (["input = u", "samples > 1000"], set()),
        (["created >= 2000-01-01", "output = y", "delay > 0"], {"a.h5", "c.h5", "roll/b.h5"}),
    ],
)
def test_conditions(folder, conditions, names):
    assert {r.name for r in filter_runs(find_runs(folder).runs, conditions)} == names


@pytest.mark.parametrize(
    ("condition", "words"),
    [
        ("delay", "is not a condition"),
        ("delay > slow", "'slow' is not a number"),
        ("verdict > ok", "is a word; use = or !="),
        ("mass > 3", "'mass', which no run has; choose one of name"),
        ("delay > 3deg", "cannot be turned into"),
    ],
)
def test_a_condition_that_cannot_be_read_is_refused(folder, condition, words):
    with pytest.raises(ArgumentError, match=words):
        filter_runs(find_runs(folder).runs, [condition])


def test_list_and_comparison(folder, tmp_path):
    out = tmp_path / "runs.json"
    done = run("runs", folder, "--where", "verdict = *", "--compare", "--json", out)
    assert done.exit_code == 0, done.stderr
    assert "4 of 4 runs" in done.stdout
    assert "torn.h5 cannot be read" in done.stdout
    data = json.loads(out.read_text())
    assert data["schema"] == "hmpim/runs/1"
    changed = {(c["run"], c["parameter"]) for c in data["changes"]}
    first = next(r["name"] for r in data["runs"] if r["identification"])
    assert first == "a.h5"
    assert ("c.h5", "delay") in changed
    assert ("roll/b.h5", "delay") not in changed


def test_bad_input_is_one_line(folder, tmp_path):
    done = run("runs", tmp_path / "nowhere")
    assert (done.exit_code, done.stderr.count("\n")) == (2, 1)
    assert "is not a folder" in done.stderr
    done = run("runs", folder, "--where", "name = alone*", "--compare")
    assert done.exit_code == 2
    assert "0 of these runs have a result" in done.stderr


def test_no_run_is_overwritten_by_the_list_of_runs(tmp_path):
    record = bench(0.05, 1)
    hmpim.save(record, tmp_path / "a.h5")
    hmpim.save(hmpim.identify(record), tmp_path / "a.json")
    (tmp_path / "torn.h5").write_bytes((tmp_path / "a.h5").read_bytes()[:1500])
    for name in ("a.h5", "a.json", "torn.h5"):
        before = (tmp_path / name).read_bytes()
        done = run("runs", tmp_path, "--json", tmp_path / name)
        assert done.exit_code == 2
        assert "is one of the runs itself, which would be lost" in done.stderr
        assert (tmp_path / name).read_bytes() == before


def test_a_list_of_runs_is_no_run_and_can_be_written_again(tmp_path):
    record = bench(0.05, 1)
    hmpim.save(hmpim.identify(record), tmp_path / "a.json")
    for _ in range(2):
        done = run("runs", tmp_path, "--json", tmp_path / "runs.json")
        assert done.exit_code == 0, done.stderr
        assert "cannot be read" not in done.stdout


def test_a_run_of_other_channels_does_not_stop_the_comparison(tmp_path):
    for name, delay in (("a", 0.05), ("c", 0.08)):
        hmpim.save(hmpim.identify(bench(delay, 1)), tmp_path / f"{name}.json")
    other = json.loads((tmp_path / "a.json").read_text())
    other["pairs"][0]["input"] = "w"
    (tmp_path / "b.json").write_text(json.dumps(other))
    for age, name in enumerate("cba"):
        os.utime(tmp_path / f"{name}.json", (1e9 - age, 1e9 - age))
    done = run("runs", tmp_path, "--compare")
    assert done.exit_code == 0, done.stderr
    assert "b.json has no parameter in common with a.json" in done.stdout
    assert "changed" in done.stdout


def test_what_a_hidden_folder_holds_is_no_run(tmp_path):
    (tmp_path / ".workbench" / "checks").mkdir(parents=True)
    record = bench(0.05, 1)
    hmpim.save(record, tmp_path / ".workbench" / "checks" / "run.h5")
    hmpim.save(record, tmp_path / "seen.h5")
    assert [found.name for found in find_runs(tmp_path).runs] == ["seen.h5"]
    assert [found.name for found in find_runs(tmp_path / ".workbench").runs] == ["checks/run.h5"]


def test_of_two_copies_of_a_record_the_nearest_has_the_result(tmp_path):
    record = bench(0.05, 1)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        hmpim.save(record, tmp_path / name / "run.h5")
    hmpim.save(record, tmp_path / "b" / "again.h5")
    hmpim.save(hmpim.identify(record), tmp_path / "b" / "run.json")
    found = {run.name: run.found is not None for run in find_runs(tmp_path).runs}
    assert found == {"a/run.h5": False, "b/again.h5": False, "b/run.h5": True}
