"""Clipped and held outputs: unbiased, and as sure as they say."""

import numpy as np
import pytest

from hmpim.errors import RecordError
from hmpim.identify.effects import censored
from hmpim.identify.effects.censored import fit_censored
from hmpim.identify.effects.held import rows_at_updates
from hmpim.identify.effects.hold import Updates, detect_hold, updates
from hmpim.identify.effects.saturation import Saturation, detect_saturation
from hmpim.identify.effects.smeared import Side
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.threads import one_thread
from hmpim.model import STRUCTURES, prepare_input
from hmpim.rigs import Sensor
from tests_support import assert_share, rms_between, room

FS = 200.0
T = np.arange(2000) / FS
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))
SYSTEM = {"delay": 0.15, "natural_frequency": 10.0, "damping_ratio": 0.4, "bias": 0.1}
STRUCTURE = STRUCTURES["second_order"]


@pytest.fixture(scope="module")
def source():
    return prepare_input(CHIRP, "bandlimited")


@pytest.fixture(scope="module")
def clean() -> np.ndarray:
    return Sensor(**SYSTEM).respond(CHIRP, fs=FS)


@pytest.fixture(scope="module")
def truth(source, clean) -> Fit:
    problem = Problem(source=source, y=clean, valid=None, longest_delay=1000.0)
    start = np.concatenate([[30.0], [np.log(0.8 / (2 * np.pi * 10) * FS), 1 / (4 * 0.16)]])
    return fit_structure(problem, STRUCTURE, start, precision=1e-9)


def vector(fit: Fit) -> np.ndarray:
    return np.concatenate([fit.theta, fit.linear])


def level(clean: np.ndarray) -> float:
    """Half of the range beyond which a third of the samples lie."""
    return float(np.quantile(np.abs(clean - 0.1), 2 / 3))


def study(source, truth, make, count, *, clip=True):
    """Errors and standard deviations over `count` seeds, shape (count, 5), and the noise's."""
    errors, stds, noise = [], [], []
    with one_thread():
        for seed in range(count):
            y, arrivals = make(seed)
            problem = Problem(source=source, y=y, valid=None, longest_delay=1000.0)
            plain = fit_structure(problem, STRUCTURE, truth.theta)
            clipped = detect_saturation(y, plain.prediction) if clip else None
            if clipped is not None:
                assert clipped.low is not None
                assert clipped.high is not None
                assert 0.25 < clipped.share < 0.42
            found = fit_censored(problem, plain, clipped, arrivals=arrivals)
            assert found.fit.converged
            errors.append(vector(found.fit) - vector(truth))
            stds.append(np.sqrt(np.diag(found.covariance)))
            noise.append((found.noise_std, found.noise_std_std))
    return np.array(errors), np.array(stds), np.array(noise)


def check(errors, stds):
    """Mean error below 0.2 standard deviations; 92 to 98 % inside, of all and of each."""
    z = errors / stds
    assert np.all(np.abs(z.mean(axis=0)) < 0.2 + room(len(z)))
    assert_share(np.abs(z) < 1.96, at_least=0.92, at_most=0.98)
    for inside in (np.abs(z) < 1.96).T:
        assert_share(inside, at_least=0.92, at_most=0.98)


def check_noise(noise):
    """Within 1 %, with room for chance."""
    chance = room(len(noise), np.mean(noise[:, 1]))
    assert noise[:, 0].mean() == pytest.approx(0.1, abs=0.001 + chance)


def test_a_third_clipped_with_the_noise(source, clean, truth, seeds):
    half = level(clean)

    def make(seed):
        sensor = Sensor(
            **SYSTEM, noise_std=0.1, saturation_low=0.1 - half, saturation_high=0.1 + half
        )
        return sensor.respond(CHIRP, fs=FS, rng=seed), None

    errors, stds, noise = study(source, truth, make, seeds)
    check(errors, stds)
    check_noise(noise)
    low, high = rms_between(seeds - 1)
    assert 0.95 * low < noise[:, 0].std(ddof=1) / noise[:, 1].mean() < 1.05 * high


@pytest.mark.few(10)
def test_a_third_clipped_before_the_noise(source, clean, truth, seeds):
    half = level(clean)

    def make(seed):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(clean.size)
        return np.clip(clean, 0.1 - half, 0.1 + half) + noise, None

    errors, stds, noise = study(source, truth, make, seeds)
    check(errors, stds)
    check_noise(noise)


