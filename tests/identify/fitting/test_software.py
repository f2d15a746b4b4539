"""Software under test: filters in z, found with their delay in whole samples."""

import numpy as np
import pytest
from scipy import signal

import hmpim
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.rows import Problem
from hmpim.identify.fitting.sampled_rows import SampledPart
from hmpim.identify.fitting.software import is_exact, software_fit
from hmpim.model.dynamics import FILTERS, theta_of
from hmpim.model.sampled import prepare_input
from tests_support import assert_share, in_studies

FS = 200.0
TIME = np.arange(2000) / FS
SWEEP = 3.0 * np.sin(2 * np.pi * (0.1 * TIME + 2.0 * TIME**2))
CASES = {
    "z-6": ([1.0], [1.0], 6, "static"),
    "one pole": ([0.2], [1.0, -0.8], 3, "iir_1"),
    "Butterworth": (*signal.butter(3, 0.2), 2, "bilinear_3"),
    "alpha-beta": ([0.5, -0.4], [1.0, -1.4, 0.5], 0, "iir_2_zeros"),
    "moving average": (np.ones(5) / 5, [1.0], 0, "fir"),
}


def output(name, noise=0.0, seed=0):
    top, below, late, _ = CASES[name]
    moved = np.concatenate([np.zeros(late), SWEEP])[: SWEEP.size]
    clean = 2.0 * signal.lfilter(top, below, moved) + 0.4
    return clean + noise * np.random.default_rng(seed).standard_normal(clean.size)


@pytest.mark.parametrize("name", CASES)
def test_software_without_noise_is_found_to_the_last_digit_by_itself(name):
    top, below, late, structure = CASES[name]
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": SWEEP}, {"y": output(name)}, fs=FS))["y"]
    gain = 2.0 * np.sum(top) / np.sum(below)
    assert (pair.structure, pair.intersample, pair.verdict) == (structure, "sampled", "ok")
    assert pair.delay.value == late / FS
    assert pair.delay.ci95 == (late / FS, late / FS)
    assert pair.scale_factor.value == pytest.approx(gain, rel=1e-9)
    assert pair.bias.value == pytest.approx(0.4, abs=1e-9)
    assert not {w.code for w in pair.warnings} - {"beyond_band"}
    _, truth = signal.freqz(top, below, worN=np.array([1.0, 10.0, 30.0]), fs=FS)
    model = hmpim.to_model(pair, fs=FS)
    seen = hmpim.frequency_response(model, np.array([1.0, 10.0, 30.0]))
    truth = 2.0 * truth * np.exp(-2j * np.pi * np.array([1.0, 10.0, 30.0]) * late / FS)
    assert seen == pytest.approx(truth, rel=1e-6)


@pytest.mark.few(6)
@pytest.mark.parametrize("name", ["one pole", *in_studies(*(c for c in CASES if c != "one pole"))])
def test_under_noise_the_intervals_hold(name, seeds):
    """The few with the structure told: two in one pole's figures must hold at least."""
    top, below, late, structure = CASES[name]
    told = {"structures": [structure]} if seeds < 20 else {}
    held = {"delay": [], "scale_factor": [], "bias": []}
    truth = {"delay": late / FS, "scale_factor": 2.0 * np.sum(top) / np.sum(below), "bias": 0.4}
    for seed in range(seeds):
        record = hmpim.Record.from_arrays({"u": SWEEP}, {"y": output(name, 0.02, seed)}, fs=FS)
        pair = hmpim.identify(record, intersample="sampled", **told)["y"]
        for figure, value in truth.items():
            low, high = getattr(pair, figure).ci95
            held[figure].append(low - 1e-12 <= value <= high + 1e-12)
    for found in held.values():
        assert_share(found, at_least=0.9)


