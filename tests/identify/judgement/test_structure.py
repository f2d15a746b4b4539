"""Another number of poles, or another assumption between samples, that the record allows."""

import re
from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.fitting.trial import Trial
from hmpim.identify.judgement.between_samples import other_intersample, wide_span
from hmpim.identify.judgement.structure import missed_pole, other_order
from hmpim.identify.result.groups import MODELLED, PHASE_SPLIT
from hmpim.model.dynamics import STRUCTURES

TIME = np.arange(2000) / 200.0


@pytest.mark.parametrize("check", [other_order, missed_pole, wide_span])
def test_a_clean_record_gives_no_finding(clean, check):
    assert not [*check(clean)]


def with_rival(evidence, *, delay):
    """Add a fit with one more pole that is as likely but for its price."""
    fit = replace(
        evidence.joint.best.fit,
        structure=STRUCTURES["third_order"],
        theta=np.append(evidence.joint.best.fit.theta + np.array([delay, 0.0, 0.0]), 0.0),
    )
    rival = Trial(intersample="bandlimited", fit=fit, criterion=0.0)
    return replace(evidence, joint=replace(evidence.joint, rivals=(rival,)))


def test_one_more_pole_that_is_as_likely_is_named_and_costs_no_verdict(clean):
    (found,) = other_order(with_rival(clean, delay=-3.0))
    assert (found.severity, found.parameters) == ("info", PHASE_SPLIT)
    assert "barely distinguishes 2 from 3 poles" in found.message
    assert "the delay would be 0.135" in found.message


def test_figures_that_the_models_allowed_put_far_apart_are_doubtful(clean):
    parameters = clean.readings.parameters
    low, high = 0.8 * parameters.bandwidth_phase90.value, 1.3 * parameters.bandwidth_phase90.value
    wide = replace(parameters.bandwidth_phase90, std=None, ci95=(low, high))
    (found,) = wide_span(replace(clean, spanned=replace(parameters, bandwidth_phase90=wide)))
    assert (found.severity, found.parameters) == ("doubt", ("bandwidth_phase90",))
    assert f"−90° bandwidth from {low:.4g} to {high:.4g}" in found.message


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
    (asked,) = other_order(lagging((0.05, 0.02), 0.005, evidence_of))
    assert (asked.code, asked.severity) == ("other_dynamics", "doubt")  # which it may not be given
    assert "requires dynamics other than 1 pole:" in asked.message
    (hidden,) = missed_pole(lagging((0.05,), 0.3, evidence_of))
    assert re.search(r"further pole with a time constant of up to .* would not", hidden.message)
    assert (hidden.severity, hidden.parameters) == ("info", PHASE_SPLIT)
    assert not [*missed_pole(lagging((0.05,), 0.005, evidence_of))]


@pytest.mark.parametrize(
    ("deviations", "severity", "close"),
    [(2.5, None, False), (3.5, "info", True), (4.5, "doubt", True), (9.0, "doubt", False)],
)
def test_a_statistic_close_to_its_level_is_said_on_both_sides(clean, deviations, severity, close):
    hidden = clean.joint.hidden
    squared = (0.5 * hidden.scale) ** 2
    asked = replace(hidden, squared=squared, std=squared / deviations)
    found = missed_pole(replace(clean, joint=replace(clean.joint, hidden=asked)))
    assert [f.severity for f in found] == ([severity] if severity else [])
    for finding in found:
        assert (
            f"is {deviations:.1f} standard deviations, and a doubt begins at 3.9" in finding.message
        )
        assert ("Another run may give the opposite verdict." in finding.message) == close


def test_a_nonlinear_residual_asks_for_no_pole(evidence_of):
    bent = lagging((0.05, 0.02), 0.005, evidence_of)
    assert not [*missed_pole(replace(bent, nonlinear=0.6))]


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
        ("second_order", 1.0, "it may also be held, with a delay 0.50 samples shorter."),
        ("second_order", -8.0, "it may also be held, with a delay 0.50 samples shorter."),
        (
            "first_order",
            -2.0,
            "it may also be held, with a first-order model and a delay 0.50 samples shorter.",
        ),
    ],
)
def test_another_assumption_between_samples_is_named(clean, name, criterion, words):
    evidence = with_assumption(clean, name, delay=-0.5, criterion=criterion)
    (found,) = other_intersample(evidence)
    assert (found.code, found.severity) == ("intersample", "info")
    assert words in found.message


def test_an_assumption_that_the_record_excludes_is_not_named(clean):
    assert not [
        *other_intersample(with_assumption(clean, "second_order", delay=-0.5, criterion=13))
    ]


def test_a_pole_that_no_model_here_can_have_and_the_record_requires_is_a_doubt(clean):
    evidence = with_rival(clean, delay=-3.0)
    best, (rival,) = evidence.joint.best, evidence.joint.rivals

    def at(ahead, white):
        likelier = replace(rival, criterion=best.criterion - ahead)
        joint = replace(evidence.joint, rivals=(likelier,))
        readings = replace(evidence.readings, white=white)
        return other_order(replace(evidence, joint=joint, readings=readings))

    (close,), (far,), (coloured,) = at(5.0, True), at(7.0, True), at(7.0, False)
    assert (close.code, close.severity) == ("structure", "info")
    assert (far.code, far.severity, far.parameters) == ("other_dynamics", "doubt", PHASE_SPLIT)
    assert "delay would be 0.135" in far.message
    assert coloured.parameters == MODELLED


def test_dynamics_that_leave_coloured_noise_spare_no_figure(clean):
    hidden = clean.joint.hidden
    squared = (0.5 * hidden.scale) ** 2
    asked = replace(hidden, squared=squared, std=squared / 9.0)
    evidence = replace(clean, joint=replace(clean.joint, hidden=asked))
    (white,) = missed_pole(evidence)
    coloured = replace(evidence, readings=replace(clean.readings, white=False))
    (little,) = missed_pole(replace(coloured, fit_percent=98.0))
    (much,) = missed_pole(replace(coloured, fit_percent=95.0))
    assert (white.parameters, little.parameters) == (PHASE_SPLIT, PHASE_SPLIT)
    assert much.parameters == MODELLED


def test_a_figure_that_a_model_allowed_does_not_have_is_open_and_doubtful(clean):
    natural = replace(clean.readings.parameters.natural_frequency, std=None, ci95=(9.0, None))
    spanned = replace(clean.readings.parameters, natural_frequency=natural)
    (found,) = wide_span(replace(clean, spanned=spanned))
    assert found.parameters == ("natural_frequency",)
    assert "natural frequency above 9" in found.message
