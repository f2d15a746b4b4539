"""The joint fit: at the Cramér-Rao bound, right from its own starts, and honest about error."""

import numpy as np
import pytest

from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.start import rough_response, starting_values
from hmpim.identify.reading.readings import read_parameters
from hmpim.model import (
    STRUCTURES,
    Model,
    coefficients_of,
    denominator_of,
    prepare_input,
    second_order_coefficients,
    simulate,
    theta_of,
)
from tests_support import assert_share, holds, in_studies, rms_between, room

FS = 200.0
TRUTH = {
    "delay": 0.15,
    "scale_factor": 1.0,
    "bias": 0.6,
    "natural_frequency": 10.0,
    "damping_ratio": 0.4,
    "bandwidth_phase90": 1.534015,
}


def true_theta() -> np.ndarray:
    return np.concatenate(
        [
            [0.15 * FS],
            theta_of(
                STRUCTURES["second_order"], second_order_coefficients(10.0, 0.4) * [FS, FS**2]
            ),
        ]
    )


def problem(u, y, mode="bandlimited") -> Problem:
    return Problem(source=prepare_input(u, mode), y=y, valid=None, longest_delay=800.0)


def read(joint, highest=20.0):
    return read_parameters(
        joint, fs=FS, highest=highest, delay_correlation=None, units=("", "")
    ).parameters