@pytest.mark.parametrize("begins", [None, 40])
@pytest.mark.parametrize("name", ["iir_2_zeros", "bilinear_3", "iir_4"])
def test_derivatives_are_those_by_differences(name, begins):
    structure = FILTERS[name]
    sections = {
        "iir_2_zeros": [4.0, 9.0],
        "bilinear_3": [4.0, 9.0, 3.0],
        "iir_4": [4.0, 9.0, 7.0, 4.0],
    }
    theta = np.append(5.0, theta_of(structure, sections[name]))
    problem = Problem(
        source=prepare_input(SWEEP[:300], "sampled"),
        y=np.zeros(300),
        valid=None,
        longest_delay=100.0,
        begins=begins,
    )
    numerator = np.array([1.0, 0.7, -0.3])[: structure.zeros + 1]
    initial = np.array([0.5, -0.2, 0.1, 0.3])[: structure.order if begins else 0]

    def made(theta):
        part = SampledPart(problem, structure, theta)
        free = initial @ part.free if begins else 0.0
        return numerator @ part.rows + free

    slopes = SampledPart(problem, structure, theta).slopes(numerator, initial)
    for j in range(1, theta.size):
        step = np.zeros(theta.size)
        step[j] = 1e-6
        numeric = (made(theta + step) - made(theta - step)) / 2e-6
        assert slopes[j] == pytest.approx(numeric, abs=1e-6 * np.abs(numeric).max() + 1e-9)


def test_the_bound_is_met():
    """The scatter over seeds is what the stated deviation says."""
    found = []
    for seed in range(20):
        joint = software_fit(SWEEP, output("one pole", 0.05, seed), structures=("iir_1",))
        fit = joint.best.fit
        rows = jacobian(joint.problem, fit)[1:]
        covariance = np.linalg.inv(rows @ rows.T) * 0.05**2
        found.append((fit.linear[0] - 2.0) / np.sqrt(covariance[1, 1]))
    spread = np.std(found)
    assert spread == pytest.approx(1.0, abs=3 / np.sqrt(2 * len(found)))


def test_a_sensor_is_not_taken_for_software():
    sensor = hmpim.Sensor(delay=0.0324, natural_frequency=12, damping_ratio=0.4)
    y = sensor.respond(SWEEP, fs=FS, intersample="zoh", rng=0)
    assert is_exact(SWEEP, y)  # a held input's output is an equation between samples as well
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": SWEEP}, {"y": y}, fs=FS))["y"]
    assert pair.intersample == "zoh"
    assert pair.delay.value == pytest.approx(0.0324, abs=1e-7)
    assert not is_exact(SWEEP, y + 1e-5 * np.random.default_rng(0).standard_normal(y.size))


def test_a_task_slower_than_the_record_is_software_too():
    index = np.arange(SWEEP.size) - 7
    y = np.where(index >= 0, SWEEP[np.maximum(index - index % 4, 0)], SWEEP[0])
    record = hmpim.Record.from_arrays({"u": SWEEP}, {"y": y}, fs=FS)
    pair = hmpim.identify(record, intersample="sampled")["y"]
    assert pair.delay.value == pytest.approx(7 / FS, abs=1e-12)
    assert pair.hold_period.value == pytest.approx(4 / FS, rel=1e-3)


WALK = 5.0 + 0.1 * np.cumsum(np.random.default_rng(0).standard_normal(2000))
MOVING = {
    "white": np.random.default_rng(0).standard_normal(2000),
    "a walk far from 0": WALK,
    "a cosine sweep": np.cos(2 * np.pi * (0.1 * TIME + TIME**2)),
}
FILTERED = {
    "z-6": lambda u: np.concatenate([np.zeros(6), u[:-6]]),
    "one pole": lambda u: signal.lfilter([0.2], [1.0, -0.8], u),
    "Butterworth": lambda u: signal.lfilter(*signal.butter(4, 0.2), u),
    "elliptic": lambda u: signal.lfilter(*signal.ellip(3, 1, 40, 0.2), u),
}


