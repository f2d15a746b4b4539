"""What a spline makes of the corner at which a short command starts."""

import numpy as np
import pytest
from scipy.signal import lsim

import hmpim

FS, FINE = 100.0, 16
N = 60


def short(seed: int) -> hmpim.Record:
    """A sweep from rest, whose velocity jumps at the first sample; second order, 9 Hz."""
    t = np.arange(N * FINE) / (FS * FINE)
    u = np.sin(2 * np.pi * (1.67 * t + 25 * t**2))
    omega, damping = 2 * np.pi * 9.0, 0.25
    _, y, _ = lsim(([1.0], [omega**-2, 2 * damping / omega, 1.0]), u, t)
    noise = 1e-3 * np.random.default_rng(seed).standard_normal(N)
    return hmpim.Record.from_arrays({"u": u[::FINE]}, {"y": y[::FINE] + noise}, fs=FS)


@pytest.mark.few(10)
def test_what_rings_at_the_start_of_a_short_record_is_no_noise(seeds):
    found = [hmpim.identify(short(seed))["y", "u"].noise_std for seed in range(seeds)]
    held = [one.ci95[0] <= 1e-3 <= one.ci95[1] for one in found]
    assert np.mean([one.value for one in found]) == pytest.approx(1e-3, rel=0.1)
    assert np.mean(held) >= 0.8  # 0.95 on average
