"""A gain that changes along the record, and dynamics that only look like it."""

from functools import cache

import numpy as np
import pytest
import scipy

import hmpim
from hmpim.identify.effects.gain import scored
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.model import STRUCTURES
from hmpim.model.sampled import prepare_input
from tests_support import answer_of, assert_share, holds, in_studies

FS = 200.0
T = np.arange(2000) / FS
SWEEP = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0), fs=FS)
TRUTH = {"delay": 0.05, "scale_factor": 1.0, "natural_frequency": 10.0, "damping_ratio": 0.4}
STEADY = 1.0 + 0.1 * (T / 10.0 - 0.5)


def warming(rate):
    """Ten per cent more gain at the end, by an exponential of so many time constants."""
    course = 1.0 - np.exp(-rate * T / 10.0)
    return 1.0 + 0.1 * (course - course.mean()) / np.ptp(course)


def record_of(change, seed, noise=0.01):
    """Second order under a sweep; its gain is 1 on average."""
    sensor = hmpim.Sensor(delay=0.05, natural_frequency=10.0, damping_ratio=0.4)
    clean = hmpim.run(sensor, SWEEP, rng=seed)
    y = change * clean.outputs[0].values + 0.3
    y += noise * np.random.default_rng(seed).standard_normal(y.size)
    return hmpim.Record.from_arrays(
        {"u": clean.inputs[0].values}, {"y": y}, fs=FS, intersample="bandlimited"
    )


@cache
def found(seed):
    """A result is never changed: several tests look at it. For the first, all are tried."""
    plain = ["second_order", "third_order"] if seed else None
    return hmpim.identify(record_of(STEADY, seed), structures=plain)["y", "u"]


def of_gain(pair):
    return [w for w in pair.warnings if w.code == "gain_change"]


@pytest.fixture(scope="module")
def fitted():
    """A first-order fit beside a gain that rises by 4 %, and its data."""
    rng = np.random.default_rng(5)
    t = np.arange(800) / 800
    u = np.sin(2 * np.pi * (3 * t + 40 * t**2))
    x = scipy.signal.lfilter([0.0, 0.3], [1.0, -0.7], u)
    y = (1.0 + 0.04 * (t - 0.5)) * x + 0.2 + 0.02 * rng.standard_normal(800)
    source = prepare_input(u, "zoh")
    problem = Problem(source=source, y=y, valid=None, longest_delay=20.0)
    structure = STRUCTURES["first_order"]
    return problem, fit_structure(problem, structure, np.array([0.6, 1.0]), precision=1e-9)


def test_the_score_is_the_derivative_of_the_likelihood(fitted):
    """Of the profile likelihood: all other parameters follow the change."""
    problem, fit = fitted
    one = scored(problem, fit, problem.counted)[0]

    def left(change):
        moved = Problem(
            source=problem.source,
            y=problem.y - change * one.rows[0],
            valid=None,
            longest_delay=20.0,
        )
        return fit_structure(moved, fit.structure, fit.theta, precision=1e-9).objective

    step = 0.1 * one.std
    slope = (left(step) - left(-step)) / (2 * step)
    variance = left(0.0) * np.exp(-2 * one.gain / problem.counted) / problem.counted
    information = variance / one.std**2
    assert slope == pytest.approx(-2 * one.change * information, rel=1e-3)
    gain = 0.5 * problem.counted * np.log(left(0.0) / left(one.change))
    assert gain == pytest.approx(one.gain, rel=0.03)


def test_the_score_finds_the_change_with_its_error(fitted):
    problem, fit = fitted
    one = scored(problem, fit, problem.counted)[0]
    assert abs(one.change - 0.04) < 4 * one.std < 0.04


@pytest.mark.few(6)
def test_a_change_is_found_and_the_figures_are_those_of_the_mean_gain(seeds):
    pairs = [found(seed) for seed in range(seeds)]
    assert all(len(of_gain(pair)) == 1 for pair in pairs)
    assert all(pair.structure == "second_order" for pair in pairs)
    assert_share(
        [[holds(getattr(p.parameters, name), true) for name, true in TRUTH.items()] for p in pairs],
        at_least=0.92,
    )
    assert_share([holds(p.parameters.noise_std, 0.01) for p in pairs], at_least=0.92)


