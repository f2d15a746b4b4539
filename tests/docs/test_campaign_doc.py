"""docs/campaign.md: its rig, its plan and its command do what the page says."""

import json
import re
import sys

import pytest
from typer.testing import CliRunner

from docs_following import execute, page_of, snippet
from hmpim.campaign.shipped import shipped_plan
from hmpim.cli.main import app


@pytest.fixture(autouse=True)
def _each_its_own_rig():
    """Python keeps a module that was imported: a rig of the same name would be the first one."""
    yield
    sys.modules.pop("my_gimbal", None)


def plan():
    return snippet("campaign.md", 'name = "My gimbal"')


def test_a_rig_of_ones_own_beside_its_plan(tmp_path, monkeypatch):
    """From another folder than the plan's: the rig is found beside the plan."""
    (tmp_path / "bench").mkdir()
    code = snippet("campaign.md", "import numpy as np")
    (tmp_path / "bench" / "my_gimbal.py").write_text(code, encoding="utf-8")
    (tmp_path / "bench" / "my_gimbal.toml").write_text(plan(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    command = snippet("campaign.md", "hmpim campaign my_gimbal.toml")
    command = command.replace("my_gimbal.toml", "bench/my_gimbal.toml")
    assert "All 2 checks of the specification are met." in execute(command)
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
    (tmp_path / "my_gimbal.toml").write_text(plan(), encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["campaign", "my_gimbal.toml", "--out", "out"])
    assert done.exit_code == 2
    assert done.stdout == ""
    words = r"hmpim: the rig failed in case bench\.\S+: OSError: cable pulled\n"
    assert re.fullmatch(words, done.stderr)


def test_the_plan_that_ships_as_an_example_has_every_key():
    """So that who has no documents at hand finds them all."""
    page = page_of("campaign.md").read_text(encoding="utf-8")
    cells = [line.split("|")[1] for line in page.splitlines() if line.startswith("| ")][2:]
    keys = {key.rpartition(".")[2] for cell in cells for key in re.findall(r"`([a-z_.]+)`", cell)}
    assert len(keys) > 30
    text = shipped_plan("example").read_text(encoding="utf-8")
    assert [key for key in sorted(keys) if not re.search(rf"\b{key}\b", text)] == []
