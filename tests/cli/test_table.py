"""`hmpim table`: what it refuses to serve."""

import pytest
import typer
from typer.testing import CliRunner

from hmpim.cli.main import app
from hmpim.rigs import wire

SENSOR = 'rig = "sensor"\n'
LIMITS = "position = 3\nvelocity = 130\nacceleration = 17000\n"


@pytest.fixture(autouse=True)
def _serves_nothing(monkeypatch):
    """A table that is not refused ends at once."""

    def served(*_args, **_kwargs):
        raise typer.Exit(0)

    monkeypatch.setattr(wire, "serve", served)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--clock-drift", "nan"), "clock drift = nan must be finite and above -1"),
        (("--clock-drift", "-2e6"), "clock drift = -2 must be finite and above -1"),
        (("--clock-offset", "inf"), "clock offset = inf must be finite"),
        (("--watchdog", "nan"), "--watchdog nan s must be more than 0 and at most 0.1"),
        (("--mode", "X"), "--mode 'X' is not known; use P, PV or PVA"),
        (("--rate", "333"), "does not divide the controller's rate"),
    ],
)
def test_what_cannot_be_served_is_refused(options, words):
    out = CliRunner().invoke(app, ["table", "--udp", "127.0.0.1:0", *options])
    assert out.exit_code == 2, out.output
    assert words in out.stderr


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (
            f"{SENSOR}rate = 500\n[limits]\n{LIMITS}",
            "--rate 200 Hz, and 's.toml' states rate = 500",
        ),
        (
            f"{SENSOR}[limits.motion]\n{LIMITS}",
            "states limits of motion; a sensor is served on one",
        ),
        (SENSOR, "no position limit is stated for 'sensor'"),
        ('rig = "table"\n', "describes 'table', and a sensor is needed"),
    ],
)
def test_a_sensor_that_cannot_be_served_is_refused(tmp_path, monkeypatch, text, words):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.toml").write_text(text)
    arguments = ["table", "--udp", "127.0.0.1:0", "--rate", "200", "--sensor", "s.toml"]
    out = CliRunner().invoke(app, arguments)
    assert out.exit_code == 2, out.output
    assert words in out.stderr