def test_starting_values_are_near_the_truth(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(3).standard_normal(y.size)
    start = starting_values(
        rough_response(u, noisy, longest_delay=1000), STRUCTURES["second_order"]
    )[0]
    assert start[0] == pytest.approx(30.0, abs=2.0)
    np.testing.assert_allclose(start[1:], true_theta()[1:], atol=0.4)


def test_a_fit_without_noise_finds_the_truth(field_record):
    _, u, y = field_record
    fit = joint_fit(u, y).best.fit
    assert fit.structure.name == "second_order"
    np.testing.assert_allclose(fit.theta, true_theta(), atol=5e-5)
    np.testing.assert_allclose(fit.linear, [1.0, 0.6], atol=2e-5)


def test_jacobian_agrees_with_central_differences(field_record):
    """Against differences of the simulated output, with another step and another route."""
    _, u, y = field_record
    fit = fit_structure(problem(u, y), STRUCTURES["second_order"], true_theta())
    rows = jacobian(problem(u, y), fit)

    def output(vector):
        denominator = denominator_of(fit.structure, coefficients_of(fit.structure, vector[1:3]))
        model = Model(
            delay=vector[0] / FS,
            scale_factor=vector[3],
            denominator=tuple((denominator / FS ** np.arange(3))[::-1]),
            bias=vector[4],
        )
        return simulate(model, u, fs=FS, intersample="bandlimited")

    vector = np.concatenate([fit.theta, fit.linear])
    for i in range(5):
        step = np.zeros(5)
        step[i] = 1e-4
        expected = (output(vector + step) - output(vector - step)) / 2e-4
        np.testing.assert_allclose(rows[i], expected, atol=2e-5 * np.max(np.abs(expected)))


def cramer_rao(u, y) -> dict[str, float]:
    """Bound on each standard deviation for noise 0.1, from the true system's derivatives."""
    fit = fit_structure(problem(u, y), STRUCTURES["second_order"], true_theta())
    rows = jacobian(problem(u, y), fit)
    cov = 0.01 * np.linalg.inv(rows @ rows.T)
    # θ1 = ln(2ζ/ω), θ2 = 1/(4ζ²)
    frequency_slope = np.array([0, -10.0, -10.0 * 2 * 0.4**2, 0, 0])
    damping_slope = np.array([0, 0, -2 * 0.4**3, 0, 0])
    return {
        "delay": np.sqrt(cov[0, 0]) / FS,
        "scale_factor": np.sqrt(cov[3, 3]),
        "bias": np.sqrt(cov[4, 4]),
        "natural_frequency": np.sqrt(frequency_slope @ cov @ frequency_slope),
        "damping_ratio": np.sqrt(damping_slope @ cov @ damping_slope),
    }


def test_the_bound_is_the_published_one(field_record):
    """docs/field.md's bounds: τ 0.106 ms, fn 0.032 Hz, ζ 0.0029, gain 0.0046, bias 0.0022."""
    _, u, y = field_record
    bound = cramer_rao(u, y)
    assert bound["delay"] == pytest.approx(0.106e-3, rel=0.02)
    assert bound["natural_frequency"] == pytest.approx(0.032, rel=0.02)
    assert bound["damping_ratio"] == pytest.approx(0.0029, rel=0.02)
    assert bound["scale_factor"] == pytest.approx(0.0046, rel=0.03)
    assert bound["bias"] == pytest.approx(0.0022, rel=0.03)


@pytest.mark.few(10)
def test_at_the_bound_with_honest_intervals(field_record, seeds):
    _, u, y = field_record
    bound = cramer_rao(u, y)
    errors: dict[str, list[float]] = {name: [] for name in TRUTH}
    inside = []
    noise = []
    count = 3 * seeds
    for seed in range(count):
        noisy = y + 0.1 * np.random.default_rng(seed).standard_normal(y.size)
        p = read(joint_fit(u, noisy))
        for name, truth in TRUTH.items():
            errors[name].append(getattr(p, name).value - truth)
        inside.append([holds(getattr(p, name), truth) for name, truth in TRUTH.items()])
        noise.append(p.noise_std.value)
    _, high = rms_between(count)
    for name, smallest in bound.items():
        assert np.sqrt(np.mean(np.square(errors[name]))) < 1.02 * high * smallest, name
    assert_share(inside, at_least=0.94, at_most=0.96)
    # Its own bound is σ/√(2n) = 1.6 % on one record; the mean over the seeds has no bias.
    allowed = 2e-4 + room(count, 0.1 / np.sqrt(2 * y.size))
    assert np.mean(noise) == pytest.approx(0.1, abs=allowed)
    assert np.max(np.abs(errors["bandwidth_phase90"])) < 0.01


@pytest.mark.parametrize("mode", ["zoh", "foh", "bandlimited"])
def test_a_rough_input_tells_what_lies_between_its_samples(mode):
    rng = np.random.default_rng(11)
    u = rng.uniform(-1, 1, 1200)
    model = Model(delay=0.0317, scale_factor=1.5, denominator=(0.02, 1.0), bias=0.1)
    y = simulate(model, u, fs=FS, intersample=mode) + 0.005 * rng.standard_normal(u.size)
    joint = joint_fit(u, y)
    assert joint.best.intersample == mode
    p = read(joint, highest=100.0)
    assert p.delay.value == pytest.approx(0.0317, abs=5 * p.delay.std)


@pytest.mark.parametrize("structure", ["static", "first_order", "second_order"])
def test_the_structure_is_chosen_by_the_data(structure, field_record):
    _, u, _ = field_record
    denominator = {
        "static": (1.0,),
        "first_order": (0.03, 1.0),
        "second_order": (1 / (2 * np.pi * 8) ** 2, 1.4 / (2 * np.pi * 8), 1.0),
    }[structure]
    model = Model(delay=0.0731, scale_factor=-0.7, denominator=denominator, bias=-0.2)
    y = simulate(model, u, fs=FS, intersample="bandlimited")
    joint = joint_fit(u, y + 0.02 * np.random.default_rng(1).standard_normal(u.size))
    assert joint.best.fit.structure.name == structure
    p = read(joint)
    assert p.delay.value == pytest.approx(0.0731, abs=5 * p.delay.std)
    assert p.scale_factor.value == pytest.approx(-0.7, abs=5 * p.scale_factor.std)


def test_a_record_that_begins_in_mid_motion_forgets_what_it_cannot_know(field_record):
    _, u, y = field_record
    noisy = y + 0.01 * np.random.default_rng(1).standard_normal(y.size)
    joint = joint_fit(u[700:], noisy[700:])
    assert joint.forgotten > 0.15 * FS
    p = read(joint)
    assert p.delay.value == pytest.approx(0.15, abs=5 * p.delay.std)
    assert p.bias.value == pytest.approx(0.6, abs=5 * p.bias.std)


def test_samples_that_do_not_count_do_not_count(field_record):
    _, u, y = field_record
    noisy = y + 0.01 * np.random.default_rng(1).standard_normal(y.size)
    spoilt = noisy.copy()
    spoilt[900:1000] = 50.0
    valid = np.ones(y.size, dtype=bool)
    valid[900:1000] = False
    p = read(joint_fit(u, spoilt, valid=valid))
    assert p.delay.value == pytest.approx(0.15, abs=5 * p.delay.std)
    assert p.scale_factor.value == pytest.approx(1.0, abs=5 * p.scale_factor.std)


def test_noise_alone_is_unrelated(field_record):
    _, u, _ = field_record
    for seed in range(4):
        fit = joint_fit(u, np.random.default_rng(seed).standard_normal(u.size))
        assert fit.silent
        assert not fit.related


def test_scaling_the_output_scales_gain_bias_and_noise_only(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(2).standard_normal(y.size)
    one, other = read(joint_fit(u, noisy)), read(joint_fit(u, -250.0 * noisy))
    for name, factor in (("scale_factor", -250), ("bias", -250), ("noise_std", 250)):
        assert getattr(other, name).value == pytest.approx(
            factor * getattr(one, name).value, rel=1e-4
        )
    for name in ("delay", "natural_frequency", "damping_ratio", "bandwidth_3db"):
        assert getattr(other, name).value == pytest.approx(getattr(one, name).value, rel=1e-4)
        assert getattr(other, name).std == pytest.approx(getattr(one, name).std, rel=1e-3)


@pytest.mark.few(6)
@pytest.mark.parametrize("colour", [0.9, *in_studies(-0.6)])
def test_intervals_hold_under_coloured_noise(field_record, seeds, colour):
    from scipy.signal import lfilter

    _, u, y = field_record
    inside = []
    for seed in range(seeds):
        white = np.random.default_rng(seed).standard_normal(y.size + 200)
        noise = lfilter([0.05], [1, -colour], white)[200:]
        p = read(joint_fit(u, y + noise))
        inside.append([holds(getattr(p, name), truth) for name, truth in TRUTH.items()])
    assert_share(inside, at_least=0.92, at_most=0.98)


@pytest.mark.parametrize("seed", [2, *in_studies(*range(3, 12))])
def test_a_free_response_of_two_modes_is_no_coloured_noise(seed):
    """A record out of the midst of a random motion: its lines answered one by one."""
    rng = np.random.default_rng(seed)
    lines = np.fft.rfft(rng.standard_normal(4000))
    lines[np.fft.rfftfreq(4000) > 0.4] = 0.0
    s = 2j * np.pi * np.fft.rfftfreq(4000, 1.0 / FS)
    answer = np.exp(-0.02 * s) * sum(
        gain / (1.0 + 2 * damping * s / w + (s / w) ** 2)
        for gain, damping, w in ((1.0, 0.06, 2 * np.pi * 4.0), (0.5, 0.05, 2 * np.pi * 9.0))
    )
    u, y = (np.fft.irfft(x, 4000)[1000:2500] for x in (lines, lines * answer))
    noise = 0.03 * float(y.std())
    joint = joint_fit(u, y + noise * rng.standard_normal(y.size), intersample="bandlimited")
    assert joint.best.fit.structure.name == "two_modes"
    assert joint.forgotten > 0
    assert np.sqrt(joint.best.fit.cost / y.size) == pytest.approx(noise, rel=0.08)


@pytest.mark.parametrize("ahead", [0.05, 0.4])
def test_an_output_may_be_ahead_of_its_input(field_record, ahead):
    """The same answer, its stamps too early by more than delay and dynamics are late."""
    _, u, y = field_record
    moved = round((0.15 + ahead) * FS)
    noisy = y + 0.02 * np.random.default_rng(3).standard_normal(y.size)
    joint = joint_fit(u[:-moved], noisy[moved:], intersample="bandlimited")
    assert joint.best.fit.structure.name == "second_order"
    rest = joint_fit(u, noisy, intersample="bandlimited").best.fit
    assert joint.best.fit.delay == pytest.approx(rest.delay - moved, abs=0.05)
    assert joint.best.fit.denominator == pytest.approx(rest.denominator, rel=0.02)


def test_a_delay_beyond_half_of_a_record_in_motion():
    """What answers the input before the record does not count, be it most of the record."""
    rng = np.random.default_rng(4)
    lines = np.fft.rfft(rng.standard_normal(4000))
    lines[np.fft.rfftfreq(4000) > 0.1] = 0.0
    s = 2j * np.pi * np.fft.rfftfreq(4000, 1.0 / FS)
    answer = np.exp(-6.0 * s) / (1.0 + 0.8 * s / 60.0 + (s / 60.0) ** 2)
    u, y = (np.fft.irfft(x, 4000)[:2000] for x in (lines, lines * answer))
    noise = 0.02 * float(y.std())
    joint = joint_fit(u, y + noise * rng.standard_normal(y.size), intersample="bandlimited")
    assert joint.best.fit.structure.name == "second_order"
    assert joint.best.fit.delay == pytest.approx(6.0 * FS, abs=0.1)
    assert joint.forgotten > 6.0 * FS
