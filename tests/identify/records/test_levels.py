"""Several amplitudes of one stimulus: what stays, what moves, and what that means."""

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.identify.records.levels import compare_levels
from hmpim.identify.result import Estimate, Parameters


def estimate(value: float, std: float) -> Estimate:
    return Estimate(value=value, std=std, ci95=(value - 2 * std, value + 2 * std))


def level(frequency: float, damping: float, std: float = 0.001) -> Parameters:
    return Parameters(
        natural_frequency=estimate(frequency, std * frequency),
        damping_ratio=estimate(damping, 5 * std * damping),
        scale_factor=estimate(1.0, std),
    )


def test_a_linear_system_moves_within_its_errors():
    alarms = 0
    for seed in range(300):
        rng = np.random.default_rng(seed)
        noisy = [
            level(
                10 * (1 + 0.001 * rng.standard_normal()), 0.4 * (1 + 0.005 * rng.standard_normal())
            )
            for _ in range(4)
        ]
        alarms += bool(compare_levels(noisy, [1, 2, 3, 4]).findings)
    assert alarms <= 2


@pytest.mark.parametrize(
    ("frequencies", "dampings", "code"),
    [
        ([10.0, 10.1, 10.6], [0.4, 0.4, 0.4], "hardening"),
        ([10.0, 9.9, 9.4], [0.4, 0.4, 0.41], "softening"),
        ([10.0, 10.05, 10.1], [0.6, 0.5, 0.42], "friction"),
    ],
)
def test_what_moves_tells_the_kind(frequencies, dampings, code):
    results = [level(f, d) for f, d in zip(frequencies, dampings, strict=True)]
    found = compare_levels(results, [1.0, 2.0, 4.0])
    assert [f.code for f in found.findings] == ["nonlinear", code]
    shuffled = compare_levels(results[::-1], [4.0, 2.0, 1.0])
    assert [f.message for f in shuffled.findings] == [f.message for f in found.findings]


def test_the_linear_range_ends_where_two_percent_are_passed():
    results = [level(f, 0.4) for f in (10.0, 10.05, 10.1, 10.5, 11.0)]
    assert compare_levels(results, [1, 2, 3, 4, 5]).linear_up_to == 3
    assert compare_levels(results[:2], [1, 2]).linear_up_to == 2


def test_what_a_level_cannot_tell_is_left_out():
    found = compare_levels([level(10, 0.4), Parameters(), level(10, 0.4)], [1, 2, 3])
    trend = next(t for t in found.trends if t.name == "natural_frequency")
    assert trend.amplitudes == (1, 3)
    assert trend.probability == 1.0
    assert found.findings == ()


def test_bad_levels_are_refused():
    with pytest.raises(ArgumentError, match="2 results and 1 amplitudes"):
        compare_levels([level(1, 1), level(1, 1)], [1.0])
    with pytest.raises(ArgumentError, match="1 level has nothing"):
        compare_levels([level(1, 1)], [1.0])
    with pytest.raises(ArgumentError, match=r"amplitude -2\.0 is not a positive"):
        compare_levels([level(1, 1), level(1, 1)], [1.0, -2.0])
