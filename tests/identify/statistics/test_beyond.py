"""What no linear system does, told from statistics: it is found, and seldom where it is not."""

import hashlib
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim import Record, compress, identify
from hmpim.identify.statistics.beyond import held_for
from hmpim.identify.statistics.products import Products, Responses
from hmpim.identify.statistics.reach import AHEAD
from hmpim.identify.statistics.run import Run, cubes_by, of_cubes
from tests_support import assert_share, in_studies

FS = 200.0
MODEL = hmpim.Model(
    scale_factor=1.0,
    delay=0.02,
    noise_std=0.003,
    denominator=(1 / (24 * np.pi) ** 2, 1.0 / (24 * np.pi), 1.0),
)


def swept(size=2000):
    t = np.arange(size) / FS
    return np.sin(2 * np.pi * (0.5 * t + 24.5 / (2 * size / FS) * t**2))


def dead_zone(u, half=0.05):
    return np.sign(u) * np.maximum(np.abs(u) - half, 0.0)


def answered(u, seed=0, *, bent=None, model=MODEL):
    moved = u if bent is None else bent(u)
    y = hmpim.simulate(model, moved, fs=FS, intersample="bandlimited", rng=seed)
    return Record.from_arrays({"u": u}, {"y": np.asarray(y)}, fs=FS, intersample="bandlimited")


def kept_for(y, count):
    """An output that is updated at every so many samples."""
    return y[np.arange(y.size) // count * count]


def codes(statistics):
    plain = identify(statistics, structures=["second_order"])
    return [finding.code for finding in plain["y", "u"].warnings]


@pytest.mark.few(10)
@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_a_linear_system_is_not_accused(seeds, colour):
    accused = []
    for seed in range(seeds):
        record = answered(swept(), seed)
        noise = lfilter([1.0], [1.0, -colour], np.random.default_rng(seed).normal(0, 0.01, 2000))
        y = record.outputs[0].values + noise
        linear = Record.from_arrays({"u": swept()}, {"y": y}, fs=FS, intersample="bandlimited")
        accused.append(bool({"nonlinear", "held_output"} & set(codes(compress(linear)))))
    assert_share(accused, at_most=0.001)


@pytest.mark.few(3)
def test_a_dead_zone_is_doubted(seeds):
    for seed in range(seeds):
        statistics = compress(answered(swept(), seed, bent=dead_zone))
        pair = identify(statistics, structures=["second_order"])["y", "u"]
        assert pair.verdict == pair.scale_factor.verdict == "doubtful"
        (found,) = (finding for finding in pair.warnings if finding.code == "nonlinear")
        assert found.severity == "doubt"
        assert "friction" in found.message


def test_a_binary_input_tells_nothing_of_it():
    bits = np.where(np.random.default_rng(1).standard_normal(400) > 0, 1.0, -1.0)
    u = np.repeat(bits, 5)
    y = 0.7 * np.concatenate([np.zeros(3), u[:-3]]) ** 3  # which is u
    y = y + np.random.default_rng(2).normal(0, 0.01, u.size)
    record = Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="zoh")
    assert "nonlinear" not in codes(compress(record))


@pytest.mark.parametrize("count", [3, *in_studies(8)])
def test_a_held_output_is_doubted(count):
    record = answered(swept(3000))
    held = kept_for(record.outputs[0].values, count)
    statistics = compress(Record.from_arrays({"u": swept(3000)}, {"y": held}, fs=FS))
    assert held_for(statistics) == pytest.approx(count)
    pair = identify(statistics)["y", "u"]
    assert pair.delay.verdict == "doubtful"
    assert pair.delay.ci95 is None


def test_rounding_is_not_holding():
    quiet = replace(MODEL, noise_std=1e-4)
    y = np.round(answered(swept(), model=quiet).outputs[0].values, 1)
    assert np.mean(np.diff(y) == 0) > 0.15
    assert held_for(compress(Record.from_arrays({"u": swept()}, {"y": y}, fs=FS))) is None


def test_block_by_block_gives_the_same():
    record = answered(swept(), bent=dead_zone)
    size = 2000
    grows = np.linspace(1e-6, 1.0, size)  # so that the scale does too
    u, y = record.inputs[0].values * grows, kept_for(record.outputs[0].values, 3)
    whole = compress(Record.from_arrays({"u": u}, {"y": y}, fs=FS), lags=100)
    parts = compress(Record.from_arrays({"u": u[:20]}, {"y": y[:20]}, fs=FS), lags=100)
    for first, last in ((20, 21), (21, 60), (60, 700), (700, 702), (702, size)):
        parts.update(u[first:last], y[first:last])
    for name in ("scale", "ww", "wu", "vw", "stood"):
        one, other = (getattr(of.runs[0], name) for of in (whole, parts))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-9 * np.abs(one).max(), err_msg=name)
    assert whole.runs[0].stood[1:] @ np.arange(1, 65) + whole.runs[0].stood[0] == size


