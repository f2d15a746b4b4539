"""The rigid bodies: energy, symmetry, couplings, derivatives of a tick."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, MissingExtraError
from hmpim.rigs.table.axes import AXES, FIG_4
from hmpim.rigs.table.bodies import LOADS, Base, Rigid, load_named
from hmpim.rigs.table.mjcf import mjcf
from hmpim.rigs.table.plant import BASE, ORDER, Plant, build, mujoco
from tests_support import examples

mj = pytest.importorskip("mujoco")

LOPSIDED = {"uut": LOADS["uut", "bracket"], "target": LOADS["target", "projector"]}
TICK = 5e-4
angles = st.lists(st.floats(-0.7, 0.7), min_size=5, max_size=5).map(np.array)


def plant(*, friction=False, tick=TICK, base=None, uut="bracket", target="projector"):
    return build(
        FIG_4,
        uut=load_named("uut", uut),
        target=load_named("target", target),
        base=Base() if base is None else base,
        friction=friction,
        tick=tick,
    )


def energy(model, data):
    mj.mj_energyPos(model, data)
    mj.mj_energyVel(model, data)
    return float(data.energy.sum())


def tumble(model, steps):
    """Energy at each step of a table let go with all axes turning, actuators dead."""
    data = mj.MjData(model)
    data.qpos[BASE:] = [0.3, -0.2, 0.5, 0.1, -0.3]
    data.qvel[BASE:] = [1.5, -2.0, 4.0, 0.5, -0.7]
    found = []
    for _ in range(steps):
        mj.mj_forward(model, data)
        found.append(energy(model, data))
        mj.mj_step(model, data)
    assert np.abs(data.qpos[BASE:] - [0.3, -0.2, 0.5, 0.1, -0.3]).min() > 0.05  # all have moved
    return np.array(found)


def free_model(timestep):
    """A table whose ground takes no energy either."""
    calm = Base(damping_ratio=1e-12)
    text = mjcf(FIG_4, **LOPSIDED, base=calm, friction=False, timestep=timestep)
    return mj.MjModel.from_xml_string(text)


def test_energy_is_conserved_without_friction_and_control():
    model = free_model(1e-4)
    model.opt.integrator = mj.mjtIntegrator.mjINT_RK4
    found = tumble(model, 3000)
    kinetic = 0.5 * 1100 * 0.7**2
    assert np.ptp(found) < 1e-7 * kinetic


def test_what_the_integrator_loses_falls_with_its_step():
    coarse, fine = (np.ptp(tumble(free_model(h), round(0.3 / h))) for h in (1e-3, 2.5e-4))
    assert fine < 0.3 * coarse


def test_friction_only_takes_energy():
    model = mj.MjModel.from_xml_string(
        mjcf(FIG_4, **LOPSIDED, base=Base(), friction=True, timestep=1e-4)
    )
    found = tumble(model, 2000)
    assert np.diff(found).max() <= 0.0
    assert found[-1] < 0.9 * found[0]


@examples(16)
@given(at=angles)
def test_mass_matrix_is_symmetric_and_positive(at):
    matrix = plant().mass_matrix(at)
    assert np.array_equal(matrix, matrix.T)
    assert np.linalg.eigvalsh(matrix)[0] > 0.1


@examples(16)
@given(at=angles)
def test_inner_and_outer_axes_meet_in_the_base_alone(at):
    matrix = plant().mass_matrix(at)[BASE:, BASE:][np.ix_(ORDER, ORDER)]
    assert np.abs(matrix[:3, 3:]).max() == 0.0


def test_the_base_feels_each_balanced_axis_by_its_inertia():
    matrix = plant(uut="acceptance", target="acceptance").mass_matrix(np.zeros(5))
    inertia = np.diag(matrix)[BASE:]
    about = [1, 2, 0, 1, 2]  # pitch, yaw, roll, elevation, azimuth turn about y, z, x, y, z
    assert np.allclose(matrix[about, BASE + np.arange(5)], inertia, rtol=1e-12)


def test_inertias_add_up_along_the_chain():
    gimbal = {axis.name: axis.gimbal.inertia for axis in FIG_4}
    uut, target = LOADS["uut", "acceptance"], LOADS["target", "acceptance"]
    found = plant(uut="acceptance", target="acceptance").inertia(np.zeros(5))
    expected = [
        gimbal["roll"][0] + uut.inertia[0],
        gimbal["yaw"][2] + gimbal["roll"][2] + uut.inertia[2],
        gimbal["pitch"][1] + gimbal["yaw"][1] + gimbal["roll"][1] + uut.inertia[1],
        gimbal["azimuth"][2] + target.inertia[2],
        gimbal["elevation"][1] + gimbal["azimuth"][1] + target.inertia[1],
    ]
    assert np.allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize("yaw", [-0.6, 0.25, 0.6])
def test_pitch_drives_roll_by_the_sine_of_yaw(yaw):
    """The roll axis, turned by yaw ψ, has the share sin ψ of the pitch axis along it."""
    at = np.array([0.0, yaw, 0.0, 0.0, 0.0])
    matrix = plant(uut="acceptance").mass_matrix(at)[BASE:, BASE:][np.ix_(ORDER, ORDER)]
    roll = matrix[0, 0]
    assert math.isclose(matrix[0, 2], roll * math.sin(yaw), rel_tol=1e-12)


def test_torque_of_one_axis_is_inertia_times_acceleration():
    acceleration = np.array([100.0, 50.0, -40.0, 8.0, -5.0])
    still = np.zeros((5, 5))
    p = plant(uut="acceptance", target="acceptance")
    torque = p.torques(still, still, np.diag(acceleration))
    assert np.allclose(np.diag(torque), p.inertia(np.zeros(5)) * acceleration, rtol=1e-12)


def test_torque_carries_weight_and_friction():
    bracket = LOADS["uut", "bracket"]
    still = np.zeros((1, 5))
    weight = plant().torques(still, still, still)[0]
    # About +y, a mass in front of the axis pulls the nose down: it is held by a negative torque.
    assert math.isclose(weight[2], -bracket.mass * 9.81 * bracket.centre[0], rel_tol=1e-9)
    rate = np.array([[2.0, 1.0, -1.0, 0.5, 0.5]])
    rough, smooth = (plant(friction=f).torques(still, rate, still)[0] for f in (True, False))
    sign = np.sign(rate[0])
    expected = [a.coulomb * s + a.viscous * v for a, s, v in zip(FIG_4, sign, rate[0], strict=True)]
    assert np.allclose(rough - smooth, expected, rtol=1e-6)


def test_a_table_at_rest_stays_at_rest():
    p = plant()
    data, _ = p.at_rest(np.array([0.3, -0.2, 0.4, 0.1, -0.3]))
    before = data.qpos.copy()
    for _ in range(2000):
        p.advance(data)
    assert np.abs(data.qpos - before).max() < 1e-9


@pytest.mark.parametrize("at", [np.zeros(5), np.array([0.4, 0.5, -0.3, 0.2, 0.3])])
def test_derivatives_of_a_tick_against_differences_of_ticks(at):
    p = plant()
    step = p.step(at)
    nv, na = p.model.nv, p.model.na

    def after(state, control):
        data, torque = p.at_rest(at)
        data.qpos += state[:nv]
        data.qvel += state[nv : 2 * nv]
        data.act += state[2 * nv :]
        data.ctrl[:] = torque + control
        p.advance(data)
        return np.concatenate((data.qpos, data.qvel, data.act))

    size = 2 * nv + na
    scale = np.concatenate((np.full(nv, 1e-4), np.full(nv, 1e-3), np.full(na, 1.0)))
    for k, width in enumerate(scale):
        nudge = np.zeros(size)
        nudge[k] = width
        slope = (after(nudge, np.zeros(5)) - after(-nudge, np.zeros(5))) / (2 * width)
        assert np.allclose(step.a[:, k], slope, rtol=1e-5, atol=1e-6)
    for k in range(5):
        nudge = np.zeros(5)
        nudge[k] = 1.0
        slope = (after(np.zeros(size), nudge) - after(np.zeros(size), -nudge)) / 2.0
        assert np.allclose(step.b[:, k], slope, rtol=1e-5, atol=1e-9)


def test_actuators_lag_by_their_time_constant():
    step = plant().step(np.zeros(5))
    torque_on = np.diag(step.b[-5:])[ORDER]
    expected = [-math.expm1(-TICK / axis.actuator_lag) for axis in FIG_4]
    assert np.allclose(torque_on, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"mass": 0.0, "inertia": (1, 1, 1)}, "needs a positive mass"),
        ({"mass": 1.0, "inertia": (1, math.nan, 1)}, "needs a positive mass and three finite"),
        ({"mass": 1.0, "inertia": (1, 1, -1)}, "belongs to no body"),
        ({"mass": 1.0, "inertia": (1, 1, 1), "products": (2, 0, 0)}, "belongs to no body"),
    ],
)
def test_impossible_bodies_are_refused(body, words):
    with pytest.raises(ArgumentError, match=words):
        Rigid(**body)


@pytest.mark.parametrize(
    ("gimbal", "load"), [("uut", "projector"), ("target", "bracket"), ("uut", "brick")]
)
def test_a_load_goes_on_its_own_gimbal(gimbal, load):
    with pytest.raises(ArgumentError, match=f"carries no load '{load}'"):
        load_named(gimbal, load)


def test_every_named_load_can_be_compiled():
    for uut, target in itertools.product(("acceptance", "bracket", "none"), ("projector", "none")):
        made = plant(uut=uut, target=target)
        assert isinstance(made, Plant)
        assert made.inertia(np.zeros(5)).shape == (len(AXES),)


def test_without_mujoco_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r'pip install "hmpim\[table\]"'):
        mujoco()
