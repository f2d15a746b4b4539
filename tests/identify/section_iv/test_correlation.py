import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from hmpim.errors import RecordError
from hmpim.identify.section_iv.correlation import (
    autocorrelation,
    cross_correlation,
    likeness,
)

FS = 200.0
PAIRS = st.integers(4, 40).flatmap(
    lambda n: npst.arrays(float, (2, n), elements=st.floats(-100, 100, width=32))
)


def sweep(samples: int = 2000, top: float = 20.0) -> np.ndarray:
    t = np.arange(samples) / FS
    duration = samples / FS
    return np.sin(2 * np.pi * (0.1 * t + (top - 0.1) * t**2 / (2 * duration)))


def delay(u: np.ndarray, y: np.ndarray) -> float:
    return likeness(u, y, u.size // 2).peak.lag / FS


def shifted(x: np.ndarray, k: int) -> np.ndarray:
    return np.concatenate((np.zeros(k), x[: x.size - k]))


@given(PAIRS)
def test_equation_8_as_printed(pair: np.ndarray) -> None:
    x, y = pair
    big_n = x.size
    r = cross_correlation(x, y)
    for k, value in zip(r.lag, r.value, strict=True):
        printed = sum(x[n] * y[n - k] for n in range(big_n) if 0 <= n - k < big_n) / big_n
        assert value == pytest.approx(printed, abs=1e-9)


@given(PAIRS)
def test_equation_10_is_equation_8_of_a_signal_with_itself(pair: np.ndarray) -> None:
    x = pair[0]
    r = autocorrelation(x)
    np.testing.assert_allclose(r.value, cross_correlation(x, x).value, atol=1e-12)
    np.testing.assert_allclose(r.value, r.value[::-1], atol=1e-9)
    at_zero = r.value[r.lag == 0].item()
    assert at_zero == pytest.approx(np.mean(x**2), abs=1e-9)
    assert np.all(np.abs(r.value) <= at_zero + 1e-9)


@given(PAIRS)
def test_swapping_the_signals_turns_the_lags(pair: np.ndarray) -> None:
    x, y = pair
    there, back = cross_correlation(x, y), cross_correlation(y, x)
    np.testing.assert_allclose(there.value, back.value[::-1], atol=1e-9)


def test_means_are_not_removed() -> None:
    r = autocorrelation(np.full(5, 2.0))
    np.testing.assert_allclose(r.value, 4 * np.array([1, 2, 3, 4, 5, 4, 3, 2, 1]) / 5)


@given(st.integers(0, 400), st.floats(0.2, 5.0))
def test_a_delayed_copy_is_found_to_the_sample(k: int, scale: float) -> None:
    u = sweep()
    assert delay(u, scale * shifted(u, k)) == k / FS


@given(st.integers(0, 300), st.integers(0, 100))
def test_shifting_the_output_by_k_samples_adds_k_over_fs(first: int, more: int) -> None:
    u = sweep()
    y = shifted(u, first) + 0.01 * np.random.default_rng(first).standard_normal(u.size)
    before = delay(u, y)
    assert delay(u, shifted(y, more)) == pytest.approx(before + more / FS)


def test_a_sinusoid_is_delayed_by_its_phase() -> None:
    t = np.arange(4000) / FS
    u, y = np.sin(2 * np.pi * t), np.sin(2 * np.pi * t - np.pi / 4)
    assert delay(u, y) == pytest.approx(0.125, abs=1 / FS)


def test_a_device_that_turns_the_sign_is_found_at_the_trough() -> None:
    u = sweep()
    peak = likeness(u, -2 * shifted(u, 25), 200).peak
    assert peak.lag == 25
    assert peak.value < 0


def test_a_trough_counts_only_where_it_is_clearly_deeper_than_the_peak_is_high() -> None:
    def lag(depth: float) -> int:
        u, y = np.zeros(60), np.zeros(60)
        u[:2], y[10:12], y[20:22] = (1.0, -1.0), (1.0, -1.0), (-depth, depth)
        return likeness(u, y, 30).peak.lag

    assert (lag(1.1), lag(3.0)) == (10, 20)


def test_an_output_before_its_input_is_not_searched() -> None:
    u = sweep()
    early = np.concatenate((u[50:], np.zeros(50)))
    assert delay(u, early) != 50 / FS
    assert delay(u, early) >= 0


def test_lengths_are_checked() -> None:
    with pytest.raises(RecordError, match="u has 2000 samples and y has 1999"):
        cross_correlation(sweep(), sweep()[:-1])


@pytest.mark.parametrize("offsets", [(0.0, 0.0), (3.0, -2.0)])
@pytest.mark.parametrize("late", [-7, 0, 7, 40])
def test_one_transform_tells_the_papers_peak_and_who_is_ahead(offsets, late):
    rng = np.random.default_rng(late + 100)
    x = np.convolve(rng.standard_normal(601), np.ones(5))
    u, y = x[50:551] + offsets[0], -1.5 * x[50 - late : 551 - late] + offsets[1]
    seen = likeness(u, y, 50)
    printed = cross_correlation(y, u).value[u.size - 1 :][: u.size // 2 + 1]
    wanted = int(np.argmax(np.where(printed < 0.0, -printed / 1.2, printed)))
    assert seen.peak.lag == wanted
    assert seen.peak.value == pytest.approx(printed[wanted], rel=1e-9)
    assert seen.is_ahead == (late < 0)
    assert (seen.lead if late < 0 else seen.lag) == late


@pytest.mark.parametrize("bias", [0.0, 1e3, -1e6])
def test_a_bias_of_many_times_the_motion_has_no_peak_of_its_own(bias) -> None:
    u = sweep()
    y = np.concatenate([np.zeros(30), u[:-30]]) + bias
    assert likeness(u, y, 200).peak.lag == 30
