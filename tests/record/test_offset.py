"""Clocks held together by a common signal: offset, drift, and error bars that hold."""

import numpy as np
import pytest

from hmpim.errors import RecordError
from hmpim.record import Channel, clock_offset

OFFSET, DRIFT = 5.4321, 25e-6


def signal(t):
    return np.sin(2 * np.pi * (0.3 * t + 0.2 * t**2)) + 0.4 * np.sin(2 * np.pi * 1.7 * t + 1)


def pair(seed, *, noise=0.05, offset=OFFSET, drift=DRIFT, late=1.234, length=15.6):
    rng = np.random.default_rng(seed)
    t1 = np.arange(4000) / 200.0
    t2 = late + np.arange(round(length * 333.3)) / 333.3
    one = signal(t1) + noise * rng.standard_normal(t1.size)
    other = -2 * signal(t2) + 2 * noise * rng.standard_normal(t2.size) + 3
    shown = t2 + offset + drift * (t2 - 10)
    return Channel(name="s", time=t1, values=one), Channel(name="s", time=shown, values=other)


def test_without_noise_to_a_thousandth_of_a_sample():
    found = clock_offset(*pair(0, noise=0.0))
    assert found.offset == pytest.approx(OFFSET + DRIFT * (found.at - 10), abs=1e-7)
    assert found.drift == pytest.approx(DRIFT, abs=1e-8)
    shown = np.array([0.0, 7.0, 20.0])
    back = found.corrected(shown + OFFSET + DRIFT * (shown - 10))
    assert back == pytest.approx(shown, abs=1e-6)


def test_errors_are_as_large_as_stated():
    off, drifts = [], []
    for seed in range(25):
        found = clock_offset(*pair(seed))
        off.append((found.offset - OFFSET - DRIFT * (found.at - 10)) / found.std)
        drifts.append((found.drift - DRIFT) / found.drift_std)
    for z in (np.array(off), np.array(drifts)):
        # 25 draws: the mean within 3.3 standard errors, the spread within its 99.9 % range.
        assert abs(z.mean()) < 3.3 / np.sqrt(25)
        assert 0.54 < z.std() < 1.48


def test_a_day_apart_and_half_overlapping():
    found = clock_offset(*pair(1, offset=86_400.5, late=8.0, length=20.0))
    assert found.offset == pytest.approx(86_400.5 + DRIFT * (found.at - 10), abs=1e-3)


def test_what_does_not_tell_is_refused():
    rng = np.random.default_rng(2)
    t = np.arange(2000) / 100.0
    one = Channel(name="s", time=t, values=rng.standard_normal(2000))
    other = Channel(name="s", time=t, values=rng.standard_normal(2000))
    with pytest.raises(RecordError, match=r"are not alike \(correlation 0\.\d\d\)"):
        clock_offset(one, other)
    sine = np.sin(2 * np.pi * 2.0 * t)
    with pytest.raises(RecordError, match="repeats itself"):
        clock_offset(
            Channel(name="s", time=t, values=sine), Channel(name="s", time=t + 0.1, values=sine)
        )
