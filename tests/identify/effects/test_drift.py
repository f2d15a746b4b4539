"""A bias that drifts, up to several times the motion, and one that does not."""

from functools import cache

import numpy as np
import pytest

import hmpim
from hmpim.identify.effects import drift
from hmpim.identify.fitting.joint import joint_fit
from tests_support import answer_of, assert_share, four_sines, holds, in_studies, study_size

FS = 200.0
T = np.arange(2000) / FS
TRUTH = {"delay": 0.05, "scale_factor": 1.0, "natural_frequency": 10.0, "damping_ratio": 0.4}
STIMULUS = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.1, 20.0), duration=10.0), fs=FS)
DRIFTS = {
    "steady, small": lambda rng: 0.01 * T,
    "steady, three times the amplitude": lambda rng: -0.3 * T,
    "warming up": lambda rng: 3.0 * (1 - np.exp(-T / 3.0)),
    "warming up for long": lambda rng: 5.0 * (1 - np.exp(-T / 20.0)),
    "slow sine": lambda rng: 2.0 * np.sin(2 * np.pi * 0.07 * T + 1.0),
    "random walk": lambda rng: 0.05 * np.cumsum(rng.standard_normal(T.size)),
}


def identified(drift, seed=1, structures=None, **parts):
    sensor = hmpim.Sensor(
        delay=0.05, natural_frequency=10.0, damping_ratio=0.4, bias=0.1, noise_std=0.05, **parts
    )
    record = hmpim.run(sensor, STIMULUS, rng=seed)
    y = record.outputs[0].values + drift
    bare = hmpim.Record.from_arrays(
        {"u": record.inputs[0].values}, {"y": y}, fs=FS, intersample="bandlimited"
    )
    return hmpim.identify(bare, structures=structures)["y", "u"]


@cache
def found(kind):
    """A result is never changed: several tests look at that of one kind."""
    return identified(DRIFTS[kind](np.random.default_rng(7)))


@cache
def steady(rate):
    """Drift by so much per s, its structure told."""
    return identified(rate * T, structures=["second_order"])


def said(pair):
    return [w.message for w in pair.warnings if w.code == "drift"]


def test_a_warm_up_is_no_slow_pole_of_the_unit():
    # Beside little noise a pole that a zero all but cancels, its state free, looks the same.
    rng = np.random.default_rng(3)
    fine = np.arange(16 * 1200) / 1600.0
    u = np.sin(2 * np.pi * (0.1 * fine + 0.45 * fine**2))
    late = np.interp(fine - 0.025, fine, u, left=0.0)
    y = answer_of([1.0], [1 / 28.5**2, 2 * 0.7 / 28.5, 1.0], late, fine)[::16]
    t = fine[::16]
    warming = 0.5 * (1 - np.exp(-t / 1.9))
    record = hmpim.Record.from_arrays(
        {"u": u[::16]},
        {"y": y + warming + 0.001 * rng.standard_normal(t.size)},
        fs=100.0,
        intersample="bandlimited",
    )
    pair = hmpim.identify(record)["y", "u"]
    assert (pair.structure, pair.verdict) == ("second_order", "ok")
    for name, truth in (("bias", warming.mean()), ("natural_frequency", 28.5 / (2 * np.pi))):
        estimate = getattr(pair, name)
        assert abs(estimate.value - truth) < 4.5 * estimate.spread, name
    assert said(pair)


LONG = ("steady, small", "warming up for long", "slow sine", "random walk")


@pytest.mark.parametrize("kind", [*(k for k in DRIFTS if k not in LONG), *in_studies(*LONG)])
def test_everything_else_is_found_as_without_the_drift(kind):
    drift = DRIFTS[kind](np.random.default_rng(7))
    pair = found(kind)
    assert pair.structure == "second_order"
    assert pair.verdict == "ok"
    assert len(said(pair)) == 1
    for name, value in (TRUTH | {"bias": 0.1 + drift.mean()}).items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 4 * estimate.std, name
    assert pair.scale_factor.std < 0.03
    assert pair.delay.std < 0.0005


def test_the_prediction_holds_the_drift():
    drift = DRIFTS["warming up"](None)
    pair = found("warming up")
    assert np.std(pair.residual) == pytest.approx(0.05, rel=0.1)
    assert np.corrcoef(pair.prediction, drift)[0, 1] > 0.5


def test_a_steady_drift_is_said_with_its_rate_and_error():
    message = said(steady(0.3))[0]
    rate, error = message.split("on average by ")[1].split(" per s")[0].split(" ± ")
    assert abs(float(rate) - 0.3) < 4 * float(error)
    # White noise: σ / sqrt(Σ t²) for a straight line.
    assert float(error) == pytest.approx(0.05 / np.sqrt(np.sum((T - T.mean()) ** 2)), rel=0.1)


def test_the_bias_costs_no_more_than_a_straight_line_takes():
    assert steady(0.3).bias.std == pytest.approx(steady(0.0).bias.std, rel=0.1)


def test_a_clipped_output_may_drift():
    drift = 0.1 * T
    sensor = hmpim.Sensor(delay=0.05, natural_frequency=10.0, damping_ratio=0.4, bias=0.1)
    record = hmpim.run(sensor, STIMULUS, rng=1)
    noise = 0.05 * np.random.default_rng(5).standard_normal(T.size)
    y = np.minimum(record.outputs[0].values + drift + noise, 1.2)
    pair = hmpim.identify(
        hmpim.Record.from_arrays(
            {"u": record.inputs[0].values}, {"y": y}, fs=FS, intersample="bandlimited"
        ),
        structures=["second_order", "third_order"],
    )["y", "u"]
    assert pair.saturation_high.value == pytest.approx(1.2)
    assert said(pair)
    for name, value in TRUTH.items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 4 * estimate.spread, name


