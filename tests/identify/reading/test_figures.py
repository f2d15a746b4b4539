"""Figures read off a fit, held against what arithmetic says."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.reading.figures import gradient, variance_of

FS = 100.0


@pytest.mark.parametrize("taps", [2, 5])
def test_a_moving_average_delays_slow_motion_by_half_its_length(taps):
    """z⁻³ and so many equal taps: three samples, and half of what lies between first and last."""
    rng = np.random.default_rng(0)
    u = rng.standard_normal(1000)
    y = np.convolve(np.concatenate([np.zeros(3), u]), np.ones(taps) / taps)[: u.size]
    record = hmpim.Record.from_arrays(
        {"u": u}, {"y": y + 1e-3 * rng.standard_normal(u.size)}, fs=FS
    )
    found = hmpim.identify(record, intersample="sampled", structures=[f"fir_{taps}"])["y", "u"]
    late, slow = found.delay, found.delay_low_frequency
    assert late is not None
    assert slow is not None
    assert late.value == pytest.approx(3 / FS)
    assert 0 < slow.spread < 1e-4
    assert abs(slow.value - (3 + (taps - 1) / 2) / FS) < 4 * slow.spread


def test_a_variance_is_at_least_its_rounding():
    """Of a direction that the record leaves open nearly everything cancels."""
    open_end = 1e20 * np.array([[1.0, -1.0], [-1.0, 1.0 - 1e-15]])
    slope = gradient(lambda at: float(at.sum()), np.zeros(2))
    assert 0.0 < variance_of(slope, open_end) < 1e6
