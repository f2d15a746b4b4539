"""Channels in figures, counted against what was put in."""

import numpy as np
import pytest

from hmpim.record import Series, describe

RNG = np.random.default_rng(4)


def test_every_oddity_is_counted():
    time = np.arange(2000) / 250.0
    values = np.sin(time)
    values[[5, 6, 700]] = np.nan
    time = np.delete(time, np.s_[1000:1020])
    values = np.delete(values, np.s_[1000:1020])
    time[50] = time[49]
    time[[300, 301]] = time[[301, 300]]
    found, channel = describe(Series(name="y", values=values, time=time, unit="deg"))
    assert found.samples == 1980
    assert found.missing == 3
    assert found.doubled == 1
    assert found.backward == 1
    assert found.restarts == 0
    assert found.gaps == 4  # two places of missing values, one of missing samples, one doubled
    assert found.longest_gap == pytest.approx(21 / 250)
    assert found.rate == pytest.approx(250.0, rel=1e-9)
    assert (found.start, found.stop) == (0.0, 1999 / 250)
    assert (found.low, found.high) == pytest.approx((-1, 1), abs=1e-4)
    assert found.problem == ""
    assert channel.values.size == 1976


def test_jitter_is_the_share_of_an_interval():
    time = (np.arange(5000) + 0.1 * RNG.standard_normal(5000)) / 100.0
    found, _ = describe(Series(name="y", values=np.cos(time), time=time))
    assert found.jitter == pytest.approx(0.1, rel=0.05)
    even, _ = describe(Series(name="y", values=np.cos(time), time=np.arange(5000) / 100.0))
    assert even.jitter == 0.0


def test_what_cannot_be_used_is_described_all_the_same():
    twice = np.concatenate((np.arange(50.0), np.arange(50.0)))
    found, channel = describe(Series(name="y", values=twice, time=twice / 10))
    assert channel is None
    assert (found.restarts, found.backward, found.rate) == (1, 0, pytest.approx(10.0))
    assert "starts again" in found.problem
    found, channel = describe(Series(name="y", values=np.full(9, np.nan), time=np.arange(9.0)))
    assert channel is None
    assert (found.missing, found.low, found.high) == (9, None, None)
    found, channel = describe(Series(name="y", values=np.arange(9.0)))
    assert channel is None
    assert (found.rate, found.start) == (None, None)
    assert "no time" in found.problem
    found, channel = describe(Series(name="y", values=np.arange(9.0) % 4), fs=20.0)
    assert channel is not None
    assert found.rate == pytest.approx(20.0)
    # A unit that nobody knows is no reason not to look.
    found, channel = describe(
        Series(name="y", values=np.arange(9.0), time=np.arange(9.0), unit="x")
    )
    assert found.unit == "x"
    assert channel.unit == ""
