"""Zeros that resemble delay: either half plane, and a servo's second one."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.fitting.growth import hidden_pole
from hmpim.identify.fitting.zeros import mirrored, second_zeros
from hmpim.model.dynamics import STRUCTURES, theta_of
from hmpim.model.sampled import delayed_response, prepare_input
from tests_support import assert_share

FS, N, DELAY = 200.0, 1600, 2.4
MODE = (2.0, 6.0)  # 1 + 2 s + 6 s², time in samples


def sweep():
    t = np.arange(N) / N
    return np.sin(2 * np.pi * (2.0 * t + 0.11 * N * t**2))


def answer(u, *leads, lag=0.0):
    """The response of a mode, a lag and zeros (1 + sT) to a band-limited input."""
    below, above = np.convolve([1.0, *MODE], [1.0, lag]), np.ones(1)
    for lead in leads:
        above = np.convolve(above, [1.0, lead])
    below = np.trim_zeros(below, "b")
    rows = delayed_response(
        prepare_input(u, "bandlimited"), delay=DELAY, denominator=below, powers=above.size
    )
    return above @ rows + u[0]


def problem(u, y):
    return Problem(source=prepare_input(u, "bandlimited"), y=y, valid=None, longest_delay=99.0)


def noisy(clean, noise, seed):
    return clean + noise * np.random.default_rng(seed).standard_normal(N)


@pytest.mark.parametrize("lead", [0.5, -0.5])
def test_the_search_ends_on_either_side_and_the_mirror_image_leads_to_the_other(lead):
    u = sweep()
    data = problem(u, noisy(answer(u, lead), 1e-3, 1))
    structure = STRUCTURES["second_order_zero"]
    theta = np.append(DELAY - 2.0 * lead, theta_of(structure, MODE))
    wrong = fit_structure(data, structure, theta)
    assert wrong.numerator[1] / wrong.numerator[0] == pytest.approx(-lead, abs=0.15)
    assert wrong.delay == pytest.approx(DELAY - 2.0 * lead, abs=0.15)
    (right,) = mirrored(data, wrong, hopeless=wrong.objective)
    assert right.objective < wrong.objective
    assert right.numerator[1] / right.numerator[0] == pytest.approx(lead, abs=0.02)
    assert right.delay == pytest.approx(DELAY, abs=0.02)
    assert not mirrored(data, right, hopeless=right.objective)


def test_nothing_is_mirrored_without_zeros():
    u = sweep()
    data = problem(u, noisy(answer(u), 1e-3, 1))
    structure = STRUCTURES["second_order"]
    fit = fit_structure(data, structure, np.append(DELAY, theta_of(structure, MODE)))
    assert not mirrored(data, fit, hopeless=np.inf)


def test_a_second_zero_is_fitted_in_either_half_plane():
    u = sweep()
    data = problem(u, noisy(answer(u, 1.9, 0.5, lag=1.0), 0.01, 3))
    structure = STRUCTURES["third_order_zero"]
    start = np.append(DELAY - 0.4, theta_of(structure, [*MODE, 0.7]))
    plainer = fit_structure(data, structure, start)
    fits = second_zeros(data, plainer, hidden_pole(data, plainer), count=data.counted)
    delays = sorted(fit.delay for fit in fits)
    assert delays[0] < plainer.delay < delays[1]
    assert all(fit.objective <= plainer.objective for fit in fits)
    assert delays[1] == pytest.approx(DELAY, abs=0.2)


@pytest.mark.few(4)
@pytest.mark.parametrize("noise", [0.003, 0.012])
def test_the_delay_of_a_servo_with_two_zeros_is_in_its_interval(noise, seeds):
    """The noise hides the sign of the second zero, or all of it: the delay is a sample off."""
    u = sweep()
    clean = answer(u, 1.9, 0.6, lag=0.9)
    inside = []
    for seed in range(seeds):
        record = hmpim.Record.from_arrays(
            {"u": u}, {"y": noisy(clean, noise, seed)}, fs=FS, intersample="bandlimited"
        )
        low, high = hmpim.identify(record)["y", "u"].delay.ci95
        inside.append(low <= DELAY / FS <= high)
    assert_share(inside, at_least=0.93)
