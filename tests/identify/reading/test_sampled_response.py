"""Samples over samples against systems stepped in time on a much finer grid."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

import hmpim
from hmpim.identify import gain_and_phase
from hmpim.identify.reading.bandwidth import sampled_response
from hmpim.model import RationalDelay, response

FS = 100.0
FINE = 64
FREQUENCY = np.array([0.5, 7.0, 22.0, 41.0])
SYSTEMS = {
    "first": ([1.0], [0.02, 1.0]),
    "second": ([1.0], [1 / 60.0**2, 0.8 / 60.0, 1.0]),
    "zero": ([0.03, 1.0], [1 / 60.0**2, 0.8 / 60.0, 1.0]),
    "lead": ([0.05, 1.0], [0.02, 1.0]),
    "static": ([2.0], [1.0]),
}


def stepped(numerator, denominator, delay, values, method):
    """Response of a system to samples of an input, held or joined, delay in fine steps."""
    fine = np.repeat(values, FINE)
    if method == "foh":
        index = np.arange(values.size * FINE) / FINE
        fine = np.interp(index, np.arange(values.size), values)
    fine = np.concatenate([np.zeros(round(delay * FS * FINE)), fine])[: fine.size]
    if len(denominator) == 1:
        return numerator[0] / denominator[0] * fine[::FINE]
    b, a, _ = cont2discrete((numerator, denominator), 1 / (FS * FINE), method)
    return lfilter(np.ravel(b), a, fine)[::FINE]


@pytest.mark.parametrize("method", ["zoh", "foh"])
@pytest.mark.parametrize("delay", [0.0, 0.25 / FS, 3.75 / FS])
@pytest.mark.parametrize("name", SYSTEMS)
def test_it_is_the_spectrum_of_the_answer_to_one_sample(name, delay, method):
    numerator, denominator = SYSTEMS[name]
    one = np.zeros(600)
    one[2] = 1.0
    answer = stepped(numerator, denominator, delay, one, method)
    kernel = np.exp(-2j * np.pi * np.outer(FREQUENCY, np.arange(600) - 2) / FS)
    system = RationalDelay(
        delay=delay, numerator=np.array(numerator[::-1]), denominator=np.array(denominator[::-1])
    )
    found = sampled_response(system, FREQUENCY, fs=FS, intersample=method)
    np.testing.assert_allclose(found, kernel @ answer, atol=1e-9 * np.abs(found).max())


def test_an_integrator_and_a_pole_far_beyond_the_rate_are_borne():
    tail = RationalDelay(
        delay=0.013, numerator=np.ones(1), denominator=np.array([0.0, 1.0, 1e-3 + 1e-9, 1e-12])
    )
    found = sampled_response(tail, np.array([0.1]), fs=FS, intersample="zoh")
    held = np.sinc(0.1 / FS) * np.exp(-1j * np.pi * 0.1 / FS)
    assert found[0] == pytest.approx(response(tail, np.array([0.1]))[0] * held, rel=1e-4)


def test_an_integrator_behind_many_poles_is_the_sum_of_its_aliases():
    """With one more integrator for the linear input it came out a thousand times too small."""
    below = np.polynomial.polynomial.polyfromroots([0.0, -0.4, -0.5, -0.7, -1.5, -2.0])
    system = RationalDelay(delay=-0.03, numerator=np.array([1.0, 0.5]), denominator=below)
    found = sampled_response(system, np.array([0.5, 17.0]), fs=FS, intersample="foh")
    for at, value in zip((0.5, 17.0), found, strict=True):
        aliases = at + FS * np.arange(-2000, 2001)
        each = response(system, np.abs(aliases))
        each = np.where(aliases > 0.0, each, each.conj()) * np.sinc(aliases / FS) ** 2
        assert value == pytest.approx(each.sum(), rel=1e-9)


def test_slow_poles_and_a_zero_at_a_high_rate():
    """Its numerator, small over the slow poles, was once cut off: 60 times too small at 20 Hz."""
    below = np.polynomial.polynomial.polyfromroots([-9.0, -10.0, -12.0])
    system = RationalDelay(delay=0.0, numerator=np.array([1.0, 0.5]), denominator=below / below[0])
    wanted = np.array([0.1, 1.0, 5.0, 20.0])
    found = sampled_response(system, wanted, fs=1e6, intersample="zoh")
    np.testing.assert_allclose(found, response(system, wanted), rtol=1e-4)


@pytest.mark.parametrize("name", ["first", "second"])
def test_gain_and_phase_behind_a_held_input_are_the_systems(name):
    """Aliases left out, the first-order lag was read tens of standard deviations off."""
    numerator, denominator = SYSTEMS[name]
    t = np.arange(1000) / FS
    u = np.sin(2 * np.pi * (0.2 * t + 1.24 * t**2))
    delay = 3.25 / FS
    y = stepped(numerator, denominator, delay, u, "zoh")
    y += 0.001 * np.random.default_rng(0).standard_normal(u.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="zoh")
    pair = hmpim.identify(record)["y", "u"]
    wanted = np.array([3.0, 9.0, 15.0, 21.0])
    s = 2j * np.pi * wanted
    truth = np.polyval(numerator, s) / np.polyval(denominator, s) * np.exp(-s * delay)
    for at, value in zip(gain_and_phase(pair, wanted, fs=FS), truth, strict=True):
        assert abs(at.gain_db.value - 20 * np.log10(abs(value))) < 4 * at.gain_db.std
        apart = (at.phase.value - np.degrees(np.angle(value)) + 180) % 360 - 180
        assert abs(apart) < 4 * at.phase.std
    assert pair.verdict == "ok"
