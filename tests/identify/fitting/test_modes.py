"""Modes in parallel, grown from the peaks of what is left over."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.fitting.fit import Problem
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.rows import Part
from hmpim.model.dynamics import STRUCTURES, second_order_coefficients, theta_of
from hmpim.model.sampled import prepare_input

FS = 100.0


def _answer(u, places, dampings, gains, delay, name):
    structure = STRUCTURES[name]
    sections = [
        second_order_coefficients(f, z) * FS ** np.arange(1, 3)
        for f, z in zip(places, dampings, strict=True)
    ]
    theta = np.append(delay, theta_of(structure, np.concatenate(sections)))
    structure = replace(structure, zeros=2 * len(places) - 2, parallel=True)
    source = prepare_input(u, "bandlimited")
    problem = Problem(source=source, y=u, valid=None, longest_delay=100.0)
    weights = np.concatenate([[gains.sum()], gains[1:]])
    return Part(problem, structure, theta).driven(weights)


def test_two_modes_of_opposite_sign_are_found_in_mid_motion():
    """White input that moves before the record: the rough response alone does not show them."""
    u = np.convolve(np.random.default_rng(3).standard_normal(1400), np.ones(2) / 2, "same")
    gains = np.array([-2.1757, 2.1564])
    y = _answer(u, [5.43, 10.48], [0.088, 0.099], gains, 15.09, "two_modes")
    y = y + 0.002 * np.std(y) * np.random.default_rng(4).standard_normal(y.size)
    fit = joint_fit(u[700:], y[700:], intersample="bandlimited").best.fit
    assert fit.structure.name == "two_modes"
    assert fit.delay == pytest.approx(15.09, abs=0.02)
