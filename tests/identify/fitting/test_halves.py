"""A plant that changes during the test is not called ok; one that does not, is."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.fitting.halves import compare_halves, products_of_halves
from hmpim.model import Model, simulate
from tests_support import assert_share


def stepped(field_record, late_delay, seed):
    _, u, _ = field_record
    w = 2 * np.pi * 10
    early, late = (
        simulate(
            Model(delay=d, scale_factor=1.0, denominator=(1 / w**2, 0.8 / w, 1.0)),
            u,
            fs=200.0,
            intersample="bandlimited",
        )
        for d in (0.05, late_delay)
    )
    y = np.where(np.arange(u.size) < u.size // 2, early, late)
    noise = 0.02 * np.random.default_rng(seed).standard_normal(u.size)
    return hmpim.Record.from_arrays({"u": u}, {"y": y + noise}, fs=200.0)


@pytest.mark.few(1)
def test_a_delay_that_changes_in_mid_test_is_noticed(field_record, seeds):
    for seed in range(seeds):
        pair = hmpim.identify(stepped(field_record, 0.06, seed))["y", "u"]
        assert pair.verdict != "ok"
        assert "halves_disagree" in [w.code for w in pair.warnings]


@pytest.mark.few(10)
def test_one_that_does_not_change_is_not_accused(field_record, seeds):
    accused = []
    for seed in range(seeds):
        pair = hmpim.identify(stepped(field_record, 0.05, seed))["y", "u"]
        accused.append("halves_disagree" in [w.code for w in pair.warnings])
        assert (pair.verdict == "ok") != accused[-1]
    assert_share(accused, at_most=0.01)


def test_friction_in_a_half_that_hardly_moves_is_no_change_of_the_unit():
    """Halves of one sweep: what is much of the quiet one and nothing of the record accuses none."""
    n = 4000
    loud = np.arange(n) < n // 2
    u = np.where(loud, 1.0, 0.01) * np.sin(np.arange(n) ** 2 / n)
    slip = 0.001 * np.where(loud, -1e-4, 1.0) * np.sign(u)
    rows = np.vstack([u, np.ones(n)])
    left = slip - np.linalg.lstsq(rows.T, slip, rcond=None)[0] @ rows
    halves = products_of_halves(rows, left)
    quiet = compare_halves(halves, u, share=1.0)
    assert quiet.probability < 1e-6
    assert quiet.share > 0.2
    own = left[n // 2 :] / u[n // 2 :].std()
    assert own.std() > 0.05
    assert quiet.owed < 0.003
    assert compare_halves(halves, 0.01 * u, share=1.0).owed == pytest.approx(100 * quiet.owed)
