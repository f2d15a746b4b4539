"""The phase of a sweep, and harmonics that follow it: exact where known, never by chance."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim import Limits, design
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.nonlinear.harmonics import sweep_harmonics
from hmpim.identify.nonlinear.sweep_phase import sweep_phase
from hmpim.identify.threads import one_thread
from hmpim.model import STRUCTURES, prepare_input
from hmpim.rigs import Sensor
from tests_support import assert_share, examples

FS = 200.0
T = np.arange(2000) / FS
ANGLE = 2 * np.pi * (0.1 * T + 19.9 / 20 * T * T)
CHIRP = np.sin(ANGLE)


def harmonics(residual, **known):
    return sweep_harmonics(residual, sweep_phase(CHIRP, FS), FS, **known)


@examples(20)
@given(
    first=st.floats(0.1, 2.0),
    last=st.floats(8.0, 75.0),
    exponential=st.booleans(),
    backward=st.booleans(),
    extinction=st.floats(0.0, 1.0),
)
def test_the_frequency_of_any_sweep(first, last, exponential, backward, extinction):
    if exponential:
        rate = np.log(last / first) / 10
        angle = 2 * np.pi * first / rate * (np.exp(rate * T) - 1)
        frequency = first * np.exp(rate * T)
    else:
        angle = 2 * np.pi * (first * T + (last - first) / 20 * T * T)
        frequency = first + (last - first) / 10 * T
    u = np.sin(angle) / (1 + T) ** extinction
    if backward:
        u, frequency = u[::-1], frequency[::-1]
    found = sweep_phase(u, FS)
    assert found is not None
    assert found.inside.mean() > 0.5
    error = (found.frequency - frequency)[found.inside][20:-20]
    assert np.sqrt(np.mean(error**2)) < 0.02 * last


def test_the_phase_of_a_clean_sweep_is_right_to_milliradians():
    found = sweep_phase(CHIRP, FS)
    error = (found.phase - ANGLE + np.pi / 2)[found.inside]
    turn = 2 * np.pi * np.rint(np.median(error) / (2 * np.pi))
    assert np.sqrt(np.mean((error - turn)[200:] ** 2)) < 2e-3


def test_a_designed_stimulus_with_leads_is_a_sweep():
    limits = Limits(position=10, velocity=66, acceleration=8060, unit="deg")
    stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    found = sweep_phase(stimulus.position, 200.0)
    assert found.inside.mean() > 0.8
    assert found.frequency[found.inside].max() == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("step", [0.0, 1 / 128, 1 / 32])
@pytest.mark.parametrize("rest", [0, 1, 333])
def test_a_sweep_between_rests_is_a_sweep(rest, step):
    """At rest zero is touched at every sample and crossed at none; a scope's steps touch it too."""
    inside = CHIRP * np.sin(np.pi * np.arange(CHIRP.size) / CHIRP.size)
    u = np.concatenate([np.zeros(rest), inside, np.zeros(rest)])
    u = step * np.rint(u / step) if step else u
    found = sweep_phase(u, FS)
    assert found is not None
    during = slice(rest, rest + CHIRP.size)
    assert np.mean(found.inside[during]) > 0.8
    truth = 0.1 + 1.99 * T
    off = np.abs(found.frequency[during] / truth - 1.0)[found.inside[during]]
    assert np.median(off) < (1e-2 if step else 1e-3)


@pytest.mark.parametrize(
    "kind", ["square", "triangle", "binary", "noise", "multisine", "constant", "staircase"]
)
def test_what_is_no_sweep(kind):
    rng = np.random.default_rng(0)
    tones = np.arange(1, 15)[:, None]
    u = {
        "square": np.sign(CHIRP),
        "triangle": np.arcsin(CHIRP),
        "binary": rng.choice([-1.0, 1.0], 200).repeat(10),
        "noise": rng.standard_normal(2000),
        "multisine": np.cos(2 * np.pi * tones * T + rng.uniform(0, 6, (14, 1))).sum(axis=0),
        "constant": np.ones(2000),
        "staircase": np.repeat([0.0, 1.0, 2.0], [51, 182, 67]),  # stands at its centre
    }[kind]
    assert sweep_phase(u, FS) is None


