"""The table in motion: the servos tick, MuJoCo steps, the encoders are read."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RigError
from hmpim.rigs.table.axes import AXES, AxisName, AxisSpec, CommandMode
from hmpim.rigs.table.plant import BASE, ORDER, Plant
from hmpim.rigs.table.servo import RESERVE, Gains, feedforward

__all__ = ["History", "Motion", "Timing"]

FloatArray = NDArray[np.float64]

_OVERSPEED = 1.5  # times the rate limit: the interlock opens


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Clock of commands and controller.

    Parameters
    ----------
    tick : float
        Period of the controller, s.
    hold, late : int
        Ticks for which a command is held, and by which it comes late.
    """

    tick: float
    hold: int
    late: int


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


class Motion:
    """The table from rest on, fed command by command.

    Parameters
    ----------
    plant : Plant
        The mechanics.
    axes : tuple of AxisSpec
        For their limits.
    gains : Gains
        Of the servos.
    start : ndarray, shape (5,)
        Where the axes stand, rad; that command has long been in force.
    mode : {'P', 'PV', 'PVA'}
        Which commands count.
    timing : Timing
        Of commands and controller.
    supply : float
        Share of their torque limits that the actuators really give.
    resolution, noise_std : float
        Step of the encoders, and standard deviation of what each reading errs by, rad.
    rng : numpy.random.Generator
        Source of that noise.
    """

    def __init__(
        self,
        plant: Plant,
        axes: tuple[AxisSpec, ...],
        gains: Gains,
        *,
        start: FloatArray,
        mode: CommandMode,
        timing: Timing,
        supply: float,
        resolution: float,
        noise_std: float,
        rng: np.random.Generator,
    ) -> None:
        self._plant = plant
        self._data, self._trim = plant.at_rest(start)
        self._timing, self._resolution = timing, resolution
        self._noise_std, self._rng = noise_std, rng
        joint = self._joint = np.argsort(ORDER)  # from AXES to MuJoCo's order
        self._stiffness, self._damping = gains.position[joint], gains.rate[joint]
        self._inertia = gains.inertia[joint]
        self._with_velocity, self._with_acceleration = feedforward(mode)
        limits = [axis.limits.to("rad") for axis in axes]
        rate = RESERVE * np.array([x.velocity for x in limits])[joint]
        acceleration = RESERVE * np.array([x.acceleration for x in limits])[joint]
        torque = supply * np.array([x.torque_limit for x in axes])[joint]
        self._rate, self._acceleration, self._torque = (
            (-limit, limit) for limit in (rate, acceleration, torque)
        )
        self._overspeed = _OVERSPEED * np.array([x.velocity for x in limits])[joint]
        # Commands come late: those before the newest are needed, at rest the first of all.
        before = -(-timing.late // timing.hold)
        self._wanted = np.tile(self._stiffness * start[joint], (before, 1))
        self._push = np.zeros((before, 5))
        self._count = 0

    def advance(
        self, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> History:
        """Let the table follow the next commands.

        Parameters
        ----------
        position, velocity, acceleration : ndarray, shape (n, 5)
            Commands in the order of `AXES`, rad.

        Returns
        -------
        History
            At the times of these commands, counted from the first of all.

        Raises
        ------
        RigError
            If an axis runs away and the interlock opens, or the simulation diverges.
        """
        joint, hold, late = self._joint, self._timing.hold, self._timing.late
        r, v, a = (c[:, joint] for c in (position, velocity, acceleration))
        count, before = position.shape[0], self._wanted.shape[0]
        wanted = np.concatenate(
            (self._wanted, self._stiffness * r + self._with_velocity * v), dtype=np.float64
        )
        push = np.concatenate((self._push, self._with_acceleration * a), dtype=np.float64)
        jitter = None
        if self._noise_std > 0.0:
            drawn = self._rng.standard_normal((count * hold, 5))
            jitter = np.ascontiguousarray(self._noise_std * drawn[:, joint])
        q, qd = self._data.qpos[BASE:], self._data.qvel[BASE:]
        force = self._data.actuator_force
        read, at, speed, torque = (np.empty((count, 5)) for _ in range(4))
        for j in range(count):
            at[j], speed[j], torque[j] = q, qd, force
            if not (np.abs(qd) < self._overspeed).all():
                seconds = (self._count + j) * hold * self._timing.tick
                _open_interlock(qd[ORDER], self._overspeed[ORDER], seconds)
            for i in range(hold):
                tick = j * hold + i
                seen = (q if jitter is None else q + jitter[tick]) / self._resolution
                seen = np.rint(seen, out=seen) * self._resolution
                if i == 0:
                    read[j] = seen
                row = before + (tick - late) // hold  # of the command in force
                self._tick(wanted[row] - self._stiffness * seen, qd, push[row])
        self._wanted, self._push = wanted[count:], push[count:]
        time = (self._count + np.arange(count)) * (hold * self._timing.tick)
        self._count += count
        degrees = 180.0 / math.pi
        return History(
            time=np.asarray(time, dtype=np.float64),
            command=position * degrees,
            encoder=read[:, ORDER] * degrees,
            position=at[:, ORDER] * degrees,
            velocity=speed[:, ORDER] * degrees,
            torque=torque[:, ORDER],
        )

    def _tick(self, rate: FloatArray, measured: FloatArray, push: FloatArray) -> None:
        """One tick of the controller: rate wanted to torque, and the mechanics."""
        least, most = self._rate
        rate = np.minimum(np.maximum(rate, least, out=rate), most, out=rate)
        rate -= measured
        rate *= self._damping
        rate += push
        least, most = self._acceleration
        demand = np.minimum(np.maximum(rate, least, out=rate), most, out=rate)
        demand *= self._inertia
        demand += self._trim
        least, most = self._torque
        np.minimum(np.maximum(demand, least, out=demand), most, out=self._data.ctrl)
        self._plant.advance(self._data)


def _open_interlock(rate: FloatArray, overspeed: FloatArray, seconds: float) -> None:
    worst = int(np.argmax(np.nan_to_num(np.abs(rate) / overspeed, nan=np.inf)))
    raise RigError(
        f"interlock opened at {seconds:.3f} s: {AXES[worst]} turned at "
        f"{math.degrees(rate[worst]):.4g} deg/s, more than {_OVERSPEED:g} times its rate limit; "
        "check gains and loads"
    )
