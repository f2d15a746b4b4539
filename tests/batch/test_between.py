"""A fleet's mean and the spread of its units; records added up where they lie."""

import numpy as np
import pytest
from scipy.special import stdtrit
from typer.testing import CliRunner

import hmpim
from hmpim.batch import Request, open_table
from hmpim.batch.between import between_units
from hmpim.batch.pooled import Sums
from hmpim.batch.run import Cluster
from hmpim.cli.main import app


@pytest.mark.few(150)
@pytest.mark.parametrize("spread", [0.0, 0.05, 0.5])
def test_intervals_hold_the_spread_and_the_mean(seeds, spread):
    """Error bars of unequal length, 15 units; each share to four of its own deviations.

    The spread's interval holds with 95 %; with 97.5 % where there is none, since nothing lies
    below. The mean's takes the estimated spread for the true one, which costs it most where the
    spread is as large as the error bars: 93.1 % in 1500 draws.
    """
    holds = mean = 0
    for seed in range(seeds):
        rng = np.random.default_rng([11, seed])
        errors = 0.1 * np.exp(rng.uniform(-1, 1, 15))
        values = 3 + spread * rng.standard_normal(15) + errors * rng.standard_normal(15)
        found = between_units(values, errors)
        low, high = found.spread_ci95
        holds += low <= spread <= high
        mean += abs(found.mean - 3) < stdtrit(14, 0.975) * found.mean_std
    share = 0.95 if spread else 0.975
    assert abs(holds / seeds - share) < 4 * np.sqrt(share * (1 - share) / seeds)
    assert mean / seeds > 0.93 - 4 * np.sqrt(0.95 * 0.05 / seeds)


def test_units_do_not_depend_on_the_unit():
    rng = np.random.default_rng(1)
    values, errors = rng.standard_normal(20), 0.3 + 0.1 * rng.random(20)
    one, other = between_units(values, errors), between_units(1e-6 * values, 1e-6 * errors)
    assert other.spread == pytest.approx(1e-6 * one.spread, rel=1e-6)
    assert other.share == pytest.approx(one.share)


def test_one_unit_known_far_better_than_all_others_is_no_division_by_zero():
    """As a simulation without noise among measured records."""
    values = np.array([1.0, 1.2, 0.9, 1.1])
    near, nearer = (
        between_units(values, np.array([tiny, 0.01, 0.02, 0.01])) for tiny in (1e-5, 1e-19)
    )
    assert nearer.share == pytest.approx(near.share, rel=1e-3)
    assert 0.9 < nearer.share < 1.0
    even = between_units(values, np.full(4, 0.01))
    assert even.share == pytest.approx(even.spread**2 / (even.spread**2 + 0.01**2))


def test_too_few_units_are_refused():
    with pytest.raises(hmpim.HmpimError, match="two units or more"):
        between_units(np.ones(1), np.ones(1))


@pytest.fixture
def history(tmp_path):
    """Three runs of each of two units in one file, one of them with a gap."""
    import pyarrow as pa
    from pyarrow import parquet

    rng = np.random.default_rng(2)
    rows = {"u": [], "y": [], "unit": []}
    for unit, gain in (("A", 1.0), ("B", 2.0)):
        for run in range(3):
            u = rng.standard_normal(800)
            y = gain * np.concatenate([np.zeros(4), u[:-4]]) + run + 0.1 * rng.standard_normal(800)
            rows["u"].append(u.tolist())
            rows["y"].append(y.tolist())
            rows["unit"].append(unit)
    rows["y"][5][3:9] = [float("nan")] * 6
    path = tmp_path / "history.parquet"
    parquet.write_table(pa.table({**rows, "fs": [100.0] * 6}), path)
    return path


