import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.frf.averaged import (
    averaged_response,
    coherence_significance,
    effective_averages,
)

FS, BAND = 200.0, (0.5, 20.0)


def chirp(samples: int) -> np.ndarray:
    """0.1 to 20 Hz, tapered at both ends to rest."""
    t = np.arange(samples) / FS
    rate = 19.9 / t[-1]
    ends = np.minimum(1.0, np.minimum(t, t[-1] - t) / 0.5)
    return ends * np.sin(2 * np.pi * (0.1 * t + rate / 2 * t**2))


def circular(u: np.ndarray, response, fs: float = FS) -> np.ndarray:
    """Output of a response given over frequency, exact at the record's bins."""
    spectrum = np.fft.rfft(u)
    return np.fft.irfft(spectrum * response(np.fft.rfftfreq(u.size, 1 / fs)), u.size)


def first_order(f: np.ndarray, delay: float = 0.0) -> np.ndarray:
    return np.exp(-2j * np.pi * f * delay) / (1 + 1j * f / 5.0)


def test_repeats_of_a_sweep_find_the_response_and_its_error(seeds: int) -> None:
    u = chirp(2000)
    clean = circular(u, first_order)
    ratios = []
    for seed in range(max(seeds // 5, 20)):
        rng = np.random.default_rng(seed)
        y = clean + 0.1 * rng.standard_normal((8, 2000)) + 3.0
        found = averaged_response(np.tile(u, (8, 1)), y, FS, band=BAND).response
        error = np.abs(found.response - first_order(found.frequency))
        ratios.append(np.mean(error**2) / np.mean(found.std**2))
    assert np.mean(ratios) == pytest.approx(1, abs=0.1)


@pytest.mark.parametrize("estimator", ["h1", "h2", "hv"])
def test_stated_errors_over_segments_of_noise_agree_with_the_scatter(
    estimator: str, seeds: int
) -> None:
    ratios = []
    for seed in range(max(seeds // 5, 20)):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(20_000)
        at_input = 0.2 if estimator in ("h2", "hv") else 0.0
        at_output = 0.2 if estimator in ("h1", "hv") else 0.0
        y = 1.0 * u + at_output * rng.standard_normal(u.size)
        measured = u + at_input * rng.standard_normal(u.size)
        found = averaged_response(
            measured, y, FS, band=BAND, segment=400, estimator=estimator
        ).response
        ratios.append(np.mean(np.abs(found.response - 1) ** 2) / np.mean(found.std**2))
    assert np.mean(ratios) == pytest.approx(1, abs=0.15)


def test_h1_is_low_with_noise_at_the_input_and_h2_high_with_noise_at_the_output() -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(200_000)
    noisy = u + 0.5 * rng.standard_normal(u.size)

    def gain(x: np.ndarray, y: np.ndarray, estimator: str) -> float:
        found = averaged_response(x, y, FS, band=BAND, segment=400, estimator=estimator)
        return float(np.mean(found.response.response.real))

    assert gain(noisy, u, "h1") == pytest.approx(1 / 1.25, rel=0.01)
    assert gain(noisy, u, "h2") == pytest.approx(1.0, rel=0.01)
    assert gain(u, noisy, "h2") == pytest.approx(1.25, rel=0.01)
    assert gain(u, noisy, "h1") == pytest.approx(1.0, rel=0.01)
    assert gain(u, noisy, "hv") == pytest.approx(np.sqrt(1.25), rel=0.01)


def test_hv_is_the_geometric_mean_of_h1_and_h2() -> None:
    rng = np.random.default_rng(1)
    u = rng.standard_normal(4000)
    y = u + rng.standard_normal(4000)
    h1, h2, hv = (
        averaged_response(u, y, FS, band=BAND, segment=200, estimator=name).response.response
        for name in ("h1", "h2", "hv")
    )
    np.testing.assert_allclose(np.abs(hv) ** 2, np.abs(h1 * h2), rtol=1e-9)
    np.testing.assert_allclose(np.angle(hv), np.angle(h1), atol=1e-9)


def test_a_delay_taken_out_first_keeps_the_coherence() -> None:
    rng = np.random.default_rng(2)
    u = rng.standard_normal(20_000)
    y = np.concatenate((np.zeros(30), u[:-30]))
    blind = averaged_response(u, y, FS, band=BAND, segment=100)
    told = averaged_response(u, y, FS, band=BAND, segment=100, delay=0.15)
    assert blind.response.coherence is not None
    assert told.response.coherence is not None
    assert np.mean(blind.response.coherence) < 0.8
    assert np.min(told.response.coherence) > 1 - 1e-9
    true = np.exp(-2j * np.pi * told.response.frequency * 0.15)
    np.testing.assert_allclose(told.response.response, true, atol=1e-9)


def test_one_segment_has_no_coherence_and_no_error() -> None:
    u = chirp(2000)
    found = averaged_response(u, circular(u, first_order), FS, band=BAND)
    assert found.response.coherence is None
    assert found.significance is None
    assert np.all(np.isnan(found.response.std))
    true = first_order(found.response.frequency)
    np.testing.assert_allclose(found.response.response, true, atol=1e-9)


def test_unrelated_noise_exceeds_the_significance_once_in_twenty(seeds: int) -> None:
    above, unbiased, raw = [], [], []
    for seed in range(max(seeds // 10, 10)):
        rng = np.random.default_rng(seed)
        u, y = rng.standard_normal((2, 20_000))
        found = averaged_response(u, y, FS, band=(2.0, 90.0), segment=400, overlap=0.0)
        assert found.response.coherence is not None
        assert found.significance is not None
        assert found.coherence_unbiased is not None
        above.append(np.mean(found.response.coherence > found.significance))
        unbiased.append(np.mean(found.coherence_unbiased))
        raw.append(np.mean(found.response.coherence))
    assert np.mean(above) == pytest.approx(0.05, abs=0.015)
    assert np.mean(raw) == pytest.approx(1 / 50, rel=0.1)  # the bias of no coherence at all
    assert np.mean(unbiased) < 0.6 * np.mean(raw)


def test_coherence_scatters_as_stated(seeds: int) -> None:
    values, stated = [], []
    for seed in range(max(seeds // 5, 40)):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(20_000)
        found = averaged_response(
            u, u + rng.standard_normal(u.size), FS, band=(2.0, 90.0), segment=400, overlap=0.5
        )
        values.append(found.coherence_unbiased)
        stated.append(found.coherence_std)
    assert np.mean(values) == pytest.approx(0.5, abs=0.01)
    assert np.std(values, axis=0).mean() == pytest.approx(np.mean(stated), rel=0.1)


@settings(max_examples=25)
@given(st.floats(0.01, 100), st.floats(0.01, 100), st.floats(-100, 100))
def test_units_scale_the_response_and_a_bias_does_not_matter(
    of_u: float, of_y: float, bias: float
) -> None:
    rng = np.random.default_rng(0)
    u = rng.standard_normal(2000)
    y = u + rng.standard_normal(2000)
    one = averaged_response(u, y, FS, band=BAND, segment=200)
    other = averaged_response(of_u * u, of_y * (y + bias), FS, band=BAND, segment=200)
    scale = of_y / of_u
    tolerance = 1e-7 * scale
    np.testing.assert_allclose(
        other.response.response, scale * one.response.response, rtol=1e-6, atol=tolerance
    )
    np.testing.assert_allclose(other.response.std, scale * one.response.std, rtol=1e-6)
    np.testing.assert_allclose(
        other.response.coherence, one.response.coherence, rtol=1e-6, atol=1e-9
    )


def test_effective_averages_of_half_overlapped_hann_segments() -> None:
    # ρ(1) = 1/6 for the Hann window at half overlap, and nothing beyond
    window = np.sin(np.pi * (np.arange(10_000) + 0.5) / 10_000) ** 2
    expected = 100 / (1 + 2 * 0.99 / 36)
    assert effective_averages(window, 5000, 100) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"estimator": "h3"}, "estimator is 'h3'"),
        ({"delay": -1.0}, r"delay is -1.0 s"),
        ({"overlap": 0.95}, r"overlap is 0.95"),
        ({"segment": 3}, "segment is 3 samples"),
        ({"segment": 2001}, "segment is 2001 samples"),
        ({"segment": 8, "band": (1.0, 2.0)}, "only multiples of 25 Hz"),
    ],
)
def test_bad_options_are_refused(change: dict[str, object], message: str) -> None:
    u = chirp(2000)
    options: dict[str, object] = {"band": BAND} | change
    with pytest.raises(ArgumentError, match=message):
        averaged_response(u, u, FS, **options)  # type: ignore[arg-type]


def test_bad_records_are_refused() -> None:
    u = chirp(100)
    with pytest.raises(RecordError, match=r"u has shape \(100,\) and y \(99,\)"):
        averaged_response(u, u[:-1], FS, band=BAND)
    with pytest.raises(RecordError, match="y holds nan at sample 1 of repeat 1"):
        averaged_response([u, u], [u, np.where(np.arange(100) == 1, np.nan, u)], FS, band=BAND)
    with pytest.raises(RecordError, match="u is constant at 2 in repeat 0"):
        averaged_response(np.full(100, 2.0), u, FS, band=BAND)
    with pytest.raises(RecordError, match="the record has 9 samples"):
        averaged_response(u[:9], u[:9], FS, band=BAND)
    with pytest.raises(ArgumentError, match="the coherence of one segment is 1"):
        coherence_significance(1.0)
    with pytest.raises(ArgumentError, match="level is 5"):
        coherence_significance(10.0, level=5)
