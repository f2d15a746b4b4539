"""Intervals that cover what a record cannot tell: held, linear or band-limited."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.reading.figures import figures_of
from hmpim.identify.reading.readings import read_parameters
from hmpim.identify.reading.spanned import rivals_of
from tests_support import assert_share

FS = 200.0
SENSOR = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1)
TIME = np.arange(2000) / FS
SWEEP = 3.0 * np.sin(2 * np.pi * (0.1 * TIME + 0.995 * TIME**2))
TRUTH = {"delay": 0.15, "natural_frequency": 10.0, "damping_ratio": 0.4, "bias": 0.6}


def found(between, seed, *, stated=None):
    y = SENSOR.respond(SWEEP, fs=FS, intersample=between, rng=seed)
    record = hmpim.Record.from_arrays({"u": SWEEP}, {"y": y}, fs=FS, intersample=stated)
    return hmpim.identify(record)["y", "u"]


@pytest.mark.few(1)
@pytest.mark.parametrize("between", ["zoh", "foh", "bandlimited"])
def test_the_interval_holds_whatever_the_input_does_between_its_samples(between, seeds):
    pairs = [found(between, 6 + seed) for seed in range(seeds)]
    for name, truth in TRUTH.items():
        estimates = [getattr(pair, name) for pair in pairs]
        held = [e.ci95[0] <= truth <= e.ci95[1] for e in estimates]
        assert_share(held, at_least=0.93)
        assert all(e.verdict == "ok" for e in estimates), name
    delay = pairs[0].delay
    assert delay.std is None
    low, high = delay.value - delay.ci95[0], delay.ci95[1] - delay.value
    assert 0.0022 < low < 0.0028  # half a sample, and the error
    assert high < 0.0003


def test_what_is_stated_costs_nothing():
    open_, stated = found("bandlimited", 6), found("bandlimited", 6, stated="bandlimited")
    assert stated.delay.value == pytest.approx(open_.delay.value, abs=1e-7)
    assert stated.delay.std < 0.0001
    assert stated.delay.ci95[1] - stated.delay.ci95[0] < 0.0002
    assert "intersample" in {w.code for w in open_.warnings}
    assert "intersample" not in {w.code for w in stated.warnings}


def test_an_assumption_that_the_record_excludes_widens_nothing():
    """A held input that moves at every sample: the output tells that it is held."""
    u = np.random.default_rng(0).standard_normal(2000)
    fast = hmpim.Sensor(delay=0.015, natural_frequency=60, damping_ratio=0.4, noise_std=0.01)
    joint = joint_fit(u, fast.respond(u, fs=FS, intersample="zoh", rng=1))
    assert joint.best.intersample == "zoh"
    assert rivals_of(joint) == ()


@pytest.mark.parametrize("structure", ["second_order", "first_order", "integrator", "washout"])
def test_values_alone_are_those_with_error_bars(structure):
    y = SENSOR.respond(SWEEP, fs=FS, intersample="bandlimited", rng=3)
    joint = joint_fit(SWEEP, y, intersample="bandlimited", structures=(structure,))
    read = read_parameters(joint, fs=FS, highest=20.0, delay_correlation=None, units=("", ""))
    values = figures_of(joint.best.fit, fs=FS, highest=20.0)
    for name, value in values.items():
        estimate = getattr(read.parameters, name)
        assert (estimate is None) == (value is None), name
        assert estimate is None or estimate.value == pytest.approx(value), name


def test_a_pulse_that_rises_over_several_samples_is_not_held():
    u = np.zeros(2000)
    u[500:510] = np.sin(np.pi * np.arange(10) / 10)
    quiet = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.001)
    y = quiet.respond(u, fs=FS, intersample="bandlimited", rng=0)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))["y", "u"]
    low, high = pair.delay.ci95
    assert low <= 0.15 <= high


def test_a_zero_that_hardly_shows_is_covered():
    """Of four fifths of a sample, which the price of a parameter keeps out."""
    model = hmpim.Model(
        delay=0.15,
        scale_factor=1.0,
        numerator=(4e-3, 1.0),
        denominator=(1 / (2 * np.pi * 10) ** 2, 0.8 / (2 * np.pi * 10), 1.0),
    )
    answer = model.simulate(SWEEP, TIME)
    held = []
    for seed in range(20):
        y = answer + 0.3 * np.random.default_rng(seed).standard_normal(TIME.size)
        record = hmpim.Record.from_arrays({"u": SWEEP}, {"y": y}, fs=FS, intersample="bandlimited")
        delay = hmpim.identify(record)["y", "u"].delay
        if delay.verdict == "ok":
            held.append(delay.ci95[0] <= 0.15 <= delay.ci95[1])
    assert len(held) >= 5
    assert_share(held, at_least=0.95)


@pytest.mark.parametrize("seed", [0, 4])
def test_a_figure_that_a_model_allowed_does_not_have_is_open(seed):
    """A lag alone is a pair of poles of which one is infinitely fast."""
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=8, damping_ratio=0.9, noise_std=2.0)
    y = sensor.respond(SWEEP, fs=FS, intersample="bandlimited", rng=seed)
    record = hmpim.Record.from_arrays({"u": SWEEP}, {"y": y}, fs=FS, intersample="bandlimited")
    pair = hmpim.identify(record)["y", "u"]
    assert pair.structure == "second_order"
    low, high = pair.natural_frequency.ci95
    assert low < 8.0
    assert high is None
    assert pair.natural_frequency.verdict == "doubtful"
    assert None not in pair.delay.ci95
