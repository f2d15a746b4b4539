"""docs/campaign.md: its rig, its plan and its command do what the page says."""

import json
import re
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hmpim.cli.main import app

DOC = Path(__file__).parents[2] / "docs" / "campaign.md"


@pytest.fixture(autouse=True)
def _each_its_own_rig():
    """Python keeps a module that was imported: a rig of the same name would be the first one."""
    yield
    sys.modules.pop("my_gimbal", None)


def block(kind):
    (found,) = re.findall(rf"```{kind}\n(.*?)```", DOC.read_text(encoding="utf-8"), re.DOTALL)
    return found


def test_a_rig_of_ones_own_beside_its_plan(tmp_path, monkeypatch):
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "my_gimbal.py").write_text(block("python"), encoding="utf-8")
    (tmp_path / "bench" / "my_gimbal.toml").write_text(block("toml"), encoding="utf-8")
    program, *arguments = block("sh").split()
    assert program == "hmpim"
    # From another folder than the plan's: the rig is found beside the plan.
    arguments[1] = "bench/my_gimbal.toml"
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, arguments)
    assert done.exit_code == 0, done.stderr
    assert "All 2 checks of the specification are met." in done.stdout
    study = json.loads((tmp_path / "out" / "my-gimbal" / "study.json").read_text())
    assert [row["rate"] for row in study["rows"]] == [500.0, 1000.0]
    for row in study["rows"]:
        # A lag of 4 ms, 3 samples late, one of which the loop adds and the hold gives back.
        assert row["parameters"]["time_constant"]["value"] == pytest.approx(4e-3, rel=0.02)
        assert row["parameters"]["delay"]["value"] == pytest.approx(3 / row["rate"], abs=1e-4)


def test_what_the_rig_raises_is_one_sentence(tmp_path, monkeypatch):
    (tmp_path / "my_gimbal.py").write_text(
        "def play(case, stimuli, rng):\n    raise OSError('cable pulled')\n", encoding="utf-8"
    )
    (tmp_path / "my_gimbal.toml").write_text(block("toml"), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["campaign", "my_gimbal.toml", "--out", "out"])
    assert done.exit_code == 2
    assert done.stdout == ""
    words = r"hmpim: the rig failed in case bench\.\S+: OSError: cable pulled\n"
    assert re.fullmatch(words, done.stderr)
