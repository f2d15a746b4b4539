"""Nonlinear systems, where a closed form says what they do; and loops."""

import numpy as np
import pytest
from families import loops, nonlinear
from families.drive import Drive, Samples
from families.made import _plant
from families.simulate import linear_output
from families.system import System

FS = 100.0


def drive(source, **more):
    given = {"between": "smooth", "band": (0.1, 10.0), "fs": FS, "samples": 600}
    return Drive(source=source, **given | more)


SLOW = drive(lambda t: np.where(t > 0, np.sin(2 * np.pi * 0.5 * np.maximum(t, 0)), 0.0))
AXIS = System(delay=0.02, gain=2.0, bias=0.3, pairs=((4.0, 0.7),))


def test_play_lags_by_its_half_width():
    u = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, -1, 201)])
    out = nonlinear.play(u, 0.1)
    assert out[100] == pytest.approx(0.9)
    assert out[115] == pytest.approx(0.9)  # inside the play
    assert out[-1] == pytest.approx(-0.9)


def test_a_slew_limited_step_is_a_ramp():
    out = nonlinear.slew_limited(np.r_[0.0, np.ones(20)], 0.1)
    assert out[:12] == pytest.approx(np.r_[0.0, np.minimum(0.1 * np.arange(1, 12), 1.0)])


def test_without_friction_or_cubic_force_the_axis_is_linear():
    expected = linear_output(AXIS, SLOW)
    assert nonlinear.friction(AXIS, SLOW, 0.0) == pytest.approx(expected, abs=2e-5)
    assert nonlinear.spring(AXIS, SLOW, 0.0) == pytest.approx(expected, abs=2e-5)
    fine = nonlinear.through(AXIS, SLOW, nonlinear.finely(SLOW))[:: nonlinear.FINE]
    assert fine == pytest.approx(expected, abs=1e-4)


def test_friction_stands_within_its_band():
    held = drive(Samples(np.r_[np.zeros(10), np.full(590, 0.04)], FS), between="zoh")
    assert np.ptp(nonlinear.friction(AXIS, held, 0.05)) == 0
    assert np.ptp(nonlinear.friction(AXIS, held, 0.03)) > 0


def test_a_loop_steps_its_plant_exactly():
    rng = np.random.default_rng(0)
    for _ in range(5):
        plant = _plant(rng, FS)
        controller = loops.tuned(plant, FS, share=0.4)
        reference = rng.standard_normal(600)
        u, y = loops.closed(plant, controller, reference, np.zeros(600), FS)
        sent = drive(Samples(u, FS), between="zoh")
        assert y == pytest.approx(linear_output(plant, sent), abs=1e-9)


@pytest.mark.parametrize(("share", "steady"), [(0.97, True), (1.03, False)])
def test_the_gain_margin_is_where_the_loop_begins_to_swing(share, steady):
    plant = System(delay=0.02, lags=(0.1,))
    place, gain = loops.margin_of(plant, FS)
    controller = loops.Controller(proportional=share / gain, integral=0.0)
    _, y = loops.closed(plant, controller, np.eye(1, 2000)[0], np.zeros(2000), FS)
    assert bool(np.max(np.abs(y[1500:])) < np.max(np.abs(y[:200]))) is steady
    assert 0 < place < FS / 2
