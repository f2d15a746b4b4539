"""No output is an input or another output; what cannot be written is refused before the work."""

import os

import pytest
from typer.testing import CliRunner

from hmpim.cli.files import check_files, plan_file
from hmpim.cli.main import app
from hmpim.errors import ArgumentError

RUNNER = CliRunner()
DESIGN = ("design", *("--band", "1", "5"), *("--duration", "4", "--fs", "50", "--amplitude", "1"))
GENTLE = (
    *("gentlest", "--natural-frequency", "5", "--damping", "0.4", "--noise", "0.1"),
    *("--fs", "50", "--amplitude", "10"),
)
PLAN = "name = 'x'\n"


@pytest.fixture
def here(tmp_path, monkeypatch, good):
    """A folder with a record, a result, a plan; and no work that could be done."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sub").mkdir()
    (tmp_path / "link.csv").symlink_to(good)
    (tmp_path / "loop").symlink_to(tmp_path)
    os.link(good, tmp_path / "hard.csv")
    os.link(good, tmp_path / "parameters.csv")
    os.link(good, tmp_path / "response-2.csv")
    for name in ("r.json", "plan.toml", "rig.toml", "unit.py"):
        (tmp_path / name).write_text(name)

    def work(*_, **__):
        raise AssertionError("work was begun")

    monkeypatch.setattr("hmpim.formats.read", work)
    monkeypatch.setattr("hmpim.formats.load", work)
    monkeypatch.setattr("hmpim.stimulus.design", work)
    monkeypatch.setattr("hmpim.optimal.gentlest", work)
    monkeypatch.setattr("hmpim.experiment.run", work)
    return tmp_path


LOST = "itself, which would be lost"
ONE = "are one file"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("identify", "good.csv", "--json", "good.csv"), LOST),
        (("identify", "good.csv", "--report", "good.csv"), LOST),
        (("identify", "good.csv", "--json", "./sub/../good.csv"), LOST),
        (("identify", "good.csv", "--json", "{tmp}/good.csv"), LOST),
        (("identify", "good.csv", "--json", "link.csv"), LOST),
        (("identify", "link.csv", "--json", "good.csv"), LOST),
        (("identify", "good.csv", "--json", "hard.csv"), LOST),
        (("identify", "good.csv", "--json", "loop/good.csv"), LOST),
        (("identify", "a.csv", "good.csv", "--json", "good.csv"), LOST),
        (("identify", "parameters.csv", "--figures", "."), LOST),
        (("identify", "response-2.csv", "--figures", "."), LOST),
        (("identify", "good.csv", "--json", "x", "--report", "x"), ONE),
        (("identify", "good.csv", "--json", "x", "--report", "loop/x"), ONE),
        ((*DESIGN, "-o", "s.csv", "--json", "s.csv"), ONE),
        ((*DESIGN, "-o", "s.csv", "--plot", "sub/../s.csv"), ONE),
        ((*DESIGN, "--json", "s.png", "--plot", "s.png"), ONE),
        ((*GENTLE, "-o", "s.csv", "--json", "s.csv"), ONE),
        ((*GENTLE, "--plot", "s.png", "--json", "s.png"), ONE),
        (("run", "good.csv", "--rig", "sensor", "-o", "good.csv"), LOST),
        (("run", "good.csv", "--rig", "sensor", "-o", "r.csv", "--json", "r.csv"), ONE),
        (("run", "good.csv", "--rig", "sensor", "-o", "r.csv", "--log", "r.csv"), ONE),
        (("run", "good.csv", "--rig-file", "rig.toml", "--json", "rig.toml"), LOST),
        (("run", "good.csv", "--rig", "python:unit.py:f", "--report", "unit.py"), LOST),
        (("export", "r.json", "--to", "json", "-o", "r.json"), LOST),
        (("export", "r.json", "--to", "csv", "-o", "loop/r.json"), LOST),
    ],
)
def test_no_output_is_an_input_or_another_output(here, arguments, said):
    before = {path: path.read_bytes() for path in here.glob("*.*")}
    done = RUNNER.invoke(app, [word.format(tmp=here) for word in arguments])
    assert done.exit_code == 2, done.output + repr(done.exception)
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert {path: path.read_bytes() for path in here.glob("*.*")} == before


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (("--json", "plan.toml"), LOST),
        (("--document", "plan.toml"), LOST),
        (("--json", "d.md", "--document", "d.md"), ONE),
        (("--json", "out/study.json"), ONE),
        (("--document", "out/../out/study.md"), ONE),
        (("--json", "out/campaign.json"), ONE),
        (("--json", "out/cases/a.json"), "in each other's way"),
        (("--json", "d/x.json", "--document", "d.md"), "in each other's way"),
        (("--json", "out"), "in each other's way"),
        (("--document", "d"), "has no suffix; name it d.md"),
        (("--json", "old.json"), "the earlier study itself, which would be lost"),
    ],
)
def test_a_campaign_loses_nothing(tmp_path, monkeypatch, more, said):
    from hmpim.campaign.shipped import shipped_plan

    monkeypatch.chdir(tmp_path)
    plan = "compare = 'old.json'\n" + shipped_plan("example").read_text(encoding="utf-8")
    (tmp_path / "plan.toml").write_text(plan, encoding="utf-8")
    (tmp_path / "old.json").write_text("{}")
    (tmp_path / "d").mkdir()
    done = RUNNER.invoke(app, ["campaign", "plan.toml", "--out", "out", *more])
    assert done.exit_code == 2, done.output + repr(done.exception)
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()
    assert (tmp_path / "plan.toml").read_text(encoding="utf-8") == plan


@pytest.mark.parametrize("command", ["demo", "paper", "campaign"])
@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("file", "--out: file is a file; name a folder"),
        ("file/below", "--out: file is a file; name a folder"),
        ("dangling", "is a link that leads nowhere"),
    ],
)
def test_a_folder_that_cannot_be_made(tmp_path, monkeypatch, command, out, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("kept")
    (tmp_path / "dangling").symlink_to("nowhere")
    plan = ["demo"] if command == "campaign" else []
    done = RUNNER.invoke(app, [command, *plan, "--out", out])
    assert (done.exit_code, done.stdout) == (2, "")
    assert said in done.stderr
    assert done.stderr.count("\n") == 1
    assert (tmp_path / "file").read_text() == "kept"


@pytest.mark.parametrize(
    ("path", "said"),
    [
        ("sub", "--json: sub is a folder; name a file in it"),
        ("no/such/r.json", "--json: folder no/such does not exist; make it first"),
        ("good.csv/r.json", "--json: good.csv is a file, not a folder"),
    ],
)
def test_a_file_that_cannot_be_written(here, path, said):
    done = RUNNER.invoke(app, ["identify", "good.csv", "--json", path])
    assert done.exit_code == 2
    assert said in done.stderr


def test_what_keeps_nothing_may_be_named_twice():
    null = os.devnull
    from pathlib import Path

    check_files(reads={"the record": Path("a")}, writes={"-o": Path(null), "--json": Path(null)})


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="needs rights that bind")
def test_a_folder_without_write_permission(tmp_path):
    tmp_path.chmod(0o500)
    with pytest.raises(ArgumentError, match=r"--json: .*Permission denied"):
        check_files(writes={"--json": tmp_path / "r.json"})
    with pytest.raises(ArgumentError, match="may not be written to"):
        check_files(folders={"--out": tmp_path / "new"})
    tmp_path.chmod(0o700)


def test_a_folder_does_not_hide_a_plan_that_ships_and_a_file_does(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ships = tmp_path / "inside.toml"
    (tmp_path / "demo").mkdir()
    assert plan_file("demo", ("demo",), lambda _: ships) == ships
    (tmp_path / "example").write_text(PLAN)
    assert plan_file("example", ("example",), lambda _: ships).read_text() == PLAN
    with pytest.raises(ArgumentError, match="there is no plan sub"):
        plan_file("sub", ("demo",), lambda _: ships)
