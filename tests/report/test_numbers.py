import math
import re
from dataclasses import replace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hmpim.identify import Estimate
from hmpim.report.numbers import (
    format_estimate,
    format_interval,
    format_number,
    format_value,
    plus_minus,
    typeset,
)

values = st.floats(-1e12, 1e12)
errors = st.floats(1e-12, 1e9)
PATTERN = re.compile(r"\(?(-?[\d.]+) ± ([\d.]+)\)?(?:e([+-]\d+))?$")


def parts(text):
    match = PATTERN.fullmatch(text)
    assert match, text
    return match[1], match[2], 10.0 ** int(match[3] or 0)


@given(value=values, std=errors)
def test_the_error_keeps_two_digits_and_the_value_as_many_places(value, std):
    assume(std > 1e-9 * abs(value))  # 64-bit numbers hold no more
    shown, error, power = parts(plus_minus(value, std))
    assert float(error) * power == pytest.approx(std, rel=0.051)
    # Half of the error's last digit at most is lost of the value.
    assert abs(float(shown) * power - value) <= 0.051 * std
    assert len(shown.partition(".")[2]) == len(error.partition(".")[2])


@given(value=values, std=errors)
def test_no_number_is_longer_than_a_table_can_show(value, std):
    assume(std > 1e-9 * abs(value))
    assert len(plus_minus(value, std)) <= 36


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (0.150021, 0.0000952, "0.150021 ± 0.000095"),
        (9.99712, 0.0996, "10.00 ± 0.10"),
        (9.99712, 0.0299, "9.997 ± 0.030"),
        (-0.0001, 0.5, "0.00 ± 0.50"),
        (1234567.0, 8900.0, "1234600 ± 8900"),
        (2.5e9, 1e7, "(2.500 ± 0.010)e+09"),
        (0.0, 1e-9, "(0.0 ± 1.0)e-09"),
        (3.0, 0.0, "3 ± 0"),
        (3.0, math.inf, "3 ± ?"),
        (3.0, math.nan, "3 ± ?"),
    ],
)
def test_known_numbers(value, std, text):
    assert plus_minus(value, std) == text


def test_the_unit_follows_where_there_is_one():
    with_unit = Estimate(value=1.0, std=0.01, ci95=(0.98, 1.02), unit="deg")
    without = Estimate(value=1.0, std=0.01, ci95=(0.98, 1.02))
    assert format_estimate(with_unit) == "1.000 ± 0.010 deg"
    assert format_estimate(without) == "1.000 ± 0.010"


@given(value=st.floats(-1e5, 1e5), std=st.floats(1e-6, 1e5))
def test_the_interval_reads_back(value, std):
    assume(std > 1e-10 * abs(value))  # less is the error of arithmetic
    interval = (value - 1.96 * std, value + 1.96 * std)
    text = format_interval(Estimate(value=value, std=std, ci95=interval))
    low, high = (float(part) for part in text.split(" to "))
    assert low == pytest.approx(interval[0], abs=0.06 * std + 1e-5 * abs(value))
    assert high == pytest.approx(interval[1], abs=0.06 * std + 1e-5 * abs(value))


def test_no_number_is_a_dash():
    assert format_number(None) == "–"
    assert format_number(0.31234) == "0.3123"


@pytest.mark.parametrize(
    ("value", "std", "low", "unit", "positive", "text"),
    [
        (3.0, 5.0, -7.0, "Hz", False, "not determined"),
        (0.4, 0.5, -0.6, "", True, "not determined"),
        (0.4, 0.5, -0.6, "", False, "0.40 ± 0.50"),  # a bias, say
        (3.0, 2.0, -1.0, "Hz", False, "3.0 ± 2.0"),  # known to be about three
        (3.0, 5.0, 0.2, "Hz", False, "3.0 −2.8 +10.0"),  # its interval excludes nothing at all
    ],
)
def test_a_positive_figure_that_may_be_nothing_is_not_determined(
    value, std, low, unit, positive, text
):
    estimate = Estimate(value=value, std=std, ci95=(low, value + 2 * std), unit=unit)
    assert format_value(estimate, positive=positive) == text
    bounded = format_interval(estimate, positive=positive).endswith("or less")
    assert bounded == (text == "not determined")


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("-0.5 to -0.1", "−0.5 to −0.1"),
        ("(1.5 ± 0.2)e-09", "(1.5 ± 0.2)·10⁻⁹"),
        ("1.5e+07 Hz", "1.5·10⁷ Hz"),
        ("2026-11-23", "2026-11-23"),
        ("u-1.csv, --from, /tmp/-1", "u-1.csv, --from, /tmp/-1"),
        ("791c8e749", "791c8e749"),
    ],
)
def test_numbers_are_typeset_and_names_are_not(text, shown):
    assert typeset(text) == shown


def test_an_interval_that_is_not_symmetric_is_written_with_both_sides_wherever_a_figure_stands():
    from hmpim.plots.bode import _in_words

    sides = Estimate(value=6.9223, std=0.0348, ci95=(6.8911, 6.9905), unit="Hz")
    assert format_estimate(sides) == "6.922 −0.031 +0.068 Hz"
    assert format_interval(sides) == "6.891 to 6.990"
    assert _in_words(sides) == "6.922 −0.031 +0.068 Hz"
    # The chi-squared interval of a noise is all but symmetric, and its std says as much.
    noise = Estimate(value=0.001809, std=0.0000896, ci95=(0.001649, 0.002003), unit="deg")
    assert format_estimate(noise) == "0.001809 ± 0.000090 deg"


def test_an_error_of_arithmetic_is_none_and_a_side_that_does_not_reach_is_0():
    stop = Estimate(value=-6.0, std=1e-10, ci95=(-6.0 - 2e-10, -6.0 + 2e-10), unit="deg")
    assert format_value(stop) == "-6 ± 0"
    assert format_interval(stop) == "–"
    late = Estimate(value=0.02, std=None, ci95=(0.02, 0.03), unit="s")
    assert format_value(late) == "0.020 −0 +0.010"
    assert format_value(replace(late, ci95=(0.0199, 0.03))) == "0.02000 −0.00010 +0.01000"


@pytest.mark.parametrize(
    ("value", "std", "interval", "shown"),
    [
        (4.975e7, 4.3e5, (4.8903e7, 5.05935e7), "(4.890 to 5.059)e+07"),
        (-1e-15, 1e-14, (-2.31161e-14, 2.11161e-14), "(-2.3 to 2.1)e-14"),
        (1.23e-15, None, (1.05e-15, 1.48e-15), "(1.05 to 1.48)e-15"),
        (1.23e-15, None, (None, 1.48e-15), "1.48e-15 or less"),
    ],
)
def test_an_interval_has_the_power_of_ten_and_the_places_of_its_value(value, std, interval, shown):
    estimate = Estimate(value=value, std=std, ci95=interval, unit="V")
    assert format_interval(estimate) == shown
    if None not in interval:
        assert format_value(estimate).partition(")")[2] == shown.partition(")")[2]