FROM_ZERO = [*(("white", name) for name in FILTERED), ("a cosine sweep", "z-6")]


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *FROM_ZERO,
        *in_studies(*((k, n) for k in MOVING for n in FILTERED if (k, n) not in FROM_ZERO)),
    ],
)
def test_a_filter_that_began_from_zero_in_the_midst_of_motion_is_found_without_a_remark(kind, name):
    """What a filter's memory holds before the record is nobody's: its first samples follow it."""
    u = MOVING[kind]
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": FILTERED[name](u)}, fs=FS))["y"]
    assert (pair.intersample, pair.verdict) == ("sampled", "ok")
    assert pair.delay.value == (6 / FS if name == "z-6" else 0.0)
    assert pair.scale_factor.value == pytest.approx(1.0, rel=1e-9)
    assert not {w.code for w in pair.warnings} - {"beyond_band", "initial_transient"}


@pytest.mark.parametrize("kind", ["a walk far from 0", "a step", *in_studies("white")])
def test_a_long_filter_without_poles_is_found_with_all_its_taps(kind):
    u = {**MOVING, "a step": np.repeat([0.0, 1.0], [100, 900])}[kind][:1000]
    taps = signal.firwin(20, 0.3)
    y = signal.lfilter(taps, [1.0], u)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))["y"]
    assert (pair.structure, pair.intersample, pair.verdict) == ("fir", "sampled", "ok")
    late = round(pair.delay.value * FS)
    assert np.pad(pair.numerator, (late, 0)) == pytest.approx(taps[: late + 20], abs=1e-8)


def test_a_filter_whose_first_tap_is_small_keeps_it_under_a_smooth_input():
    """One tap less at either end leaves 1e-9 of the output, all of them nothing but rounding."""
    u = np.sin(2 * np.pi * (0.08 * TIME + 0.5 * TIME**2))
    taps = np.convolve(np.ones(6), np.ones(7)) / 42
    y = signal.lfilter(taps, [1.0], u)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))["y"]
    assert (pair.delay.value, pair.verdict) == (0.0, "ok")
    assert pair.numerator == pytest.approx(tuple(taps), abs=1e-3)


def test_so_smooth_an_input_that_any_output_follows_it_tells_of_no_long_filter():
    u = np.cos(2 * np.pi * (0.1 * TIME + 0.2 * TIME**2))
    y = signal.lfilter(signal.firwin(21, 0.1), [1.0], u)
    assert software_fit(u, y).best.fit.structure.zeros < 16


def test_a_task_at_a_slower_rate_is_found_under_a_fast_sweep():
    """What it repeats looks more like another part of the sweep than like the one it answers."""
    u = 3.0 * np.sin(2 * np.pi * (0.1 * TIME + 4.0 * TIME**2))
    index = np.maximum(np.arange(u.size) - 8, 0)
    said = index - index % 7
    noise = 0.005 * np.random.default_rng(1).standard_normal(u.size)
    y = 0.5 * u[said] + noise[said]
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)
    pair = hmpim.identify(record, intersample="sampled")["y"]
    assert pair.delay.value == pytest.approx(8 / FS)
    assert pair.scale_factor.value == pytest.approx(0.5, rel=0.01)


def test_a_slow_filter_under_noise_is_found_at_its_own_delay():
    """Its first taps are far below the noise, and the equations' errors no errors of the output."""
    rng = np.random.default_rng(23)
    u = signal.lfilter([0.05], [1.0, -0.95], rng.standard_normal(1800))
    top, below = signal.butter(4, 0.06)
    y = signal.lfilter(top, below, np.concatenate([np.zeros(7), u])[: u.size])
    y = y + 0.005 * y.std() * rng.standard_normal(y.size)
    joint = software_fit(u, y)
    assert (joint.best.fit.structure.name, joint.best.fit.delay) == ("bilinear_4", 7.0)
