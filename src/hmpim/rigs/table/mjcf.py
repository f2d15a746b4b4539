"""The table in MJCF, MuJoCo's own notation, from numbers alone.

    world ── base (rocks about x, y, twists about z)
              ├── pitch (y) ── yaw (z) ── roll (x) ── load of the unit under test
              └── elevation (y) ── azimuth (z) ── load of the target

All axes meet in one point. Axes are right-handed about x forward, y to the left, z up.
"""

import math

from hmpim.rigs.table.axes import AxisName, AxisSpec
from hmpim.rigs.table.bodies import Base, Rigid

__all__ = ["CHAIN", "mjcf"]

CHAIN: tuple[AxisName, ...] = ("pitch", "yaw", "roll", "elevation", "azimuth")
"""Axes in the order of MuJoCo's joints, behind the three of the base."""

_DIRECTION: dict[AxisName, str] = {
    "roll": "1 0 0",
    "pitch": "0 1 0",
    "elevation": "0 1 0",
    "yaw": "0 0 1",
    "azimuth": "0 0 1",
}


def mjcf(
    axes: tuple[AxisSpec, ...],
    *,
    uut: Rigid | None,
    target: Rigid | None,
    base: Base,
    friction: bool,
    timestep: float,
) -> str:
    """Write the table as MJCF.

    Parameters
    ----------
    axes : tuple of AxisSpec
        The five axes, in any order.
    uut, target : Rigid or None
        Loads.
    base : Base
        The block underneath.
    friction : bool
        False leaves out the dry and the viscous friction of the axes.
    timestep : float
        Of the integration, s.

    Returns
    -------
    str

    Examples
    --------
    >>> from hmpim.rigs.table.axes import FIG_4
    >>> text = mjcf(FIG_4, uut=None, target=None, base=Base(), friction=True, timestep=5e-4)
    >>> text.count("<joint"), text.count("<general")
    (8, 5)
    """
    of = {axis.name: axis for axis in axes}

    def nested(names: tuple[AxisName, ...], load: Rigid | None, called: str) -> str:
        if not names:
            return "" if load is None else f'<body name="{called}">{_inertial(load)}</body>'
        axis = of[names[0]]
        inner = nested(names[1:], load, called)
        at = f' pos="0 0 {base.height!r}"' if names[0] in ("pitch", "elevation") else ""
        return (
            f'<body name="{axis.name}"{at}>{_inertial(axis.gimbal)}'
            f"{_joint(axis, friction=friction, timestep=timestep)}{inner}</body>"
        )

    ground = "".join(
        f'<joint name="base_{name}" type="hinge" axis="{direction}" stiffness="{k!r}" '
        f'damping="{c!r}"/>'
        for name, direction, k, c in zip(
            "xyz", ("1 0 0", "0 1 0", "0 0 1"), base.stiffness, base.damping, strict=True
        )
    )
    block = Rigid(mass=base.mass, inertia=base.inertia)
    motors = "".join(_motor(of[name]) for name in CHAIN)
    return (
        '<mujoco model="five-axis motion table"><compiler angle="radian" autolimits="true"/>'
        f'<option timestep="{timestep!r}" integrator="implicitfast" gravity="0 0 -9.81">'
        '<flag contact="disable" energy="disable"/></option><worldbody>'
        f'<body name="base" pos="0 0 {-base.height!r}">{_inertial(block)}{ground}'
        f"{nested(CHAIN[:3], uut, 'uut_load')}{nested(CHAIN[3:], target, 'target_load')}"
        f"</body></worldbody><actuator>{motors}</actuator></mujoco>"
    )


def _numbers(*values: float) -> str:
    return " ".join(repr(float(value)) for value in values)


def _inertial(body: Rigid) -> str:
    return (
        f'<inertial pos="{_numbers(*body.centre)}" mass="{body.mass!r}" '
        f'fullinertia="{_numbers(*body.inertia, *body.products)}"/>'
    )


def _joint(axis: AxisSpec, *, friction: bool, timestep: float) -> str:
    limits = axis.limits.to("deg")
    margin = axis.stop_margin * limits.position / axis.limits.position
    stop = math.radians(limits.position + margin)
    resistance = (
        # The shortest time constant MuJoCo takes: else dry friction lags behind the motion.
        f' frictionloss="{axis.coulomb!r}" solreffriction="{2.0 * timestep!r} 1" '
        f'solimpfriction="0.99 0.99 0.001" damping="{axis.viscous!r}"'
        if friction
        else ""
    )
    return (
        f'<joint name="{axis.name}" type="hinge" axis="{_DIRECTION[axis.name]}" '
        f'range="{-stop!r} {stop!r}" solreflimit="{4.0 * timestep!r} 1"{resistance}/>'
    )


def _motor(axis: AxisSpec) -> str:
    return (
        f'<general name="{axis.name}" joint="{axis.name}" dyntype="filterexact" '
        f'dynprm="{axis.actuator_lag!r}" actearly="true" gainprm="1" biastype="none" '
        f'forcerange="{-axis.torque_limit!r} {axis.torque_limit!r}"/>'
    )
