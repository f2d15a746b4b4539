import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.section_iv.spectrum import (
    decibel,
    excited_band,
    padding,
    ratio,
    spectrum,
    transfer_function,
    well_excited,
)
from hmpim.identify.section_iv.windows import window_samples
from tests_support import examples


def hmpim_waveform(
    band: tuple[float, float], duration: float, fs: float, n: float, peak: float
) -> np.ndarray:
    """Equations (4) and (5), scaled to a peak position."""
    t = np.arange(round(duration * fs)) / fs
    a, b = 2 * np.pi * (band[1] - band[0]) / duration, 2 * np.pi * band[0]
    x = np.sin(a * t**2 / 2 + b * t) / (b + a * t**n / 2)
    return x * (peak / np.max(np.abs(x)))


@given(npst.arrays(float, st.integers(4, 24), elements=st.floats(-10, 10)), st.integers(0, 20))
def test_equation_17_as_printed(x: np.ndarray, zeros: int) -> None:
    padded = np.concatenate((x, np.zeros(zeros)))
    big_n = padded.size
    omega = np.exp(-2j * np.pi / big_n)
    found = spectrum(x, 10.0, window="rectangular", pad=zeros)
    for k in range(1, big_n // 2 + 2):
        printed = sum(padded[j - 1] * omega ** ((j - 1) * (k - 1)) for j in range(1, big_n + 1))
        assert found.value[k - 1] == pytest.approx(printed, abs=1e-8)
        assert found.frequency[k - 1] == pytest.approx((k - 1) * 10.0 / big_n)


@given(st.integers(0, 3000))
def test_zeros_are_never_windowed(zeros: int) -> None:
    # However many zeros follow, the value at a frequency is that of the windowed signal alone.
    x = np.random.default_rng(3).standard_normal(500)
    found = spectrum(x, 100.0, pad=zeros)
    k = found.frequency.size // 3
    alone = np.sum(
        x
        * window_samples("gaussian", 500)
        * np.exp(-2j * np.pi * found.frequency[k] * np.arange(500) / 100)
    )
    assert found.value[k] == pytest.approx(alone, abs=1e-9)


def test_a_sinusoid_on_a_bin_has_half_its_amplitude_times_the_samples() -> None:
    x = 3 * np.cos(2 * np.pi * 5 * np.arange(400) / 100)
    found = spectrum(x, 100.0, window="rectangular", pad=0)
    assert found.frequency[20] == 5.0
    assert abs(found.value[20]) == pytest.approx(3 * 400 / 2)


@pytest.mark.parametrize(("duration", "level"), [(5.0, 50.6), (10.0, 53.0)])
def test_level_of_figure_12_at_10_hz(duration: float, level: float) -> None:
    u = hmpim_waveform((0.1, 10.0), duration, 500.0, n=0, peak=10.0)
    x = spectrum(u, 500.0, window="gaussian", alpha=1.5)
    at = decibel(x.value)[np.argmin(np.abs(x.frequency - 10.0))]
    assert at == pytest.approx(level, abs=0.1)


def test_twice_the_sampling_rate_gives_6_db_more() -> None:
    levels = []
    for fs in (500.0, 1000.0):
        u = hmpim_waveform((0.1, 20.0), 10.0, fs, n=1, peak=10.0)
        x = spectrum(u, fs)
        levels.append(np.interp(8.0, x.frequency, decibel(x.value)))
    assert levels[1] - levels[0] == pytest.approx(20 * np.log10(2), abs=0.02)


def test_decibel_of_an_exact_zero_is_finite() -> None:
    np.testing.assert_allclose(decibel([10.0, 0.0]), [20.0, -6000.0])


@given(st.integers(4, 10**6))
def test_padding_never_shortens(samples: int) -> None:
    assert padding(samples) >= samples


@given(st.floats(-100, 100).filter(lambda c: abs(c) > 0.01), st.integers(0, 2**32 - 1))
def test_equation_18_scales_with_the_output(scale: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, y = rng.standard_normal(64), rng.standard_normal(64)
    one, other = transfer_function(u, y, 10.0), transfer_function(u, scale * y, 10.0)
    np.testing.assert_allclose(other.response, scale * one.response, rtol=1e-9)


@given(st.integers(0, 2**32 - 1))
def test_equation_18_is_the_ratio_of_the_two_spectra(seed: int) -> None:
    rng = np.random.default_rng(seed)
    u, y = rng.standard_normal(50), rng.standard_normal(50)
    g = transfer_function(u, y, 10.0, pad=14)
    above = spectrum(y, 10.0, pad=14).value
    below = spectrum(u, 10.0, pad=14).value
    np.testing.assert_allclose(g.response * below, above, atol=1e-9)


def test_ratio_is_nan_where_there_is_nothing() -> None:
    found = ratio(np.array([1 + 0j, 2 + 0j]), np.array([0 + 0j, 4 + 0j]))
    assert np.isnan(found[0])
    assert found[1] == 0.5


@examples(12)
@given(
    st.floats(0.1, 3.0),
    st.floats(8.0, 80.0),
    st.sampled_from([5.0, 10.0]),
    st.sampled_from([0.0, 0.5, 1.0, 1.1]),
    st.floats(0.01, 1000.0),
)
def test_excited_band_is_that_of_the_sweep(
    low: float, high: float, duration: float, n: float, peak: float
) -> None:
    u = hmpim_waveform((low, high), duration, 200.0, n=n, peak=peak)
    found = excited_band(u, 200.0)
    # A sweep through frequency at k Hz/s has edges about √k wide.
    edge = 1.5 * np.sqrt((high - low) / duration)
    assert found[0] <= low + edge
    assert found[1] == pytest.approx(high, abs=edge)


def test_excited_band_survives_noise_on_a_measured_stimulus() -> None:
    u = hmpim_waveform((0.1, 20.0), 10.0, 200.0, n=1, peak=10.0)
    noisy = u + 0.05 * np.random.default_rng(1).standard_normal(u.size)
    assert excited_band(noisy, 200.0)[1] == pytest.approx(20.0, abs=2.5)


def test_excited_band_of_white_noise_is_everything() -> None:
    low, high = excited_band(np.random.default_rng(2).standard_normal(2000), 200.0)
    assert low <= 1.0
    assert high >= 98.0


def test_excited_band_ignores_an_offset() -> None:
    u = hmpim_waveform((0.5, 20.0), 10.0, 200.0, n=0, peak=1.0)
    assert excited_band(u + 100.0, 200.0) == excited_band(u, 200.0)


@pytest.mark.parametrize("level", [0.0, 0.1, -3.3])
def test_a_stimulus_that_does_not_move_is_refused(level: float) -> None:
    with pytest.raises(RecordError, match=f"u is constant at {level:g}"):
        excited_band(np.full(777, level), 200.0)


def test_negative_padding_is_refused() -> None:
    with pytest.raises(ArgumentError, match="pad is -1"):
        spectrum(np.ones(8), 10.0, pad=-1)


@given(st.integers(0, 199), st.floats(0.0, 0.25), st.floats(1e-6, 1e6))
def test_a_notch_is_left_out_and_nothing_else(k: int, depth: float, size: float) -> None:
    u = size * np.exp(1j * np.arange(200.0) ** 2)
    u[k] *= depth
    expected = np.ones(200, dtype=bool)
    expected[k] = False
    np.testing.assert_array_equal(well_excited(u), expected)


def test_a_spectrum_that_falls_as_1_over_f_has_no_notch() -> None:
    assert well_excited(1 / np.arange(4.0, 800.0)).all()


def test_no_stimulus_at_all_is_nowhere_excited() -> None:
    assert not well_excited(np.zeros(5, dtype=complex)).any()


def test_an_excited_band_ends_at_half_the_rate_however_bins_round() -> None:
    u = np.random.default_rng(0).standard_normal(60)
    assert 30 * (500.0 / 60) > 250.0  # the last bin
    assert excited_band(u, 500.0)[1] == 250.0
