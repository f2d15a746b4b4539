import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import signal

from hmpim.errors import ArgumentError
from hmpim.identify.frf.local import local_response, local_responses
from tests_support import examples

FS, BAND = 200.0, (0.1, 20.0)
SEEDS = int(os.environ.get("HMPIM_SEEDS", "60"))


def chirp(t: np.ndarray) -> np.ndarray:
    t = np.maximum(t, 0.0)
    return np.sin(2 * np.pi * (0.1 * t + 0.995 * t**2))


def second_order(f: np.ndarray, delay: float = 0.15) -> np.ndarray:
    s, w = 2j * np.pi * f, 2 * np.pi * 10
    return w**2 / (s**2 + 0.8 * w * s + w**2) * np.exp(-s * delay)


def clean_output(delay: float = 0.15, seconds: float = 10.0) -> np.ndarray:
    """docs/field.md's system without noise: 10 Hz, ζ 0.4, bias 0.6; input linear over 1/6400 s."""
    fine, w = 32, 2 * np.pi * 10
    t = np.arange(round(seconds * FS) * fine) / (FS * fine)
    matrices = ([[0, 1], [-(w**2), -0.8 * w]], [[0], [w**2]], [[1.0, 0]], [[0.0]])
    step = signal.cont2discrete(tuple(map(np.array, matrices)), 1 / (FS * fine), "foh")
    numerator, denominator = signal.ss2tf(*step[:4])
    return signal.lfilter(numerator[0], denominator, chirp(t - delay))[::fine] + 0.6


U = chirp(np.arange(2000) / FS)
CLEAN = clean_output()


def study(*, noise: float, delay: float, seeds: int) -> tuple[np.ndarray, ...]:
    """Frequency, and error and stated standard deviation of each seed at each frequency."""
    errors, stds = [], []
    for seed in range(seeds):
        y = CLEAN + noise * np.random.default_rng(seed).standard_normal(CLEAN.size)
        found = local_response(U, y, FS, band=BAND, delay=delay)
        errors.append(found.response - second_order(found.frequency))
        stds.append(found.std)
    return found.frequency, np.array(errors), np.array(stds)


@pytest.fixture(scope="module")
def field_record() -> tuple[np.ndarray, ...]:
    return study(noise=0.1, delay=0.15, seeds=SEEDS)


def test_median_error_on_the_field_record_is_at_most_2_percent(
    field_record: tuple[np.ndarray, ...],
) -> None:
    frequency, error, _ = field_record
    relative = np.abs(error) / np.abs(second_order(frequency))
    per_seed = np.median(relative[:, frequency >= 0.5], axis=1)
    assert np.median(per_seed) < 0.016  # 1.4 % over many seeds
    assert np.mean(per_seed <= 0.02) > 0.9


def test_stated_errors_agree_with_the_scatter(field_record: tuple[np.ndarray, ...]) -> None:
    frequency, error, std = field_record
    for low, high in ((0.0, 5.0), (5.0, 10.0), (10.0, 15.0), (15.0, 20.0)):
        part = (frequency >= low) & (frequency < high)
        ratio = np.sqrt(np.mean(np.abs(error[:, part]) ** 2) / np.mean(std[:, part] ** 2))
        assert 0.8 < ratio < 1.25, (low, high)
    # |error|/std is Rayleigh distributed: 63 % lie within one, 98 % within two.
    assert np.mean(np.abs(error) < std) == pytest.approx(1 - np.exp(-1), abs=0.05)
    assert np.mean(np.abs(error) < 2 * std) == pytest.approx(1 - np.exp(-4), abs=0.02)


@pytest.mark.study
@pytest.mark.parametrize("delay", [0.145, 0.163, 0.17])
def test_a_delay_known_only_roughly_is_enough(delay: float) -> None:
    frequency, error, _ = study(noise=0.1, delay=delay, seeds=max(SEEDS // 3, 10))
    relative = np.abs(error) / np.abs(second_order(frequency))
    assert np.median(relative[:, frequency >= 0.5]) < 0.02


def test_without_noise_what_remains_is_curvature() -> None:
    frequency, error, _ = study(noise=0.0, delay=0.15, seeds=1)
    relative = np.abs(error[0]) / np.abs(second_order(frequency))
    assert np.median(relative[frequency >= 0.5]) < 0.001


def test_more_noise_more_stated_error_in_proportion() -> None:
    y = np.random.default_rng(0).standard_normal(U.size)
    one = local_response(U, U + 0.1 * y, FS, band=BAND)
    ten = local_response(U, U + 1.0 * y, FS, band=BAND)
    np.testing.assert_allclose(ten.std, 10 * one.std, rtol=1e-3)


@examples(10)
@given(st.integers(0, 200), st.floats(0.2, 5.0), st.sampled_from([-1, 1]), st.floats(-50, 50))
def test_a_delayed_scaled_biased_copy_is_exact(
    k: int, scale: float, sign: int, bias: float
) -> None:
    y = sign * scale * np.concatenate((np.zeros(k), U[: U.size - k])) + bias
    found = local_response(U, y, FS, band=BAND, delay=k / FS)
    true = sign * scale * np.exp(-2j * np.pi * found.frequency * k / FS)
    np.testing.assert_allclose(found.response, true, rtol=2e-4, atol=0)


@examples(10)
@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0), st.integers(0, 2**32 - 1))
def test_units_scale_response_and_error_alike(of_u: float, of_y: float, seed: int) -> None:
    y = CLEAN + 0.1 * np.random.default_rng(seed).standard_normal(CLEAN.size)
    one = local_response(U, y, FS, band=BAND, delay=0.15)
    other = local_response(of_u * U, of_y * y, FS, band=BAND, delay=0.15)
    np.testing.assert_allclose(other.response, of_y / of_u * one.response, rtol=1e-6)
    np.testing.assert_allclose(other.std, of_y / of_u * one.std, rtol=1e-5)


