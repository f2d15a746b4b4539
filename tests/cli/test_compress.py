"""`hmpim compress`: a small file that `hmpim identify` takes as it takes the record."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

import hmpim
from hmpim.cli.main import app
from hmpim.plots import pair_bode


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two records of a sensor, one with a second output, and the first compressed."""
    place = tmp_path_factory.mktemp("compress")
    stimulus = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=30.0), fs=100.0)
    sensor = hmpim.Sensor(delay=0.05, time_constant=0.04, noise_std=0.02)
    for seed, name in enumerate(("a.h5", "b.h5")):
        hmpim.save(hmpim.run(sensor, stimulus, rng=seed), place / name)
    record = hmpim.load(place / "a.h5")
    u, y = record.inputs[0].values, record.outputs[0].values
    two = hmpim.Record.from_arrays({"u": u}, {"y": y, "z": -y}, fs=100.0)
    hmpim.save(two, place / "two.h5")
    done = run("compress", place / "a.h5", "-o", place / "small.h5")
    assert done.exit_code == 0, done.stderr
    assert f"{u.size} samples of u → y at 100 Hz in 1 run" in " ".join(done.stdout.split())
    return place


def test_a_compressed_record_is_identified_from_its_file(folder, tmp_path):
    page, data = tmp_path / "r.html", tmp_path / "r.json"
    done = run("identify", folder / "small.h5", "--at", "3", "--json", data, "--report", page)
    assert done.exit_code == 0, done.stderr
    found = hmpim.load(data)
    direct = hmpim.identify(hmpim.compress(hmpim.load(folder / "a.h5")))
    assert found["y", "u"].delay.value == direct["y", "u"].delay.value
    assert found["y", "u"].delay.value == pytest.approx(0.05, abs=0.002)
    assert "at 3 Hz: not measured there; the model" in done.stdout  # no samples, no measurement
    words = page.read_text(encoding="utf-8")
    assert "no_samples" in words
    assert "identified from statistics, which do not contain the samples" in words
    assert "Measured frequency response" not in words
    alt = pair_bode(found["y", "u"]).alt
    assert "model" in alt
    assert "measured" not in alt
    assert "measured" in pair_bode(hmpim.identify(hmpim.load(folder / "a.h5"))["y", "u"]).alt


@pytest.mark.parametrize("command", ["identify", "compress"])
def test_files_that_do_not_go_together_are_named_with_what_differs(folder, tmp_path, command):
    record = hmpim.load(folder / "a.h5")
    channels = [{one.name: one.values for one in side} for side in (record.inputs, record.outputs)]
    units = {"u": record.inputs[0].unit, "y": "mV"}
    other = hmpim.Record.from_arrays(*channels, fs=record.fs, units=units)
    hmpim.save(hmpim.compress(other, lags=hmpim.load(folder / "small.h5").lags), tmp_path / "b.h5")
    out = ["-o", tmp_path / "c.h5"] if command == "compress" else []
    done = run(command, folder / "small.h5", folder / "small.h5", tmp_path / "b.h5", *out)
    assert done.exit_code == 2
    (line,) = done.stderr.splitlines()
    assert f"{folder / 'small.h5'} (here) and {tmp_path / 'b.h5'} (there)" in line
    assert "units are ('', '') here and ('', 'mV') there" in line


def test_records_and_files_of_statistics_are_joined_run_by_run(folder, tmp_path):
    joined = tmp_path / "both.h5"
    done = run("compress", folder / "small.h5", folder / "b.h5", "--bias", "common", "-o", joined)
    assert done.exit_code == 0, done.stderr
    statistics = hmpim.load(joined)
    assert (len(statistics.runs), statistics.bias) == (2, "common")
    lone = hmpim.compress(hmpim.load(folder / "b.h5"), lags=statistics.lags)
    assert np.array_equal(statistics.runs[1].uu, lone.runs[0].uu)
    assert run("compress", folder / "b.h5", "-o", tmp_path / "b.h5", "-q").stdout == ""
    several = run("identify", folder / "small.h5", tmp_path / "b.h5", "--json", tmp_path / "s.json")
    assert several.exit_code == 0, several.stderr
    whole = json.loads((tmp_path / "s.json").read_text())
    assert whole["record"]["source"] == "statistics of 2 runs"


