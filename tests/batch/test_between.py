"""A fleet's mean and the spread of its units; records added up where they lie."""

import numpy as np
import pytest
from scipy.special import stdtrit

import hmpim
from hmpim.batch.between import between_units
from hmpim.batch.pool import here_pool
from hmpim.batch.pooled import identify_groups


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


def test_too_few_units_are_refused():
    with pytest.raises(hmpim.HmpimError, match="two units or more"):
        between_units(np.ones(1), np.ones(1))


def test_a_history_is_one_identification(tmp_path):
    """Three runs of each of two units in one file: each unit's model, from sums alone."""
    import pyarrow as pa
    from pyarrow import parquet

    fs, rng = 100.0, np.random.default_rng(2)
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
    parquet.write_table(pa.table({**rows, "fs": [fs] * 6}), path)
    groups, reasons = identify_groups([str(path)], lags=60, by="unit", pool=here_pool, per_task=2)
    assert [(g.name, g.records) for g in groups] == [("A", 3), ("B", 2)]
    assert [name.rpartition("#")[2] for name, _ in reasons] == ["5"]
    for group, gain in zip(groups, (1.0, 2.0), strict=True):
        pair = group.result["y", "u"]
        # White input and noise: least squares knows the gain to this. Its interval is no shorter
        # than 1.96 times that, less four deviations of a noise level told from 1600 samples, 7 %.
        error = 0.1 / np.sqrt(group.statistics.samples)
        low, high = pair.scale_factor.ci95
        assert abs(pair.scale_factor.value - gain) < 4 * error
        assert low + 1.82 * error < pair.scale_factor.value < high - 1.82 * error
        assert pair.delay.value == pytest.approx(0.04, abs=0.006)
        assert group.statistics.samples == 800 * group.records
