"""Where a record begins: in mid-motion, or from rest with a corner that a spline rings about."""

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim.identify.fitting.beginning import begin_later, begins_of
from hmpim.identify.fitting.data import Counted
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.model.dynamics import STRUCTURES
from hmpim.model.sampled import prepare_input
from tests_support import answer_of, fewest, four_sines

FS, FINE = 100.0, 16
N = 60


def short(seed: int) -> hmpim.Record:
    """A sweep from rest, whose velocity jumps at the first sample; second order, 9 Hz."""
    t = np.arange(N * FINE) / (FS * FINE)
    u = np.sin(2 * np.pi * (1.67 * t + 25 * t**2))
    omega, damping = 2 * np.pi * 9.0, 0.25
    y = answer_of([1.0], [omega**-2, 2 * damping / omega, 1.0], u, t)
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(N)
    return hmpim.Record.from_arrays({"u": u[::FINE]}, {"y": y[::FINE] + noise}, fs=FS)


@pytest.mark.few(10)
def test_what_rings_at_the_start_of_a_short_record_is_no_noise(seeds):
    found = [hmpim.identify(short(seed))["y", "u"].noise_std for seed in range(seeds)]
    held = [one.ci95[0] <= 1e-3 <= one.ci95[1] for one in found]
    assert np.mean([one.value for one in found]) == pytest.approx(1e-3, rel=0.1)
    assert np.mean(held) >= 0.8  # 0.95 on average


@pytest.mark.few(20)
def test_coloured_noise_behind_an_input_from_rest_is_no_free_response(seeds):
    u = np.concatenate([np.zeros(50), np.random.default_rng(0).standard_normal(550)])
    unit = hmpim.Model(delay=0.01, scale_factor=1.0, denominator=(0.02, 1.0))
    clean = np.asarray(hmpim.simulate(unit, u, fs=200.0, intersample="bandlimited"))
    source, found = prepare_input(u, "bandlimited"), []
    for seed in range(seeds):
        noise = lfilter([0.05], [1.0, -0.95], np.random.default_rng(seed).standard_normal(900))
        problem = Problem(source=source, y=clean + noise[300:], valid=None, longest_delay=100.0)
        fit = fit_structure(problem, STRUCTURES["first_order"], np.array([2.0, np.log(4.0)]))
        found.append(begins_of(problem, fit, lag=2))
    assert found.count(None) >= fewest(seeds, 0.99)


def cut(u: np.ndarray, unit: hmpim.Model, samples: int, noise: float, seed: int) -> hmpim.Record:
    """The last samples of a test at 1 kHz, noise a share of the output's motion."""
    y = np.asarray(hmpim.simulate(unit, u, fs=1000.0, intersample="bandlimited"))[-samples:]
    rng = np.random.default_rng(seed)
    y = y + noise * y.std() * rng.standard_normal(samples)
    return hmpim.Record.from_arrays({"u": u[-samples:]}, {"y": y}, fs=1000.0)


def second_order(frequency: float, damping: float, delay: float, bias: float) -> hmpim.Model:
    omega = 2 * np.pi * frequency
    below = (omega**-2, 2 * damping / omega, 1.0)
    return hmpim.Model(delay=delay, scale_factor=2.6, bias=bias, denominator=below)


@pytest.mark.parametrize("seed", [8, 18])
def test_a_delay_a_period_off_is_left_behind_where_the_output_still_rings(seed):
    """Three quarters of a sweep, all of it above the resonance, where the phase hardly turns."""
    t = np.arange(400) / 1000.0
    u = 3.0 * np.sin(2 * np.pi * (2.5 * t + 273 * t**2))
    pair = hmpim.identify(cut(u, second_order(41.7, 0.22, 0.0225, -0.4), 300, 0.04, seed))["y", "u"]
    assert pair.structure == "second_order"
    assert pair.delay.value == pytest.approx(0.0225, abs=1e-4)


def test_sines_that_go_on_are_no_response_from_rest():
    seed = 3
    u = four_sines(np.random.default_rng(seed))
    pair = hmpim.identify(cut(u, second_order(5.6, 0.63, 0.001, 2.1), 400, 0.03, seed))["y", "u"]
    assert pair.structure == "second_order"
    assert pair.bias.value == pytest.approx(2.1, abs=0.01)


def test_measured_input_that_explains_its_output_exactly_is_all_that_counts():
    """Its residual is 0, and no division by its power may follow."""
    u = np.random.default_rng(0).choice([-1.0, 1.0], 300)
    y = np.concatenate([[0.0, 0.0], 2.0 * u[:-2]])
    lost = np.zeros(300, dtype=bool)
    lost[100:160] = True
    record = hmpim.Record.from_arrays(
        {"u": np.ma.masked_array(u, lost)}, {"y": y}, fs=FS, intersample="zoh"
    )
    assert hmpim.identify(record)["y", "u"].fit_percent == pytest.approx(100.0)


def test_a_longer_delay_leaves_samples_for_the_fit():
    """None were left, and the criterion divided by their number."""
    u = np.random.default_rng(0).standard_normal(400)
    problem = Problem(source=prepare_input(u, "foh"), y=u, valid=None, longest_delay=300.0)
    fit = fit_structure(problem, STRUCTURES["static"], np.array([34.4]), iterations=0)
    early = np.arange(400) < 35  # then the output is stuck
    assert begin_later(Counted(valid=early, begins=4), fit) is None
    assert begin_later(Counted(valid=None, begins=4), fit).begins > 34
