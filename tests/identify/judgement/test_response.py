"""A bandwidth that the measured response contradicts, and what of the model shapes it."""

from dataclasses import replace

import pytest

from hmpim.identify.judgement.response import bandwidth_disagrees


def test_a_clean_record_gives_no_finding(clean):
    assert bandwidth_disagrees(clean) == ()


def moved(evidence, name, share):
    stated = getattr(evidence.readings.parameters, name)
    other = replace(stated, value=stated.value * (1 + share), std=0.001 * stated.value)
    return replace(evidence, measured=replace(evidence.measured, **{name: other}))


@pytest.mark.parametrize(
    ("name", "spared"),
    [
        ("bandwidth_phase90", {"bandwidth_3db", "scale_factor", "bias", "peak_gain_db"}),
        ("bandwidth_3db", {"bandwidth_phase90", "delay", "scale_factor", "bias"}),
    ],
)
def test_a_bandwidth_five_per_cent_apart_casts_doubt_on_itself_and_its_shape(clean, name, spared):
    (found,) = bandwidth_disagrees(moved(clean, name, 0.05))
    assert found.severity == "doubt"
    assert name in found.parameters
    assert not spared & set(found.parameters)


def test_two_per_cent_do_not_matter_and_a_held_output_shows_its_hold(clean):
    assert bandwidth_disagrees(moved(clean, "bandwidth_phase90", 0.02)) == ()
    assert bandwidth_disagrees(replace(moved(clean, "bandwidth_phase90", 0.05), held=True)) == ()


def test_both_apart_are_one_sentence_about_both(clean):
    both = moved(moved(clean, "bandwidth_phase90", 0.05), "bandwidth_3db", 0.05)
    (found,) = bandwidth_disagrees(both)
    assert {"bandwidth_phase90", "bandwidth_3db", "delay", "damping_ratio"} <= set(found.parameters)
