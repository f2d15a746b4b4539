"""Initial states of several inputs, decided once all inputs are known."""

from dataclasses import replace

import numpy as np
import pytest

import hmpim
from hmpim.identify.coupling.pairs import Pairs, begun
from hmpim.identify.fitting.data import Counted
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.noise.whiteness import is_white

FS, BEFORE, SIZE = 100.0, 300, 1500


def answered(u, natural, delay):
    w = 2 * np.pi * natural
    model = hmpim.Model(delay=delay, scale_factor=1.0, denominator=(1 / w**2, 0.8 / w, 1.0))
    return hmpim.simulate(model, u, fs=FS, intersample="bandlimited")


def found_alone(*, moving):
    """Fits of two inputs that were taken to begin at rest, and those inputs."""
    rng = np.random.default_rng(5)
    inputs = []
    for moves in moving:
        u = np.convolve(rng.standard_normal(BEFORE + SIZE), np.hanning(9), "same")
        inputs.append(u if moves else u * np.clip((np.arange(u.size) - BEFORE - 60) / 20, 0, 1))
    own = [answered(inputs[0], 1.0, 0.05)[BEFORE:], answered(inputs[1], 1.5, 0.08)[BEFORE:]]
    noise = 0.01 * rng.standard_normal(SIZE)
    inputs = [u[BEFORE:] for u in inputs]
    pairs = Pairs(y=sum(own) + noise, valid=None, fits={}, strong=[], alike=())
    options = {"intersample": "bandlimited", "structures": ("second_order",), "growing": False}
    for i, u in enumerate(inputs):
        fit = replace(joint_fit(u, own[i] + noise, **options), effective_share=1.0)
        fit = replace(fit, problem=replace(fit.problem, y=pairs.y))
        pairs.put(i, begun(fit, u, Counted(valid=None, begins=None)))
        pairs.strong.append(i)
    pairs.refine(pairs.kept, None)
    return inputs, pairs


@pytest.mark.parametrize("moving", [(True, True), (True, False), (False, True)])
def test_states_are_free_where_the_input_moved_before_the_record(moving):
    inputs, pairs = found_alone(moving=moving)
    pairs.free_states(inputs)
    assert is_white(pairs.residual())
    pairs.rest_states(inputs)
    free = [pairs.fits[i].problem.begins is not None for i in (0, 1)]
    assert free == list(moving)
    assert is_white(pairs.residual())


def test_no_state_is_free_where_the_record_begins_at_rest():
    inputs, pairs = found_alone(moving=(False, False))
    before = pairs.residual()
    pairs.free_states(inputs)
    assert np.array_equal(pairs.residual(), before)
    assert not pairs.begins


def test_a_full_search_is_not_repeated_for_a_change_below_the_noise():
    _, pairs = found_alone(moving=(False, False))
    rest = pairs.without_others(0)
    assert pairs.is_new(0, rest, None)
    one_sample = np.zeros(SIZE)
    one_sample[700] = np.sqrt(pairs.cost)
    assert not pairs.is_new(0, rest + 0.9 * one_sample, None)
    assert pairs.is_new(0, rest + 1.1 * one_sample, None)
