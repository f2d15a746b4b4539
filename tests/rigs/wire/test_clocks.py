"""Offset and drift between two clocks, from time stamps through an unkind network."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError
from hmpim.rigs.wire import Sequence, fit_clocks
from tests_support import examples


def exchange(*, offset, drift, forth, back, seconds=10.0, rate=1000.0, seed=0, jitter=2e-4):
    """Time stamps of a run: shortest delays, and exponential jitter above them."""
    rng = np.random.default_rng(seed)
    t1 = np.arange(0.0, seconds, 1 / rate)

    def far(near):
        return offset + (1 + drift) * near

    t2 = far(t1 + forth + jitter * rng.exponential(size=t1.size))
    t3_near = t1 + 0.0005
    t4 = t3_near + back + jitter * rng.exponential(size=t1.size)
    return t1, t2, far(t3_near), t4


@examples(6)
@given(offset=st.floats(-1e6, 1e6), drift=st.floats(-1e-4, 1e-4), seed=st.integers(0, 1000))
def test_offset_and_drift_are_found(offset, drift, seed):
    stamps = exchange(offset=offset, drift=drift, forth=1e-3, back=1e-3, seed=seed)
    fit = fit_clocks(*stamps)
    assert abs(fit.drift - drift) < 1e-6  # of 10 000 delays the shortest are within 0.2 µs
    assert abs(fit.offset - (offset + drift * fit.origin)) < 5e-6
    assert fit.uncertainty == pytest.approx(1e-3, abs=5e-6)
    near = np.array([0.0, 5.0, 10.0])
    assert np.abs(fit.near(offset + (1 + drift) * near) - near).max() < 1e-5


def test_delay_on_one_side_is_within_what_is_said_cannot_be_told():
    stamps = exchange(offset=2.0, drift=5e-5, forth=5e-3, back=0.0)
    fit = fit_clocks(*stamps)
    error = fit.offset - (2.0 + 5e-5 * fit.origin)
    assert error == pytest.approx(2.5e-3, rel=0.01)
    assert fit.uncertainty == pytest.approx(2.5e-3, rel=0.01)
    assert abs(fit.drift - 5e-5) < 1e-6


def test_a_burst_of_late_datagrams_does_not_matter():
    t1, t2, t3, t4 = exchange(offset=2.0, drift=5e-5, forth=1e-3, back=1e-3)
    t2[4000:6000] += 0.05
    t4[7000:8000] += 0.03
    fit = fit_clocks(t1, t2, t3, t4)
    assert abs(fit.drift - 5e-5) < 1e-6
    assert abs(fit.offset - (2.0 + 5e-5 * fit.origin)) < 5e-6


def test_too_few_time_stamps_are_refused():
    with pytest.raises(ArgumentError, match="1 datagrams there and 2 back do not determine"):
        fit_clocks([0.0], [1.0], [1.0, 2.0], [0.0, 1.0])
    with pytest.raises(ArgumentError, match="as many arrivals as departures"):
        fit_clocks([0.0, 1.0], [1.0], [1.0, 2.0], [0.0, 1.0])


@examples(16)
@given(
    order=st.permutations(range(30)),
    lost=st.sets(st.integers(1, 28), max_size=10),
    doubled=st.sets(st.integers(0, 29), max_size=10),
)
def test_what_becomes_of_numbers_is_counted(order, lost, doubled):
    seen = Sequence()
    came = [n for n in order if n not in lost]
    for n in came:
        assert seen.arrived(n)
        if n in doubled:
            assert not seen.arrived(n)
    counts = seen.counts
    assert counts.received == len(came)
    assert counts.lost == len(lost)
    assert counts.doubled == len(doubled - lost)
    highest = np.maximum.accumulate(came)
    assert counts.swapped == int(np.sum(np.array(came) < highest))
