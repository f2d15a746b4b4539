"""`hmpim gentlest`, the command by itself."""

import csv
import json
import re

import pytest
import typer
from typer.testing import CliRunner

from hmpim.cli.gentlest import _as_dict, _print, gentlest
from hmpim.errors import ArgumentError
from hmpim.formats.stimulus_files import read_stimuli
from hmpim.optimal import Accuracy, Errors, Gentlest, ModelRange, RoughModel, Wish
from hmpim.stimulus import Limits, Sine, Stimulus
from tests_support import search_coarsely

ROUGH = [
    *("--natural-frequency", "10", "--damping", "0.4", "--delay", "0.15", "--noise", "0.1"),
    *("--fs", "200", "--amplitude", "10", "--unit", "deg", "--duration", "2"),
    *("--family", "multisine"),
]


def run(*arguments):
    app = typer.Typer()
    app.command()(gentlest)
    return CliRunner().invoke(app, [*arguments])


@pytest.fixture
def coarsely(monkeypatch):
    """What the command writes is looked at, and not how good it is."""
    search_coarsely(monkeypatch)


@pytest.mark.usefixtures("coarsely")
def test_to_files_with_a_picture_of_the_trade(tmp_path):
    files = ("-o", str(tmp_path / "s.csv"), "--json", str(tmp_path / "s.json"))
    files = (*files, "--plot", str(tmp_path / "t.png"))
    out = run(*ROUGH, "--range", "9", "11", *files)
    assert out.exit_code == 0, out.output
    data = json.loads((tmp_path / "s.json").read_text())
    lines = (tmp_path / "s.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == data["stimulus"]["samples"] == 400
    largest = max(abs(float(row["acceleration"])) for row in rows)
    assert 0.8 * data["value"] <= largest <= data["value"] == data["peaks"]["acceleration"]
    errors = data["errors"]["natural_frequency"]
    assert errors["wanted_ci95"] == pytest.approx(0.17)
    assert errors["ci95"] <= errors["worst_ci95"] <= 0.017 * 11 * 1.001
    assert data["errors"]["delay"]["ci95"] <= 0.005
    assert "Predicted errors at 95 %" in out.output
    assert "0.153 to 0.187" in out.output  # of 9 and of 11 Hz; the worst is at the upper end
    assert f"{data['value']:.4g}" in out.output
    assert (tmp_path / "t.png").read_bytes().startswith(b"\x89PNG")
    values = [p["value"] for p in data["trade"] if p["value"] is not None]
    assert values == sorted(values, reverse=True)


def test_what_cannot_be_met_is_said_with_exit_code_1(tmp_path):
    sweep = (*ROUGH[:-1], "sweep")  # refused in a quarter of a multisine's time
    out = run(*sweep, "--max-acceleration", "50", "-o", str(tmp_path / "s.csv"))
    assert out.exit_code == 1
    assert "the accuracy cannot be met inside the limits in 2 s" in out.stderr
    assert "allow errors" in out.stderr
    assert not (tmp_path / "s.csv").exists()


@pytest.mark.usefixtures("coarsely")
def test_to_a_specification_that_a_run_reads(tmp_path):
    rough = ("--natural-frequency", "10", "--damping", "0.4", "--noise", "0.1", "--fs", "200")
    path = tmp_path / "s.toml"
    out = run(*rough, "--duration", "2", "--family", "sweep", "-o", str(path))
    assert out.exit_code == 0, out.output
    (stimulus,) = read_stimuli(path)
    assert stimulus.duration == pytest.approx(2.0, abs=0.01)


@pytest.mark.usefixtures("coarsely")
def test_without_any_limit():
    rough = ("--natural-frequency", "10", "--damping", "0.4", "--noise", "0.1", "--fs", "200")
    out = run(*rough, "--duration", "2", "--family", "sweep")
    assert out.exit_code == 0, out.output
    assert "peak velocity" in out.output
    assert "units/s" in out.output
    assert "times the limits" not in out.output


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (("--noise", "0"), "noise_std = 0.0 must be"),
        (("--delay-error", "-1"), "accuracy of delay = -1.0"),
        (("--range", "14", "7"), "does not rise"),
        (("--family", "banjo"), "--family 'banjo' is not known"),
        (("--amplitude", "nan"), "position limit = nan deg"),
        (("--plot", "t.gif"), "does not end in .png"),
        (("-o", "s.foo"), "--output s.foo must end in one of .csv, "),
        (("--fs", "20"), "cannot be observed at fs = 20 Hz"),
    ],
)
def test_bad_input(more, message):
    out = run(*ROUGH, *more)
    assert isinstance(out.exception, ArgumentError)
    assert message in str(out.exception)


def test_help_shows_an_example():
    assert "hmpim gentlest --natural-frequency 10" in run("--help").output


def test_a_figure_that_is_not_asked_for_is_not_infinite(capsys):
    told = Errors(
        delay=1e-3, natural_frequency=0.1, damping_ratio=0.01, scale_factor=0.01, bias=1.0
    )
    sine = Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=100.0)
    wish = Wish(
        accuracy=Accuracy(delay=None),
        model=RoughModel(natural_frequency=10, damping_ratio=0.4),
        model_range=ModelRange(),
        noise_std=0.1,
        limits=Limits(),
        fs=100.0,
        gentle="travel",
        duration=10.0,
    )
    found = Gentlest(
        stimulus=sine, family="sweep", value=4.0, errors=told, worst=told, wish=wish, candidates=()
    )
    _print(found)
    shown = capsys.readouterr().out
    assert "inf" not in shown
    assert re.search(r"delay\W+–", shown)
    assert _as_dict(found, ())["errors"]["delay"]["wanted_ci95"] is None
    assert _as_dict(found, ())["errors"]["damping_ratio"]["wanted_ci95"] == 0.04
