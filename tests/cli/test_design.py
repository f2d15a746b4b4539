"""`hmpim design`, the command by itself."""

import csv
import json

import pytest
import typer
from typer.testing import CliRunner

from hmpim.cli.design import design
from hmpim.errors import ArgumentError, LimitsError
from hmpim.formats.stimulus_files import read_stimulus
from hmpim.stimulus import KINDS

FIG_12 = [
    *("--band", "0.1", "10", "--duration", "10", "--fs", "500", "--amplitude", "10"),
    *("--max-rate", "1000", "--max-acceleration", "40000", "--unit", "deg"),
]


def run(*arguments):
    app = typer.Typer()
    app.command()(design)
    return CliRunner().invoke(app, [*arguments])


def test_figure_12_to_files(tmp_path):
    out = run(*FIG_12, "-o", str(tmp_path / "s.csv"), "--json", str(tmp_path / "s.json"))
    assert out.exit_code == 0, out.output
    data = json.loads((tmp_path / "s.json").read_text())
    assert data["extinction"] == 0.0
    assert data["peaks"]["position"] == pytest.approx(10.0, rel=1e-7)
    lines = (tmp_path / "s.csv").read_text().splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    assert len(rows) == data["samples"]
    assert float(rows[0]["velocity"]) == float(rows[-1]["velocity"]) == 0.0
    assert "extinction n = 0" in out.output
    assert "of 1000 deg/s\n" in out.output


def test_a_limit_that_is_not_given_is_not_printed():
    out = run("--band", "0.1", "10", "--duration", "5", "--fs", "200", "--amplitude", "2")
    assert out.exit_code == 0, out.output
    assert " of 2" in out.output
    assert "inf" not in out.output


def test_printed_waveform_and_stated_extinction(tmp_path):
    run(*FIG_12, "--lead", "0", "--extinction", "0.5", "--json", str(tmp_path / "s.json"))
    data = json.loads((tmp_path / "s.json").read_text())
    assert (data["extinction"], data["samples"], data["lead"]) == (0.5, 5000, 0.0)


def test_picture(tmp_path):
    out = run(*FIG_12, "--plot", str(tmp_path / "s.png"))
    assert out.exit_code == 0, out.output
    assert (tmp_path / "s.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("more", "error", "message"),
    [
        (("--max-rate", "1"), LimitsError, "limits are too tight .* lower the position limit to"),
        (("--fs", "15"), LimitsError, "reaches the Nyquist frequency 7.5 Hz"),
        (("--amplitude", "nan"), ArgumentError, "position limit = nan deg"),
        (("--extinction", "lots"), ArgumentError, "--extinction 'lots' is neither"),
        (("--lead", "-1"), ArgumentError, "lead = -1.0 must be"),
        (("--plot", "s.foo"), ArgumentError, "--plot s.foo does not end in .png"),
        (("--json", "no/such/s.json"), ArgumentError, "--json: folder no/such does not exist"),
        (("--unit", "parsnips"), ArgumentError, "unit 'parsnips' is not known"),
    ],
)
def test_refusals_write_nothing(tmp_path, more, error, message):
    out = run(*FIG_12, *more, "-o", str(tmp_path / "s.csv"))
    assert isinstance(out.exception, error)
    with pytest.raises(error, match=message):
        raise out.exception
    assert not (tmp_path / "s.csv").exists()


def test_help_shows_an_example():
    out = run("--help")
    assert "hmpim design --band 0.1 10" in out.output


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".mat", ".h", ".toml"])
def test_every_kind_of_file(tmp_path, suffix):
    path = tmp_path / f"s{suffix}"
    out = run(*FIG_12, "--kind", "exponential", "--resolution", "0.0001", "-o", str(path))
    assert out.exit_code == 0, out.output
    [back] = read_stimulus(path)
    assert abs(back.position).max() == pytest.approx(10.0, rel=1e-3)
    assert back.fs == 500.0


def test_a_program_for_a_target_that_computes_its_own_command(tmp_path):
    out = run(*FIG_12, "-o", str(tmp_path / "stimulus.c"))
    assert out.exit_code == 0, out.output
    text = (tmp_path / "stimulus.c").read_text()
    assert "-DHMPIM_PRINT stimulus.c -lm" in text
    assert "/* Equations (5) to (7): 0.1 to 10 Hz in 10 s," in text


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_waveform_with_a_jerk_limit(tmp_path, kind):
    path = tmp_path / "s.json"
    out = run(*FIG_12, "--kind", kind, "--jerk", "3e6", "--json", str(path))
    assert out.exit_code == 0, out.output
    data = json.loads(path.read_text())
    assert data["limits"]["jerk"] == 3e6
    assert data["peaks"]["jerk"] <= 3e6
    assert "of 3e+06 deg/s³\n" in out.output
    assert ("extinction n" in out.output) == (kind in ("hmpim", "exponential", "reversed"))


@pytest.mark.parametrize(
    ("more", "error", "message"),
    [
        (("--wanted-snr", "90", "--noise", "0.1"), LimitsError, "signal-to-noise .* is enough"),
        (("--wanted-snr", "90"), ArgumentError, "belong together"),
        (("--kind", "square"), ArgumentError, "--kind 'square' must be one of hmpim"),
        (("-o", "s.doc"), ArgumentError, r"--output s.doc must end in one of .csv"),
        (("--resolution", "1"), LimitsError, "rounding to 1 deg at 500 Hz alone"),
        (("--jerk", "-1"), ArgumentError, "jerk limit = -1.0"),
    ],
)
def test_more_refusals(more, error, message):
    out = run(*FIG_12, *more)
    with pytest.raises(error, match=message):
        raise out.exception


def test_jerk_has_one_spelling_and_the_old_one_still_works(tmp_path):
    usual = ["--band", "0.5", "5", "--duration", "5", "--fs", "100", "--amplitude", "1"]
    both = [run(*usual, option, "1e5").output for option in ("--max-jerk", "--jerk")]
    assert both[0] == both[1]
    assert "peak jerk" in both[0]
    assert "units/s³" in both[0]
    assert "--max-jerk" in run("--help").output
    assert " --jerk" not in run("--help").output
