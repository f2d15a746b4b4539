"""Numbers far outside what can be meant: one line and exit code 2 or 1, never a traceback."""

import numpy as np
import pytest

import hmpim
from hmpim.batch.pool import dask_pool
from hmpim.cli.main import app
from hmpim.errors import ArgumentError
from hmpim.identify import Bounds
from hmpim.optimal import RoughModel
from tests_support import in_studies, search_coarsely

DESIGN = {
    "--duration": "5",
    "--fs": "100",
    "--amplitude": "10",
    "--max-rate": "1000",
    "--max-acceleration": "40000",
    "--max-jerk": "1e7",
    "--resolution": "0.001",
    "--lead": "auto",
    "--tail": "auto",
    "--wanted-snr": "1",
    "--noise": "0.001",
}
GENTLEST = {
    "--natural-frequency": "10",
    "--damping": "0.4",
    "--noise": "0.1",
    "--fs": "200",
    "--delay": "0.15",
    "--scale-factor": "1",
    "--delay-error": "0.005",
    "--frequency-error": "0.017",
    "--scale-error": "0.02",
    "--damping-error": "0.04",
    "--amplitude": "10",
    "--max-rate": "1000",
    "--max-acceleration": "40000",
    "--max-jerk": "1e7",
    "--duration": "3",
}
EXTREME = ("1e308", "1e-308", "-1e308", "nan", "inf", "-1", "0", "1e29", "1e-29")


def run(*words: str) -> int:
    return app([str(word) for word in words], standalone_mode=False)


def is_said(code: int, error: str) -> bool:
    """Whether a command did its work, or said in one line why not."""
    return code == 0 or (code in (1, 2) and len(error.splitlines()) == 1)


@pytest.mark.parametrize("option", ["--band", *DESIGN])
def test_no_number_ends_a_design_in_a_traceback(option, capsys):
    for value in EXTREME:
        band = (value, "10") if option == "--band" else ("0.5", "10")
        words = [f"{name}={value if name == option else usual}" for name, usual in DESIGN.items()]
        code = run("design", "--band", *band, *words)
        assert is_said(code, capsys.readouterr().err), value
        if value in ("1e308", "-1e308", "nan") and option != "--wanted-snr":
            assert code == 2, value


@pytest.mark.parametrize("option", GENTLEST)
def test_no_number_ends_a_search_in_a_traceback(option, capsys, monkeypatch):
    search_coarsely(monkeypatch)
    for value in ("1e308", "1e-308", "nan"):
        code = run("gentlest", *with_number(option, value), "--family", "exponential")
        assert is_said(code, capsys.readouterr().err), value
        if value != "1e-308":
            assert code == 2, value


SEARCHED = ("--noise", "--max-rate")
"""Options for which a search is made with a number that is merely large."""


@pytest.mark.parametrize("option", [*SEARCHED, *in_studies(*sorted({*GENTLEST} - {*SEARCHED}))])
def test_no_large_number_ends_a_search_in_a_traceback(option, capsys, monkeypatch):
    search_coarsely(monkeypatch)
    code = run("gentlest", *with_number(option, "1e29"), "--family", "exponential")
    assert is_said(code, capsys.readouterr().err)


def with_number(option: str, value: str) -> list[str]:
    """The options of a search, one of them with another value."""
    return [f"{name}={value if name == option else usual}" for name, usual in GENTLEST.items()]


@pytest.mark.parametrize("value", ["1e308", "1e-308"])
def test_a_size_that_cannot_be_computed_with_is_quoted(value, capsys):
    words = [f"{name}={usual}" for name, usual in DESIGN.items() if name != "--max-rate"]
    assert run("design", "--band", "0.5", "10", *words, f"--max-rate={value}") == 2
    much = "large" if value == "1e308" else "small"
    said = f"velocity limit = {float(value):g} units/s is too {much} to compute with"
    assert said in capsys.readouterr().err


def test_python_refuses_the_same_sizes():
    for kind in ("exponential", "random_phase"):
        with pytest.raises(ArgumentError, match=r"start of the band = 1e-308 Hz is too small"):
            hmpim.design(
                band=(1e-308, 10), duration=5, fs=100, kind=kind, limits=hmpim.Limits(position=1)
            )
    with pytest.raises(ArgumentError, match=r"natural_frequency = 1e\+300 Hz is too large"):
        RoughModel(natural_frequency=1e300, damping_ratio=0.4)
    assert RoughModel(natural_frequency=10, damping_ratio=0.4, delay=1e-300).delay > 0.0


def test_a_strongly_damped_unit_settles_slowly():
    slow = RoughModel(natural_frequency=10, damping_ratio=1e20)
    assert slow.settling == pytest.approx(2e20 / slow.omega)


def test_a_bound_is_finite():
    for bound in ({"fit_percent": -float("inf")}, {"noise_ratio": float("inf")}):
        (name,) = bound
        with pytest.raises(ArgumentError, match=rf"{name} = -?inf is no bound"):
            Bounds(**bound)


def test_fewer_than_no_processes_cannot_be_started():
    with pytest.raises(ArgumentError, match="workers = -1"), dask_pool(workers=-1):
        pass


@pytest.mark.parametrize("value", ["1e308", "1e-308", "nan", "-1", "0"])
def test_a_rate_that_is_none_is_refused_by_all_that_read_and_write(value, capsys, tmp_path):
    u = np.random.default_rng(1).standard_normal(100)
    record = hmpim.Record.from_arrays({"u": u}, {"y": u}, fs=10.0)
    file, result = tmp_path / "bare.csv", tmp_path / "r.json"
    file.write_text("u,y\n" + "\n".join(f"{k % 2},{k % 3}" for k in range(100)) + "\n")
    hmpim.save(hmpim.identify(record), result)
    roles = ("--input", "u", "--output", "y")
    for words in (
        ("channels", file),
        ("identify", file, *roles),
        ("compress", file, *roles, "-o", tmp_path / "s.h5"),
        ("export", result, "--to", "python", "-o", tmp_path / "m.py"),
    ):
        assert run(*words, f"--fs={value}") == 2, words[0]
        error = capsys.readouterr().err
        assert "fs = " in error or words[0] == "export", error
        assert len(error.splitlines()) == 1
