"""Error bars that are too wide, and a fit that did not end."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.judgement.errors import not_converged, weak_delay, weak_excitation
from hmpim.identify.result.groups import MODELLED


@pytest.mark.parametrize("check", [not_converged, weak_delay, weak_excitation])
def test_a_clean_record_gives_no_finding(clean, check):
    assert not [*check(clean)]


def test_a_fit_that_stopped_on_its_way_casts_doubt_on_all_of_it(clean):
    best = clean.joint.best
    stopped = replace(best, fit=replace(best.fit, converged=False))
    (found,) = not_converged(replace(clean, joint=replace(clean.joint, best=stopped)))
    assert (found.severity, found.parameters) == ("doubt", MODELLED)


def with_std(evidence, **stds):
    p = evidence.readings.parameters
    wide = {name: replace(getattr(p, name), std=std) for name, std in stds.items()}
    return replace(evidence, readings=replace(evidence.readings, parameters=replace(p, **wide)))


@pytest.mark.parametrize(
    ("name", "std"), [("scale_factor", 0.4), ("natural_frequency", 4.0), ("damping_ratio", 0.2)]
)
def test_a_figure_with_a_third_of_its_value_for_error_is_doubtful_alone(clean, name, std):
    (found,) = weak_excitation(with_std(clean, **{name: std}))
    assert (found.code, found.severity, found.parameters) == ("weak_excitation", "doubt", (name,))
    assert name.replace("_", " ") in found.message


def test_far_from_zero_input_the_bias_is_as_doubtful_as_the_scale_factor(field_record, evidence_of):
    _, u, y = field_record
    far = with_std(evidence_of(u + 50.0, y, structures=("second_order",)), scale_factor=0.4)
    (found,) = weak_excitation(far)
    assert found.parameters == ("scale_factor", "bias")


def test_an_error_without_end_is_doubtful_too(clean):
    p = clean.readings.parameters
    endless = replace(p, scale_factor=replace(p.scale_factor, std=float("inf"), ci95=None))
    (found,) = weak_excitation(replace(clean, readings=replace(clean.readings, parameters=endless)))
    assert found.parameters == ("scale_factor",)
    assert "does not determine the scale factor: its standard deviation exceeds" in found.message


def test_a_deviation_is_stated_in_per_cent_only_below_the_value(clean):
    (some,) = weak_excitation(with_std(clean, natural_frequency=4.0))
    assert "barely determines the natural frequency" in some.message
    assert "40 % of its value" in some.message
    (none,) = weak_excitation(with_std(clean, natural_frequency=1e4))
    assert "does not determine the natural frequency" in none.message
    assert "%" not in none.message


def test_a_delay_is_weak_beyond_two_samples_and_a_third_of_itself(clean):
    """150 ms at 200 Hz: two samples are 10 ms, 30 % are 45 ms."""
    assert not [*weak_delay(with_std(clean, delay=0.044))]
    (found,) = weak_delay(with_std(clean, delay=0.046))
    assert found.parameters == ("delay",)
    (found,) = weak_delay(with_std(clean, delay=0.2, delay_low_frequency=0.2))
    assert found.parameters == ("delay", "delay_low_frequency")


def test_weak_noise_makes_no_doubt_and_strong_noise_does(field_record, evidence_of):
    _, u, y = field_record
    noise = np.random.default_rng(0).standard_normal(y.size)
    loose = evidence_of(u, y + 20 * noise, structures=("second_order",))
    doubtful = {name for f in weak_excitation(loose) for name in f.parameters}
    p = loose.readings.parameters
    for name in ("scale_factor", "natural_frequency", "damping_ratio"):
        estimate = getattr(p, name)
        assert (name in doubtful) == (estimate.std > 0.3 * abs(estimate.value))
    assert doubtful


def test_a_pole_that_may_lie_anywhere_leaves_the_delay_open(clean):
    (found,) = weak_excitation(with_std(clean, natural_frequency=1e4))
    assert found.parameters == ("natural_frequency", "delay")