@pytest.mark.parametrize(
    ("order", "shape", "rms"),
    [
        (2, lambda x: 0.1 * x**2, 0.05 / np.sqrt(2)),  # x² = 1/2 - cos 2φ / 2
        (3, lambda x: 0.1 * x**3, 0.025 / np.sqrt(2)),  # x³ = 3/4 sin φ - sin 3φ / 4
        (4, lambda x: 0.1 * (x**4 - x**2), 0.0125 / np.sqrt(2)),
        (5, lambda x: 0.1 * (x**5 - 1.25 * x**3), 0.00625 / np.sqrt(2)),
    ],
)
def test_each_power_makes_the_harmonic_of_trigonometry(order, shape, rms):
    noise = 1e-4 * np.random.default_rng(0).standard_normal(2000)
    found = harmonics(shape(CHIRP) + noise)
    by_order = {h.curve.order: h for h in found.orders}
    sweep = sweep_phase(CHIRP, FS)
    seen = np.mean(order * sweep.frequency[sweep.inside] < 0.9 * FS / 2)  # then it would fold
    assert by_order[order].rms == pytest.approx(rms * np.sqrt(seen), rel=0.02)
    assert by_order[order].probability < 1e-10
    for other in by_order.values():
        if other.curve.order != order:
            assert other.rms < 0.02 * rms


def test_what_comes_late_is_followed_by_the_delay():
    late = np.sin(2 * np.pi * (0.1 * (T - 0.15) + 19.9 / 20 * (T - 0.15) ** 2))
    late[T < 0.15] = 0.0
    noise = 1e-3 * np.random.default_rng(0).standard_normal(2000)
    right = harmonics(0.1 * late**2 + noise, delay=0.15)
    wrong = harmonics(0.1 * late**2 + noise)
    assert right.rms(0) == pytest.approx(0.05 / np.sqrt(2), rel=0.05)
    assert wrong.rms(0) < 0.7 * right.rms(0)


def test_the_three_parts_add_up():
    noise = 0.02 * np.random.default_rng(0).standard_normal(2000)
    found = harmonics(0.03 * CHIRP + 0.1 * CHIRP**2 + noise)
    assert found.fundamental_rms == pytest.approx(0.03 / np.sqrt(2), rel=0.1)
    assert found.noise_rms == pytest.approx(0.02, rel=0.05)
    assert found.rms(0) == pytest.approx(0.05 / np.sqrt(2), rel=0.05)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_alone_gives_the_chances_it_should(seeds, colour):
    source = prepare_input(CHIRP, "bandlimited")
    start = np.array([6.0, np.log(0.8 / (2 * np.pi * 10) * FS), 1 / (4 * 0.16)])
    chances = []
    with one_thread():
        for seed in range(seeds):
            sensor = Sensor(
                delay=0.03,
                natural_frequency=10,
                damping_ratio=0.4,
                noise_std=0.1,
                noise_colour=colour,
            )
            y = sensor.respond(CHIRP, fs=FS, rng=seed)
            problem = Problem(source=source, y=y, valid=None, longest_delay=100.0)
            fit = fit_structure(problem, STRUCTURES["second_order"], start)
            found = harmonics(fit.residual, delay=fit.delay / FS)
            chances.append([h.probability for h in found.orders])
    chances = np.array(chances)
    assert_share(chances < 0.05, at_most=0.07)
    assert_share(chances < 1e-3, at_most=0.003)
    assert chances.min() > 1e-5


def test_a_linear_misfit_makes_no_harmonic():
    y = Sensor(natural_frequency=10, damping_ratio=0.4, noise_std=0.002).respond(
        CHIRP, fs=FS, rng=0
    )
    problem = Problem(
        source=prepare_input(CHIRP, "bandlimited"), y=y, valid=None, longest_delay=100.0
    )
    fit = fit_structure(problem, STRUCTURES["first_order"], np.array([1.0, 1.0]))
    assert np.std(fit.residual) > 0.1  # badly wrong
    found = harmonics(fit.residual, delay=fit.delay / FS)
    assert min(h.probability for h in found.orders) > 1e-4
    assert found.fundamental_rms > 10 * found.rms(0)
