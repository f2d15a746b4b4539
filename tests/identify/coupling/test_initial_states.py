"""Initial states of several inputs, decided once all inputs are known."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

import hmpim
from hmpim.identify.coupling.output_fit import _fit_strong, _join, fit_leading
from hmpim.identify.coupling.pairs import Pairs
from hmpim.identify.effects.disturbance import held_rows
from hmpim.identify.fitting.course import start
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.noise.whiteness import is_white

FS, BEFORE, SIZE = 100.0, 300, 1500
OPTIONS = {"known": None, "intersample": "bandlimited", "structures": ("second_order",)}


def answered(u, natural, delay):
    w = 2 * np.pi * natural
    model = hmpim.Model(delay=delay, scale_factor=1.0, denominator=(1 / w**2, 0.8 / w, 1.0))
    return hmpim.simulate(model, u, fs=FS, intersample="bandlimited")


def found(*, moving, seed=5):
    """Two inputs and their plain fits; only those `moving` moved before the record."""
    rng = np.random.default_rng(seed)
    inputs = []
    for moves in moving:
        u = np.convolve(rng.standard_normal(BEFORE + SIZE), np.hanning(9), "same")
        inputs.append(u if moves else u * np.clip((np.arange(u.size) - BEFORE - 60) / 20, 0, 1))
    y = answered(inputs[0], 1.0, 0.05) + answered(inputs[1], 1.5, 0.08)
    y = y[BEFORE:] + 0.01 * rng.standard_normal(SIZE)
    inputs = [u[BEFORE:] for u in inputs]
    pairs = Pairs(y=y, valid=None, fits={}, strong=[], alike=())
    pairs.resume(fit_leading(inputs, y, None, **OPTIONS), None)
    _join(inputs, pairs, partial(joint_fit, **OPTIONS, growing=False))
    return inputs, pairs


@pytest.mark.parametrize("moving", [(True, True), (True, False)])
def test_states_are_free_where_an_input_moved_before_the_record(moving):
    _, pairs = found(moving=moving)
    assert is_white(pairs.residual())
    assert pairs.cost < 1.1 * 0.01**2


def test_no_state_is_free_where_the_record_begins_at_rest():
    _, pairs = found(moving=(False, False))
    assert is_white(pairs.residual())
    assert all(fit.problem.begins is None for fit in pairs.fits.values())


def test_states_that_explain_nothing_stay_at_rest():
    """A slow wave is no free response, though it is not white."""
    inputs, pairs = found(moving=(False, False))
    pairs = replace(pairs, y=pairs.y + 0.05 * np.sin(0.05 * np.arange(SIZE)))
    fits, masks = dict(pairs.fits), dict(pairs.masks)
    assert not is_white(pairs.residual())
    pairs.free_states(inputs)
    assert all(pairs.fits[i] is fit for i, fit in fits.items())
    assert pairs.masks == masks


def test_states_of_inputs_that_move_nothing_are_not_asked():
    inputs, pairs = found(moving=(True, True))
    late = replace(pairs.fits[1], related=False)
    late.best.fit.theta[0] = SIZE / 2
    pairs.fits[1] = late
    pairs.fits[0] = replace(pairs.fits[0], problem=replace(pairs.fits[0].problem, begins=None))
    pairs.free_states(inputs)
    assert pairs.fits[1] is late


def test_samples_before_a_free_response_do_not_count_with_other_rows():
    _, pairs = found(moving=(True, True))
    rows = np.linspace(-1.0, 1.0, SIZE)[None]
    again = Pairs(y=pairs.y, valid=None, fits={}, strong=[], alike=())
    again.resume(pairs.fits, rows)
    assert again.cost < 1.1 * 0.01**2
    for i, fit in again.fits.items():
        assert fit.problem.begins
        assert not again.masks[i][: fit.problem.begins].any()


def test_free_responses_of_the_others_may_change_while_an_input_is_fitted():
    inputs, pairs = found(moving=(True, True))
    first, second = pairs.strong
    pairs = replace(pairs, y=pairs.y + 0.05 * np.sin(0.2 * np.arange(SIZE)))  # no white noise
    rows = pairs.free_of_others(first)
    assert rows.shape == (2, SIZE)
    assert not rows[:, : pairs.fits[second].problem.begins].any()
    given = []

    def fitted(u, y, **options):
        given.append(options)
        return joint_fit(u, y, **OPTIONS, **options)

    _fit_strong(inputs, pairs, fitted)
    assert np.array_equal(given[0]["nuisance"], rows)
    assert all(fit.problem.nuisance is None for fit in pairs.fits.values())


def test_rows_that_are_held_are_subtracted_from_the_output():
    rng = np.random.default_rng(0)
    u, rows = rng.standard_normal(SIZE), rng.standard_normal((2, SIZE))
    y = answered(u, 1.0, 0.05) + 0.3 * rows[0] - 0.2 * rows[1] + 0.01 * rng.standard_normal(SIZE)
    free = joint_fit(u, y, **OPTIONS, nuisance=rows)
    held = held_rows(free, 1)
    explained = free.best.fit.nuisance[1] * rows[1]
    assert np.array_equal(held.problem.nuisance, rows[:1])
    assert held.best.fit.nuisance == pytest.approx(free.best.fit.nuisance[:1])
    assert held.problem.y == pytest.approx(y - explained)
    assert held.best.fit.prediction == pytest.approx(free.best.fit.prediction - explained)
    (rival,) = held_rows(replace(free, rivals=(free.best,)), 1).rivals
    assert rival.fit.nuisance == pytest.approx(free.best.fit.nuisance[:1])
    assert rival.fit.prediction == pytest.approx(free.best.fit.prediction - explained)


def test_spectra_ignore_rows_that_explain_little():
    rng = np.random.default_rng(1)
    u = np.convolve(rng.standard_normal(SIZE), np.hanning(9), "same")
    y = answered(u, 1.0, 0.05)
    rows = y[None] + 0.1 * rng.standard_normal((1, SIZE))
    alone = start(u, y, None, **OPTIONS, nuisance=None).data.rough
    beside = start(u, y, None, **OPTIONS, nuisance=rows, small=1).data.rough
    assert np.array_equal(beside.response, alone.response)
