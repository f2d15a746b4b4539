"""Identification from statistics: the same figures as from the samples, and honest bars."""

import functools
import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim import HmpimError, Record, compress, identify
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.model.dynamics import STRUCTURES
from hmpim.model.sampled import prepare_input
from tests_support import fewest, rms_between

FS, TRUE = 200.0, {"delay": 0.15, "natural_frequency": 10.0, "damping_ratio": 0.4}
MODEL = hmpim.Model(
    delay=0.15,
    scale_factor=1.0,
    bias=0.6,
    noise_std=0.1,
    denominator=(1 / (20 * np.pi) ** 2, 0.8 / (20 * np.pi), 1.0),
)
QUICK = hmpim.Model(
    scale_factor=1.0,
    delay=0.012,
    noise_std=0.02,
    denominator=(1 / (28 * np.pi) ** 2, 1.2 / (28 * np.pi), 1.0),
)
FIGURES = ("delay", "scale_factor", "bias", "natural_frequency", "damping_ratio", "bandwidth_3db")


def chirped(seed, size=2000, *, model=MODEL, colour=0.0, intersample="bandlimited"):
    t = np.arange(size) / FS
    u = np.sin(2 * np.pi * (0.1 * t + 19.9 / (2 * size / FS) * t**2))
    rng = np.random.default_rng(seed)
    y = np.asarray(hmpim.simulate(model, u, fs=FS, intersample=intersample, rng=rng))
    if colour:
        y = y + lfilter([1.0], [1.0, -colour], 0.03 * rng.standard_normal(size))
    return Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample=intersample, band=(0.1, 20))


def test_memory_does_not_grow_with_the_samples():
    rng = np.random.default_rng(0)
    statistics, state, block = None, np.zeros(1), 100_000
    peaks, plain = [], {"structures": ["first_order"]}
    for blocks in (1, 19):
        for _ in range(blocks):
            u = np.repeat(rng.choice([-1.0, 1.0], block // 20), 20)
            y, state = lfilter([0.1], [1.0, -0.9], u, zi=state)
            y = y + 0.1 * rng.standard_normal(block)
            if statistics is None:
                record = Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="zoh")
                statistics = compress(record, lags=300)
                identify(statistics, **plain)  # what is kept once for all is in place
            else:
                statistics.update(u, y)
        tracemalloc.start()
        identify(statistics, **plain)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 1e6  # one array of two million samples takes 16 MB


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_figures_are_those_of_the_record(colour):
    record = chirped(3, colour=colour)
    compressed, whole = identify(compress(record))["y", "u"], identify(record)["y", "u"]
    assert compressed.structure == whole.structure == "second_order"
    assert compressed.verdict == whole.verdict == "ok"
    for name in FIGURES:
        here, there = getattr(compressed, name), getattr(whole, name)
        assert abs(here.value - there.value) < 0.05 * there.std, name
        if name == "bias" and colour:  # the lowest bins, which tell kinds of noise, are not kept
            assert 0.7 * there.std < here.std < 1.03 * there.std
            continue
        assert here.std == pytest.approx(there.std, rel=0.03), name
    assert compressed.noise_std.value == pytest.approx(whole.noise_std.value, rel=0.02)
    assert "no_samples" in [finding.code for finding in compressed.warnings]
    assert compressed.residual is None


def test_a_run_in_mid_motion_is_conditioned_and_says_so():
    record = chirped(5, 6000)
    u, y = record.inputs[0].values[2000:], record.outputs[0].values[2000:]
    cut = Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="bandlimited", band=(6, 20))
    pair = identify(compress(cut, lags=400))["y", "u"]
    assert "initial_transient" in [finding.code for finding in pair.warnings]
    for name, value in TRUE.items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 4 * estimate.std, name


def modes(*pairs):
    """Numerator and denominator of a sum of modes of equal gains, at (Hz, damping ratio)."""
    below = [np.array([1 / (2 * np.pi * f) ** 2, 2 * z / (2 * np.pi * f), 1.0]) for f, z in pairs]
    others = [
        functools.reduce(np.polymul, [b for j, b in enumerate(below) if j != i])
        for i in range(len(below))
    ]
    above = functools.reduce(np.polyadd, others) / len(below)
    return tuple(above), tuple(functools.reduce(np.polymul, below))


RICHER = {
    "third_order": ((1.0,), tuple(np.polymul([0.02, 1.0], MODEL.denominator))),
    "washout": ((0.1, 0.0), (0.1, 1.0)),
    "two_modes": modes((4.0, 0.05), (9.0, 0.05)),
}