def test_a_history_is_one_identification(history, tmp_path):
    """Each unit's model from sums alone: a row a unit, and one that says what was left out."""
    asked = ["batch", history, "--out", tmp_path / "out", "--pool-by", "unit", "--lags", 60]
    told = CliRunner().invoke(app, [*map(str, asked), "--workers", "0", "--per-task", "2"])
    assert told.exit_code == 0, told.output
    table = open_table(tmp_path / "out")
    rows = {row["record"]: row for row in table.to_arrow().to_pylist()}
    assert set(rows) == {"A", "B", f"{history}#5"}
    assert rows[f"{history}#5"]["reason"]
    for unit, records, gain in (("A", 3, 1.0), ("B", 2, 2.0)):
        row, pair = rows[unit], table.result(unit)["y", "u"]
        assert (row["meta_unit"], row["meta_records"]) == (unit, str(records))
        assert row["samples"] == 800 * records
        assert row["scale_factor"] == pair.scale_factor.value
        # White input and noise: least squares knows the gain to this. Its interval is no shorter
        # than 1.96 times that, less four deviations of a noise level told from 1600 samples, 7 %.
        error = 0.1 / np.sqrt(row["samples"])
        low, high = pair.scale_factor.ci95
        assert abs(pair.scale_factor.value - gain) < 4 * error
        assert low + 1.82 * error < pair.scale_factor.value < high - 1.82 * error
        assert pair.delay.value == pytest.approx(0.04, abs=0.006)
    assert (tmp_path / "out" / "study.html").exists()


def test_a_column_that_no_record_has_is_told(history, tmp_path):
    request = Request(pool_by="serial")
    table = hmpim.batch(history, out=tmp_path / "out", request=request, cluster=Cluster(workers=0))
    reasons = table.to_arrow(["reason"]).column(0).to_pylist()
    assert reasons[:5] == ["it has no metadata 'serial'; it has unit, fs"] * 5
    assert "has 6 samples missing" in reasons[5]
    other = Request(pool_by="unit")
    with pytest.raises(hmpim.HmpimError, match=r"pool_by = 'serial'.*'unit'"):
        hmpim.batch(history, out=tmp_path / "out", request=other, cluster=Cluster(workers=0))


def test_sums_of_another_rate_are_left_out():
    rng = np.random.default_rng(0)
    one, other = (
        hmpim.compress(hmpim.Record.from_arrays({"u": u}, {"y": u}, fs=fs), lags=40)
        for fs, u in ((100.0, rng.standard_normal(200)), (200.0, rng.standard_normal(200)))
    )
    total = Sums(groups={"A": (2, one)}) + Sums(groups={"A": (1, other)})
    assert total.groups["A"] == (2, one)
    assert total.reasons[0][0] == "A: 1 of its records"
    assert "fs is 100.0 here and 200.0 there" in total.reasons[0][1]


def test_windows_without_groups_are_refused():
    with pytest.raises(hmpim.HmpimError, match="lags = 40 is for records identified as one"):
        Request(lags=40)


def test_rates_that_differ_by_rounding_are_one():
    rng = np.random.default_rng(0)
    one, other, away = (
        hmpim.compress(hmpim.Record.from_arrays({"u": u}, {"y": u}, fs=fs), lags=40)
        for fs, u in ((f, rng.standard_normal(200)) for f in (200.0, 200.00000000000003, 200.001))
    )
    assert (one + other).fs == 200.0
    with pytest.raises(hmpim.HmpimError, match=r"fs is 200\.0 here and 200\.001 there"):
        one + away


def test_a_dead_sensor_is_no_part_of_its_group(tmp_path):
    rng = np.random.default_rng(1)
    for k in range(4):
        u = rng.standard_normal(800)
        y = np.full(800, 3.0) if k == 3 else 2.0 * u + 0.1 * rng.standard_normal(800)
        hmpim.save(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=100.0), tmp_path / f"r{k}.h5")
    request, here = Request(pool_by="all", lags=40), Cluster(workers=0)
    table = hmpim.batch(str(tmp_path / "*.h5"), out=tmp_path / "out", request=request, cluster=here)
    rows = {r["record"]: r for r in table.to_arrow().to_pylist()}
    assert rows["all"]["meta_records"] == "3"
    assert rows["all"]["noise_std"] == pytest.approx(0.1, rel=0.1)
    assert "'y' is constant at 3" in rows[str(tmp_path / "r3.h5")]["reason"]