@examples(8)
@given(st.floats(-1000, 1000))
def test_a_bias_makes_no_difference(bias: float) -> None:
    y = CLEAN + 0.1 * np.random.default_rng(1).standard_normal(CLEAN.size)
    one = local_response(U, y, FS, band=BAND, delay=0.15)
    other = local_response(U, y + bias, FS, band=BAND, delay=0.15)
    np.testing.assert_allclose(other.response, one.response, atol=1e-7)


def test_a_fraction_of_a_sample_of_delay() -> None:
    # white, so that the response is known for each bin of the periodic record
    rng = np.random.default_rng(3)
    spectrum = np.fft.rfft(rng.standard_normal(1000))
    spectrum[-1] = 0
    frequency = np.fft.rfftfreq(1000, 1 / FS)
    u = np.fft.irfft(spectrum)
    y = np.fft.irfft(spectrum * np.exp(-2j * np.pi * frequency * 0.3 / FS))
    found = local_response(u, y, FS, band=(1.0, 90.0), delay=0.3 / FS)
    true = np.exp(-2j * np.pi * found.frequency * 0.3 / FS)
    np.testing.assert_allclose(found.response, true, atol=1e-6)


def test_the_transient_of_a_record_that_starts_in_motion_is_taken_out() -> None:
    # A ring-down from before the record, ten times the noise: only the term T can hold it.
    t = np.arange(2000) / FS
    rng = np.random.default_rng(5)
    u = rng.standard_normal(2000)
    y = 2 * u + 3 * np.exp(-8 * t) * np.cos(2 * np.pi * 9 * t)
    found = local_response(u, y, FS, band=(5.0, 15.0))
    plain = np.fft.rfft(y)[50:151] / np.fft.rfft(u)[50:151]
    assert np.median(np.abs(found.response - 2)) < 0.1 * np.median(np.abs(plain - 2))


def test_response_goes_on_after_the_end_of_the_record() -> None:
    # 150 ms of the response to the sweep's last three cycles are missing: without taking the
    # delay out first, the plain ratio errs by far more than the method does.
    frequency, error, _ = study(noise=0.0, delay=0.15, seeds=1)
    plain = np.fft.rfft(CLEAN)[1:201] / np.fft.rfft(U)[1:201]
    at = np.arange(1, 201) * 0.1
    ours = np.median(np.abs(error[0][frequency > 15]))
    theirs = np.median(np.abs(plain - second_order(at))[at > 15])
    assert ours < 0.02 * theirs


def test_a_sweep_through_a_slow_pole_keeps_its_low_end() -> None:
    # At 10 Hz/s the sweep passes the pole at 1 Hz in a tenth of a second.
    fs, t = 500.0, np.arange(5000) / 500
    u = np.sin(2 * np.pi * (0.1 * t + 4.995 * t**2))
    w = 2 * np.pi
    b, a = signal.bilinear([w], [1, w], fs)
    y = signal.lfilter(b, a, u) + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    found = local_response(u, y, fs, band=(0.1, 100.0))
    z = np.exp(2j * np.pi * found.frequency / fs)
    true = np.polyval(b, z) / np.polyval(a, z)
    low = found.frequency < 3
    assert np.median(np.abs(found.response - true)[low] / np.abs(true)[low]) < 0.1


def test_frequencies_are_bins_inside_the_band() -> None:
    found = local_response(U, U, FS, band=(2.0, 7.0))
    np.testing.assert_allclose(found.frequency, np.arange(20, 71) * 0.1)
    assert found.coherence is None


@pytest.mark.parametrize("points", [1, 10, 400])
def test_many_bins_are_thinned_by_a_constant_ratio(points: int) -> None:
    u = np.random.default_rng(0).standard_normal(20_000)
    found = local_response(u, u, FS, band=(1.0, 90.0), points=points)
    assert found.frequency.size <= points
    assert found.frequency[0] == pytest.approx(1.0)
    steps = np.diff(np.log(found.frequency))
    expected = np.log(90) / max(points - 1, 1)
    bin_width = 0.01 / found.frequency[:-1]
    assert np.all(np.abs(steps - expected) <= bin_width + 1e-9)


