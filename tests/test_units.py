"""Units are checked and turned into one another; values stay plain numbers."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import UnitError
from hmpim.units import check_unit, conversion_factor, rate_unit


@pytest.mark.parametrize("unit", ["", "deg", "rad", "m", "V", "deg/s", "deg/s²", "N*m", "g_0", "%"])
def test_usual_units_are_known(unit):
    assert check_unit(unit) == unit


@pytest.mark.parametrize("unit", ["furlongz", "deg/", "[", "1e400x", "π/2 q"])
def test_an_unknown_unit_is_quoted_with_examples(unit):
    with pytest.raises(UnitError, match="is not known; use one such as 'deg'") as caught:
        check_unit(unit)
    assert repr(unit) in str(caught.value)


@pytest.mark.parametrize("unit", [None, 3, b"deg"])
def test_a_unit_is_a_string(unit):
    with pytest.raises(UnitError, match="is not a string"):
        check_unit(unit)


@pytest.mark.parametrize(
    ("unit", "to", "factor"),
    [
        ("deg", "rad", math.pi / 180),
        ("deg/s²", "rad/s²", math.pi / 180),
        ("mm", "m", 1e-3),
        ("inch", "mm", 25.4),
        ("rpm", "deg/s", 6.0),
        ("ms", "s", 1e-3),
        ("arcsec", "deg", 1 / 3600),
    ],
)
def test_known_factors(unit, to, factor):
    assert conversion_factor(unit, to=to) == pytest.approx(factor, rel=1e-12)


def test_units_of_different_zeros_have_no_factor():
    with pytest.raises(UnitError, match="'degC' cannot be turned into 'K' by a factor"):
        conversion_factor("degC", to="K")
    assert conversion_factor("delta_degC", to="K") == 1.0


@given(
    units=st.sampled_from(
        [["deg", "rad", "mrad", "arcsec"], ["m", "mm", "inch"], ["m/s", "km/hour", "knot"]]
    ),
    data=st.data(),
)
def test_there_and_back_is_one(units, data):
    a, b, c = (data.draw(st.sampled_from(units)) for _ in range(3))
    assert conversion_factor(a, to=b) * conversion_factor(b, to=a) == pytest.approx(1, rel=1e-12)
    direct = conversion_factor(a, to=c)
    assert conversion_factor(a, to=b) * conversion_factor(b, to=c) == pytest.approx(
        direct, rel=1e-12
    )


@pytest.mark.parametrize("units", [("count", "deg"), ("rad", "count"), ("V/count", "V/deg")])
def test_a_count_is_not_an_angle(units):
    """Else a limit of 10 deg would hold for 573 counts, whatever they are worth."""
    with pytest.raises(UnitError, match="what a count is worth is not known"):
        conversion_factor(units[0], to=units[1])
    assert conversion_factor("count", to="kilocount") == pytest.approx(1e-3)


def test_dimensions_must_agree():
    with pytest.raises(UnitError, match="'deg' cannot be turned into 'm'"):
        conversion_factor("deg", to="m")


def test_derivatives_are_written_the_usual_way_and_understood():
    for unit in ("deg", "m", "", "V"):
        for order in (1, 2, 3):
            assert check_unit(rate_unit(unit, order))
    assert conversion_factor(rate_unit("deg", 2), to="rad/s**2") == pytest.approx(math.pi / 180)


@pytest.mark.parametrize(("unit", "to"), [("deg", "rad"), ("rad", "deg")])
def test_what_is_known_without_the_registry_is_what_the_registry_says(unit, to):
    pint = pytest.importorskip("pint")
    there = pint.UnitRegistry().Quantity(1.0, unit).to(to).magnitude
    assert conversion_factor(unit, to=to) == there
