"""One clear line for whatever is wrong: no words of the system's or of a library's own."""

import re

import numpy as np
import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

LIMITS = ("--amplitude", "10", "--max-rate", "1000", "--max-acceleration", "40000")
DESIGN = ("design", "--band", "0.1", "20", "--duration", "4", "--fs", "200", *LIMITS)
ROUGH = ("gentlest", "--natural-frequency", "10", "--damping", "0.4", "--noise", "0.1")
LIBRARY = re.compile(
    r"Is a directory|File exists|Errno|Value ?error|Traceback|suffix ''|hmpim-|\.tmp|math domain"
)


def run(*arguments):
    return CliRunner().invoke(app, list(arguments))


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    time = np.arange(200) / 100
    u = np.sin(2 * np.pi * (0.5 * time + 4 * time**2))
    np.savetxt(
        "good.csv", np.column_stack([time, u, 2 * u]), delimiter=",", header="time,u,y", comments=""
    )
    (tmp_path / "file").write_text("x")
    (tmp_path / "folder").mkdir()
    (tmp_path / "plan.toml").write_text("name = 'x'\nrig = 3\n")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("identify", "good.csv", "--json", ""), "is a folder; name a file in it"),
        (("identify", "good.csv", "--json", "folder"), "is a folder; name a file in it"),
        (("identify", "good.csv", "--json", "file/r.json"), "is a file, not a folder"),
        (("identify", "good.csv", "--json", "no/r.json"), "does not exist; make it first"),
        (("identify", "good.csv", "--report", "r.docx"), "name it r.html"),
        (("identify", "folder"), "is a folder; name the file in it"),
        (("identify", "good.csv", "--at", "51"), "beyond the Nyquist frequency 50 Hz"),
        ((*DESIGN, "-o", "folder"), "is a folder; name a file in it"),
        ((*DESIGN, "-o", "noext"), "must end in one of .csv"),
        ((*DESIGN, "--max-rate", "10", "-o", "s.csv"), r"needs at least \S+ units/s"),
        ((*DESIGN, "--duration", "1e9", "-o", "s.csv"), "samples are made at once"),
        ((*DESIGN, "--fs", "1e12", "-o", "s.csv"), "samples are made at once"),
        ((*ROUGH, "--fs", "1e12", "--duration", "5"), "samples are made at once"),
        (("run", "--rig", "sensor", "good.csv", "-o", "folder"), "is a folder; name a file in it"),
        (("run", "--rig", "sensor", "good.csv", "-o", "r.h5", "--seed", "-1"), "'--seed'.*'-1'"),
        (("demo", "--seed", "-1"), "'--seed'.*'-1'"),
        (("demo", "--out", "file"), "file is a file; name a folder"),
        (("paper", "--out", "file"), "file is a file; name a folder"),
        (("campaign", "demo", "--out", "file"), "file is a file; name a folder"),
        (("campaign", "plan.toml", "--out", "out"), "plan"),
        (("export", "good.csv", "--to", "c", "-o", "out"), "good.csv"),
    ],
    ids=lambda value: " ".join(value[:1] + value[-2:]) if isinstance(value, tuple) else None,
)
def test_one_line_in_our_own_words(here, arguments, said):
    done = run(*arguments)
    assert done.exit_code == 2, done.output
    assert done.stdout == ""
    (line,) = done.stderr.strip().splitlines()
    assert re.search(said, line), line
    assert not LIBRARY.search(line), line
    assert not re.search(r"\d 1/s", line), line


def test_both_commands_spell_the_jerk_limit_alike():
    for command in ("design", "gentlest"):
        shown = re.sub(r"\x1b\[[0-9;]*m", "", run(command, "--help").stdout)
        assert re.search(r"--max-jerk\b", shown), command
        assert not re.search(r"--jerk\b", shown), command


def test_a_long_search_shows_that_it_goes_on(here, monkeypatch):
    """The search tells how far it is; the command passes it on to what is shown."""
    told = []

    def searched(*, progress, **_):
        progress(0.5, "half of it")
        told.append(progress)
        raise AssertionError("reached")

    monkeypatch.setattr("hmpim.optimal.gentlest", searched)
    done = run(*ROUGH, "--fs", "200", "--duration", "2")
    assert told
    assert str(done.exception) == "reached"