@pytest.mark.parametrize("samples", [16, 17, 24, 50, 99])
@pytest.mark.parametrize("delay", [0.0, 0.02, 3.0])
def test_short_records_and_wild_delays_give_finite_numbers(samples: int, delay: float) -> None:
    rng = np.random.default_rng(samples)
    u = rng.standard_normal(samples)
    found = local_response(u, u, FS, band=(1.0, 100.0), delay=delay)
    assert found.frequency.size > 0
    assert np.all(np.isfinite(found.response))
    assert np.all(np.isfinite(found.std))


@pytest.mark.parametrize(
    ("band", "message"),
    [
        ((5.01, 5.02), "no bin in it, only multiples of 0.1 Hz"),
        ((0.1, 101.0), "band is"),
    ],
)
def test_bad_bands_are_refused(band: tuple[float, float], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        local_response(U, U, FS, band=band)


def test_many_outputs_at_once_say_what_each_says_alone():
    """To rounding, whatever the delays: those of different samples are fitted apart."""
    rng = np.random.default_rng(6)
    time = np.arange(1000) / 100
    u = np.sin(2 * np.pi * (0.2 * time + 0.9 * time**2))
    lag, below = [0.1, 0.1], [1.0, -1.5, 0.7]
    delays = np.array([0.03, 0.034, 0.071])
    outputs = np.stack(
        [np.interp(time - d, time, signal.lfilter(lag, below, u), left=0.0) for d in delays]
    )
    outputs += 0.01 * rng.standard_normal(outputs.shape)
    together = local_responses(u, outputs, 100.0, band=(0.2, 18.0), delays=delays)
    for one, y, delay in zip(together, outputs, delays, strict=True):
        alone = local_response(u, y, 100.0, band=(0.2, 18.0), delay=float(delay))
        assert np.array_equal(one.frequency, alone.frequency)
        assert np.abs(one.response - alone.response).max() < 1e-6 * alone.std.min()
        assert one.std == pytest.approx(alone.std, rel=1e-6)


def two_bands(noise: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Two periods of 20 s at lines of 0.05 Hz up to 0.7 Hz, and from 3 to 18 Hz."""
    rng = np.random.default_rng(seed)
    n, lines = 4000, np.arange(1, 361)
    lines = lines[(lines <= 14) | (lines >= 60)]
    spectrum = np.zeros(n // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random(lines.size))
    answered = spectrum * second_order(np.arange(n // 2 + 1) * FS / n)
    u, y = (np.tile(np.fft.irfft(s, n), 2) for s in (spectrum, answered))
    return u, y + noise * float(y.std()) * rng.standard_normal(y.size)


@pytest.mark.parametrize("noise", [0.0, 0.03])
def test_nothing_is_said_where_nothing_moved(noise: float) -> None:
    u, y = two_bands(noise)
    found = local_response(u, y, FS, band=(0.05, 18.0), delay=0.15)
    f = found.frequency
    assert not ((f > 1.0) & (f < 2.7)).any()
    low, high = f[f < 2.0], f[f > 2.0]
    assert low.size >= 14
    assert high.max() == pytest.approx(18.0, abs=0.03)
    assert np.abs(high - 3.0).min() < 0.02


def test_a_spectrum_that_falls_has_no_gap() -> None:
    """A small step's falls by 60 dB, a sweep's ripples: both move everywhere."""
    step = np.where(np.arange(2000) > 100, 1.0, 0.0)
    for u in (step, U):
        found = local_response(u, u, FS, band=(0.1, 99.0), points=4000)
        assert np.diff(found.frequency).max() < 0.11


def test_a_record_that_ends_elsewhere_than_it_began_leaks_into_no_bin():
    # y[k] = 0.9 y[k - 1] + 0.1 u[k] of a ramp that stays up: no transient is left of differences.
    u = np.interp(np.arange(1200.0), [80.0, 270.0], [0.0, 4.0])
    y = np.stack([signal.lfilter([0.1], [1.0, -0.9], u), 2.0 * u + 1.0])
    ramp, twice = local_responses(u, y, 100.0, band=(0.1, 3.0), delays=np.zeros(2))
    z = np.exp(-2j * np.pi * ramp.frequency / 100.0)
    assert np.abs(ramp.response * (1 - 0.9 * z) / 0.1 - 1).max() < 0.01
    assert np.abs(twice.response / 2.0 - 1).max() < 1e-6
    alone = local_response(u, y[0], 100.0, band=(0.1, 3.0))
    assert np.array_equal(alone.response, ramp.response)


def test_input_that_moves_only_before_what_is_compared_has_a_response() -> None:
    """It steps down at the second sample: four samples less of it are a constant."""
    n, decay = np.arange(400), np.exp(-0.1)
    u, y = np.where(n == 0, 1.0, 0.0), decay**n
    found = local_response(u, y, FS, band=(0.5, 100.0), delay=-4 / FS)
    true = (1 - decay) / (1 - decay * np.exp(-2j * np.pi * found.frequency / FS))
    assert found.frequency.size > 0
    assert (np.abs(found.response - true) < 5 * found.std).all()
