"""What the model leaves over: each check is silent on a clean record and speaks on its own."""

import re
from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.judgement.residual import (
    changing_noise,
    coloured_noise,
    filled_input,
    halves_disagree,
    lack_of_fit,
    noise_colour_of,
    noise_on_the_input,
    uneven_noise,
    unsampled_input,
)
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.result.groups import GAIN, MODELLED

WHITE = 0.1 * np.random.default_rng(3).standard_normal(2000)


@pytest.mark.parametrize(
    "check",
    [
        *(lack_of_fit, coloured_noise, halves_disagree),
        *(noise_colour_of, noise_on_the_input, uneven_noise, changing_noise),
    ],
)
def test_a_clean_record_gives_no_finding(clean, check):
    assert not [*check(clean)]


@pytest.mark.parametrize(
    ("share", "severity", "others"),
    [(0.008, "info", set()), (0.1, "doubt", {"noise_std"}), (0.2, "doubt", set())],
)
def test_a_residual_that_follows_the_input_casts_doubt_from_three_per_cent_on(
    clean, share, severity, others
):
    """Of an output with 10 % left over, a share s of its power is 10 √s per cent."""
    (found,) = lack_of_fit(
        replace(
            clean,
            misfit=Misfit(share=share, within=share, probability=1e-9),
            fit_percent=90 - 10 * 1.2,
        )
    )
    assert (found.code, found.severity) == ("lack_of_fit", severity)
    assert set(found.parameters) == set(MODELLED) - others  # a tenth of its power is little noise
    assert f"about {100 * 0.22 * np.sqrt(share):.2g} % of the output" in found.message


def test_what_explains_none_of_the_residual_is_not_said(clean):
    assert not [
        *lack_of_fit(replace(clean, misfit=Misfit(share=0.0, within=0.0, probability=1e-9)))
    ]


def test_a_missing_resonance_is_a_lack_of_fit(field_record, evidence_of):
    """A static model of the field record, in which the resonance is all that matters."""
    _, u, y = field_record
    (found,) = lack_of_fit(evidence_of(u, y + WHITE, structures=("static",)))
    assert found.severity == "doubt"
    assert "static model" in found.message


def test_coloured_noise_is_said_and_doubted_only_where_it_is_most_of_the_output(
    field_record, evidence_of
):
    _, u, y = field_record
    shaped = np.convolve(np.random.default_rng(1).standard_normal(2019), np.ones(20), "valid")
    evidence = evidence_of(u, y + 0.02 * shaped)
    (found,) = coloured_noise(evidence)
    assert (found.severity, found.parameters) == ("info", MODELLED)
    (colour,) = noise_colour_of(evidence)
    assert (colour.code, colour.parameters) == ("noise_colour", ("noise_std",))
    follows = replace(
        evidence, fit_percent=40.0, misfit=Misfit(share=0.1, within=0.1, probability=0.0)
    )
    (found,) = coloured_noise(follows)
    assert found.severity == "doubt"


def test_a_residual_that_is_not_white_is_never_said_to_be_white(clean):
    assert not [*noise_colour_of(replace(clean, readings=replace(clean.readings, white=False)))]


def test_noise_that_is_louder_at_the_end_is_no_colour_and_its_time_is_said(
    field_record, evidence_of
):
    _, u, y = field_record
    level = np.where(np.arange(y.size) < 1600, 1.0, 5.0)
    evidence = evidence_of(u, y + level * WHITE)
    assert not [*coloured_noise(evidence), *noise_colour_of(evidence)]
    (found,) = changing_noise(evidence)
    assert (found.severity, found.parameters) == ("info", MODELLED)
    low, high = map(float, re.findall(r"from (\S+) to (\S+) times", found.message)[0])
    assert (low, high) == pytest.approx((0.415, 2.08), rel=0.15)  # 1 and 5 over their r.m.s.
    assert "loudest from 9 to 10 s" in found.message or "loudest from 8 to 9 s" in found.message


def test_noise_that_varies_where_input_was_filled_in_is_doubted(clean, field_record, evidence_of):
    _, u, y = field_record
    level = np.where(np.arange(y.size) < 1600, 1.0, 5.0)
    evidence = evidence_of(u, y + level * WHITE)
    assert not [*filled_input(evidence), *filled_input(replace(clean, filled=40))]
    (found,) = filled_input(replace(evidence, filled=40))
    assert (found.severity, found.parameters) == ("doubt", ("noise_std",))
    assert "40 samples" in found.message


def test_halves_of_another_delay_cast_doubt(field_record, evidence_of):
    """Two samples later from the middle on."""
    _, u, y = field_record
    changed = np.concatenate([y[:1000], y[998:-2]])
    (found,) = halves_disagree(evidence_of(u, changed + 0.2 * WHITE))
    assert (found.code, found.severity, found.parameters) == ("halves_disagree", "doubt", MODELLED)


@pytest.mark.parametrize(("std", "severity"), [(0.1, "info"), (0.3, "doubt")])
def test_noise_on_the_input_touches_the_size_of_the_response_alone(clean, std, severity):
    noisy = clean.u + std * np.random.default_rng(4).standard_normal(clean.u.size)
    (found,) = noise_on_the_input(replace(clean, u=noisy))
    assert (found.code, found.severity) == ("input_noise", severity)
    assert found.parameters == (*GAIN, "noise_std")
    # A fifth of white noise of variance σ² lies in the band, beside a sweep of power 1/2.
    lowered = 100 / (1 + 0.5 / (0.2 * std**2))
    said = float(found.message.split("about ")[1].split(" %")[0])
    assert said == pytest.approx(lowered, rel=0.25)


def test_noise_that_grows_with_a_fast_input_is_doubted_where_stamps_jitter(clean):
    u, residual = clean.u, clean.joint.best.fit.residual
    fast = np.abs(np.diff(u, 4, prepend=np.zeros(4)))
    grown = residual + 3 * np.std(residual) * fast / np.std(fast) * np.sign(residual)
    fit = replace(clean.joint.best.fit, residual=grown)
    strewn = replace(
        clean, joint=replace(clean.joint, best=replace(clean.joint.best, fit=fit)), jittered=True
    )
    (found,) = uneven_noise(strewn)
    assert (found.code, found.severity, found.parameters) == (
        "uneven_noise",
        "doubt",
        ("noise_std",),
    )
    assert not [*uneven_noise(replace(strewn, jittered=False))]
    assert not [*uneven_noise(replace(clean, jittered=True))]


def test_an_input_that_moves_beyond_half_the_rate_makes_the_noise_doubtful(clean):
    fine = np.random.default_rng(2).standard_normal(8 * clean.u.size)
    smooth = np.convolve(fine, np.hanning(22), mode="same")[::8]
    folded = replace(clean, u=30.0 * smooth / smooth.std() * clean.u.std())
    (found,) = unsampled_input(folded)
    assert (found.severity, found.parameters) == ("doubt", ("noise_std",))
    assert not [*unsampled_input(clean)]
    white = np.random.default_rng(2).standard_normal(clean.u.size)
    assert not [*unsampled_input(replace(clean, u=white))]
