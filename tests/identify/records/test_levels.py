"""Several amplitudes of one stimulus: what stays, what moves, and what that means."""

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.identify.records.levels import compare_levels, identify_levels
from hmpim.identify.result import Estimate, Parameters
from hmpim.record import Record


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


@pytest.mark.parametrize(
    ("frequencies", "unit", "words"),
    [
        ([10.0, 10.01, 10.5], "deg", "From an amplitude of 1 to one of 3 deg, the natural"),
        ([10.0, 10.01, 10.5], "", "From an amplitude of 1 to one of 3, the natural"),
        (
            [10.0, 10.01, 10.5],
            "deg",
            "Up to 2 deg, no parameter clearly changes by more than 1 %: ",
        ),
        ([10.0, 10.4, 10.5], "deg", "Use a linear model at the smallest amplitude only."),
        ([10.0, 10.01, 10.06], "", "Up to 3, no parameter clearly changes by more than 1 %."),
    ],
)
def test_amplitudes_are_stated_with_their_unit(frequencies, unit, words):
    found = compare_levels([level(f, 0.4, std=0.0001) for f in frequencies], [1, 2, 3], unit=unit)
    assert found.unit == unit
    assert words in found.findings[0].message


def test_the_unit_is_the_inputs_unless_amplitudes_are_given():
    t = np.arange(500) / 100
    sweep = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    rng = np.random.default_rng(1)
    records = [
        Record.from_arrays(
            {"u": gain * sweep},
            {"y": gain * sweep + 0.001 * rng.standard_normal(500)},
            fs=100.0,
            units={"u": "V", "y": "V"},
        )
        for gain in (0.5, 1.0)
    ]
    own = identify_levels(records, structures=["static"])
    assert own["y", "u"].unit == "V"
    given = identify_levels(records, amplitudes=[1, 2], structures=["static"])
    assert given["y", "u"].unit == ""


def test_what_a_level_cannot_tell_is_left_out():
    found = compare_levels([level(10, 0.4), Parameters(), level(10, 0.4)], [1, 2, 3])
    trend = next(t for t in found.trends if t.name == "natural_frequency")
    assert trend.amplitudes == (1, 3)
    assert trend.probability == 1.0
    assert found.findings == ()


def test_bad_levels_are_refused():
    record = Record.from_arrays({"u": np.arange(60.0)}, {"y": np.arange(60.0)}, fs=1.0)
    with pytest.raises(ArgumentError, match="2 records and 1 amplitudes"):
        identify_levels([record, record], amplitudes=[1.0])
    with pytest.raises(ArgumentError, match="1 record has nothing"):
        identify_levels([record])


def test_an_impossible_amplitude_is_refused_before_anything_is_identified():
    record = Record.from_arrays({"u": np.arange(60.0)}, {"y": np.arange(60.0)}, fs=1.0)
    with pytest.raises(ArgumentError, match=r"amplitude -1\.0 is not a positive number"):
        identify_levels([record, record], amplitudes=[1.0, -1.0])
