"""The simulator against closed forms; it shares no line with the package."""

import numpy as np
import pytest
from families.drive import Drive, Lines, Samples
from families.simulate import linear_output
from families.system import System, figures

FS = 100.0


def held(values, **more):
    source = Samples(np.asarray(values, float), FS)
    given = {"between": "zoh", "band": (0.1, 40.0), "fs": FS, "samples": 400, **more}
    return Drive(source=source, **given)


def sine(frequency, **more):
    """Going since long ago."""
    return Drive(
        source=lambda t: np.sin(2 * np.pi * frequency * t),
        between="smooth",
        band=(frequency, frequency),
        fs=FS,
        samples=400,
        quiet=False,
        **more,
    )


SYSTEMS = {
    "first": System(delay=0.0234, gain=-2.0, bias=0.7, lags=(0.11,)),
    "second": System(delay=-0.031, gain=1.5, pairs=((4.0, 0.05),)),
    "zeros": System(delay=0.01, pairs=((4.0, 0.4),), leads=(-0.05,), lags=(0.3,)),
    "dip": System(delay=0.01, pairs=((3.0, 0.2), (7.0, 0.1)), zero_pairs=((5.0, 0.1),)),
    "washout": System(delay=0.013, gain=0.4, lags=(0.4,), washouts=1),
    "modes": System(delay=0.013, modes=((1.0, 3.0, 0.1), (-0.4, 6.0, 0.05), (0.3, 9.0, 0.2))),
    "static": System(delay=0.013, gain=3.0),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_sine_comes_out_as_the_response_says(name):
    system, f = SYSTEMS[name], 3.7
    t = np.arange(400) / FS
    expected = (system.response(np.array([f]))[0] * np.exp(2j * np.pi * f * t)).imag + system.bias
    assert linear_output(system, sine(f)) == pytest.approx(expected, abs=1e-8)


def test_a_held_step_of_first_order_is_an_exponential():
    values = np.r_[np.zeros(20), np.ones(380)]
    system = System(delay=0.1234, gain=2.0, bias=0.5, lags=(0.2,))
    t = np.arange(400) / FS - 0.2 - 0.1234
    expected = 0.5 + 2.0 * np.where(t > 0, -np.expm1(-t / 0.2), 0.0)
    assert linear_output(system, held(values)) == pytest.approx(expected, abs=1e-12)


def test_a_ramp_between_samples_through_an_integrator_is_a_parabola():
    values = np.r_[np.zeros(20), np.arange(380)] / FS
    system = System(delay=0.055, gain=3.0, integrators=1)
    t = np.maximum(np.arange(400) / FS - 0.2 - 0.055, 0.0)
    y = linear_output(system, held(values, between="foh"))
    assert y == pytest.approx(1.5 * t**2, abs=1e-12)


def test_band_limited_lines_pass_through_their_samples_and_between_them():
    t = np.arange(200) / FS
    through = Lines.through(np.cos(2 * np.pi * 2 * t + 0.3), FS)
    assert through(t + 0.0037) == pytest.approx(np.cos(2 * np.pi * 2 * (t + 0.0037) + 0.3))


def test_figures_in_closed_form():
    found = figures(System(delay=0.15, pairs=((10.0, 0.4),), bias=0.6), top=50.0)
    assert found["bandwidth_phase90"] == pytest.approx(1.534013130377, abs=1e-10)
    assert found["bandwidth_phase90_without_delay"] == pytest.approx(10.0)
    assert found["peak_gain_db"] == pytest.approx(-20 * np.log10(0.8 * np.sqrt(1 - 0.16)))
    assert found["delay_low_frequency"] == pytest.approx(0.15 + 0.8 / (20 * np.pi))
    one = figures(System(delay=0.0, lags=(0.1,)), top=50.0)
    assert one["bandwidth_3db"] == pytest.approx(1 / (0.2 * np.pi))
    assert one["time_constant"] == pytest.approx(0.1)
    assert "bandwidth_phase90_without_delay" not in one
    assert "scale_factor" not in figures(SYSTEMS["washout"], top=50.0)


def test_a_record_that_begins_later_remembers_what_came_before():
    """The same output, whether the record begins at rest or in the motion."""
    system = System(delay=0.123, gain=2.0, pairs=((3.0, 0.05),), lags=(0.2,))
    drive = Drive(
        source=lambda t: np.where(t > 0, np.sin(2 * np.pi * (1 + t) * t), 0.0),
        between="smooth",
        band=(1.0, 9.0),
        fs=FS,
        samples=400,
    )
    whole = linear_output(system, drive)
    later = linear_output(system, drive, start=1.5, samples=250)
    assert later == pytest.approx(whole[150:], abs=1e-9)


def test_a_slower_converter_holds_for_several_samples():
    values = np.random.default_rng(1).standard_normal(400)
    system = System(delay=0.0071, lags=(0.05,))
    slow = linear_output(system, held(values, every=4))
    repeated = linear_output(system, held(np.repeat(values[::4], 4)))
    assert slow == pytest.approx(repeated, abs=1e-12)