@pytest.mark.parametrize("skipped", [0, 40])
@pytest.mark.parametrize("noise", [[1.0], [1.0, -0.6, 0.2]])
@pytest.mark.parametrize("to_the_end", [False, True])
def test_products_of_cube_and_input_are_sums_over_the_samples(to_the_end, skipped, noise):
    rng = np.random.default_rng(3)
    records = [
        Record.from_arrays({"u": scale * rng.standard_normal(300)}, {"y": rng.random(300)}, fs=FS)
        for scale in (1.0, 7.0)
    ]
    statistics = sum(compress(record, lags=60) for record in records)
    reach, scale = statistics.reach, 8.0
    thirds = replace(statistics, runs=tuple(of_cubes(r, reach, scale) for r in statistics.runs))
    inputs, cubes = (
        Products(one, skipped=skipped, noise=np.array(noise), to_the_end=to_the_end)
        for one in (statistics, thirds)
    )
    one, other = rng.standard_normal((2, 3, reach.taps))
    lags = sum(cubes_by(run, reach, scale, to_the_end=to_the_end) for run in statistics.runs)
    made = cubes.across(ending(one), inputs, ending(other), lags)
    direct = np.zeros((3, 3))
    for record in records:
        u = record.inputs[0].values - record.inputs[0].values[0]
        rows = [
            counted(rows, x, noise, skipped, to_the_end=to_the_end)
            for rows, x in ((one, (u / scale) ** 3), (other, u))
        ]
        direct += rows[0] @ rows[1].T
    np.testing.assert_allclose(made, direct, rtol=0, atol=1e-9 * np.abs(direct).max())


def ending(rows):
    return Responses.ending(rows, np.zeros(rows.shape[0]))


def counted(rows, x, noise, skipped, *, to_the_end):
    """What responses make of an input, continued as `closed` does, whitened and less its bias."""
    after = 2 * x[-1] - x[-2 : -2 - AHEAD : -1]
    padded = np.concatenate([x, after])
    last = AHEAD + x.size - AHEAD * (not to_the_end)
    made = np.array([np.convolve(row, padded)[AHEAD:last] for row in rows])
    first = len(noise) - 1 + skipped
    white = lfilter(noise, [1.0], made)[:, first:]
    return white - white.mean(axis=1, keepdims=True)


def test_runs_that_are_joined_are_told_together():
    parts = [compress(answered(swept(), seed, bent=dead_zone), lags=150) for seed in (1, 2)]
    assert "nonlinear" in codes(parts[0] + parts[1])
    common = parts[0].join(parts[1], bias="common")
    assert "nonlinear" in codes(common)
    lines = [compress(answered(swept(), seed), lags=150) for seed in (1, 2)]
    assert "nonlinear" not in codes(lines[0] + lines[1])


def as_first_schema(path):
    """Rewrite a file as it was before the cube was kept."""
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = "hmpim/statistics/1"
        del file.attrs["beyond"]
        for i in range(int(file.attrs["runs"])):
            for name in ("scale", "ww", "wu", "vw", "stood"):
                del file[f"run {i}"][name]
        digest = hashlib.sha256()
        for i in range(int(file.attrs["runs"])):
            group = file[f"run {i}"]
            digest.update(str(int(group.attrs["samples"])).encode())
            for name in Run.__dataclass_fields__:
                if name in group:
                    digest.update(np.ascontiguousarray(group[name][()]).tobytes())
        file.attrs["sha256"] = digest.hexdigest()


def test_a_file_of_before_is_read_and_joined(tmp_path):
    new = compress(answered(swept(), 1, bent=dead_zone), lags=150)
    hmpim.save(new, tmp_path / "new.h5")
    assert hmpim.load(tmp_path / "new.h5") == new
    hmpim.save(new, tmp_path / "old.h5")
    as_first_schema(tmp_path / "old.h5")
    old = hmpim.load(tmp_path / "old.h5")
    assert "nonlinear" in codes(new)
    assert "nonlinear" not in codes(old)
    plain = {"structures": ["second_order"]}
    here, there = (identify(which, **plain)["y", "u"].delay for which in (new, old))
    assert here.value == there.value
    joined = old + compress(answered(swept(), 2, bent=dead_zone), lags=150)
    assert joined.nbytes < new.nbytes + old.nbytes
    assert "nonlinear" not in codes(joined)
    continued = old.update(np.zeros(500), np.zeros(500))
    assert continued.samples == 2500


def test_a_live_estimate_keeps_none_of_it():
    stimulus = hmpim.Stimulus(waveform=hmpim.Chirp(band=(0.5, 20), duration=5), fs=FS)
    live = hmpim.LiveEstimator(stimulus)
    live.read(stimulus.position, stimulus.position)
    assert not live.statistics.runs[0].cubed
    lags = live.statistics.lags
    record = Record.from_arrays({"u": stimulus.position}, {"y": stimulus.position}, fs=FS)
    assert live.statistics.nbytes < compress(record, lags=lags).nbytes


def test_statistics_of_a_schema_to_come_are_refused_by_its_name(tmp_path):
    record = hmpim.Record.from_arrays(
        {"u": np.sin(np.arange(300) / 9)}, {"y": np.cos(np.arange(300) / 9)}, fs=100.0
    )
    path = tmp_path / "later.h5"
    hmpim.save(hmpim.compress(record, lags=20), path)
    with h5py.File(path, "r+") as file:
        file.attrs["schema"] = "hmpim/statistics/9"
    with pytest.raises(hmpim.HmpimError, match="holds hmpim/statistics/9"):
        hmpim.load(path)
