"""Zeros in front of the hold: rows against simulation, derivatives against differences."""

import runpy

import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError
from hmpim.identify.fitting.feedforward_rows import FeedforwardPart
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.model.dynamics import STRUCTURES
from hmpim.model.sampled import prepare_input
from tests_support import in_studies

FS, SAMPLES = 500.0, 2500
TIME = np.arange(SAMPLES) / FS
W = 2 * np.pi * 25.0
SERVO = {
    "delay": 0.0031,
    "scale_factor": 1.02,
    "denominator": (0.002 / W**2, 1 / W**2 + 0.0028 / W, 1.4 / W + 0.002, 1.0),
}
"""Third order: a mode at 25 Hz of ζ 0.7, and a lag of 2 ms."""
VELOCITY = (1.2 / W, 1.0)
ACCELERATION = (0.8 / W**2, 1.2 / W, 1.0)


def sweep():
    fade = np.clip(np.minimum(TIME, TIME[-1] - TIME) / 0.2, 0.0, 1.0)
    frequency = 0.5 + 11.0 * TIME
    return (
        np.sin(0.5 * np.pi * fade) ** 2
        * np.sin(2 * np.pi * (0.5 * TIME + 5.5 * TIME**2))
        / (1.0 + frequency / 12.0)
    )


def record(numerator, between, seed, *, stated=None, noise=1e-3):
    model = hmpim.Model(numerator=numerator, **SERVO)
    y = hmpim.simulate(model, sweep(), fs=FS, intersample=between)
    y += 0.1 + noise * np.random.default_rng(seed).standard_normal(SAMPLES)
    return hmpim.Record.from_arrays({"u": sweep()}, {"y": y}, fs=FS, intersample=stated)


def problem():
    source = prepare_input(sweep() + 0.3, "feedforward")
    return Problem(source=source, y=np.zeros(SAMPLES), valid=None, longest_delay=99.0)


@pytest.mark.parametrize("name", ["second_order_zero", "third_order_zero", "third_order_zeros"])
def test_slopes_are_those_of_the_rows(name):
    structure = STRUCTURES[name]
    theta = np.array([1.4, np.log(4.0), 0.5, np.log(1.5)])[: 1 + structure.order]
    numerator = np.array([1.1, 3.0, 9.0])[: structure.zeros + 1]
    part = part_of(problem(), structure, theta)
    assert isinstance(part, FeedforwardPart)
    slopes = part.slopes(numerator, np.zeros(0))
    some = part.slopes(numerator, np.zeros(0), slice(700, 950))
    assert np.allclose(some, slopes[:, 700:950], rtol=0.0, atol=1e-12)
    for i, slope in enumerate(slopes):
        step = 1e-5 * np.eye(theta.size)[i]
        up, down = (
            part_of(problem(), structure, theta + sign * step).driven(numerator)
            for sign in (1.0, -1.0)
        )
        expected = (up - down) / 2e-5
        # A held input changes at once: a sample that the delay moves over is no derivative.
        assert np.max(np.abs(slope - expected)) < 1e-5 * np.max(np.abs(expected))


def test_without_zeros_a_command_is_held_alone():
    part = part_of(problem(), STRUCTURES["third_order"], np.array([1.4, 1.2, 0.5, 0.3]))
    assert type(part) is Part


@pytest.mark.parametrize(
    ("numerator", "stated"),
    [
        (VELOCITY, None),
        (ACCELERATION, None),
        (ACCELERATION, "feedforward"),
        *in_studies((VELOCITY, "feedforward")),
    ],
)
def test_a_servo_with_feedforward_is_found(numerator, stated):
    pair = hmpim.identify(record(numerator, "feedforward", 3, stated=stated, noise=1e-4)).pairs[0]
    assert pair.intersample == "feedforward"
    # Two modes behind the hold would have much the same samples.
    assert pair.verdict == "ok" or stated is None
    assert len(pair.numerator) == len(numerator)
    for name, truth in {"delay": 0.0031, "natural_frequency": 25.0, "damping_ratio": 0.7}.items():
        found = getattr(pair, name)
        assert abs(found.value - truth) < 4.0 * found.spread
    assert pair.noise_std.value == pytest.approx(1e-4, rel=0.06)


@pytest.mark.parametrize("seed", [0, *in_studies(1, 2, 3)])
def test_zeros_behind_the_hold_stay_there(seed):
    pair = hmpim.identify(record(ACCELERATION, "zoh", seed)).pairs[0]
    assert pair.intersample in ("zoh", "foh")  # half a sample of delay apart


@pytest.mark.study
@pytest.mark.parametrize("stated", [None, "feedforward"])
def test_error_bars_are_the_scatter(stated):
    _check_coverage(range(100), stated)


def test_error_bars_are_the_scatter_of_a_few():
    # Which structure it is, other tests ask.
    _check_coverage(range(12), "feedforward", structures=["third_order_zeros"])


