"""The table in motion: the servos tick, MuJoCo steps, the encoders are read."""

import math
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RigError
from hmpim.rigs.table.axes import AXES, AxisName, AxisSpec, CommandMode
from hmpim.rigs.table.plant import BASE, ORDER, Plant, mujoco
from hmpim.rigs.table.servo import RESERVE, Gains, feedforward

__all__ = ["History", "Timing", "simulate"]

FloatArray = NDArray[np.float64]

_OVERSPEED = 1.5  # times the rate limit: the interlock opens
_BLOCK = 0.01  # s between looks at the clock, where the pace is real


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Clock of commands and controller.

    Parameters
    ----------
    tick : float
        Period of the controller, and step of the integration, s.
    hold, late : int
        Ticks for which a command is held, and by which it comes late.
    realtime : bool
        Whether to keep pace with the clock on the wall.
    """

    tick: float
    hold: int
    late: int
    realtime: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class History:
    """What all axes did, at the times of the commands; axes in the order of `AXES`.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Time stamps, s.
    command, encoder, position : ndarray, shape (n, 5)
        Angle commanded, read and true, deg.
    velocity : ndarray, shape (n, 5)
        True rate, deg/s.
    torque : ndarray, shape (n, 5)
        Of the actuators, N·m.
    """

    time: FloatArray
    command: FloatArray
    encoder: FloatArray
    position: FloatArray
    velocity: FloatArray
    torque: FloatArray

    def of(self, axis: AxisName, quantity: str = "position") -> FloatArray:
        """One quantity of one axis, shape (n,).

        Examples
        --------
        >>> history = History(
        ...     time=np.arange(2.0), command=np.zeros((2, 5)), encoder=np.zeros((2, 5)),
        ...     position=np.zeros((2, 5)), velocity=np.zeros((2, 5)), torque=np.ones((2, 5)),
        ... )
        >>> history.of("yaw", "torque").tolist()
        [1.0, 1.0]
        """
        array: FloatArray = getattr(self, quantity)
        return array[:, AXES.index(axis)]


def simulate(
    plant: Plant,
    axes: tuple[AxisSpec, ...],
    gains: Gains,
    *,
    command: tuple[FloatArray, FloatArray, FloatArray],
    mode: CommandMode,
    timing: Timing,
    resolution: float,
    noise: FloatArray | None,
) -> History:
    """Move the table from rest, where the first command has long been in force.

    Parameters
    ----------
    plant : Plant
        The mechanics; its step is the controller's tick.
    axes : tuple of AxisSpec
        For their limits.
    gains : Gains
        Of the servos.
    command : tuple of ndarray, each shape (n + 1, 5)
        Position, velocity, acceleration, rad; in front the place of rest before time 0.
    mode : {'P', 'PV', 'PVA'}
        Which commands count.
    timing : Timing
        Of commands and controller.
    resolution : float
        Of the encoders, rad.
    noise : ndarray, shape (n * hold, 5), or None
        What each reading of the encoders errs by, rad.

    Returns
    -------
    History

    Raises
    ------
    RigError
        If an axis runs away and the interlock opens, or the simulation diverges.
    """
    mj = mujoco()
    model = plant.model
    data, trim = plant.at_rest(command[0][0])
    count, hold, late = command[0].shape[0] - 1, timing.hold, timing.late
    joint = np.argsort(ORDER)  # from AXES to MuJoCo's order
    r, v, a = (np.ascontiguousarray(c[:, joint]) for c in command)
    stiffness, damping, inertia = gains.position[joint], gains.rate[joint], gains.inertia[joint]
    with_velocity, with_acceleration = feedforward(mode)
    wanted = stiffness * r + with_velocity * v
    push = with_acceleration * a
    limits = [axis.limits.to("rad") for axis in axes]
    rate_limit = RESERVE * np.array([x.velocity for x in limits])[joint]
    acceleration_limit = RESERVE * np.array([x.acceleration for x in limits])[joint]
    torque_limit = np.array([x.torque_limit for x in axes])[joint]
    overspeed = _OVERSPEED * np.array([x.velocity for x in limits])[joint]
    jitter = None if noise is None else np.ascontiguousarray(noise[:, joint])
    q, qd = data.qpos[BASE:], data.qvel[BASE:]
    control, force = data.ctrl, data.actuator_force
    low_rate, low_acceleration, low_torque = -rate_limit, -acceleration_limit, -torque_limit
    read, at, speed, torque = (np.empty((count, 5)) for _ in range(4))
    advance = mj.mj_step
    started = time.perf_counter()
    block = max(1, round(_BLOCK / (hold * timing.tick)))
    for j in range(count):
        at[j], speed[j], torque[j] = q, qd, force
        if not (np.abs(qd) < overspeed).all():
            _open_interlock(qd[ORDER], overspeed[ORDER], j * hold * timing.tick)
        for i in range(hold):
            tick = j * hold + i
            seen = (q if jitter is None else q + jitter[tick]) / resolution
            seen = np.rint(seen, out=seen) * resolution
            if i == 0:
                read[j] = seen
            row = max((tick - late) // hold, -1) + 1  # of the command in force
            rate = wanted[row] - stiffness * seen
            rate = np.minimum(np.maximum(rate, low_rate, out=rate), rate_limit, out=rate)
            rate -= qd
            rate *= damping
            rate += push[row]
            demand = np.maximum(rate, low_acceleration, out=rate)
            demand = np.minimum(demand, acceleration_limit, out=demand)
            demand *= inertia
            demand += trim
            np.maximum(demand, low_torque, out=demand)
            np.minimum(demand, torque_limit, out=control)
            advance(model, data)
        if timing.realtime and j % block == 0:
            ahead = (j + 1) * hold * timing.tick - (time.perf_counter() - started)
            if ahead > 0.0:
                time.sleep(ahead)
    degrees = 180.0 / math.pi
    return History(
        time=np.asarray(np.arange(count) * (hold * timing.tick), dtype=np.float64),
        command=command[0][1:] * degrees,
        encoder=read[:, ORDER] * degrees,
        position=at[:, ORDER] * degrees,
        velocity=speed[:, ORDER] * degrees,
        torque=torque[:, ORDER],
    )


def _open_interlock(rate: FloatArray, overspeed: FloatArray, seconds: float) -> None:
    worst = int(np.argmax(np.nan_to_num(np.abs(rate) / overspeed, nan=np.inf)))
    raise RigError(
        f"interlock opened at {seconds:.3f} s: {AXES[worst]} turned at "
        f"{math.degrees(rate[worst]):.4g} deg/s, more than {_OVERSPEED:g} times its rate limit; "
        "check gains and loads"
    )
