"""Records that ended in tracebacks: numbers of any size, trim, masks, plain sweeps at once."""

import numpy as np
import pytest

import hmpim
from hmpim.errors import RecordError
from tests_support import answer_of

FS = 100.0
T = np.arange(1000) / FS
SWEEP = np.sin(2 * np.pi * (0.2 * T + 0.9 * T**2))
NOISE = 0.01 * np.random.default_rng(1).standard_normal(T.size)
STATIC = ("static", "first_order")


def lagged(u, pole=0.7):
    y = np.zeros_like(u)
    y[0] = u[0]
    for k in range(1, u.size):
        y[k] = pole * y[k - 1] + (1 - pole) * u[k - 1]
    return y


def found(u, y, **clock):
    clock = clock or {"fs": FS}
    return hmpim.identify(hmpim.Record.from_arrays(u, y, **clock), structures=STATIC)["y", "u"]


@pytest.fixture(scope="module")
def plain():
    return found(SWEEP, lagged(SWEEP) + NOISE)


@pytest.mark.parametrize("size", [1e-70, 1e70])
@pytest.mark.parametrize("which", ["input", "output", "both", "time"])
def test_a_unit_of_any_size_gives_the_same_result(plain, size, which):
    y = lagged(SWEEP) + NOISE
    sizes = {"input": (size, 1, 1), "output": (1, size, 1), "both": (size, size, 1)}
    a, b, c = sizes.get(which, (1, 1, size))
    pair = found(a * SWEEP, b * y, **({"fs": FS} if c == 1 else {"time": c * T}))
    assert pair.verdict == plain.verdict
    for name, unit in (("scale_factor", b / a), ("time_constant", c), ("bias", b), ("delay", c)):
        estimate, wanted = getattr(pair, name), getattr(plain, name)
        assert estimate.value == pytest.approx(wanted.value * unit, rel=1e-3, abs=1e-4 * unit)
        assert estimate.std == pytest.approx(wanted.std * unit, rel=1e-2)


@pytest.mark.parametrize("size", [1e-300, 1e-100, 1e100, 1e300])
@pytest.mark.parametrize("which", ["u", "y", "time"])
def test_numbers_that_cannot_be_squared_are_refused(size, which):
    u, y = (SWEEP, lagged(SWEEP) + NOISE)
    u, y = (u * size if which == "u" else u, y * size if which == "y" else y)
    clock = {"time": size * T} if which == "time" else {"fs": FS}
    with pytest.raises(RecordError, match=r"stamps, which are seconds|another unit"):
        found(u, y, **clock)


@pytest.mark.parametrize("trim", [0.0, 3.7, -1e5])
@pytest.mark.parametrize("shape", ["sweep", "doublet", "3-2-1-1"])
def test_an_input_that_rests_exactly_at_its_trim_value(trim, shape):
    """Stick inputs of flight tests: at rest but for a few seconds, every sample the same there."""
    moved = np.zeros(T.size)
    if shape == "sweep":
        t = T[300:600] - 3.0
        moved[300:600] = np.sin(2 * np.pi * (0.3 * t + 1.2 * t**2))
    else:
        lengths = (100, 100) if shape == "doublet" else (150, 100, 50, 50)
        start = 300
        for k, length in enumerate(lengths):
            moved[start : start + length] = (-1.0) ** k
            start += length
    pair = found(moved + trim, 2.0 * lagged(moved) + 0.5 + NOISE)
    assert abs(pair.scale_factor.value - 2.0) < 5 * pair.scale_factor.std
    assert pair.scale_factor.std < 0.05
    steps = hmpim.paper_analysis(moved + trim, 2.0 * lagged(moved) + 0.5 + NOISE, FS)
    assert np.isfinite(steps.estimates.delay)


def hidden(values, at):
    return np.ma.masked_array(values, mask=at)


def test_masks_that_leave_no_sample_in_common():
    """Every other sample of each, never both: the output's own clock counts."""
    even = np.arange(T.size) % 2 == 0
    y = lagged(SWEEP) + NOISE
    pair = found(hidden(SWEEP, even), hidden(y, ~even))
    assert pair.scale_factor.value == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("kept", [0, 1, 5, 49])
def test_masks_that_leave_next_to_nothing_are_refused(kept):
    with pytest.raises(RecordError, match=f"channel 'y' has {kept} samples; at least"):
        found(SWEEP, hidden(lagged(SWEEP), np.arange(T.size) >= kept))


def test_parts_that_never_overlap_are_refused():
    first = T < 5.0
    with pytest.raises(RecordError):
        found(hidden(SWEEP, first), hidden(lagged(SWEEP), ~first))


def test_what_a_mask_hides_is_not_looked_at(plain):
    y = lagged(SWEEP) + NOISE
    at = (T > 4.0) & (T < 4.2)
    pair = found(SWEEP, hidden(np.where(at, 1e6, y), at))
    assert abs(pair.delay.value - plain.delay.value) < 3 * plain.delay.std
    assert pair.noise_std.value == pytest.approx(0.01, rel=0.15)
    assert "gaps" in [w.code for w in pair.warnings]


def test_five_plain_sweeps_at_once():
    """Alike in all but their last frequency, and over most of the record each like the next."""
    inputs = {f"u{k}": np.sin(2 * np.pi * (0.1 * T + (2.0 + k) / 20 * T**2)) for k in range(5)}
    y = sum((k + 1) * u for k, u in enumerate(inputs.values())) + NOISE
    result = hmpim.identify(
        hmpim.Record.from_arrays(inputs, {"y": y}, fs=FS, intersample="bandlimited"),
        structures=("static",),
    )
    truth = dict(zip(inputs, range(1, 6), strict=True))
    told = {pair.input: pair.scale_factor for pair in result if pair.verdict == "ok"}
    assert len(result.pairs) == 5
    assert told
    for name, gain in told.items():
        assert abs(gain.value - truth[name]) < 5 * gain.std


def test_small_spikes_show_once_the_large_ones_are_out(field_record):
    """Spikes of fifty times the range move the first fit so far that those of half of it hide."""
    _, u, y = (x[:600] for x in field_record)
    rng = np.random.default_rng(1)
    noisy = y + 0.01 * rng.standard_normal(y.size)
    at = rng.choice(np.arange(60, 580), 8, replace=False)
    noisy[at] += [50.0, -50.0, 50.0, -50.0, 0.6, -0.8, 0.7, -1.0]
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0))["y", "u"]
    assert "8 samples" in next(w.message for w in pair.warnings if w.code == "spikes")
    assert pair.parameters.noise_std.value == pytest.approx(0.01, rel=0.15)


def test_losses_so_dense_that_no_output_is_clear_of_them_are_noise():
    rng = np.random.default_rng(3)
    t = np.arange(1600) / 200
    u = np.sin(2 * np.pi * (0.2 * t + 0.3 * t**2))
    y = answer_of([1.0], [1 / 6.0**2, 2 * 0.4 / 6.0, 1.0], u, t)
    y += 0.02 * rng.standard_normal(t.size)
    kept = rng.random(t.size) > 0.08
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u[kept]}, {"y": y[kept]}, time=t[kept]))[
        "y", "u"
    ]
    assert pair.scale_factor.value == pytest.approx(1.0, abs=0.01)
    assert pair.natural_frequency.value == pytest.approx(6.0 / (2 * np.pi), rel=0.02)
