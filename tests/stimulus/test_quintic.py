"""The polynomial of fifth degree: its peaks, all of many at once."""

import numpy as np
import pytest

from hmpim.stimulus.quintic import Quintic, between, coefficients_between, largest

NAMES = ("position", "velocity", "acceleration", "jerk")


@pytest.mark.parametrize("lead", [1.0, 0.0, 1e-17])
def test_peaks_are_those_of_a_dense_look(lead):
    rng = np.random.default_rng(3)
    coefficients = rng.standard_normal((40, 6))
    coefficients[:, 5] *= lead  # of a lower degree, too
    durations = rng.uniform(0.1, 5.0, 40)
    found = largest(coefficients, durations)
    for row, duration, peaks in zip(coefficients, durations, found.T, strict=True):
        dense = Quintic(start=0.0, duration=duration, coefficients=tuple(row)).motion(
            np.linspace(0.0, duration, 5001)
        )
        seen = np.array([np.abs(getattr(dense, name)).max() for name in NAMES])
        assert np.all(peaks >= seen * (1 - 1e-12))
        np.testing.assert_allclose(peaks, seen, rtol=1e-5)


def test_one_alone_and_many_together_are_the_same():
    first, last = np.array([0.0, 1.0, -2.0]), np.array([3.0, 0.0, 5.0])
    durations = np.array([0.5, 1.0, 4.0])
    found = coefficients_between(first, last, duration=durations)
    together = largest(np.stack(np.broadcast_arrays(*found), axis=1), durations)
    for k, duration in enumerate(durations.tolist()):
        alone = between(first, last, start=7.0, duration=duration)
        peaks = [getattr(alone.peaks, name) for name in NAMES]
        np.testing.assert_allclose(together[:, k], peaks, rtol=1e-12)
        ends = alone.motion(np.array([7.0, 7.0 + duration]))
        np.testing.assert_allclose(ends.position, [first[0], last[0]], atol=1e-12)
        np.testing.assert_allclose(ends.acceleration, [first[2], last[2]], atol=1e-9)


def test_at_rest_nothing_peaks():
    still = Quintic(start=0.0, duration=2.0, coefficients=(0.0,) * 6)
    assert [getattr(still.peaks, name) for name in NAMES] == [0.0] * 4
