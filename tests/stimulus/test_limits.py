"""Limits: units, shares, refusals."""

import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, UnitError
from hmpim.stimulus import Limits, Peaks
from hmpim.stimulus.exponential import ExponentialSweep
from hmpim.stimulus.peaks import ROUGHLY, true_peaks
from hmpim.stimulus.solve import _Search
from hmpim.stimulus.sweep import Sweep

sizes = st.floats(1e-3, 1e6)


@given(p=sizes, v=sizes, a=sizes)
def test_units_there_and_back(p, v, a):
    limits = Limits(position=p, velocity=v, acceleration=a, unit="deg")
    rad = limits.to("rad")
    assert rad.velocity == pytest.approx(math.radians(v), rel=1e-12)
    back = rad.to("deg")
    assert (back.position, back.velocity, back.acceleration) == pytest.approx((p, v, a), rel=1e-12)


def test_no_limit_stays_no_limit_in_any_unit():
    assert Limits(position=1.0, unit="m").to("mm").velocity == math.inf


@given(p=sizes, v=sizes, a=sizes)
def test_use_is_the_largest_share(p, v, a):
    limits = Limits(position=2.0, velocity=3.0, acceleration=4.0)
    use = limits.use(Peaks(position=p, velocity=v, acceleration=a))
    assert use == max(p / 2.0, v / 3.0, a / 4.0)


@pytest.mark.parametrize("value", [math.nan, 0.0, -1.0, -math.inf])
@pytest.mark.parametrize("name", ["position", "velocity", "acceleration"])
def test_what_bounds_nothing_is_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name} limit = .* give a positive number"):
        Limits(**{name: value, "unit": "deg"})


@pytest.mark.parametrize("value", ["10", None, True, 1j])
@pytest.mark.parametrize("name", ["position", "velocity", "acceleration", "jerk"])
def test_what_is_no_number_is_refused(name, value):
    with pytest.raises(ArgumentError, match=f"{name} = {re.escape(repr(value))} is not a number"):
        Limits(**{name: value, "unit": "deg"})


def test_units_must_go_together():
    with pytest.raises(UnitError, match="'deg' cannot be turned into 'm'"):
        Limits(position=1.0, unit="deg").to("m")
    with pytest.raises(UnitError, match="limits in no unit cannot be turned into 'deg'; state the"):
        Limits(position=1.0).to("deg")
    with pytest.raises(UnitError, match="limits in 'rad' cannot be turned into no unit; state a u"):
        Limits(position=1.0, unit="rad").to("")
    assert Limits(position=1.0).to("").position == 1.0
    assert Limits().to("deg") == Limits(unit="deg")


@pytest.mark.parametrize("extinction", [0.0, 0.4, 0.9, 1.3, 2.0])
def test_rough_peaks_are_too_small_by_what_they_say_at_most(extinction):
    sweep = Sweep(band=(0.3, 17.0), duration=4.0, extinction=extinction)
    exact = true_peaks(sweep, start=0.05)
    rough = true_peaks(sweep, start=0.05, exact=False)
    for name in ("position", "velocity", "acceleration", "jerk"):
        share = getattr(rough, name) / getattr(exact, name)
        assert 1.0 - ROUGHLY <= share <= 1.0 + 1e-12


@pytest.mark.parametrize("kind", [Sweep, ExponentialSweep])
@pytest.mark.parametrize("limits", [{"acceleration": 50.0}, {"velocity": 9.0, "jerk": 1e4}])
def test_a_few_instants_show_an_excess_no_larger_than_it_is(kind, limits):
    def make(n):
        return kind(band=(0.3, 17.0), duration=4.0, extinction=n)

    search = _Search(make=make, limits=Limits(position=2.0, **limits), start=None)
    for n in np.linspace(0.0, 2.0, 9):
        assert search.at_least(n) <= search.excess(n)
    assert search.at_least(0.0) > search.excess(0.0) - 0.5  # where most is spared


@pytest.mark.parametrize("extinction", [0.0, 0.7, 1.0, 2.0])
def test_a_motion_without_its_jerk_is_the_same_motion(extinction):
    sweep = Sweep(band=(0.3, 17.0), duration=4.0, extinction=extinction)
    time = np.linspace(-0.1, 4.1, 500)
    whole, brief = sweep.motion(time), sweep.without_jerk(time)
    assert brief.jerk is None
    for name in ("position", "velocity", "acceleration"):
        assert np.array_equal(getattr(whole, name), getattr(brief, name))
