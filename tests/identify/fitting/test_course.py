"""Where the joint fit starts: what the input's own samples say of how it was held."""

import numpy as np
import pytest

from hmpim.identify.fitting.course import looks_held

SWEEP = np.sin(2 * np.pi * (0.001 + 0.004 * np.arange(10_000) / 10_000) * np.arange(10_000))


@pytest.mark.parametrize("every", [2, 3, 4, 5])
def test_a_slow_sweep_through_a_slower_converter_is_held_however_small_its_steps(every):
    held = np.repeat(SWEEP[::every], every)[: SWEEP.size]
    assert np.abs(np.diff(held)).max() < 0.2 * np.ptp(held)
    assert looks_held(held[:5000])
    assert looks_held(np.round(held, 3))


def test_a_slow_sweep_that_was_rounded_is_not():
    slow = SWEEP[:2000]
    rounded = np.round(slow / 0.05) * 0.05
    assert np.count_nonzero(np.diff(rounded)) < 0.5 * rounded.size  # it mostly stands
    assert not looks_held(rounded)
    assert not looks_held(slow)