@pytest.mark.parametrize("name", RICHER)
def test_richer_structures_are_found_as_from_the_record(name):
    numerator, denominator = RICHER[name]
    model = hmpim.Model(
        delay=0.05,
        scale_factor=1.0,
        bias=0.6,
        noise_std=0.01,
        numerator=numerator,
        denominator=denominator,
    )
    record = chirped(7, 6000, model=model)
    compressed = identify(compress(record))["y", "u"]
    whole = identify(record, structures=[name])["y", "u"]
    assert compressed.structure == name
    assert (
        abs(compressed.delay.value - whole.delay.value) < 0.25 * whole.delay.std
    )  # other samples at the ends
    assert compressed.delay.std == pytest.approx(whole.delay.std, rel=0.05)


def jointly(records, theta, lags, common):
    """Gauss-Newton on the samples of several records, each conditioned on its first ones."""
    structure = STRUCTURES["second_order"]
    for _ in range(30):
        x, d, y, n = [], [], [], []
        for i, record in enumerate(records):
            u, out = record.inputs[0].values, record.outputs[0].values
            source = prepare_input(u, "zoh")
            problem = Problem(source=source, y=out, valid=None, longest_delay=100.0)
            part = Part(problem, structure, theta)
            bias = np.zeros((1 if common else len(records), out.size))
            bias[0 if common else i] = 1.0
            x.append(part.rows[:, lags:])
            d.append(part.slopes(np.ones(1), np.empty(0))[:, lags:])
            y.append(out[lags:])
            n.append(bias[:, lags:])
        rows = np.vstack([np.hstack(x), np.hstack(n)])
        linear = np.linalg.lstsq(rows.T, np.hstack(y), rcond=None)[0]
        left = np.hstack(y) - linear @ rows
        every = np.vstack([np.hstack(d) * linear[0], rows])
        step = np.linalg.lstsq(every.T, left, rcond=None)[0]
        theta = theta + step[:3]
    cov = np.linalg.inv(every @ every.T) * (left @ left) / (left.size - every.shape[0])
    return theta, np.sqrt(np.diag(cov)[:3]), linear


@pytest.mark.parametrize("bias", ["own", "common"])
def test_joined_runs_give_what_a_joint_fit_gives(bias):
    shifted = hmpim.Model(
        delay=0.15,
        scale_factor=1.0,
        bias=0.6 if bias == "common" else -2.0,
        noise_std=0.1,
        denominator=MODEL.denominator,
    )
    records = [
        chirped(1, intersample="zoh"),
        chirped(2, 1400, model=shifted, intersample="zoh"),
    ]
    first, second = (compress(r, lags=250, bias=bias) for r in records)
    pair = identify(first + second, structures=["second_order"])["y", "u"]
    zeta, omega = pair.damping_ratio.value, 2 * np.pi * pair.natural_frequency.value / FS
    start = np.array([pair.delay.value * FS, np.log(2 * zeta / omega), 0.25 / zeta**2])
    theta, std, linear = jointly(
        records, start + 0.3 * np.array([0.1, 0.05, 0.1]), 250, bias == "common"
    )
    assert np.all(np.abs(theta - start) < 1e-4 * std)
    assert pair.delay.std * FS == pytest.approx(std[0], rel=1e-3)
    expected = linear[1] if bias == "common" else linear[1:].mean()
    assert pair.bias.value == pytest.approx(expected, abs=1e-4 * pair.bias.std)


def test_a_drifting_bias_on_knots_is_no_response():
    record = chirped(4)
    drift = np.interp(np.arange(2000), [0, 800, 2000], [0.0, 3.0, -1.0])
    moved = Record.from_arrays(
        {"u": record.inputs[0].values},
        {"y": record.outputs[0].values + drift},
        fs=FS,
        intersample="bandlimited",
        band=(0.1, 20),
    )
    pair = identify(compress(moved, knots=(0, 4, 10)))["y", "u"]
    assert pair.verdict == "ok"
    for name, value in TRUE.items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 4 * estimate.std, name
    assert pair.bias.value == pytest.approx(0.6 + drift.mean(), abs=4 * pair.bias.std)


