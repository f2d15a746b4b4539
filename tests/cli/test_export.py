"""`hmpim export`, from the JSON that `hmpim identify` writes."""

import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from nonlinear_predictions import chirp, moved, recorded

import hmpim
from hmpim.cli.main import app
from hmpim.formats.models import TARGETS, fmu


def run(*words: object) -> int:
    return app([str(w) for w in words], standalone_mode=False)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    sensor = hmpim.Sensor(delay=0.1, time_constant=0.05, scale_factor=2.0, noise_std=0.01)
    limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    stimulus = hmpim.design(band=(0.1, 10), duration=8, fs=100, limits=limits)
    found = hmpim.identify(hmpim.run(sensor, stimulus, rng=3))
    hmpim.save(found, folder / "r.json")
    return folder / "r.json"


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_every_target_is_written_from_a_result(target, result, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(fmu, "PLATFORMS", fmu.PLATFORMS[:1])
    monkeypatch.setattr("hmpim.formats.models.isaac._DRAWS", 20)
    place = tmp_path / ("axis" + TARGETS[target].suffix)
    step = ["--timestep", "0.001"] if target in ("mujoco", "isaac") else []
    assert run("export", result, "--to", target, "-o", place, *step) == 0
    shown = [line for line in capsys.readouterr().out.splitlines() if line]
    assert shown
    for name in shown:
        text = Path(name).read_bytes()
        assert json.loads(result.read_text())["record"]["sha256"][:60].encode() in text or (
            target in ("mat", "fmu")
        )


def test_a_program_from_the_command_line_runs_as_the_model(result, tmp_path):
    assert run("export", result, "--to", "python", "-o", tmp_path / "m.py", "--fs", "500") == 0
    found = hmpim.load(result)
    t = np.arange(400) / 500.0
    u = np.sin(9 * t)
    truth = hmpim.to_model(found["y", "u"]).simulate(u, t)
    assert runpy.run_path(str(tmp_path / "m.py"))["simulate"](u) == pytest.approx(truth, abs=1e-9)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--to", "simulink", "-o", "x"], "simulink"),
        (["--to", "c", "-o", "x", "--input", "w"], "--input w fits 0 pairs"),
        (["--to", "json", "-o", "no/such/x.json"], "does not exist"),
        (["--to", "c", "-o", "x", "--fs", "0"], "fs = 0"),
        (["--to", "c", "-o", "x", "--pade", "3"], "for control alone"),
        (["--to", "mujoco", "-o", "x"], "time step of the simulation is not known"),
    ],
)
def test_what_cannot_be_exported_is_one_clear_line(words, said, result, capsys, tmp_path):
    words = [str(tmp_path / w) if w in ("x", "no/such/x.json") else w for w in words]
    assert run("export", result, *words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert len(error.splitlines()) == 1


def test_an_fmu_of_sources_only_says_so(result, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(fmu, "can_compile", lambda: False)
    assert run("export", result, "--to", "fmu", "-o", tmp_path / "x.fmu", "--fmi", "3") == 0
    shown = capsys.readouterr().out.splitlines()
    assert "x.fmu holds sources only" in shown[0]
    assert shown[1] == str(tmp_path / "x.fmu")


def test_a_result_is_not_replaced_by_its_export(result, capsys, tmp_path):
    before = result.read_bytes()
    assert run("export", result, "--to", "json", "-o", result) == 2
    assert "is the result itself" in capsys.readouterr().err
    assert result.read_bytes() == before
    (tmp_path / "r.csv").write_text("time,u,y\n0,0,0\n1,1,1\n2,0,1\n")
    assert run("export", tmp_path / "r.csv", "--to", "c", "-o", tmp_path / "x") == 2
    assert "holds nothing that hmpim.save writes" in capsys.readouterr().err


def test_a_nonlinearity_that_a_target_lacks_is_said(tmp_path, capsys):
    drive = chirp()
    found = hmpim.identify(recorded(drive, moved("backlash", drive), 1))
    hmpim.save(found, tmp_path / "r.json")
    assert run("export", tmp_path / "r.json", "--to", "csv", "-o", tmp_path / "m.csv") == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert (
        "m.csv: The file holds the linear part alone: it omits backlash (half its gap is" in shown
    )
    assert run("export", tmp_path / "r.json", "--to", "python", "-o", tmp_path / "m.py") == 0
    assert "omits" not in capsys.readouterr().out
    t = np.arange(drive.samples) / drive.fs
    truth = hmpim.to_model(found["y", "u"], fs=drive.fs).simulate(drive.sampled(), t)
    stepped = runpy.run_path(str(tmp_path / "m.py"))["simulate"](drive.sampled())
    assert stepped == pytest.approx(truth, abs=1e-9)
    assert np.std(stepped - moved("backlash", drive)) < 0.005


def test_a_rate_at_which_a_program_would_keep_too_much_is_refused(result, tmp_path, capsys):
    bent = tmp_path / "bent.json"
    hmpim.save(hmpim.identify(recorded(chirp(), moved("backlash", chirp()), 1)), bent)
    for found in (result, bent):
        words = ("export", found, "--to", "python", "-o", tmp_path / "m.py")
        assert run(*words, "--fs", "1e5") == 0
        capsys.readouterr()
        assert run(*words, "--fs", "1e9") == 2
        error = capsys.readouterr().err
        assert "fs = 1e+09 Hz is too fast" in error
        assert len(error.splitlines()) == 1


def test_a_choice_that_fits_no_pair_says_how_to_choose(result, tmp_path, capsys):
    assert run("export", result, "--to", "json", "-o", tmp_path / "m.json", "--input", "v") == 2
    assert "give --output and --input of one of them" in capsys.readouterr().err
