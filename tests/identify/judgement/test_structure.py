"""Another number of poles, or another assumption between samples, that the record allows."""

import re
from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.fitting.trial import Trial
from hmpim.identify.groups import PHASE_SPLIT
from hmpim.identify.judgement.between_samples import other_intersample
from hmpim.identify.judgement.structure import missed_pole, other_structure, undecided_order
from hmpim.model.dynamics import STRUCTURES

TIME = np.arange(2000) / 200.0


@pytest.mark.parametrize("check", [other_structure, undecided_order, missed_pole])
def test_a_clean_record_gives_no_finding(clean, check):
    assert check(clean) == ()


def with_rival(evidence, *, delay, lag, criterion):
    """Add a first-order fit that came out so, its criterion so much worse."""
    best = evidence.joint.best
    fit = replace(
        best.fit,
        structure=STRUCTURES["first_order"],
        theta=np.array([best.fit.delay + delay, np.log(lag)]),
    )
    rival = Trial(intersample=best.intersample, fit=fit, criterion=best.criterion + criterion)
    joint = replace(evidence.joint, trials=(*evidence.joint.trials, rival))
    return replace(evidence, joint=joint)


@pytest.mark.parametrize(
    ("delay", "lag", "words", "bandwidths"),
    [
        (2.0, 0.1, "delay .* standard deviations", set()),
        (2.0, 20.0, "delay .* standard deviations", {"bandwidth_phase90"}),
        (0.0, 20.0, "-90° bandwidth at .* instead of", {"bandwidth_phase90"}),
        (0.0, 2.32, "delay at 0.150. s", set()),
    ],
)
def test_a_rival_as_likely_casts_doubt_on_the_split_and_on_what_it_moves(
    clean, delay, lag, words, bandwidths
):
    (found,) = other_structure(with_rival(clean, delay=delay, lag=lag, criterion=1.0))
    assert found.severity == "doubt"
    assert re.search(words, found.message)
    assert set(PHASE_SPLIT) <= set(found.parameters)
    assert set(found.parameters) & {"bandwidth_phase90"} == bandwidths
    assert not {"scale_factor", "bias", "noise_std"} & set(found.parameters)


def test_an_unlikely_rival_is_not_named(clean):
    assert other_structure(with_rival(clean, delay=2.0, lag=20.0, criterion=50.0)) == ()


def test_an_order_taken_for_its_wider_bars_casts_doubt_on_the_split(clean):
    simple = with_rival(clean, delay=3.0, lag=1.0, criterion=-1.0).joint.trials[-1]
    careful = replace(clean, joint=replace(clean.joint, simpler=simple))
    (found,) = undecided_order(careful)
    assert (found.severity, found.parameters) == ("doubt", PHASE_SPLIT)
    assert "a first-order one would put the delay at 0.165" in found.message


def lagging(poles, noise, evidence_of):
    """A chain of lags (time constants in s) behind 50 ms, fitted as first order."""
    u = np.sin(2 * np.pi * (0.1 * TIME + 19.9 / 20 * TIME**2))
    bins = 2j * np.pi * np.fft.rfftfreq(16 * TIME.size, 1 / 200.0)
    response = np.exp(-0.05 * bins)
    for pole in poles:
        response = response / (1 + pole * bins)
    y = np.fft.irfft(np.fft.rfft(u, 16 * TIME.size) * response)[: TIME.size]
    white = np.random.default_rng(6).standard_normal(TIME.size)
    return evidence_of(u, y + noise * white, structures=("first_order",))


def test_a_second_pole_is_asked_for_or_cannot_be_excluded(evidence_of):
    (asked,) = missed_pole(lagging((0.05, 0.02), 0.005, evidence_of))
    assert "asks for more than 1 pole " in asked.message
    (hidden,) = missed_pole(lagging((0.05,), 0.3, evidence_of))
    assert re.search(r"second pole of up to .* would not show", hidden.message)
    for found in (asked, hidden):
        assert (found.severity, found.parameters) == ("doubt", PHASE_SPLIT)
    assert missed_pole(lagging((0.05,), 0.005, evidence_of)) == ()


def test_a_nonlinear_residual_asks_for_no_pole(evidence_of):
    bent = lagging((0.05, 0.02), 0.005, evidence_of)
    assert missed_pole(replace(bent, nonlinear=True)) == ()


def with_assumption(evidence, name, *, delay, criterion):
    """Add a fit under a held input that came out so, its criterion so much worse."""
    best = evidence.joint.best
    fit = replace(
        best.fit,
        structure=STRUCTURES[name],
        theta=np.array([best.fit.delay + delay, *best.fit.theta[1:]]),
    )
    trial = Trial(intersample="zoh", fit=fit, criterion=best.criterion + criterion)
    kept = tuple(t for t in evidence.joint.trials if t.intersample == best.intersample)
    return replace(evidence, joint=replace(evidence.joint, trials=(*kept, trial)))


@pytest.mark.parametrize(
    ("name", "criterion", "words"),
    [
        ("second_order", 1.0, "if it is held by -0.50 samples"),
        ("second_order", -8.0, "if it is held by -0.50 samples"),
        ("first_order", -2.0, "if it is held with a first-order model by -0.50 samples"),
    ],
)
def test_another_assumption_between_samples_is_named(clean, name, criterion, words):
    evidence = with_assumption(clean, name, delay=-0.5, criterion=criterion)
    (found,) = other_intersample(evidence)
    assert (found.code, found.severity) == ("intersample", "info")
    assert words in found.message


def test_an_assumption_that_the_record_excludes_is_not_named(clean):
    assert other_intersample(with_assumption(clean, "second_order", delay=-0.5, criterion=13)) == ()
