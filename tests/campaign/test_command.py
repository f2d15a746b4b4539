"""The command: its exit codes, its files, its plan."""

import typer
from typer.testing import CliRunner

from hmpim.campaign import parse_plan, shipped_plan
from hmpim.cli.campaign import campaign
from hmpim.cli.main import CommandGroup

app = typer.Typer(cls=CommandGroup)
app.command()(campaign)


@app.command()
def other() -> None:
    """A second command, so that the first keeps its name."""


def invoke(*arguments):
    return CliRunner().invoke(app, ["campaign", *map(str, arguments)])


def short_plan(folder, **replaced):
    text = shipped_plan("example").read_text(encoding="utf-8")
    text = text.replace("duration = 5.0", "duration = 2.0").replace("[250.0, 500.0]", "[500.0]")
    for old, new in replaced.values():
        assert old in text
        text = text.replace(old, new)
    path = folder / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_example_is_a_plan():
    import tomllib

    result = invoke("--example")
    assert result.exit_code == 0
    assert parse_plan(tomllib.loads(result.stdout)).name == "Two gimbals"


def test_done_then_specification_not_met_without_a_second_run(tmp_path):
    out = tmp_path / "out"
    result = invoke(short_plan(tmp_path), "--out", out)
    assert result.exit_code == 0, result.output
    assert "All 3 checks of the specification are met." in result.stdout
    cases = {p: p.stat().st_mtime_ns for p in (out / "cases").iterdir()}
    tight = short_plan(tmp_path, limit=("min = 20.0", "min = 90.0"))
    result = invoke(tight, "--out", out, "--quiet")
    assert result.exit_code == 1
    assert result.stdout == ""
    assert {p: p.stat().st_mtime_ns for p in (out / "cases").iterdir()} == cases


def test_stopped_from_the_keyboard_it_says_what_is_kept(tmp_path, monkeypatch):
    from hmpim.campaign import run

    written = []

    def stop_after_one(path, data):
        write(path, data)
        written.append(path)
        if path.parent.name == "cases":
            raise KeyboardInterrupt

    write = run._write
    monkeypatch.setattr(run, "_write", stop_after_one)
    out = tmp_path / "out"
    result = invoke(short_plan(tmp_path), "--out", out)
    assert result.exit_code == 130
    assert "keeps what is done (cases: 1), and the same command goes on" in result.stderr
    assert not (out / "study.html").exists()


def test_table_of_several_cases_keeps_each_row_on_one_line(tmp_path):
    plan = short_plan(tmp_path, level=("levels = [0.5]", "levels = [0.5, 0.7]"))
    result = invoke(plan, "--out", tmp_path / "out")
    assert result.exit_code in (0, 1)
    head, *lines = result.stdout.splitlines()[1:6]
    assert head.split()[:3] == ["Axis", "Peak", "acc."]
    assert [line.split()[0] for line in lines] == ["inner", "outer", "inner", "outer"]


def test_bad_input_is_one_line_and_two(tmp_path):
    bad = short_plan(tmp_path, kind=('kind = "sensor"', 'kind = "rocket"'))
    for arguments, words in (
        ((), "PLAN.toml is missing"),
        ((tmp_path / "none.toml",), "there is no plan"),
        ((bad, "--out", tmp_path / "out"), "rig.kind = 'rocket'"),
    ):
        result = invoke(*arguments)
        assert result.exit_code == 2
        assert words in result.stderr
        assert result.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_an_earlier_study_is_read_before_anything_moves_and_told_of_after(tmp_path):
    first, second = tmp_path / "first", tmp_path / "second"
    assert invoke(short_plan(tmp_path), "--out", first, "--quiet").exit_code == 0
    compared = ('# compare = "earlier/study.json"', 'compare = "first/study.json"')
    slower = ("natural_frequency = 14.0", "natural_frequency = 12.0")
    result = invoke(short_plan(tmp_path, c=compared, s=slower), "--out", second)
    assert result.exit_code == 0, result.output
    (told,) = [line for line in result.stdout.splitlines() if line.startswith("Compared with")]
    differ, of = (int(word) for word in told.split() if word.isdigit())
    assert 3 <= differ < of
    renamed = ('name = "rates"', 'name = "speeds"')
    figure = ('tests = ["rates"]', 'tests = ["speeds"]')
    other = short_plan(tmp_path, c=compared, r=renamed, f=figure)
    result = invoke(other, "--out", tmp_path / "third")
    assert result.exit_code == 2
    assert "has no case of this plan (its first is rates." in result.stderr
    (first / "study.json").write_text("{", encoding="utf-8")
    result = invoke(short_plan(tmp_path, c=compared), "--out", tmp_path / "third")
    assert result.exit_code == 2
    assert "is not a study to compare with" in result.stderr
    assert not (tmp_path / "third").exists()