@pytest.mark.study  # small: test_everything_else_is_found_as_without_the_drift
@pytest.mark.parametrize("kind", ["warming up", "steady, three times the amplitude"])
def test_stated_intervals_hold_with_a_drift(kind):
    drift = DRIFTS[kind](None)
    truth = TRUTH | {"bias": 0.1 + drift.mean()}
    pairs = [identified(drift, seed) for seed in range(study_size(200))]
    inside = [[holds(getattr(pair, name), truth[name]) for name in truth] for pair in pairs]
    assert_share(inside, at_least=0.92, at_most=0.98)


@pytest.mark.few(6)
@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_is_not_taken_for_a_drift(seeds, colour):
    plain = {"structures": ["second_order"], "noise_colour": colour}
    alarms = [bool(said(identified(0.0 * T, seed, **plain))) for seed in range(seeds)]
    assert_share(alarms, at_most=0.01)


def test_a_free_response_that_a_drift_imitates_is_no_drift():
    """Four sines that go on, 400 samples; the search beside a drift alone finds the dynamics."""
    rng = np.random.default_rng(2)
    u = four_sines(rng)
    omega = 2 * np.pi * 5.6
    unit = hmpim.Model(
        delay=0.001, scale_factor=-2.8, bias=2.1, denominator=(omega**-2, 1.26 / omega, 1.0)
    )
    y = np.asarray(hmpim.simulate(unit, u, fs=1000.0, intersample="bandlimited"))[-400:]
    y = y + 0.0316 * y.std() * rng.standard_normal(400)
    record = hmpim.Record.from_arrays({"u": u[-400:]}, {"y": y}, fs=1000.0)
    pair = hmpim.identify(record)["y", "u"]
    assert "drift" not in [finding.code for finding in pair.warnings]
    assert pair.bias.value == pytest.approx(2.1, abs=0.01)


@pytest.mark.parametrize(("gain", "drifts"), [(5.0, True), (-5.0, False)])
def test_a_drift_is_taken_if_the_criterion_improves(monkeypatch, gain, drifts):
    u = np.sin(2 * np.pi * (0.1 * T + 0.95 * T**2))
    y = np.convolve(u, np.exp(-np.arange(40) / 8.0) / 8.0)[: T.size] + 0.3 * T
    y = y + 0.02 * np.random.default_rng(4).standard_normal(T.size)
    monkeypatch.setattr(drift, "criterion_gain", lambda *_: gain)
    plain = ("first_order",)
    first = joint_fit(u, y, structures=plain)
    joint, found = drift.with_drift(
        first,
        lambda rows, _: joint_fit(u, y, structures=plain, nuisance=rows),
    )
    assert (found is not None, joint is first) == (drifts, not drifts)


def test_a_drift_and_hum_of_an_output_whose_leading_input_is_unrelated():
    """That input was left out of the fit with the rows of the drift, and had none of them."""
    draw, k = np.random.default_rng(5), np.arange(400)
    lines, phases = 10 ** draw.uniform(-3, np.log10(0.45), 11), draw.uniform(0, 6, 11)
    ramp = np.clip((k - 45) / 160, 0.0, 1.0)
    tones = np.sin(2 * np.pi * lines[:, None] * k + phases[:, None]).sum(axis=0)
    noise = 0.006 * np.random.default_rng(3).standard_normal(k.size)
    y = 0.057 * np.cumsum(ramp) + 0.04 * np.gradient(tones) + noise
    record = hmpim.Record.from_arrays({"u": ramp, "v": tones}, {"y": y}, fs=100.0)
    result = hmpim.identify(record, structures=["second_order"])
    assert len(result) == 2
    assert result.verdict != "ok"


@pytest.mark.parametrize(("seed", "size"), [(4, 30), *in_studies((1, 3))])
def test_a_drift_that_hides_the_dynamics_does_not_decide_where_their_fit_begins(seed, size):
    # Without the drift's rows the plain fits end far from the truth.
    rng = np.random.default_rng(1000 * seed + size)
    n, fs = 1200, 100.0
    t = np.arange(n) / fs
    fade = np.sin(0.5 * np.pi * np.clip(np.minimum(t, t[-1] - t) / 0.5, 0, 1)) ** 2
    high = rng.uniform(8, 25)
    u = fade * np.sin(2 * np.pi * (0.1 * t + (high - 0.1) / 2 / t[-1] * t**2))
    w, zeta, lag = 2 * np.pi * rng.uniform(2, 9), rng.uniform(0.3, 1), rng.uniform(0.003, 0.05)
    below = np.array([1 / w**2, 2 * zeta / w, 1.0])
    model = hmpim.Model(
        delay=rng.uniform(0.01, 0.3),
        scale_factor=1.0,
        denominator=tuple(np.convolve(below, [lag, 1.0]) if seed % 2 else below),
    )
    slow = np.polynomial.legendre.legval(
        np.linspace(-1, 1, n), np.r_[0, rng.standard_normal(6) * 0.5 ** np.arange(6)]
    )
    y = hmpim.simulate(model, u, fs=fs, intersample="bandlimited") + size * slow / np.std(slow)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y + 0.01 * rng.standard_normal(n)}, fs=fs)
    pair = hmpim.identify(record)["y", "u"]
    assert pair.verdict == "ok"
    assert abs(pair.delay.value - model.delay) < 0.005
