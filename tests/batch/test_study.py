"""The page of a batch, and what each record is held against."""

import numpy as np
import pytest

import hmpim
from batch_support import FS, write_rows
from hmpim.batch.expect import held_against, read_bound
from hmpim.batch.run import Cluster
from hmpim.batch.study import outliers, write_study
from hmpim.batch.summary import summary_of


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    write_rows(folder / "fleet.parquet")
    here = Cluster(workers=0)
    return hmpim.batch(folder / "fleet.parquet", out=folder / "out", fs=FS, cluster=here)


def test_bounds_are_held_against_intervals(table, tmp_path):
    """Gains 1 to 8, each known to a hundredth: one interval holds the bound."""
    outcomes = write_study(
        table, tmp_path / "study.html", bounds=[read_bound("scale_factor <= 5.0")], by=["bench"]
    )
    (found,) = outcomes
    assert found.passed + found.unsure == 5
    assert (found.failed, found.untold) == (3, 0)
    page = (tmp_path / "study.html").read_text(encoding="utf-8")
    assert "3 outside the specification" in page
    assert "Scale factor by bench" in page
    assert summary_of(table).verdicts["ok"] + summary_of(table).verdicts.get("doubtful", 0) == 8


def test_units_of_bounds(table):
    """Delays of 20 ms."""
    assert held_against(table, read_bound("delay > 1ms")).passed == 8
    assert held_against(table, read_bound("delay > 0.03 s")).failed == 8
    with pytest.raises(hmpim.HmpimError, match="'delay > 1Hz'"):
        held_against(table, read_bound("delay > 1Hz"))
    with pytest.raises(hmpim.HmpimError, match="is no bound"):
        read_bound("delay about 3")


@pytest.mark.few(200)
def test_equal_units_seldom_stand_out(seeds):
    """One fleet in a hundred, by chance; the median's own scatter adds a little."""
    alarms = 0
    for seed in range(seeds):
        away, limit = outliers(np.random.default_rng(seed).standard_normal(500))
        alarms += bool((away > limit).any())
    assert alarms <= 0.01 * seeds + 4 * np.sqrt(0.01 * seeds)
