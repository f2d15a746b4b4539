import numpy as np
import pytest

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.signals import as_pair, as_signal, check_band, check_rate


def test_an_array_is_not_copied() -> None:
    values = np.arange(5.0)
    assert as_signal("u", values) is values


def test_a_large_but_finite_signal_is_kept_though_its_sum_overflows() -> None:
    values = np.full(4, 1.7e308)
    with np.errstate(over="ignore"):
        np.testing.assert_array_equal(as_signal("u", values), values)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused_with_its_place(bad: float) -> None:
    with pytest.raises(RecordError, match=rf"y holds {bad} at sample 2"):
        as_pair([0, 1, 2, 3], [0, 1, bad, 3])


def test_infinities_that_cancel_are_seen() -> None:
    with np.errstate(invalid="ignore"), pytest.raises(RecordError, match="u holds inf at sample 0"):
        as_signal("u", [np.inf, -np.inf, 0.0, 0.0])


def test_three_samples_are_too_few() -> None:
    with pytest.raises(RecordError, match="u has 3 samples"):
        as_signal("u", [1, 2, 3])


def test_unequal_lengths_are_refused() -> None:
    with pytest.raises(RecordError, match="u has 4 samples and y has 5"):
        as_pair(np.zeros(4), np.zeros(5))


def test_two_dimensions_are_refused() -> None:
    with pytest.raises(RecordError, match=r"shape \(2, 4\)"):
        as_signal("u", np.zeros((2, 4)))


def test_words_are_refused() -> None:
    with pytest.raises(RecordError, match="u is not numeric"):
        as_signal("u", ["a", "b", "c", "d"])


@pytest.mark.parametrize("fs", [0.0, -200.0, float("nan"), float("inf")])
def test_rate_must_be_positive(fs: float) -> None:
    with pytest.raises(ArgumentError, match="fs is"):
        check_rate(fs)


@pytest.mark.parametrize("band", [(-1.0, 5.0), (5.0, 5.0), (6.0, 5.0), (1.0, 100.1), (np.nan, 5.0)])
def test_band_must_lie_between_dc_and_nyquist(band: tuple[float, float]) -> None:
    with pytest.raises(ArgumentError, match="band is"):
        check_band(band, 200.0)
