"""What `hmpim workbench` refuses before it serves anything."""

import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["--port", "70000"], "--port 70000 is not a port"),
        (["--max-upload", "0"], "--max-upload 0 MB allows no file"),
        (["--grace", "0"], "--grace 0 s"),
        (["--rig-file", "nowhere.toml"], "'nowhere.toml' cannot be read"),
        (["--rig", "warp drive"], "there is no rig 'warp drive'; there are sensor"),
    ],
)
def test_bad_options_are_one_line(tmp_path, monkeypatch, arguments, reason):
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["workbench", "--no-browser", *arguments])
    assert done.exit_code == 2
    assert reason in done.stderr
    assert done.stderr.count("\n") == 1