@pytest.mark.few(6)
def test_held_at_a_slower_clock(source, truth, seeds):
    def make(seed):
        sensor = Sensor(**SYSTEM, noise_std=0.1, hold_period=1 / 29.3, hold_phase=0.0013)
        y = sensor.respond(CHIRP, fs=FS, rng=seed)
        return y, updates(detect_hold(y, FS), y.size, FS)

    errors, stds, noise = study(source, truth, make, seeds, clip=False)
    check(errors, stds)
    check_noise(noise)


def test_plain_least_squares_is_far_off_on_the_same_data(source, clean, truth):
    half = level(clean)
    sensor = Sensor(**SYSTEM, noise_std=0.1, saturation_low=0.1 - half, saturation_high=0.1 + half)
    y = sensor.respond(CHIRP, fs=FS, rng=0)
    problem = Problem(source=source, y=y, valid=None, longest_delay=1000.0)
    plain = fit_structure(problem, STRUCTURE, truth.theta)
    better = fit_censored(problem, plain, detect_saturation(y, plain.prediction))
    scale, std = better.fit.linear[0], float(np.sqrt(better.covariance[-2, -2]))
    assert abs(scale - 1.0) < 4 * std
    assert plain.linear[0] < 1.0 - 10 * std
    # Leaving the clipped samples out is no cure: those left are chosen by their noise.
    left = Problem(source=source, y=y, valid=np.abs(y - 0.1) < half, longest_delay=1000.0)
    assert fit_structure(left, STRUCTURE, truth.theta).linear[0] < 1.0 - 4 * std


def test_without_noise_the_truth_is_found(source, clean, truth):
    for saturation in (
        detect_saturation(np.clip(clean, -0.6, 0.7), clean),
        detect_saturation(np.maximum(clean, -0.6), clean),
    ):
        low = -np.inf if saturation.low is None else saturation.low.level
        high = np.inf if saturation.high is None else saturation.high.level
        y = np.clip(clean, low, high)
        problem = Problem(source=source, y=y, valid=None, longest_delay=1000.0)
        plain = fit_structure(problem, STRUCTURE, truth.theta)
        found = fit_censored(problem, plain, saturation)
        np.testing.assert_allclose(vector(found.fit), vector(truth), atol=2e-4)


def test_with_nothing_clipped_it_is_least_squares(source, clean, truth):
    y = clean + 0.1 * np.random.default_rng(1).standard_normal(clean.size)
    valid = np.arange(clean.size) > 100
    problem = Problem(source=source, y=y, valid=valid, longest_delay=1000.0)
    plain = fit_structure(problem, STRUCTURE, truth.theta, precision=1e-8)
    found = fit_censored(problem, plain, None)
    np.testing.assert_allclose(vector(found.fit), vector(plain), atol=1e-4)
    freedom = np.count_nonzero(valid) - 5
    assert found.noise_std == pytest.approx(np.sqrt(plain.cost / freedom), rel=1e-6)
    rows = jacobian(problem, plain)
    bound = found.noise_std**2 * np.linalg.inv(rows @ rows.T)
    std = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(std, np.sqrt(np.diag(bound)), rtol=5e-3)
    white = -0.5 * np.count_nonzero(valid) * (np.log(2 * np.pi * plain.cost / (freedom + 5)) + 1)
    assert found.log_likelihood == pytest.approx(white, abs=1e-3)


def test_coloured_noise_is_not_underrated(source, clean, truth, seeds):
    half = level(clean)

    def make(seed):
        sensor = Sensor(
            **SYSTEM,
            noise_std=0.1,
            noise_colour=0.9,
            saturation_low=0.1 - half,
            saturation_high=0.1 + half,
        )
        return sensor.respond(CHIRP, fs=FS, rng=seed), None

    errors, stds, _ = study(source, truth, make, seeds)
    inside = np.abs(errors) < 1.96 * stds
    assert_share(inside, at_least=0.92)
    for each in inside.T:
        assert_share(each, at_least=0.92)
    low, _ = rms_between(seeds - 1)
    assert np.all(errors.std(axis=0, ddof=1) > 0.8 * low * stds.mean(axis=0))