def test_the_finding_says_how_much_and_the_prediction_includes_it():
    pair = found(0)
    (said,) = of_gain(pair)
    assert said.severity == "info"
    assert "The gain rises by (" in said.message
    size, error = said.message.split("(")[1].split(")")[0].split(" ± ")
    assert abs(float(size) - 10.0) < 4 * float(error) < 2.0
    y = record_of(STEADY, 0).outputs[0].values
    assert np.std(y - pair.prediction) == pytest.approx(0.01, rel=0.1)


@pytest.mark.parametrize("rate", [5.0, *in_studies(2.0, 12.0)])
def test_a_gain_that_settles_is_found_as_well(rate):
    pair = hmpim.identify(record_of(warming(rate), 3))["y", "u"]
    assert len(of_gain(pair)) == 1
    sure = [n for n in TRUTH if getattr(pair.parameters, n).verdict == "ok"]
    off = [n for n in sure if abs(getattr(pair.parameters, n).value / TRUTH[n] - 1.0) > 0.02]
    assert not off


def test_under_a_binary_sequence_no_noise_is_made_of_it():
    rng = np.random.default_rng(2)
    u = np.repeat(rng.choice([-1.0, 1.0], 500), 4)
    u[:40] = 0.0
    y = STEADY * scipy.signal.lfilter([0.0, 0.2], [1.0, -0.8], u)
    y += 0.01 * rng.standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="zoh")
    pair = hmpim.identify(record)["y", "u"]
    assert len(of_gain(pair)) == 1
    assert holds(pair.parameters.noise_std, 0.01)


def test_a_constant_gain_is_not_said_to_change(seeds):
    pairs = [hmpim.identify(record_of(np.ones(T.size), k))["y", "u"] for k in range(seeds)]
    assert not [of_gain(pair) for pair in pairs if of_gain(pair)]


@pytest.mark.few(2)
@pytest.mark.parametrize(
    ("zeros", "poles"), [([0.03, 1.0], [0.002, 0.06, 1.0]), ([0.08, 1.0], [0.03, 1.0])]
)
def test_dynamics_with_a_zero_are_no_change_of_the_gain(seeds, zeros, poles):
    fine = np.arange(16 * 2000) / (16 * FS)
    u = SWEEP.waveform.motion(fine).position
    x = answer_of(zeros, poles, u, fine)[::16]
    for seed in range(seeds):
        y = x + 0.005 * np.random.default_rng(seed).standard_normal(x.size)
        record = hmpim.Record.from_arrays(
            {"u": u[::16]}, {"y": y}, fs=FS, intersample="bandlimited"
        )
        assert not of_gain(hmpim.identify(record)["y", "u"])


def test_a_limit_of_speed_is_no_change_of_the_gain():
    """Beyond it a sweep's amplitude falls with time, as if the gain did."""
    fine = np.arange(8 * 2000) / (8 * FS)
    u = SWEEP.waveform.motion(fine).position
    steps = np.empty(u.size)
    now, most = u[0], 40.0 / (8 * FS)
    for k, wanted in enumerate(u.tolist()):
        now += min(max(wanted - now, -most), most)
        steps[k] = now
    y = steps[::8] + 0.01 * np.random.default_rng(0).standard_normal(2000)
    record = hmpim.Record.from_arrays({"u": u[::8]}, {"y": y}, fs=FS, intersample="bandlimited")
    assert not of_gain(hmpim.identify(record, structures=["static", "third_order"])["y", "u"])


def test_the_prediction_has_the_change_and_none_of_the_noise():
    record = record_of(STEADY, 3)
    pair = hmpim.identify(record)["y", "u"]
    assert of_gain(pair)
    y = record.outputs[0].values
    assert np.allclose(pair.prediction + pair.residual, y, rtol=0, atol=1e-9)
    sensor = hmpim.Sensor(delay=0.05, natural_frequency=10.0, damping_ratio=0.4)
    clean = STEADY * hmpim.run(sensor, SWEEP, rng=3).outputs[0].values + 0.3
    assert np.std(pair.prediction - clean) < 0.2 * np.std(y - clean)
