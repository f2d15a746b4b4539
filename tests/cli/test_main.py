"""The frame of the command line: version, help, usage, interruption, speed of its start."""

import subprocess
import sys
from importlib.metadata import version

import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

RUNNER = CliRunner()


def test_the_version_is_the_installed_one():
    done = RUNNER.invoke(app, ["--version"])
    assert (done.exit_code, done.stdout.strip()) == (0, f"hmpim {version('hmpim')}")


def test_no_command_shows_the_commands():
    done = RUNNER.invoke(app, [])
    assert done.exit_code == 0
    assert "identify" in done.stdout


@pytest.mark.parametrize("command", [info.callback.__name__ for info in app.registered_commands])
def test_every_command_explains_itself_with_an_example(command):
    done = RUNNER.invoke(app, [command, "--help"])
    assert done.exit_code == 0
    assert "Example" in done.stdout
    assert f"hmpim {command}" in done.stdout.partition("Example")[2]


@pytest.mark.parametrize(
    ("command", "words"), [("rigs", "under [rigs.NAME] in"), ("channels", '"NAME [ms]"')]
)
def test_help_shows_what_stands_in_brackets(command, words):
    done = RUNNER.invoke(app, [command, "--help"], env={"COLUMNS": "160"})
    assert words in done.stdout


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["indentify"], "No such command 'indentify'. Did you mean 'identify'?; see hmpim --help"),
        (["identify"], "see hmpim identify --help"),
        (["--nonsense"], "see hmpim --help"),
        (["demo", "--seed", "-1"], "see hmpim demo --help"),
        (
            ["design", "--band", "1", "--duration", "10"],
            "(it is '1 --duration'); see hmpim design --help",
        ),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(arguments, reason):
    done = RUNNER.invoke(app, arguments)
    assert done.exit_code == 2
    assert done.stdout == ""
    assert done.stderr.startswith("hmpim: ")
    assert done.stderr.count("\n") == 1
    assert done.stderr.rstrip().endswith(reason)


def test_stopping_from_the_keyboard_ends_with_130(tmp_path, monkeypatch):
    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr("hmpim.formats.read", stop)
    done = RUNNER.invoke(app, ["identify", str(tmp_path / "a.csv")])
    assert done.exit_code == 130
    assert "Traceback" not in done.stderr


STARTED = """
import builtins, os, signal, sys
plain, path = builtins.__import__, sys.argv.pop()

def stopping(name, *rest, **more):
    if name == path:
        os.kill(os.getpid(), signal.SIGINT)
    return plain(name, *rest, **more)

signal.signal(signal.SIGINT, signal.default_int_handler)
builtins.__import__ = stopping
import hmpim_start
sys.argv = ["hmpim", "--version"]
hmpim_start.main()
"""


@pytest.mark.parametrize(("at", "code"), [("hmpim.cli.main", 130), ("numpy", 130), ("", 0)])
def test_stopping_while_the_command_line_is_imported_shows_no_traceback(at, code):
    command = [sys.executable, "-c", STARTED, at or "nothing"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert (done.returncode, done.stderr) == (code, "")
    assert done.stdout == ("" if code else f"hmpim {version('hmpim')}\n")


def test_a_defect_is_not_hidden(tmp_path, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr("hmpim.formats.read", broken)
    done = RUNNER.invoke(app, ["identify", str(tmp_path / "a.csv")])
    assert isinstance(done.exception, ZeroDivisionError)