def test_a_whole_period_leaves_the_instant_open(source, truth):
    sensor = Sensor(**SYSTEM, noise_std=0.02, hold_period=4 / FS, hold_phase=0.0013)
    y = sensor.respond(CHIRP, fs=FS, rng=2)
    problem = Problem(source=source, y=y, valid=None, longest_delay=1000.0)
    plain = fit_structure(problem, STRUCTURE, truth.theta)
    found = fit_censored(problem, plain, None, arrivals=updates(detect_hold(y, FS), y.size, FS))
    assert np.sqrt(found.covariance[0, 0]) == pytest.approx(1 / np.sqrt(12), rel=0.05)
    assert abs(found.fit.delay - 30.0) < 0.55
    # Values are 0.74 samples old when they show and 3.74 when they go.
    assert plain.delay == pytest.approx(30.0 + 2.24, abs=0.25)
    assert set(np.flatnonzero(np.diff(found.fit.prediction))) <= set(np.flatnonzero(np.diff(y)))


@pytest.mark.parametrize("intersample", ["bandlimited", "zoh"])
def test_rows_between_samples_agree_with_another_delay(intersample):
    u = np.repeat(np.random.default_rng(0).standard_normal(60), 5)
    u = np.convolve(u, np.hanning(9), mode="same") if intersample == "bandlimited" else u
    held = prepare_input(u, intersample)
    problem = Problem(source=held, y=np.zeros(300), valid=None, longest_delay=50.0)
    start = np.array([3.3, np.log(2.0), 0.8])
    fit = fit_structure(problem, STRUCTURE, start, iterations=0)
    age = (np.arange(300) * 0.6180339) % 1.0
    rows = rows_at_updates(problem, fit, Updates(index=np.arange(300), age=age))
    scale = np.abs(rows).max(axis=1)
    for k in range(20, 300, 23):
        theta = start + np.array([age[k], 0.0, 0.0])
        moved = jacobian(problem, fit_structure(problem, STRUCTURE, theta, iterations=0))
        basis = slice(theta.size, None)
        error = np.abs(rows[basis, k] - moved[basis, k]) / scale[basis]
        assert error.max() < (1e-4 if intersample == "bandlimited" else 2e-3)


def test_a_record_that_is_all_clipped_is_refused(source, clean):
    problem = Problem(source=source, y=np.full(clean.size, 0.5), valid=None, longest_delay=9.0)
    fit = fit_structure(problem, STRUCTURES["static"], np.zeros(1))
    every = np.ones(clean.size, dtype=bool)
    top = Side(level=0.5, std=0.0, at=every, exact=True)
    full = Saturation(low=None, high=top, tolerance=0.0)
    with pytest.raises(RecordError, match="0 of 2000 samples are inside the range"):
        fit_censored(problem, fit, full)


def test_a_noise_taken_far_too_loud_leads_to_no_endless_step(source, clean, truth):
    """Under such a noise samples just inside the level bend the likelihood upwards."""
    levels = detect_saturation(np.clip(clean, None, 0.5), clean)
    problem = Problem(source=source, y=np.clip(clean, None, 0.5), valid=None, longest_delay=1000.0)
    data = censored._data(problem, levels, None, None)
    loud = next(
        state
        for log_sigma in np.arange(0.0, 8.0, 0.25)
        if (state := censored._evaluated(data, truth, log_sigma)).information[-1, -1] < 0.0
    )
    step = censored._step(loud, 1e-4)
    assert step[-1] < 0.0  # less noise is likelier
    assert np.all(np.abs(step) < 1e3)


def test_an_input_far_from_zero_costs_no_error_bar(clean):
    """The bias is that at zero input, and far away; the rest is known as well as before."""
    y = clean + 0.05 * np.random.default_rng(2).standard_normal(clean.size)
    start = np.array([30.0, np.log(0.8 / (2 * np.pi * 10) * FS), 1 / (4 * 0.16)])

    def stds(offset):
        raised = np.minimum(y, 0.6) + offset
        problem = Problem(
            source=prepare_input(CHIRP + offset, "bandlimited"),
            y=raised,
            valid=None,
            longest_delay=1000.0,
        )
        plain = fit_structure(problem, STRUCTURE, start)
        found = fit_censored(problem, plain, detect_saturation(raised, plain.prediction))
        return np.sqrt(np.diag(found.covariance))

    near, far = stds(0.0), stds(1e7)
    assert far[:-1] == pytest.approx(near[:-1], rel=0.01)
    assert far[-1] == pytest.approx(1e7 * far[-2], rel=0.01)
