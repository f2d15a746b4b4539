"""Held outputs: period and phase bounded by every change, and none seen where there is none."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from hmpim.identify.effects.hold import detect_hold, updates
from hmpim.rigs import Sensor
from tests_support import examples, few_of

FS = 200.0
T = np.arange(2000) / FS
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T))


def held(period: float, phase: float = 0.0031, **kind) -> np.ndarray:
    sensor = Sensor(
        delay=0.0123,
        natural_frequency=10.0,
        damping_ratio=0.4,
        hold_period=period,
        hold_phase=phase,
        **kind,
    )
    return sensor.respond(CHIRP, fs=FS, rng=3)


@examples(12)
@given(
    samples=st.one_of(st.floats(1.1, 30.0), st.sampled_from([2.0, 3.0, 20 / 3, 5.5, 5 / 3, 20.0])),
    phase=st.floats(0.0, 1.0),
    kind=st.sampled_from([{"noise_std": 0.01}, {"noise_std": 0.3, "saturation_high": 0.7}]),
)
@example(samples=2.25, phase=0.0, kind={"noise_std": 0.01})  # 9/5 samples crowd as 9/4 do
def test_period_and_phase_lie_within_what_the_record_leaves_open(samples, phase, kind):
    if samples < 3 and "saturation_high" in kind:
        kind = {}  # the clipped updates do not show, and of so few none may be missing
    period = samples / FS
    found = detect_hold(held(period, phase * period, **kind), FS)
    assert found is not None
    assert abs(found.period - period) <= np.sqrt(3) * found.std * 1.01
    # Uniform over its range: no further from the middle than √3 standard deviations.
    off = (found.phase - phase * period + period / 2) % period - period / 2
    assert abs(off) <= np.sqrt(3) * found.phase_std * 1.01 + 1e-6 / FS
    assert 0 <= found.phase < period + 1e-9
    assert found.std * FS < samples**2 / 2000


def test_a_period_that_is_no_simple_fraction_is_known_best():
    assert detect_hold(held(1 / 29.97, noise_std=0.01), FS).std * FS < 1e-4
    whole = detect_hold(held(3 / FS, noise_std=0.01), FS)
    # Between which two samples, never when: uniform over one sample.
    assert whole.phase_std * FS == pytest.approx(1 / np.sqrt(12), rel=0.02)


def test_rounding_hides_updates_and_noise_may_come_after():
    for y in (
        held(1 / 30, noise_std=0.01, quantization_step=0.02),
        held(1 / 30) + 0.005 * np.random.default_rng(0).standard_normal(2000),
    ):
        found = detect_hold(y, FS)
        assert found.period == pytest.approx(1 / 30, abs=3 * found.std)


def test_the_updates_are_where_values_change():
    y = held(1 / 29.3, noise_std=0.01)
    arrivals = updates(detect_hold(y, FS), y.size, FS)
    changes = np.flatnonzero(np.diff(y)) + 1
    assert set(changes) <= set(arrivals.index)
    assert np.all((arrivals.age >= 0) & (arrivals.age < 1))
    truth = np.ceil((arrivals.index - 1 - 0.0031 * FS) / (FS / 29.3)) * FS / 29.3 + 0.0031 * FS
    np.testing.assert_allclose(arrivals.index - arrivals.age, truth, atol=0.02)


STEPS, NOISES = (None, 0.003, 0.05, 0.2), (0.0, 0.002, 0.02, 0.1)
FEW = [(step, NOISES[(k + j) % 4]) for k, step in enumerate(STEPS) for j in (0, 1)]


@pytest.mark.parametrize(("step", "noise"), few_of(FEW, STEPS, NOISES))
def test_an_output_that_follows_at_every_sample_is_not_held(step, noise):
    rng = np.random.default_rng(0)
    for dynamics in ({}, {"natural_frequency": 10.0, "damping_ratio": 0.4}):
        ideal = Sensor(delay=0.0123, **dynamics)
        real = Sensor(delay=0.0123, noise_std=noise, quantization_step=step, **dynamics)
        triangle = np.abs((2 * T) % 2 - 1)
        for u in (CHIRP, CHIRP / (1 + T), triangle, np.sin(2 * np.pi * 0.3 * T)):
            assert detect_hold(real.respond(u, fs=FS, rng=1), FS) is None
        for u in (np.sign(np.sin(np.pi * T + 0.1)), rng.choice([-1.0, 1.0], 200).repeat(10)):
            assert detect_hold(real.respond(u, fs=FS, intersample="zoh", rng=1), FS) is None
        # An input that is itself held on random levels: the prediction stands still as well.
        u = rng.uniform(-1, 1, 200).repeat(10)
        y = real.respond(u, fs=FS, intersample="zoh", rng=1)
        assert detect_hold(y, FS, ideal.respond(u, fs=FS, intersample="zoh")) is None
