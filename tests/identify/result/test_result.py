"""The whole result: how it is looked up, what it says of old files, and its JSON."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import hmpim
from hmpim.errors import FormatError, HmpimError, RecordError
from hmpim.identify import Estimate, Identification, PairIdentification, Parameters
from hmpim.identify.judgement import judged
from hmpim.record import Finding

FIRST = Path(__file__).with_name("schema_1.json")


@pytest.fixture
def first():
    return json.loads(FIRST.read_text(encoding="utf-8"))


@pytest.fixture
def result(first):
    return Identification.from_dict(first)


def test_the_output_alone_is_enough_where_there_is_one_input(result):
    assert result["y"] is result["y", "u"] is result.pairs[0]


def test_iterating_yields_the_pairs(result):
    assert list(result) == list(result.pairs)
    assert [(pair.output, pair.input) for pair in result] == [("y", "u"), ("bent", "u")]
    assert len(result) == 2


@pytest.mark.parametrize(
    ("key", "says"),
    [
        ("u", r"no output 'u'; the result has \('y', 'u'\), \('bent', 'u'\)"),
        (("u", "y"), r"no pair \('u', 'y'\); the result has"),
        (0, r"0 names no pair; give the output and the input"),
        (("y", "u", "z"), r"names no pair"),
    ],
)
def test_a_key_that_names_no_pair_is_told_what_to_give(result, key, says):
    with pytest.raises(RecordError, match=says) as told:
        result[key]
    assert isinstance(told.value, HmpimError)


def test_an_output_of_several_inputs_asks_which(result):
    other = replace(result.pairs[0], input="v")
    both = replace(result, pairs=(result.pairs[0], other))
    with pytest.raises(
        RecordError, match=r"'y' has 2 inputs; say which: \['y', 'u'\] or \['y', 'v'"
    ):
        both["y"]
    assert both["y", "v"] is other


def test_each_parameter_is_a_property_of_the_pair(result):
    """Explicit, so that a type checker knows a misspelt name."""
    pair = result["y"]
    for field in fields(Parameters):
        assert field.name in vars(PairIdentification)
        assert getattr(pair, field.name) is getattr(pair.parameters, field.name)
    assert "__getattr__" not in PairIdentification.__dict__
    with pytest.raises(AttributeError, match="no attribute 'dealy'"):
        _ = pair.dealy


def test_a_result_without_pairs_has_a_verdict(result):
    assert replace(result, pairs=()).verdict == "not_identifiable"


def test_a_file_of_the_first_schema_loads(first, result, tmp_path):
    path = tmp_path / "r.json"
    path.write_text(FIRST.read_text(encoding="utf-8"), encoding="utf-8")
    loaded = hmpim.load(path)
    assert loaded.to_dict() == result.to_dict()
    assert loaded.to_dict()["schema"] == "hmpim/identification/2"
    old = first["pairs"][0]["parameters"]["delay"]
    assert loaded["y"].delay.to_dict() == {**old, "verdict": "ok"}


def test_doubts_of_the_first_schema_touch_everything(first, result):
    """It does not say which warning casts the doubt, nor on what."""
    assert [pair["verdict"] for pair in first["pairs"]] == ["ok", "doubtful"]
    sure, unsure = result.pairs
    assert {e.verdict for e in estimates(sure)} == {"ok"}
    assert {e.verdict for e in estimates(unsure)} == {"doubtful"}
    assert unsure.warnings
    assert {w.severity for w in unsure.warnings} == {"doubt"}
    assert [judged(pair).verdict for pair in result] == ["ok", "doubtful"]


def estimates(pair):
    given = (getattr(pair.parameters, f.name) for f in fields(Parameters))
    return [e for e in given if e is not None]


def test_the_covariance_of_the_first_schema_is_turned_with_its_coefficients(first, result):
    """Rising powers then, the highest power first now: [delay, gain, a2, a1]."""
    old = np.array(first["pairs"][0]["dynamics"]["covariance"])
    new = result["y"].covariance
    assert new.shape == (4, 4)
    assert np.diag(new).tolist() == [old[0, 0], old[1, 1], old[3, 3], old[2, 2]]
    assert new[1, 2] == old[1, 3]
    assert np.array_equal(new, new.T)


def test_coefficients_and_covariance_have_one_order(field_record):
    """Standard deviations of a2 = 1/ω² and a1 = 2ζ/ω from those of ω and ζ themselves."""
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0)
    pair = hmpim.identify(record, intersample="bandlimited", structures=["second_order"])["y"]
    stds = np.sqrt(np.diag(pair.covariance))
    a2, a1, one = pair.denominator
    omega = 2 * np.pi * pair.natural_frequency.value
    assert (a2, a1, one) == pytest.approx((omega**-2, 2 * pair.damping_ratio.value / omega, 1.0))
    assert stds[0] == pytest.approx(pair.delay.std, rel=1e-3)
    assert stds[1] == pytest.approx(pair.scale_factor.std, rel=1e-3)
    relative = pair.natural_frequency.std / pair.natural_frequency.value
    assert stds[2] / a2 == pytest.approx(2 * relative, rel=1e-3)


def test_what_a_result_says_comes_back(result):
    doubt = Finding(code="x", message="Late.", severity="doubt", parameters=("delay",))
    open_end = Estimate(value=0.1, std=None, ci95=(0.09, None), unit="s")
    pair = result["y"]
    pair = replace(
        pair,
        parameters=replace(pair.parameters, delay=open_end, time_constant=None),
        warnings=(doubt,),
    )
    pair = judged(pair)
    data = json.loads(json.dumps(replace(result, pairs=(pair,)).to_dict(), allow_nan=False))
    (back,) = Identification.from_dict(data).pairs
    assert back.parameters == pair.parameters
    assert back.warnings == (doubt,)
    assert (back.delay.ci95, back.delay.verdict, back.verdict) == (
        (0.09, None), "doubtful", "doubtful",
    )  # fmt: skip
    assert data["pairs"][0]["warnings"][0] == {
        "code": "x", "message": "Late.", "severity": "doubt", "parameters": ["delay"],
    }  # fmt: skip
    assert data["pairs"][0]["stopping"] is None


def test_a_withheld_interval_is_doubtful(result):
    vague = replace(result["y"].delay, ci95=None)
    pair = replace(result["y"], parameters=replace(result["y"].parameters, delay=vague))
    assert judged(pair).delay.verdict == "doubtful"
    assert judged(pair).verdict == "doubtful"


def test_another_schema_is_refused_by_name(first):
    with pytest.raises(FormatError, match="schema is 'hmpim/identification/3'"):
        Identification.from_dict({**first, "schema": "hmpim/identification/3"})
