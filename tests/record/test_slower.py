"""Samples lost of a channel that a slower clock updates."""

import numpy as np
import pytest

import hmpim
from hmpim.record.slower import restored


def sequence(seed: int, *, keeps: int, samples: int = 1200) -> np.ndarray:
    """Plus and minus one, each kept for so many samples, after a rest of 23 samples."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // keeps + 1), keeps)[:samples]
    u[:23] = 0.0
    return u


def lost(seed: int, samples: int = 1200) -> np.ndarray:
    known = np.random.default_rng([seed, 1]).uniform(size=samples) > 0.05
    known[[0, -1]] = True
    return known


@pytest.mark.parametrize("keeps", [2, 3, 5, 8])
def test_samples_lost_beside_a_change_are_those_of_their_interval(keeps):
    u, known = sequence(keeps, keeps=keeps), lost(keeps)
    found, told = restored(np.where(known, u, 0.3), known)
    assert np.array_equal(found[told], u[told])
    assert np.array_equal(found[known], u[known])
    assert np.count_nonzero(told) >= 0.85 * np.count_nonzero(~known)  # of a pair both may be lost


def test_nothing_is_restored_of_what_changes_by_no_slower_clock():
    known, rng = lost(0), np.random.default_rng(2)
    edges = np.cumsum(rng.integers(1, 9, 400))
    for values in (
        rng.standard_normal(1200),
        np.sin(np.arange(1200) / 20),
        rng.standard_normal(401)[np.searchsorted(edges, np.arange(1200), side="right")],
        np.where(np.arange(1200) < 600, 0.0, 1.0),
    ):
        assert not restored(values, known)[1].any()


@pytest.mark.few(10)
def test_rows_lost_of_a_binary_sequence_leave_no_noise(seeds):
    unit = hmpim.Model(
        delay=0.011, scale_factor=-0.8, bias=0.3, denominator=(1 / 41.7**2, 0.9 / 41.7, 1.0)
    )
    found = []
    for seed in range(seeds):
        u, known = sequence(seed, keeps=4), lost(seed)
        y = np.asarray(hmpim.simulate(unit, u, fs=200.0, intersample="zoh"))
        y = y + 2e-3 * np.random.default_rng(seed).standard_normal(u.size)
        time = np.arange(u.size)[known] / 200.0
        record = hmpim.Record.from_arrays({"u": u[known]}, {"y": y[known]}, time=time)
        found.append(hmpim.identify(record)["y", "u"].noise_std.value)
    assert np.median(found) == pytest.approx(2e-3, rel=0.1)
