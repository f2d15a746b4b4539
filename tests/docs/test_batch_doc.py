"""docs/batch.md: its commands and lines run, on a few records and in this process."""

import functools
import re
import shlex
from pathlib import Path

import pytest
from typer.testing import CliRunner

import hmpim
from batch_support import gain_record
from hmpim.batch.run import Cluster
from hmpim.cli.main import app

DOC = (Path(__file__).parents[2] / "docs" / "batch.md").read_text(encoding="utf-8")
FENCED = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
EACH, POOLED = (code for kind, code in FENCED.findall(DOC) if not kind)
TABLE, HISTORY = (code for kind, code in FENCED.findall(DOC) if kind == "python")


@pytest.fixture(autouse=True)
def _records_and_metadata(tmp_path, monkeypatch):
    pytest.importorskip("polars")
    monkeypatch.chdir(tmp_path)
    here = functools.partial(hmpim.batch, cluster=Cluster(workers=0))
    monkeypatch.setattr(hmpim, "batch", here)
    for name in ("records", "history"):
        Path(name).mkdir()
        for k in range(1, 5):
            hmpim.save(gain_record(2, seed=k), Path(name) / f"unit{k}.h5")
    rows = "".join(f"unit{k}.h5,{'A17' if k < 3 else 'B2'},left\n" for k in range(1, 5))
    Path("units.csv").write_text("record,serial,bench\n" + rows, encoding="utf-8")


def run(command):
    program, *words = shlex.split(command)
    assert program == "hmpim"
    return CliRunner().invoke(app, [*words, "--workers", "0"])


def executed(lines):
    space = {"hmpim": hmpim}
    exec(compile(lines, "docs/batch.md", "exec"), space)
    return space


def test_a_folder_of_records():
    done = run(EACH.replace("--by", "--metadata units.csv --by"))
    assert done.exit_code == 1, done.output  # each unit is later than 5 ms
    lines = TABLE.replace("agg(...)", "len().collect()").replace("meta_bench", "verdict")
    table = executed(lines.replace("out/fleet", "out/again"))["table"]
    assert len(table) == 4


def test_a_units_history_is_one_identification():
    # These records last a second: less than a window of 400 samples.
    done = run(POOLED.replace("--lags 400", "--lags 40"))
    assert done.exit_code == 0, done.output
    lines = HISTORY.replace("lags=400", 'lags=40, metadata="units.csv"')
    executed(lines.replace("out/units", "out/again"))