def test_any_unit_will_do():
    record = chirped(6)
    u, y = (1e80 * signal.values for signal in (record.inputs[0], record.outputs[0]))
    scaled = Record.from_arrays(
        {"u": u}, {"y": y}, fs=FS, intersample="bandlimited", band=(0.1, 20)
    )
    plain, found = (identify(compress(one))["y", "u"] for one in (record, scaled))
    assert found.structure == "second_order"
    assert found.delay.value == pytest.approx(plain.delay.value, abs=1e-3 * plain.delay.std)
    assert found.bias.value == pytest.approx(1e80 * plain.bias.value, rel=1e-6)


def test_noise_alone_is_unrelated():
    rng = np.random.default_rng(0)
    record = Record.from_arrays(
        {"u": chirped(0).inputs[0].values}, {"y": rng.standard_normal(2000)}, fs=FS
    )
    (together,), (alone,) = identify(compress(record)), identify(record)
    assert together.verdict == alone.verdict == "not_identifiable"
    assert together.noise_std.value == pytest.approx(alone.noise_std.value, rel=1e-2)
    assert together.noise_std.verdict == alone.noise_std.verdict == "doubtful"


@pytest.mark.parametrize("lags", [1, 5, 10])
def test_a_window_shorter_than_what_does_not_count_is_refused_by_name(lags):
    with pytest.raises(HmpimError, match=rf"window of {lags} samples.*compress with lags="):
        identify(compress(chirped(3, model=QUICK), lags=lags), structures=["second_order"])


def test_memory_beyond_the_window_is_refused_by_name():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(4000)
    y = lfilter([0.0, 0.01], [1.0, -0.995], u) + 0.001 * rng.standard_normal(4000)
    slow = Record.from_arrays({"u": u}, {"y": y}, fs=100.0, intersample="zoh")
    with pytest.raises(
        HmpimError, match=r"window of 150 samples.*compress with lags=3\d\d or more"
    ):
        identify(compress(slow, lags=150), structures=["first_order"])
    integrated = Record.from_arrays({"u": u}, {"y": np.cumsum(u)}, fs=100.0, intersample="zoh")
    with pytest.raises(HmpimError, match="as if it integrated the input"):
        identify(compress(integrated, lags=150), structures=["first_order"])
    for behind in ([1.0], [0.0, 0.2]):  # alone, and behind a lag of some 4 samples
        y = np.cumsum(lfilter(behind, [1.0, np.sum(behind) - 1.0], chirped(3).inputs[0].values))
        y += rng.standard_normal(y.size)
        integrated = Record.from_arrays({"u": chirped(3).inputs[0].values}, {"y": y}, fs=FS)
        with pytest.raises(HmpimError, match=r"integrate[sd] the input"):
            identify(compress(integrated), structures=["first_order"])
    with pytest.raises(HmpimError, match="input 'u' is constant at 2"):
        identify(compress(Record.from_arrays({"u": np.full(99, 2.0)}, {"y": u[:99]}, fs=1.0)))
    with pytest.raises(HmpimError, match="40 samples were read; at least 50"):
        identify(compress(Record.from_arrays({"u": u[:40]}, {"y": y[:40]}, fs=100.0)))


def held(seeds):
    """Share of 95 % intervals that hold, by parameter; and errors over their bars, squared."""
    inside, squared = [], []
    for seed in seeds:
        pair = identify(compress(chirped(seed)), structures=["second_order"])["y", "u"]
        errors = {name: getattr(pair, name) for name in TRUE}
        inside.append([e.ci95[0] <= TRUE[name] <= e.ci95[1] for name, e in errors.items()])
        squared.append([((e.value - TRUE[name]) / e.std) ** 2 for name, e in errors.items()])
    return np.mean(inside, axis=0), np.mean(squared, axis=0)


def test_intervals_hold():
    count = 10
    inside, squared = held(range(count))
    assert np.all(np.rint(inside * count) >= fewest(count, 0.92))
    low, high = rms_between(count)
    assert np.all(np.sqrt(squared) > low)
    assert np.all(np.sqrt(squared) < high)


@pytest.mark.study
def test_intervals_hold_over_many_seeds_and_reach_the_bound():
    inside, squared = held(range(400))
    assert np.all(inside > 0.92)
    assert np.all(inside < 0.98)
    assert squared == pytest.approx(1.0, abs=0.22)


def test_an_output_that_moves_only_where_nothing_counts_is_refused_by_name():
    u = np.sin(0.05 * np.arange(500))
    y = np.eye(500)[20]
    with pytest.raises(HmpimError, match="output 'y' moves only in the first 100 samples"):
        identify(compress(Record.from_arrays({"u": u}, {"y": y}, fs=FS), lags=100))
