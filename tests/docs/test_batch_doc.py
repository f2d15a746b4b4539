"""docs/batch.md: its commands and lines run, on a few records and in this process."""

import functools
from pathlib import Path

import numpy as np
import pytest

import hmpim
from batch_support import FS, gain_record
from docs_following import execute, snippet
from hmpim.batch.run import Cluster


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path, monkeypatch):
    pytest.importorskip("polars")
    monkeypatch.chdir(tmp_path)
    here = functools.partial(hmpim.batch, cluster=Cluster(workers=0))
    monkeypatch.setattr(hmpim, "batch", here)
    rows = "".join(f"unit{k}.h5,{'A17' if k < 3 else 'B2'},left\n" for k in range(1, 5))
    Path("units.csv").write_text("record,serial,bench\n" + rows, encoding="utf-8")


@pytest.fixture
def records():
    Path("records").mkdir()
    for k in range(1, 5):
        hmpim.save(gain_record(2, seed=k), f"records/unit{k}.h5")


@pytest.fixture
def history():
    """Records that are longer than the window of 400 samples."""
    Path("history").mkdir()
    for k in range(1, 5):
        time, rng = np.arange(1200) / FS, np.random.default_rng(k)
        u = np.sin(2 * np.pi * (0.5 * time + 0.8 * time**2))
        y = 2.0 * u + 0.01 * rng.standard_normal(u.size)
        hmpim.save(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS), f"history/unit{k}.h5")


def executed(lines):
    space = {"hmpim": hmpim}
    exec(compile(lines, "docs/batch.md", "exec"), space)
    return space


@pytest.mark.usefixtures("records")
def test_a_folder_of_records():
    command = snippet("batch.md", "hmpim batch records/")
    execute(command, "--workers", "0", code=1)  # each unit is later than 5 ms
    assert Path("out/fleet/study.html").is_file()


@pytest.mark.usefixtures("records")
def test_a_folder_of_records_from_python():
    assert len(executed(snippet("batch.md", "table = "))["table"]) == 4


@pytest.mark.usefixtures("history")
def test_a_units_history_is_one_identification():
    execute(snippet("batch.md", "hmpim batch history/"), "--workers", "0")


@pytest.mark.usefixtures("history")
def test_a_units_history_is_one_identification_from_python():
    executed(snippet("batch.md", "from hmpim.batch import Request"))
