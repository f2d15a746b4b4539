"""Figures that a nonlinearity has moved are doubted, and no others."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.judgement.bent import bent
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.nonlinear.bends import Bend
from hmpim.identify.reading.spanned import blurred, spanned
from hmpim.identify.result.groups import MODELLED

GAIN = 3  # of delay, two of the denominator, scale factor, bias


def bend(evidence, *, certain=True, effect=0.02, white=False, moved=GAIN):
    """Five per cent more scale factor, or of another parameter."""
    fit = evidence.joint.best.fit
    shift = np.zeros(fit.theta.size + fit.linear.size)
    shift[moved] = 0.05
    return Bend(
        kind="dead_zone",
        gain=200.0,
        certain=certain,
        effect=effect,
        share=0.05,
        white=white,
        fit=fit,
        moved=shift,
    )


def test_only_what_it_moves_is_doubted(clean):
    (found,) = bent(replace(clean, bends=(bend(clean),)))
    assert (found.code, found.severity) == ("nonlinear", "doubt")
    assert found.parameters == ("scale_factor",)
    assert "a dead zone of the command" in found.message
    assert "scale factor by 5 %" in found.message


def test_a_good_part_of_the_residual_is_no_noise(clean):
    (found,) = bent(replace(clean, bends=(replace(bend(clean), share=0.3),)))
    assert set(found.parameters) == {"scale_factor", "noise_std"}


@pytest.mark.parametrize(
    "small",
    [{"certain": False}, {"effect": 0.002}, {"effect": 0.008, "white": True}],
)
def test_what_is_possible_or_small_casts_no_doubt(clean, small):
    assert not [*bent(replace(clean, bends=(bend(clean, **small),)))]


def test_what_casts_no_doubt_widens_the_interval_to_its_side(clean):
    def intervals(bent):
        own, highest = clean.readings.parameters, clean.band[1]
        return spanned(own, clean.joint, fs=clean.fs, highest=highest, bent=bent)

    plain, wide = intervals([]), intervals([(clean.joint.best.fit, bend(clean).farthest)])
    assert wide.natural_frequency == plain.natural_frequency
    assert wide.scale_factor.ci95[0] == plain.scale_factor.ci95[0]
    own = clean.readings.parameters.scale_factor.ci95[1]
    assert plain.scale_factor.ci95[1] < own + 0.05
    assert wide.scale_factor.ci95[1] - own == pytest.approx(0.05 * 1.098, rel=0.01)


def test_what_neither_a_rich_structure_nor_a_nonlinearity_describes_is_doubted_whole(clean):
    joint = clean.joint
    fit = replace(joint.best.fit, structure=replace(joint.best.fit.structure, name="two_modes"))
    rich = replace(clean, joint=replace(joint, best=replace(joint.best, fit=fit)))
    (found,) = bent(replace(rich, bends=(bend(clean),)))
    assert set(found.parameters) == set(MODELLED)
    (found,) = bent(replace(rich, bends=(bend(clean, white=True),)))
    assert found.parameters == ("scale_factor",)


def test_dynamics_are_accused_where_a_linear_response_explains_more(clean):
    follows = replace(clean, misfit=Misfit(share=0.6, within=0.6, probability=1e-30))
    (found,) = bent(replace(follows, bends=(bend(clean),)))
    assert (found.code, found.severity) == ("other_dynamics", "doubt")
    assert found.parameters == ("scale_factor",)
    assert "60 % follows the input" in found.message
    for kept in (bend(clean, white=True), replace(bend(clean), share=0.7)):
        (found,) = bent(replace(follows, bends=(kept,)))
        assert found.code == "nonlinear"


def test_every_interval_has_room_for_what_no_linear_model_is_right_to(clean):
    own = clean.readings.parameters
    wide = blurred(own, 0.003)
    for name, room in (("delay", 0.003 * 0.15), ("peak_gain_db", 20 * np.log10(1.003))):
        before, after = getattr(own, name), getattr(wide, name)
        assert after.value == before.value
        assert after.ci95[1] - before.ci95[1] == pytest.approx(room, rel=0.01)
        assert before.ci95[0] - after.ci95[0] == pytest.approx(room, rel=0.01)
    assert wide.noise_std == own.noise_std
