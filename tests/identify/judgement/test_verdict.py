"""From findings to verdicts: a doubt touches what it names, and nothing else."""

import ast
import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError
from hmpim.identify import Parameters
from hmpim.identify.judgement import CHECKS, attempt, judge, judged, judged_together
from hmpim.identify.result.groups import EVERY, GAIN, MODELLED, PHASE_SPLIT, TIMING
from hmpim.record import Finding


@pytest.fixture(scope="module")
def pair(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0)
    return hmpim.identify(record, intersample="bandlimited")["y", "u"]


def finding(*names, severity="doubt", code="x"):
    return Finding(code=code, message="Said.", severity=severity, parameters=names)


def verdicts(pair):
    given = ((f.name, getattr(pair.parameters, f.name)) for f in fields(Parameters))
    return {name: e.verdict for name, e in given if e is not None}


def test_a_clean_record_is_ok_throughout(pair):
    assert set(verdicts(pair).values()) == {"ok"}
    assert pair.verdict == "ok"


@pytest.mark.parametrize("group", [("delay",), PHASE_SPLIT, TIMING, GAIN, MODELLED, EVERY])
def test_a_doubt_touches_what_it_names_and_nothing_else(pair, group):
    found = judged(replace(pair, warnings=(finding(*group),)))
    doubtful = {name for name, verdict in verdicts(found).items() if verdict == "doubtful"}
    assert doubtful == set(group) & set(verdicts(pair))
    assert found.verdict == "doubtful"


@pytest.mark.parametrize("code", ["nonlinear", "halves_disagree", "feedback"])
def test_a_model_that_the_record_contradicts_has_no_interval(pair, code):
    found = judged(replace(pair, warnings=(finding("delay", code=code),))).parameters.delay
    assert found.ci95 is None
    assert found.std == pair.parameters.delay.std  # what noise alone does
    assert "± ?" in str(found)


def test_where_too_few_lines_tell_it_not_even_the_noise_is_known(pair):
    found = judged(replace(pair, warnings=(finding("delay", code="few_lines"),)))
    assert (found.parameters.delay.ci95, found.parameters.delay.std) == (None, None)


def test_information_touches_nothing(pair):
    found = judged(replace(pair, warnings=(finding(*EVERY, severity="info"),)))
    assert found.verdict == "ok"
    assert set(verdicts(found).values()) == {"ok"}


def test_a_doubt_about_a_figure_that_is_not_given_leaves_the_pair_ok(pair):
    assert pair.parameters.hold_period is None
    assert judged(replace(pair, warnings=(finding("hold_period"),))).verdict == "ok"


def test_judging_twice_is_judging_once_and_taking_a_doubt_back_works(pair):
    once = judged(replace(pair, warnings=(finding("delay"),)))
    assert verdicts(judged(once)) == verdicts(once)
    assert judged(replace(once, warnings=())).verdict == "ok"


@pytest.mark.parametrize("code", ["unrelated", "dead_channel"])
def test_an_output_that_does_not_follow_is_not_identifiable(pair, code):
    assert judged(replace(pair, warnings=(finding(*EVERY, code=code),))).verdict == (
        "not_identifiable"
    )


def test_every_name_in_a_group_is_a_parameter():
    known = {f.name for f in fields(Parameters)}
    for group in (EVERY, GAIN, MODELLED, PHASE_SPLIT, TIMING):
        assert set(group) <= known
        assert len(set(group)) == len(group)


def test_a_check_that_raises_is_said_and_costs_nothing_else(clean, breaking_checks):
    def slips(evidence):
        raise ZeroDivisionError("nothing there")

    with breaking_checks():
        found = judge(clean, checks=(slips, *CHECKS))
    assert found[0].code == "check_failed"
    assert "'slips' failed to run (ZeroDivisionError: nothing there)" in found[0].message
    assert (found[0].severity, found[0].parameters) == ("info", ())
    assert found[1:] == judge(clean)


def test_every_check_may_raise_and_the_result_stands(field_record, monkeypatch, breaking_checks):
    """Each analysis beside the fit itself is made to fail in turn, in a whole identification."""
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0)

    def broken(*args, **kwargs):
        raise IndexError("index 0 is out of bounds")

    room = "hmpim.identify.judgement"
    for place, name in (
        ("hmpim.identify.nonlinearities", "inspect_nonlinearity"),
        ("hmpim.identify.pair", "response_bandwidths"),
        ("hmpim.identify.pair", "misfit"),
        (f"{room}.residual", "compare_halves"),
        (f"{room}.residual", "input_noise"),
        (f"{room}.between_samples", "rivals_of"),
        (f"{room}.reach", "lines_of"),
    ):
        monkeypatch.setattr(sys.modules[place], name, broken)
    with breaking_checks():
        found = hmpim.identify(record, intersample="bandlimited", structures=["second_order"])
    pair = found["y", "u"]
    failed = [w for w in pair.warnings if w.code == "check_failed"]
    assert len(failed) == 7
    assert all("IndexError: index 0 is out of bounds" in w.message for w in failed)
    assert pair.delay.value == pytest.approx(0.15, abs=5 * pair.delay.std)
    assert pair.verdict == "ok"


def test_attempt_lets_an_interruption_through():
    def stopped():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        attempt("x", stopped, None)


def test_a_severity_that_is_not_known_is_refused():
    with pytest.raises(ArgumentError, match="severity 'fatal' is not known"):
        finding("delay", severity="fatal")


def test_a_finding_comes_back_from_its_plain_values():
    said = finding("delay", "bias")
    assert Finding.from_dict(said.to_dict()) == said


def test_what_the_measured_response_shares_is_doubted_there_too(pair):
    """A doubt about the model leaves what was measured without it; one about the record counts."""
    assert pair.from_response.bandwidth_phase90.verdict == "ok"
    about_model = finding("bandwidth_phase90", code="structure")
    assert judged(replace(pair, warnings=(about_model,))).from_response == pair.from_response
    about_record = finding("bandwidth_phase90", code="frozen")
    found = judged(replace(pair, warnings=(about_record,))).from_response
    assert found.bandwidth_phase90.verdict == "doubtful"
    assert found.bandwidth_3db == pair.from_response.bandwidth_3db


def test_a_mean_is_as_doubtful_as_its_parts_and_as_what_is_said_of_all(pair):
    sure = pair.parameters.delay
    unsure = replace(sure, verdict="doubtful")
    assert judged_together(unsure, [sure, sure], name="delay").verdict == "ok"
    assert judged_together(sure, [sure, unsure], name="delay").verdict == "doubtful"
    scatters = [finding("delay", code="scatter")]
    assert judged_together(sure, [sure], name="delay", findings=scatters).verdict == "doubtful"
    assert judged_together(sure, [sure], name="bias", findings=scatters).verdict == "ok"


def test_no_other_room_sets_a_verdict():
    """Nowhere in the package, apart from here and from reading a file back."""
    root = Path(hmpim.__file__).parent
    allowed = {"judgement", "result"}
    setting = set()
    for path in (root / "identify").rglob("*.py"):
        room = path.relative_to(root / "identify").parts[0]
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.keyword) and node.arg == "verdict":
                setting.add(room)
            if isinstance(node, ast.Constant) and node.value == "doubtful":
                setting.add(room)
    assert setting <= allowed, setting
    assert "judgement" in setting  # or nothing was looked at
