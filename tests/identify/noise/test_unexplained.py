"""What a model leaves out counts alike over the whole band."""

import numpy as np
import pytest

from hmpim.experiment import run
from hmpim.identify import identify
from hmpim.identify.noise.misfit import unexplained_response
from hmpim.rigs import FunctionRig
from hmpim.stimulus import Limits, design

FS = 500.0


def swept():
    """A sweep that moves a hundred times as far at its low end as at its high one."""
    limits = Limits(position=5.0, velocity=60.0, acceleration=4000.0, unit="deg")
    return design(band=(0.1, 80.0), duration=10.0, fs=FS, limits=limits)


def upper_half_lost(u):
    """Half of everything above 40 Hz."""
    spectrum = np.fft.rfft(u)
    spectrum[np.fft.rfftfreq(u.size, 1.0 / FS) < 40.0] = 0.0
    return 0.5 * np.fft.irfft(spectrum, u.size)


def test_a_small_motion_counts_as_much_as_a_large_one():
    u = swept().position
    lost = upper_half_lost(u)
    assert np.std(lost) < 0.02 * np.std(u)
    found = unexplained_response(u, u, lost, delay=0.0, band=(0.1 / FS, 80.0 / FS))
    # Half of the gain over half of the band: 0.5 / sqrt(2).
    assert found == pytest.approx(0.5 / np.sqrt(2.0), rel=0.05)


def test_scale_of_input_and_output_do_not_matter():
    u = swept().position
    y, left = 3.0 * u, 3.0 * upper_half_lost(u)
    band = (0.1 / FS, 80.0 / FS)
    one = unexplained_response(u, y, left, delay=0.0, band=band)
    assert unexplained_response(7.0 * u, -y, left, delay=0.0, band=band) == pytest.approx(one)


def test_noise_alone_leaves_nothing_of_weight():
    u = swept().position
    noise = np.random.default_rng(0).standard_normal(u.size)
    found = [
        unexplained_response(u, u, std * noise, delay=0.0, band=(0.1 / FS, 80.0 / FS))
        for std in (1e-4, 1e-3)
    ]
    assert max(found) < 0.01


def test_a_band_without_bins_is_nothing():
    u = swept().position
    assert unexplained_response(u, u, u, delay=0.0, band=(0.1 / FS, 0.1 / FS)) == 0.0


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