def test_records_are_fitted_together_without_a_file_between(folder, tmp_path):
    files = [folder / "a.h5", folder / "b.h5"]
    done = run("identify", *files, "--together", "--json", tmp_path / "t.json")
    assert done.exit_code == 0, done.stderr
    assert run("compress", *files, "-o", tmp_path / "both.h5", "-q").exit_code == 0
    joined = hmpim.identify(hmpim.load(tmp_path / "both.h5"))["y", "u"]
    found = hmpim.load(tmp_path / "t.json")["y", "u"]
    assert found.delay == joined.delay
    assert found.delay.ci95[0] < 0.05 < found.delay.ci95[1]
    alone = hmpim.identify(hmpim.load(files[0]))["y", "u"]
    assert found.noise_std.std < 0.85 * alone.noise_std.std
    assert "of each run may respond to input before it" in " ".join(done.stdout.split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["a.h5"], "--together fits several records as one, but only one is given"),
        (["a.h5", "b.h5", "--holdout", "0.3"], "--holdout applies to one record, but 2 are given"),
        (["a.h5", "a.h5"], "a.h5' hold the same samples"),
        (["a.h5", "two.h5"], "two.h5': the record has 2 channels for --output (y, z)"),
        (["a.h5", "b.h5", "--output", "y", "--output", "z"], "and --output is given 2 times"),
    ],
)
def test_what_cannot_be_fitted_together_is_refused(folder, words, said):
    files = [folder / word if word.endswith(".h5") else word for word in words]
    refused = run("identify", *files, "--together")
    assert (refused.exit_code, len(refused.stderr.splitlines())) == (2, 1)
    assert said in refused.stderr


def test_one_of_several_outputs_is_named(folder, tmp_path):
    refused = run("compress", folder / "two.h5", "-o", tmp_path / "z.h5")
    assert refused.exit_code == 2
    assert "2 channels for --output (y, z)" in refused.stderr
    assert (
        run("compress", folder / "two.h5", "--output", "z", "-o", tmp_path / "z.h5").exit_code == 0
    )
    assert hmpim.load(tmp_path / "z.h5").names == ("u", "z")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("compress", "a.h5", "-o", "small.csv"), "-o small.csv must end in one of .h5, .hdf5"),
        (("compress", "a.h5", "-o", "a.h5"), "is the record itself, which would be lost"),
        (("compress", "no.h5", "-o", "x.h5"), "no.h5"),
        (("compress", "a.h5", "--lags", "0", "-o", "x.h5"), "lags = 0 is not a window"),
        (("identify", "small.h5", "a.h5"), "small.h5 holds statistics and a.h5 does not"),
        (("identify", "small.h5", "--from", "3"), "--from is about the samples of a record"),
        (("identify", "small.h5", "--holdout", "0.5"), "--holdout is about the samples"),
        (("channels", "small.h5"), "'small.h5' holds statistics of a record and not its samples"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(words, said, folder, monkeypatch):
    monkeypatch.chdir(folder)
    done = run(*words)
    assert (done.exit_code, done.stdout) == (2, "")
    assert done.stderr.startswith("hmpim: ")
    assert done.stderr.count("\n") == 1
    assert said in done.stderr
    assert not (folder / "x.h5").exists()


@pytest.mark.parametrize(
    "options",
    [("--lags", "20"), ("--input", "w"), ("--fs", "50"), ("--from", "3"), ("--unit", "u=deg")],
)
def test_what_statistics_cannot_be_asked_is_refused(folder, tmp_path, options):
    done = run("compress", folder / "small.h5", "-o", tmp_path / "new.h5", *options)
    assert done.exit_code == 2
    assert f"{options[0]} is about the samples of a record" in done.stderr
    assert not (tmp_path / "new.h5").exists()


def test_a_window_other_than_that_of_statistics_is_refused(folder, tmp_path):
    done = run(
        "compress", folder / "b.h5", folder / "small.h5", "-o", tmp_path / "n.h5", "--lags", 9
    )
    assert done.exit_code == 2
    assert "small.h5 has a window of" in done.stderr


@pytest.mark.parametrize("second", ["a.h5", "small.h5"])
def test_a_record_that_would_count_twice_is_refused(folder, tmp_path, second):
    """Two of one run would make each standard deviation too small by the root of two."""
    done = run("compress", folder / "a.h5", folder / second, "-o", tmp_path / "twice.h5")
    assert done.exit_code == 2
    assert "run 1 and run 2 hold the same samples" in done.stderr
    done = run("identify", folder / "small.h5", folder / "small.h5")
    assert done.exit_code == 2
    assert "run 1 and run 2 hold the same samples" in done.stderr
    both = run("compress", folder / "a.h5", folder / "b.h5", "-o", tmp_path / "both.h5")
    assert both.exit_code == 0, both.stderr
