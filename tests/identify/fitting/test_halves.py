"""A plant that changes during the test is not called ok; one that does not, is."""

import numpy as np

import hmpim
from hmpim.model import Model, simulate


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


def test_a_delay_that_changes_in_mid_test_is_noticed(field_record):
    for seed in range(5):
        pair = hmpim.identify(stepped(field_record, 0.06, seed))["y", "u"]
        assert pair.verdict != "ok"
        assert "halves_disagree" in [w.code for w in pair.warnings]


def test_one_that_does_not_change_is_not_accused(field_record):
    for seed in range(40):
        pair = hmpim.identify(stepped(field_record, 0.05, seed))["y", "u"]
        assert "halves_disagree" not in [w.code for w in pair.warnings]
        assert pair.verdict == "ok"
