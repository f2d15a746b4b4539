"""One figure: how it reads, what stands for its error, and its JSON."""

import json
import math

import pytest

from hmpim.identify import Estimate


def delay(**changes):
    known = {"value": 0.15, "std": 0.0000945, "ci95": (0.14981, 0.15019), "unit": "s"}
    return Estimate(**{**known, **changes})


def test_it_prints_as_value_error_and_unit():
    assert str(delay()) == f"{delay()}" == "0.15000 ± 0.00009 s"
    assert repr(delay()) == "Estimate(0.15000 ± 0.00009 s)"
    assert str(delay(verdict="doubtful")) == "0.15000 ± 0.00009 s (doubtful)"
    assert repr(delay(verdict="doubtful")) == "Estimate(0.15000 ± 0.00009 s, doubtful)"
    assert str(delay(unit="")) == "0.15000 ± 0.00009"


def test_it_is_a_number_where_one_is_asked_for():
    assert float(delay()) == 0.15
    assert math.isclose(1e3 * float(delay()), 150.0)
    assert f"{delay():.3f}" == "0.150"
    assert f"{delay():8.1e}" == " 1.5e-01"


@pytest.mark.parametrize(
    ("std", "written"),
    [  # first three digits of the error: 354 keep two, 355 to 949 one, 950 on round to two
        (0.0354, "1.000 ± 0.035"),
        (0.0355, "1.00 ± 0.04"),
        (0.0949, "1.00 ± 0.09"),
        (0.0950, "1.000 ± 0.095"),
        (0.0999, "1.00 ± 0.10"),
        (0.0, "1 ± 0"),
    ],
)
def test_the_error_is_rounded_as_the_particle_data_group_does(std, written):
    assert str(delay(value=1.0, std=std, unit="")) == written


@pytest.mark.parametrize(
    ("ci95", "written", "spread"),
    [
        ((0.1474, 0.1502), "0.15000 −0.00260 +0.00020 s", 0.0026 / 1.96),
        ((0.1474, None), "0.1500 −0.0026 +? s", math.inf),
        ((None, 0.1502), "0.15000 −? +0.00020 s", math.inf),
        (None, "0.15 ± ? s", math.inf),
    ],
)
def test_an_interval_of_its_own_is_shown_on_both_sides(ci95, written, spread):
    found = delay(std=None, ci95=ci95)
    assert str(found) == written
    assert found.spread == pytest.approx(spread, rel=1e-4)


@pytest.mark.parametrize(
    ("ci95", "written"),
    [
        ((0.1474, 0.1502), "0.15000 −0.00260 +0.00020 s"),
        ((0.1474, None), "0.1500 −0.0026 +? s"),
        ((0.14981, 0.15019), "0.15000 ± 0.00009 s"),
        ((0.14982, 0.15021), "0.15000 ± 0.00009 s"),  # a difference that rounding hides
        ((0.1501, 0.1502), "0.15000 ± 0.00009 s"),  # the value lies outside
    ],
)
def test_an_asymmetric_interval_is_written_with_both_sides(ci95, written):
    assert str(delay(ci95=ci95)) == written
    assert delay(ci95=ci95).asymmetric == ("±" not in written)


def test_what_is_no_number_is_none_and_json_has_only_numbers():
    lost = delay(std=math.inf, ci95=(-math.inf, math.inf))
    assert (lost.std, lost.ci95) == (None, None)
    assert delay(std=math.nan, ci95=(0.1, math.inf)).ci95 == (0.1, None)
    for estimate in (lost, delay(std=None, ci95=(None, 0.2)), delay(verdict="doubtful")):
        text = json.dumps(estimate.to_dict(), allow_nan=False)
        assert Estimate.from_dict(json.loads(text)) == estimate


def test_json_is_as_the_contract_has_it():
    assert delay(std=None, ci95=(0.1474, None)).to_dict() == {
        "value": 0.15,
        "std": None,
        "ci95": [0.1474, None],
        "unit": "s",
        "verdict": "ok",
    }
    assert delay(ci95=None).to_dict()["ci95"] is None
