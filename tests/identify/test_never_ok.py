"""Records that do not tell what is asked: never 'ok', never a traceback; and the converse."""

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from tests_support import in_studies, study_size

FS = 200.0
N = 2000
T = np.arange(N) / FS
STIMULUS = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0), fs=FS)
PARAMETERS = ("delay", "scale_factor", "bias", "natural_frequency", "damping_ratio", "noise_std")


def chirp(first, last, time=T):
    return np.sin(2 * np.pi * (first * time + (last - first) / 20 * time**2))


U = chirp(0.1, 20.0)


def sensed(rng, **changes):
    """Output of a good sensor, noise 0.02, or of one with some changes."""
    parts = {"delay": 0.05, "natural_frequency": 10.0, "damping_ratio": 0.4, "bias": 0.1}
    sensor = hmpim.Sensor(**{**parts, "noise_std": 0.02, **changes})
    return hmpim.run(sensor, STIMULUS, rng=int(rng.integers(1 << 30))).outputs[0].values.copy()


def with_noise(y, rng, std=0.02):
    return y + std * rng.standard_normal(y.size)


def delayed(y, samples):
    return np.concatenate([np.zeros(samples), y])[: y.size]


def somewhere(rng):
    """A sample in the middle of the record."""
    return int(rng.uniform(0.3, 0.7) * N)


def later(before, after, rng):
    k = somewhere(rng)
    return np.concatenate([before[:k], after[k:]])


def spiked(y, count, rng):
    y[rng.choice(N, count, replace=False)] += rng.choice([-5, 5], count) * rng.uniform(0.5, 2)
    return y


def stretches(y, length, value, rng):
    for k in rng.integers(0, N - length, 15):
        y[k : k + length] = y[k] if value is None else value
    return y


def rate_limited(y, step):
    out = np.empty_like(y)
    out[0] = y[0]
    for i in range(1, y.size):
        out[i] = out[i - 1] + np.clip(y[i] - out[i - 1], -step, step)
    return out


def slack(y, gap):
    out = np.zeros_like(y)
    for i in range(1, y.size):
        out[i] = min(max(out[i - 1], y[i] - gap), y[i] + gap)
    return out


UNRELATED = {
    "white noise": lambda r: r.standard_normal(N),
    "coloured noise": lambda r: lfilter([1], [1, -0.95], r.standard_normal(N)),
    "resonant noise": lambda r: lfilter([1], [1, -1.9, 0.95], r.standard_normal(N)),
    "random walk": lambda r: np.cumsum(r.standard_normal(N)),
    "twice a random walk": lambda r: np.cumsum(np.cumsum(r.standard_normal(N))),
    "sine": lambda r: with_noise(np.sin(2 * np.pi * r.uniform(0.2, 15) * T + 1.0), r),
    "sine without noise": lambda r: np.sin(2 * np.pi * r.uniform(0.2, 15) * T + 1.0),
    "another sweep": lambda r: with_noise(chirp(r.uniform(3, 15), r.uniform(20, 40)), r),
    "a sweep downwards": lambda r: with_noise(chirp(20.0, 0.1), r),
    "the input reversed": lambda r: with_noise(U[::-1], r),
    "the input squared": lambda r: with_noise(U**2, r),
    "the input rectified": lambda r: with_noise(np.abs(U), r),
    "a ramp": lambda r: with_noise(T, r),
    "one blip": lambda r: 0.1 + 0.01 * (np.arange(N) == somewhere(r)),
    "the last bit": lambda r: 0.1 * r.integers(0, 2, N),
    "noise over a trace": lambda r: 0.02 * U + r.standard_normal(N),
    "a record that ends before the response": lambda r: with_noise(np.zeros(N), r),
    "a delay of four fifths": lambda r: with_noise(delayed(U, 1600), r),
}
"""Outputs that say nothing of the input: not identifiable."""

