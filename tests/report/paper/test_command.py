from typer.testing import CliRunner

from hmpim.cli.main import app


def call(*words):
    return CliRunner().invoke(app, ["paper", *words])


def test_help_shows_an_example():
    result = call("--help")
    assert result.exit_code == 0
    assert "hmpim paper --out" in " ".join(result.stdout.split())


def test_some_figures_only(tmp_path):
    result = call("--out", str(tmp_path / "new"), "--figures", "13", "8")
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in (tmp_path / "new").glob("*.png")) == [
        "fig08.png",
        "fig13.png",
    ]
    assert str(tmp_path / "new" / "index.html") in result.stdout


def test_a_bar_is_for_terminals(tmp_path):
    result = call("--out", str(tmp_path), "--figures", "8")
    assert result.stderr == ""


def test_bad_input_is_one_line(tmp_path):
    taken = tmp_path / "file"
    taken.write_text("")
    for words, message in (
        (("--figures", "24"), "figure 24 is not made here"),
        (("--figures", "twelve"), "'twelve' is not a figure's number"),
        (("12",), "write --figures 12"),
        (("--out", str(taken)), "is a file; name a folder"),
    ):
        result = call(*words)
        assert result.exit_code == 2
        assert message in result.stderr
        assert result.stderr.count("\n") == 1
