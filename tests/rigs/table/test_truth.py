"""Exact responses: against the simulation itself, Fig. 4, and what the field knows."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.rigs.table import AXES, FIG_4, MotionTable, Rigid, TablePosition, exact_bandwidth
from hmpim.rigs.table import linear_response as exact
from hmpim.stimulus import Limits, Sine, Stimulus
from tests_support import few_of

pytest.importorskip("mujoco")

# No friction, and encoders so fine that nothing but the linear loop is left.
SMOOTH = MotionTable(friction=False, encoder_resolution=1e-9, encoder_noise_std=0.0)
OFF_CENTRE = TablePosition(roll=10.0, yaw=25.0, pitch=-15.0, azimuth=8.0, elevation=12.0)


def lock_in(table, axis, frequency, fs, amplitude):
    """Steady response of all axes to a sine, shape (5,), from the simulation."""
    duration = 4.0
    sine = Sine(amplitude=amplitude, frequency=frequency, duration=duration)
    history = table.simulate(
        {axis: Stimulus(waveform=sine, fs=fs, unit="deg")}, rng=np.random.default_rng(0)
    )
    whole = round(2.0 * fs)  # the last 2 s: whole periods, the start forgotten
    turn = np.exp(-2j * np.pi * frequency * history.time[-whole:])
    phasor = 2.0 * turn @ (history.position[-whole:] - history.position[0]) / whole
    return phasor / (-1j * amplitude)


SINES = {
    "roll": (31.0, 1000.0, 1e-2),
    "yaw": (60.0, 500.0, 1e-3),
    "pitch": (17.0, 500.0, 1e-2),
    "azimuth": (9.0, 1000.0, 1e-3),
    "elevation": (24.0, 1000.0, 1e-3),
}
"""Frequency in Hz, commands in Hz and amplitude in deg of the sine of each axis."""
EACH = [("roll", "PVA"), ("yaw", "P"), ("pitch", "PV"), ("azimuth", "P"), ("elevation", "PVA")]
"""Each axis and each mode; the others in `make studies`."""


@pytest.mark.parametrize(("axis", "mode"), few_of(EACH, SINES, ("P", "PV", "PVA")))
def test_linear_response_is_what_the_simulation_does(axis, mode):
    frequency, fs, amplitude = SINES[axis]
    table = replace(
        SMOOTH, mode=mode, start=OFF_CENTRE, uut_load="bracket", target_load="projector"
    )
    found = lock_in(table, axis, frequency, fs, amplitude)
    for out, seen in zip(AXES, found, strict=True):
        truth = exact(table, frequency, axis_in=axis, axis_out=out, fs=fs, hold="included")[0]
        assert abs(seen - truth) < 1e-6


@pytest.mark.parametrize("fs", [500.0, 1000.0])
def test_bandwidths_of_fig_4(fs):
    for axis in FIG_4:
        found = exact_bandwidth(MotionTable(), axis=axis.name, fs=fs)
        assert abs(found / axis.bandwidth - 1.0) < 1e-3


def test_feedforward_raises_the_bandwidth():
    for axis in AXES:
        p, pv, pva = (
            exact_bandwidth(MotionTable(), axis=axis, mode=mode) for mode in ("P", "PV", "PVA")
        )
        assert 1.4 * p < pv < pva / 1.4


def test_slower_commands_cost_the_fast_axes_most():
    cost = {}
    for axis in AXES:
        fast, slow = (
            exact_bandwidth(MotionTable(), axis=axis, fs=fs, hold="included")
            for fs in (1000.0, 500.0)
        )
        cost[axis] = 1.0 - slow / fast
    ordered = list(cost.values())
    assert ordered == sorted(ordered, reverse=True)
    assert cost["roll"] > 0.05
    assert cost["elevation"] < cost["azimuth"] < 0.03


def test_heavier_loads_lower_the_bandwidth():
    heavy = MotionTable(uut_load="bracket", target_load="projector")
    light = MotionTable(uut_load="none", target_load="none")
    for axis in FIG_4:
        assert exact_bandwidth(heavy, axis=axis.name) < 0.98 * axis.bandwidth
        assert exact_bandwidth(light, axis=axis.name) > 1.02 * axis.bandwidth


def test_gains_do_not_depend_on_the_load():
    heavy = MotionTable(uut_load="bracket")
    assert np.array_equal(heavy.gains.rate, MotionTable().gains.rate)


@pytest.mark.parametrize("yaw", [-30.0, 30.0])
def test_pitch_leaves_roll_behind_by_the_sine_of_yaw(yaw):
    """Roll is driven by -sin ψ times the acceleration, and its servo gives way by 1/(kp kv)."""
    frequency = 0.5
    table = replace(SMOOTH, start=TablePosition(yaw=yaw))
    cross = exact(table, frequency, axis_in="pitch", axis_out="roll")[0]
    stiffness = table.gains.position[0] * table.gains.rate[0]
    expected = np.sin(np.radians(yaw)) * (2 * np.pi * frequency) ** 2 / stiffness
    assert np.sign(cross.real) == np.sign(yaw)
    assert abs(cross.real / expected - 1.0) < 0.01


def test_couplings_through_the_base_have_the_sign_of_recoil():
    """Elevation pushed up presses the base down, and pitch stays behind its own base."""
    cross = exact(SMOOTH, 2.0, axis_in="elevation", axis_out="pitch")[0]
    assert cross.real > 0.0
    assert abs(cross) < 1e-2


def test_slow_commands_are_followed_exactly():
    for axis in AXES:
        for mode in ("P", "PV", "PVA"):
            slow = exact(MotionTable(), 1e-3, axis_in=axis, mode=mode, hold="included")
            assert abs(slow[0] - 1.0) < 1e-3


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"frequency": 600.0}, "below half the rate, 500"),
        ({"frequency": 0.0}, "must lie above 0"),
        ({"axis_in": "nod"}, "axis 'nod' is not known"),
        ({"axis_out": "nod"}, "axis 'nod' is not known"),
        ({"hold": "perhaps"}, "hold = 'perhaps' is not known"),
    ],
)
def test_refusals(wrong, words):
    given = {"frequency": 1.0, "axis_in": "roll"} | wrong
    with pytest.raises(ArgumentError, match=words):
        exact(MotionTable(), given.pop("frequency"), **given)


def test_a_bandwidth_that_cannot_be_had_is_refused():
    sluggish = (replace(FIG_4[0], actuator_lag=0.05), *FIG_4[1:])
    with pytest.raises(ArgumentError, match="roll"):
        _ = MotionTable(specs=sluggish).gains


def test_servos_that_swing_have_no_response():
    light = Rigid(mass=0.1, inertia=(1e-3, 1e-3, 1e-3))
    feather = (replace(FIG_4[0], gimbal=light), *FIG_4[1:])
    steel = MotionTable(specs=feather)
    bare = replace(steel, uut_load=light)
    assert abs(exact(steel, 43.0, axis_in="roll")[0].real) < 1e-6
    with pytest.raises(ArgumentError, match="with these loads the servos are not stable"):
        exact(bare, 43.0, axis_in="roll")


def test_limits_of_the_tuned_axis_may_be_in_radians():
    in_radians = tuple(replace(a, limits=a.limits.to("rad")) for a in FIG_4)
    assert MotionTable(specs=in_radians).limits_of("roll").velocity == pytest.approx(800.0)
    assert isinstance(MotionTable(specs=in_radians).limits_of("roll"), Limits)
