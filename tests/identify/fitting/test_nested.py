"""What a record that cannot tell one pole from two still leaves open."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.nested import widened
from hmpim.identify.noise.covariance import covariance
from hmpim.model.sampled import delayed_response, prepare_input

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


@pytest.mark.few(30)
def test_a_second_order_fit_of_one_pole_admits_the_one_pole(u, seeds):
    """Its bars by curvature alone leave the true delay out; widened, they do not."""
    clean = answer(u, 3.0, 0.0)
    told, by_curvature = [], []
    for seed in range(seeds):
        y = clean + 0.02 * np.random.default_rng(seed).standard_normal(N)
        joint = joint_fit(u, y, intersample="bandlimited", structures=("second_order",))
        simple = joint_fit(u, y, intersample="bandlimited", structures=("first_order",))
        if simple.best.fit.objective - joint.best.fit.objective < 0.5 * 0.02**2:
            continue  # the second pole is none, and its bar is wide
        both = replace(joint, trials=(*joint.trials, *simple.trials))
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