SPOILT = {
    "a sweep a little different": lambda r: with_noise(chirp(0.1, r.uniform(10, 18)), r),
    "slow sine": lambda r: with_noise(np.sin(2 * np.pi * r.uniform(0.02, 0.2) * T), r),
    "step": lambda r: with_noise(r.uniform(2, 8) < T, r),
    "stuck after half": lambda r: later(y := sensed(r), np.full(N, y[N // 2]), r),
    "stuck after half, noisy": lambda r: later(sensed(r), with_noise(np.zeros(N), r), r),
    "stuck before half": lambda r: later(np.full(N, 0.1), sensed(r), r),
    "full-wave rectifier": lambda r: np.abs(sensed(r, bias=0.0)),
    "half-wave rectifier": lambda r: np.maximum(sensed(r, bias=0.0), 0.0),
    "polarity flips": lambda r: later(y := sensed(r, bias=0.0), -y, r),
    "delay changes": lambda r: later(sensed(r), sensed(r, delay=0.08), r),
    "gain changes": lambda r: later(sensed(r), sensed(r, scale_factor=1.3), r),
    "dynamics change": lambda r: later(sensed(r), sensed(r, natural_frequency=6.0), r),
    "gain rises": lambda r: sensed(r) * (1 + 0.05 * T),
    "clocks part by 0.2 %": lambda r: with_noise(chirp(0.1, 20, 0.998 * T), r),
    "clocks part by 0.1 %": lambda r: with_noise(chirp(0.1, 20, 1.001 * T), r),
    "many spikes": lambda r: spiked(sensed(r), 300, r),
    "dropouts": lambda r: stretches(sensed(r), 20, 0.0, r),
    "freezes": lambda r: stretches(sensed(r), 40, None, r),
    "two thirds clipped": lambda r: np.clip(y := sensed(r), *np.quantile(y, [1 / 3, 2 / 3])),
    "nearly all clipped": lambda r: np.clip(y := sensed(r), *np.quantile(y, [0.45, 0.55])),
    "relay": lambda r: np.sign(sensed(r, bias=0.0)),
    "three levels": lambda r: sensed(r, quantization_step=0.8, noise_std=0.01),
    "held for 0.2 s": lambda r: sensed(r, hold_period=0.2),
    "held for 0.7 s": lambda r: sensed(r, hold_period=0.7),
    "wraps around": lambda r: (sensed(r, bias=0.0, scale_factor=2.0) + 1) % 2 - 1,
    "rate limit": lambda r: with_noise(rate_limited(sensed(r, noise_std=0.0), 0.05), r),
    "slack": lambda r: with_noise(slack(sensed(r, noise_std=0.0), 0.3), r),
    "another input as well": lambda r: with_noise(0.5 * U + chirp(3, 17), r),
}
"""Outputs that follow the input, but not as any linear unit would, or hardly at all."""


LONG = {
    *(
        "resonant noise",
        "random walk",
        "sine without noise",
        "the input reversed",
        "the input squared",
        "a ramp",
    ),
    *("a delay of four fifths", "stuck after half, noisy", "full-wave rectifier", "gain rises"),
    *("clocks part by 0.1 %", "freezes", "two thirds clipped", "relay", "wraps around"),
    "another input as well",
    *("a sweep downwards", "the input rectified", "noise over a trace", "resonant noise"),
    *("a record that ends before the response", "a sweep a little different", "gain changes"),
    *(
        "stuck after half",
        "nearly all clipped",  # effects/test_saturation.py has clipping
        "dynamics change",
        "stuck before half",
        "held for 0.2 s",
        "clocks part by 0.2 %",
        "slow sine",
        "polarity flips",
        "delay changes",  # fitting/test_halves.py has it
        "held for 0.7 s",
        "rate limit",  # nonlinear/test_speed.py and test_nonlinear_end_to_end.py have it
        "slack",
    ),
}
"""Long to identify, or like another one that is not here: in `make studies` only."""


def shorter(cases):
    """Names of cases, the long ones for studies only."""
    return [*(n for n in cases if n not in LONG), *in_studies(*(n for n in cases if n in LONG))]


def judged(y, *, between=None):
    record = hmpim.Record.from_arrays({"u": U}, {"y": y}, fs=FS, intersample=between)
    return hmpim.identify(record)["y", "u"]


def assert_sound(pair):
    """Every number finite, every warning a sentence."""
    for name in PARAMETERS:
        estimate = getattr(pair, name)
        if estimate is not None:
            numbers = [estimate.value, estimate.std, *(estimate.ci95 or ())]
            assert np.isfinite([n for n in numbers if n is not None]).all(), name
    for warning in pair.warnings:
        assert warning.message.endswith("."), warning
        assert "nan" not in warning.message.split(), warning


@pytest.mark.parametrize("name", shorter(UNRELATED))
def test_an_output_that_does_not_follow_is_refused(name):
    pair = judged(UNRELATED[name](np.random.default_rng(1)))
    assert_sound(pair)
    assert pair.verdict == "not_identifiable"
    assert pair.scale_factor is None
    assert [w.code for w in pair.warnings if w.code == "unrelated"]


@pytest.mark.parametrize("name", shorter(SPOILT))
def test_a_spoilt_output_is_never_ok(name):
    pair = judged(SPOILT[name](np.random.default_rng(1)))
    assert_sound(pair)
    assert pair.verdict != "ok"
    assert pair.warnings


@pytest.mark.study
@pytest.mark.parametrize("name", [*UNRELATED, *SPOILT])
def test_none_of_them_is_ok_for_any_seed(name):
    """None of 60 excludes that one in twenty is ok, at 95 %; of all cases, one in nine hundred."""
    for seed in range(2, 2 + study_size(60)):
        pair = judged({**UNRELATED, **SPOILT}[name](np.random.default_rng(seed)))
        assert_sound(pair)
        assert pair.verdict != "ok", (name, seed)


def test_an_output_that_never_moves_is_refused():
    with pytest.raises(hmpim.HmpimError, match=r"constant at 0\.1"):
        judged(np.full(N, 0.1))


def test_samples_that_are_no_numbers_are_refused():
    y = sensed(np.random.default_rng(0))
    y[500:900] = np.nan
    with pytest.raises(hmpim.HmpimError, match=r"nan at sample 500 \(400 in all"):
        judged(y)


EFFECTS = {
    "none": {},
    "clipped above": {"saturation_high": 0.7},
    "clipped on both sides": {"saturation_low": -0.7, "saturation_high": 0.9},
    "held at 60 Hz": {"hold_period": 1 / 60, "hold_phase": 0.004},
    "held at 50 Hz": {"hold_period": 0.02},
    "rounded finely": {"quantization_step": 0.01},
    "rounded coarsely": {"quantization_step": 0.05},
    "coloured noise": {"noise_colour": 0.9},
}


@pytest.mark.parametrize(
    "name",
    [
        *("none", "clipped on both sides", "held at 60 Hz", "rounded coarsely", "coloured noise"),
        *in_studies("clipped above", "held at 50 Hz", "rounded finely"),
    ],
)
def test_a_right_sensor_with_an_effect_of_fig_1_keeps_its_parameters(name):
    pair = judged(sensed(np.random.default_rng(3), **EFFECTS[name]), between="bandlimited")
    assert_sound(pair)
    assert pair.verdict == "ok"
    assert pair.structure == "second_order"
    truth = {"delay": 0.05, "scale_factor": 1.0, "bias": 0.1}
    truth |= {"natural_frequency": 10.0, "damping_ratio": 0.4}
    for parameter, value in truth.items():
        estimate = getattr(pair, parameter)
        assert abs(estimate.value - value) < 4 * estimate.std, parameter
        assert estimate.std < 0.1 * max(value, 0.1), parameter
