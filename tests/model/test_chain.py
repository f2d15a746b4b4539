"""The whole chain of Fig. 1, against the sensor that is stepped in time by other means."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.model import Model, frequency_response, second_order_coefficients, simulate
from hmpim.model.chain import run_chain
from hmpim.rigs import Sensor
from tests_support import examples, few_of

FS = 200.0
T = np.arange(600) / FS


def second_order(natural_frequency: float, damping_ratio: float, **more) -> Model:
    c1, c2 = second_order_coefficients(natural_frequency, damping_ratio)
    return Model(denominator=(float(c2), float(c1), 1.0), **{"scale_factor": 1.0, **more})


def smooth(seed: int = 0, highest: float = 15.0) -> np.ndarray:
    """A signal with content up to `highest` Hz that begins and ends at rest."""
    rng = np.random.default_rng(seed)
    f = rng.uniform(0.5, highest, 12)
    wave = np.sin(2 * np.pi * f * T[:, None] + rng.uniform(0, 6, 12)).sum(axis=1)
    rise = np.clip(T / 1.0, 0, 1) ** 4 * (35 - 84 * np.clip(T, 0, 1) + 70 * np.clip(T, 0, 1) ** 2)
    return wave * (rise - 20 * np.clip(T, 0, 1) ** 7)


def sensor_of(model: Model, **more) -> Sensor:
    poles = {}
    if len(model.denominator) == 3:
        c2, c1, _ = model.denominator
        omega = c2**-0.5
        poles = {"natural_frequency": omega / (2 * np.pi), "damping_ratio": c1 * omega / 2}
    elif len(model.denominator) == 2:
        poles = {"time_constant": model.denominator[0]}
    return Sensor(
        delay=model.delay,
        scale_factor=model.scale_factor,
        bias=model.bias,
        hold_period=model.hold_period,
        hold_phase=model.hold_phase,
        saturation_low=model.saturation_low,
        saturation_high=model.saturation_high,
        quantization_step=model.quantization_step,
        **poles,
        **more,
    )


STATIC = Model(delay=0.0, scale_factor=1.0)
FIRST = Model(delay=0.0, scale_factor=1.0, denominator=(0.02, 1.0))
SECOND = second_order(10.0, 0.4, delay=0.0)


@pytest.mark.parametrize("model", [STATIC, FIRST, SECOND])
@pytest.mark.parametrize("intersample", ["zoh", "foh"])
@examples(5)
@given(
    delay=st.one_of(st.sampled_from([0.0, 0.005, 0.15]), st.floats(0.0, 0.2)),
    period=st.one_of(st.none(), st.sampled_from([0.01, 0.005 * 20 / 3]), st.floats(0.002, 0.1)),
    phase=st.floats(-0.05, 0.05),
)
def test_held_and_linear_inputs_are_answered_exactly(model, intersample, delay, period, phase):
    u = np.random.default_rng(3).standard_normal(T.size).cumsum()
    model = replace(
        model, delay=delay, scale_factor=-2.5, bias=0.7, hold_period=period, hold_phase=phase
    )
    truth = sensor_of(model).respond(u, fs=FS, intersample=intersample)
    found = model.simulate(u, T, intersample=intersample)
    if intersample == "zoh" and model.denominator == (1.0,):
        # An instant that falls on a step of the input, to rounding, may see either side of it.
        assert np.mean(np.abs(found - truth) < 1e-9) > 0.99
    else:
        assert found == pytest.approx(truth, abs=1e-8)


PERIODS = (None, 0.0125, 0.0317)
ANSWERED = [
    (model, delay, PERIODS[(i + k) % 3])
    for i, model in enumerate((STATIC, FIRST, SECOND))
    for k, delay in enumerate((0.0, 0.0013, 0.0331))
]
"""Each model with each delay and each period; the other triples in `make studies`."""
DELAYS = (0.0, 0.0013, 0.0331, 0.005, 0.15)


@pytest.mark.parametrize(
    ("model", "delay", "period"), few_of(ANSWERED, (STATIC, FIRST, SECOND), DELAYS, PERIODS)
)
def test_a_band_limited_input_is_answered_causally_to_1e_6(model, delay, period):
    model = replace(model, delay=delay, bias=0.1, hold_period=period, hold_phase=0.001, band=20.0)
    u = smooth()
    fine = np.arange(24 * T.size) / (24 * FS)  # a true signal between the samples
    rng = np.random.default_rng(0)
    f, shift = rng.uniform(0.5, 15.0, 12), rng.uniform(0, 6, 12)
    ramp = np.clip(fine, 0, 1)
    rise = ramp**4 * (35 - 84 * ramp + 70 * ramp**2 - 20 * ramp**3)
    truth = sensor_of(model).respond(
        np.sin(2 * np.pi * f * fine[:, None] + shift).sum(axis=1) * rise,
        fs=24 * FS,
        intersample="bandlimited",
    )[::24]
    found = model.simulate(u, T, intersample="bandlimited")
    assert model.at_rate(FS).error < 1e-6
    assert found == pytest.approx(truth, abs=2e-5 * np.abs(truth).max())


def test_the_response_at_our_rate_is_that_of_the_model_to_1e_6():
    f = np.linspace(0.0, 20.0, 400)[1:]
    for model in (STATIC, FIRST, SECOND, Model(delay=0, scale_factor=2.0, denominator=(1.0, 0.0))):
        for delay in (0.0, 0.002, 0.0571, 0.15, 0.4013):
            moved = replace(model, delay=delay, band=20.0)
            truth = frequency_response(moved, f)
            error = np.max(np.abs(moved.at_rate(FS).step.response(f) / truth - 1.0))
            assert error < 1e-6


def test_levels_and_rounding_are_those_of_the_sensor():
    model = replace(
        SECOND,
        delay=0.0123,
        saturation_low=-1.5,
        saturation_high=2.0,
        quantization_step=0.01,
        hold_period=0.0171,
    )
    u = smooth(1)
    truth = sensor_of(model).respond(u, fs=FS, intersample="foh")
    found = model.simulate(u, T, intersample="foh")
    assert found.min() == pytest.approx(-1.5)
    assert found.max() == pytest.approx(2.0)
    assert np.mean(np.abs(found - truth) < 1e-9) > 0.995  # a value on the edge rounds either way
    assert np.abs(found - truth).max() < 0.011


def test_noise_is_drawn_once_a_reading():
    model = replace(STATIC, noise_std=0.3, hold_period=0.05)
    y = model.simulate(np.zeros(T.size), T, rng=1)
    assert np.unique(y).size == 60
    assert np.all(y[:10] == y[0])
    plain = replace(model, hold_period=None).simulate(np.zeros(4000), np.arange(4000) / FS, rng=1)
    assert np.std(plain) == pytest.approx(0.3, rel=0.05)


def test_the_chain_and_the_linear_part_agree_where_there_is_only_that():
    model = replace(SECOND, delay=0.0317, bias=0.2)
    u = smooth(2)
    for intersample in ("zoh", "foh"):
        plain = simulate(model, u, fs=FS, intersample=intersample)
        assert model.simulate(u, T, intersample=intersample) == pytest.approx(plain, abs=1e-9)


def test_clustered_poles_at_a_high_rate_lose_no_digits():
    c1, c2 = second_order_coefficients(0.5, 0.7)
    denominator = np.polymul([c2, c1, 1.0], [c2, c1, 1.0])
    slow = Model(delay=0.0, scale_factor=1.0, denominator=tuple(denominator), intersample="zoh")
    t = np.arange(40_000) / 2000.0
    y = slow.simulate((t > 0).astype(float), t)
    fine = slow.simulate((t[::4] > 0).astype(float), t[::4])
    assert y[-1] == pytest.approx(1.0, abs=1e-11)
    assert np.abs(y[4::4] - fine[1:]).max() < 2e-3  # the step falls one sample earlier


@pytest.mark.parametrize("period", [None, 0.0137])
@pytest.mark.parametrize("share", [0.999, 0.5, 1e-3])
@pytest.mark.parametrize("model", [STATIC, FIRST, SECOND])
def test_a_held_input_that_moves_before_its_sample_is_stepped(model, share, period):
    """The simulation has the whole input at hand; the program, the samples up to now."""
    ahead = replace(
        model, delay=-share / FS, intersample="zoh", hold_period=period, hold_phase=0.0021
    )
    u = np.random.default_rng(3).standard_normal(T.size).cumsum()
    stepped = run_chain(ahead.at_rate(FS), u)
    assert stepped == pytest.approx(ahead.simulate(u, T), abs=1e-9)
    until = run_chain(ahead.at_rate(FS), u[:300])
    assert np.array_equal(until, stepped[:300])
    with pytest.raises(ArgumentError, match="no program can run ahead"):
        replace(ahead, delay=-1.0 / FS).at_rate(FS)


def test_a_model_ahead_of_its_input_can_be_simulated_but_not_stepped():
    model = Model(delay=-0.0125, scale_factor=2.0, intersample="foh")
    assert model.simulate(T, T)[:500] == pytest.approx(2 * (T[:500] + 0.0125))
    with pytest.raises(ArgumentError, match=r"delay -0.0125 s is negative"):
        model.at_rate(FS)


@pytest.mark.parametrize(
    ("u", "t", "said"),
    [
        ([1.0], [0.0], "two or more samples"),
        ([1.0, 2.0, 3.0], [0.0, 1.0, 3.0], "not evenly spaced"),
        ([1.0, 2.0], [1.0, 0.0], "not evenly spaced"),
        ([1.0, np.nan], [0.0, 1.0], "not finite"),
        (["a", "b"], [0.0, 1.0], "not a number"),
    ],
)
def test_what_cannot_be_simulated_is_refused(u, t, said):
    with pytest.raises(ArgumentError, match=said):
        STATIC.simulate(u, t)


@pytest.mark.parametrize(
    "run",
    [
        lambda model: model.simulate(np.ones(600), T),
        lambda model: simulate(model, np.ones(600), fs=FS, intersample="zoh"),
    ],
)
def test_a_model_ahead_of_its_whole_input_is_refused(run):
    """It asked for as much memory as it is early."""
    with pytest.raises(ArgumentError, match="runs ahead of the input, which is 3 s long"):
        run(replace(STATIC, delay=-1e14))


def test_readouts_that_cannot_be_are_refused():
    with pytest.raises(ArgumentError, match=r"saturation_low = 2.0 is not below"):
        replace(STATIC, saturation_low=2.0, saturation_high=1.0)
    with pytest.raises(ArgumentError, match="hold_period = 0"):
        replace(STATIC, hold_period=0.0)
    with pytest.raises(ArgumentError, match="fiftieth"):
        replace(STATIC, hold_period=1e-9).at_rate(FS)
    with pytest.raises(ArgumentError, match="is not known"):
        STATIC.at_rate(FS, intersample="cubic")


@pytest.mark.parametrize("period", [None, 0.0123])
@pytest.mark.parametrize("intersample", ["zoh", "foh", "bandlimited"])
def test_what_is_late_by_a_sample_does_not_depend_on_the_newest_one(intersample, period):
    for delay in (0.005, 0.0071, 0.3):
        model = replace(SECOND, delay=delay, intersample=intersample, hold_period=period)
        u = np.random.default_rng(0).standard_normal(40)
        changed = np.concatenate([u[:-1], [u[-1] + 5.0]])
        assert np.array_equal(model.simulate(u, T[:40]), model.simulate(changed, T[:40]))
