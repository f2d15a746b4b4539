"""What a record that cannot tell one pole from two still leaves open."""

import numpy as np
import pytest

from hmpim.identify.fitting.fit import jacobian
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.nested import hidden_pole, widened
from hmpim.identify.uncertainty import covariance
from hmpim.identify.whiteness import is_white
from hmpim.model.sampled import delayed_response, prepare_input
from tests_support import rms_between, room

FS, N, DELAY = 200.0, 2000, 14.56


@pytest.fixture(scope="module")
def u():
    t = np.arange(N) / FS
    return np.sin(2 * np.pi * (0.1 * t + 2.0 * t**2))


def answer(u, first, second):
    """A lag of one or two poles, time in samples, without noise."""
    denominator = np.array([1.0, first + second, first * second] if second else [1.0, first])
    source = prepare_input(u, "bandlimited")
    return delayed_response(source, delay=DELAY, denominator=denominator)[0] + u[0]


def test_a_second_order_fit_of_one_pole_admits_the_one_pole(u):
    """Its bars by curvature alone leave the true delay out; widened, they do not."""
    clean = answer(u, 3.0, 0.0)
    told, by_curvature = [], []
    for seed in range(60):
        y = clean + 0.02 * np.random.default_rng(seed).standard_normal(N)
        both = joint_fit(
            u, y, intersample="bandlimited", structures=("second_order", "first_order")
        )
        if both.best.fit.structure.name != "second_order":
            continue
        joint = joint_fit(u, y, intersample="bandlimited", structures=("second_order",))
        rows = jacobian(both.problem, both.best.fit)
        cov = covariance(rows, both.best.fit.residual, freedom=N - 6, white=True)
        error = joint.best.fit.delay - DELAY
        by_curvature.append(abs(error) / np.sqrt(cov[0, 0]))
        told.append(abs(error) / np.sqrt(widened(both, cov)[0, 0]))
    assert len(told) >= 5
    assert max(by_curvature) > 4.0
    assert max(told) < 4.0


def test_what_is_well_known_stays_as_it_is(u):
    y = answer(u, 3.0, 2.0) + 0.001 * np.random.default_rng(0).standard_normal(N)
    joint = joint_fit(u, y, intersample="bandlimited")
    assert joint.best.fit.structure.name == "second_order"
    rows = jacobian(joint.problem, joint.best.fit)
    cov = covariance(rows, joint.best.fit.residual, freedom=N - 6, white=True)
    assert np.array_equal(widened(joint, cov), cov)


def limits(u, second, noise, count):
    """Limit of the second pole from a first-order fit, over seeds."""
    clean, found = answer(u, 6.0, second), []
    for seed in range(count):
        y = clean + noise * np.random.default_rng(seed).standard_normal(N)
        joint = joint_fit(u, y, intersample="bandlimited", structures=("first_order",))
        fit = joint.best.fit
        rows = jacobian(joint.problem, fit)
        white = is_white(fit.residual)
        found.append(hidden_pole(joint.problem, fit, rows, white=white).limit)
    return np.array(found)


def test_the_limit_holds_the_pole_and_narrows_with_the_noise(u):
    hidden = limits(u, 0.6, 0.05, 40)
    assert np.mean(hidden > 0.6) > 0.9
    quiet, loud = (np.median(limits(u, 0.0, noise, 12)) for noise in (0.005, 0.05))
    assert loud == pytest.approx(quiet * np.sqrt(10), rel=0.25)  # q, its square, is as the noise


@pytest.mark.few(12)
def test_a_pole_left_out_is_asked_for_and_none_where_there_is_none(u, seeds):
    """A third pole that the misfit does not show: second order alone puts the delay far off."""
    denominator = np.convolve([1.0, 2 * 0.4 * 6.0, 36.0], [1.0, 3.0])
    source = prepare_input(u, "bandlimited")
    third = delayed_response(source, delay=DELAY, denominator=denominator)[0] + u[0]
    second = delayed_response(source, delay=DELAY, denominator=np.array([1.0, 4.8, 36.0]))[0]
    scores = {}
    for name, clean in (("third", third), ("second", second + u[0])):
        scores[name] = []
        for seed in range(seeds):
            y = clean + 0.03 * np.random.default_rng(seed).standard_normal(N)
            joint = joint_fit(u, y, intersample="bandlimited", structures=("second_order",))
            rows = jacobian(joint.problem, joint.best.fit)
            hidden = hidden_pole(joint.problem, joint.best.fit, rows, white=True)
            scores[name].append(hidden.squared / hidden.std)
    assert np.min(scores["third"]) > 4.0
    low, high = rms_between(seeds)
    assert low < np.sqrt(np.mean(np.square(scores["second"]))) < high
    assert abs(np.mean(scores["second"])) < room(seeds)
