"""`hmpim design`, the command by itself."""

import csv
import json

import pytest
import typer
from typer.testing import CliRunner

from hmpim.cli.design import design
from hmpim.errors import ArgumentError, LimitsError

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