def _check_coverage(seeds, stated, structures=None):
    truth = {"delay": 0.0031, "natural_frequency": 25.0, "damping_ratio": 0.7, "scale_factor": 1.02}
    inside = []
    for seed in seeds:
        given = record(ACCELERATION, "feedforward", seed, stated=stated, noise=1e-4)
        pair = hmpim.identify(given, structures=structures).pairs[0]
        assert pair.intersample == "feedforward"
        for name, value in truth.items():
            low, high = getattr(pair, name).ci95
            inside.append(low <= value <= high)
    assert np.mean(inside) > 0.95 - 4.0 * np.sqrt(0.05 * 0.95 / len(seeds))


def test_the_model_predicts_as_it_was_fitted():
    whole = record(ACCELERATION, "feedforward", 5, noise=1e-6)
    pair = hmpim.identify(whole).pairs[0]
    assert pair.intersample == "feedforward"
    predicted = hmpim.predict(pair, whole)
    assert np.std(predicted.predicted - whole.outputs[0].values) < 2e-6


@pytest.mark.parametrize("name", ["washout", "four_modes", "second_order_zeros"])
def test_zeros_that_feedforward_does_not_make_are_refused(name):
    given = record(ACCELERATION, "feedforward", 1)
    with pytest.raises(ArgumentError, match=f"'{name}' has zeros that feedforward does not make"):
        hmpim.identify(given, structures=[name], intersample="feedforward")


def test_a_gap_in_the_command_spoils_no_sample_before_it():
    whole = record(ACCELERATION, "feedforward", 2, noise=1e-5)
    kept = np.ones(SAMPLES, dtype=bool)
    kept[605:625] = False
    u, y = whole.inputs[0].values[kept], whole.outputs[0].values[kept]
    given = hmpim.Record.from_arrays(
        {"u": u}, {"y": y}, time=TIME[kept], fs=FS, intersample="feedforward"
    )
    pair = hmpim.identify(given, structures=["third_order_zeros"]).pairs[0]
    assert pair.noise_std.value == pytest.approx(1e-5, rel=0.1)
    assert abs(pair.delay.value - 0.0031) < 4.0 * pair.delay.spread


def test_a_command_on_a_clock_of_its_own_is_held_alone():
    model = hmpim.Model(numerator=VELOCITY, **SERVO)
    fine = np.arange(2 * SAMPLES) / (2 * FS)
    y = hmpim.simulate(model, np.repeat(sweep(), 2), fs=2 * FS, intersample="zoh")
    given = hmpim.Record(
        inputs=(hmpim.Channel(name="u", time=TIME, values=sweep()),),
        outputs=(hmpim.Channel(name="y", time=fine, values=y + 1e-3),),
        fs=2 * FS,
        intersample="feedforward",
    )
    found = hmpim.identify(given, structures=["third_order_zero"])
    assert found.pairs[0].intersample == "zoh"


def test_statistics_take_the_command_as_held():
    pair = hmpim.identify(hmpim.compress(record(VELOCITY, "feedforward", 2), lags=300)).pairs[0]
    assert pair.intersample != "feedforward"


@pytest.mark.parametrize("target", ["scipy", "python"])
def test_exported_programs_play_the_model(target, tmp_path):
    given = record(ACCELERATION, "feedforward", 4, stated="feedforward", noise=1e-4)
    result = hmpim.identify(given, structures=["third_order_zeros"])
    (path,) = hmpim.export(result, to=target, path=tmp_path / "servo.py")
    simulate = runpy.run_path(str(path))["simulate"]
    played = simulate(sweep(), TIME) if target == "scipy" else simulate(sweep())
    wanted = hmpim.predict(result.pairs[0], given).predicted
    allowed = 0.05 if target == "scipy" else 1e-4  # a script knows the held command alone
    assert np.std(played - wanted) < allowed * np.std(wanted)


@pytest.mark.parametrize("seed", [0, *in_studies(2)])
def test_feedforward_is_found_where_four_poles_seem_to_lead(seed):
    fs, samples, w = 100.0, 1618, 2 * np.pi * 16.2
    time = np.arange(samples) / fs
    fade = np.clip(np.minimum(time, time[-1] - time) / 0.5, 0.0, 1.0)
    u = np.sin(0.5 * np.pi * fade) ** 2
    u *= np.sin(2 * np.pi * (0.1 * time + 17.35 / time[-1] * time**2))
    model = hmpim.Model(
        delay=0.2114,
        scale_factor=1.0,
        denominator=tuple(np.convolve([0.002, 1.0], [1 / w**2, 1.58 / w, 1.0])),
        numerator=(0.0114, 1.0),
    )
    y = hmpim.simulate(model, u, fs=fs, intersample="feedforward")
    y += 0.028 * np.random.default_rng(seed).standard_normal(samples)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=fs)).pairs[0]
    assert (pair.structure, pair.intersample) == ("third_order_zero", "feedforward")
    assert pair.parameters.delay.value == pytest.approx(0.2114, abs=0.001)  # a tenth of a sample
