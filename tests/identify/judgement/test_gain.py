"""A gain that changes is said; one that may have changed doubts what it would move, and no more."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.effects.gain import GainChange
from hmpim.identify.judgement.bent import gain_change


def change(evidence, *, taken, share=0.0, others=()):
    """Ten per cent, beside the fit that there is."""
    joint = evidence.joint
    return GainChange(
        joint=joint,
        taken=taken,
        trend=np.zeros(joint.problem.y.size),
        course=np.ones(joint.problem.y.size),
        change=-0.1,
        std=0.002,
        share=share,
        others=others,
    )


def with_gain(evidence, times):
    """The fit with another scale factor."""
    fit = evidence.joint.best.fit
    return replace(fit, linear=fit.linear * np.array([times, 1.0]))


def test_nothing_is_said_of_a_gain_of_which_nothing_is_known(clean):
    assert not [*gain_change(clean)]


def test_a_change_that_is_removed_is_information(clean):
    (found,) = gain_change(replace(clean, gaining=change(clean, taken=True)))
    assert (found.code, found.severity) == ("gain_change", "info")
    assert found.parameters == ("scale_factor",)
    assert "falls by (10.00 ± 0.20) %" in found.message


@pytest.mark.parametrize("taken", [True, False])
def test_only_what_another_explanation_moves_is_doubted(clean, taken):
    others = (with_gain(clean, 1.1),)
    (found,) = gain_change(replace(clean, gaining=change(clean, taken=taken, others=others)))
    assert (found.severity, found.parameters) == ("doubt", ("scale_factor",))


def test_what_it_moves_by_little_is_left_to_the_interval(clean):
    others = (with_gain(clean, 1.01),)
    (found,) = gain_change(replace(clean, gaining=change(clean, taken=False, others=others)))
    assert found.severity == "info"
    assert "may have changed" in found.message


def test_what_it_explains_of_the_residual_is_no_noise(clean):
    others = (clean.joint.best.fit,)
    gaining = change(clean, taken=False, share=0.3, others=others)
    (found,) = gain_change(replace(clean, gaining=gaining))
    assert found.parameters == ("noise_std",)
