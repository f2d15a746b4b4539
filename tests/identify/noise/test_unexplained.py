"""Dynamics that show only where a sweep hardly moves the output."""

import numpy as np
import pytest

from hmpim.experiment import run
from hmpim.identify import identify
from hmpim.rigs import FunctionRig
from hmpim.stimulus import Limits, design

FS = 500.0


def swept():
    """A sweep that moves a hundred times as far at its low end as at its high one."""
    limits = Limits(position=5.0, velocity=60.0, acceleration=4000.0, unit="deg")
    return design(band=(0.1, 80.0), duration=10.0, fs=FS, limits=limits)


def test_dynamics_at_the_far_end_of_a_sweep_are_found():
    """Two zeros flatten the response: second order explains 98 % of the motion and errs by 10 %."""
    zeta, omega, lag = 0.9, 2 * np.pi * 25.0, 1.6e-3
    below = [lag, 1.0, 2 * zeta * omega, omega**2]
    above = [1.0, 2 * zeta * omega, omega**2]

    def play(u):
        n = 1 << 14
        s = 2j * np.pi * np.fft.rfftfreq(n, 1.0 / FS)
        response = np.polyval(above, s) / np.polyval(below, s) * np.exp(-s * 1.5e-3)
        y = np.fft.irfft(np.fft.rfft(u, n) * response, n)[: u.size]
        return y + 1e-3 * np.random.default_rng(1).standard_normal(u.size)

    stimulus = swept()
    pair = identify(
        run(FunctionRig(function=play, intersample="bandlimited"), stimulus, rng=1)
    ).pairs[0]
    f = np.linspace(1.0, 200.0, 200_000)
    s = 2j * np.pi * f
    phase = np.unwrap(np.angle(np.polyval(above, s) / np.polyval(below, s) * np.exp(-s * 1.5e-3)))
    truth = f[np.argmax(phase < -np.pi / 2)]
    assert pair.structure == "third_order_zeros"
    assert pair.parameters.bandwidth_phase90.value == pytest.approx(truth, rel=0.01)
