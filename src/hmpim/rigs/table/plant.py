"""The compiled mechanics: mass matrix, weight, inverse dynamics and derivatives of one tick."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import MissingExtraError
from hmpim.rigs.table.axes import AXES, AxisSpec
from hmpim.rigs.table.bodies import Base, Rigid
from hmpim.rigs.table.mjcf import CHAIN, mjcf

__all__ = ["BASE", "ORDER", "Plant", "Step", "build", "mujoco"]

FloatArray = NDArray[np.float64]

BASE = 3  # joints of the base, in front of the axes
_NUDGE = 1e-6  # rad and rad/s
_STEPS = 4
"""Steps of the integration in a tick of the controller. Dry friction reverses at a step."""
ORDER = np.array([CHAIN.index(axis) for axis in AXES])
"""Where each of `AXES` stands among MuJoCo's five axis joints."""


def mujoco() -> Any:
    """Return the package MuJoCo.

    Raises
    ------
    MissingExtraError
        If it is not installed.

    Examples
    --------
    >>> mujoco().__name__
    'mujoco'
    """
    try:
        import mujoco as package
    except ImportError as error:
        raise MissingExtraError(
            'the motion table needs MuJoCo, which is not installed; pip install "hmpim[table]"'
        ) from error
    return package


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Step:
    """Derivatives of one tick, x[k+1] = A x[k] + B u[k], about a point at rest.

    The state is the angles of base and axes (8, rad), their rates (8, rad/s) and the torques of
    the actuators (5, N·m), joints and actuators in MuJoCo's order; u is the torques demanded.

    Parameters
    ----------
    a : ndarray, shape (21, 21)
    b : ndarray, shape (21, 5)
    """

    a: FloatArray
    b: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """The mechanics, compiled. The model is never changed; each run has data of its own.

    Angles and torques of the axes are in the order of `AXES`, in rad and N·m.

    Parameters
    ----------
    model : mujoco.MjModel
        Eight joints: three of the base, and `CHAIN`.
    """

    model: Any

    def advance(self, data: Any) -> None:
        """Move the table by one tick."""
        mujoco().mj_step(self.model, data, _STEPS)

    def at_rest(self, position: FloatArray) -> tuple[Any, FloatArray]:
        """Data of the table standing still, held by its actuators, and the holding torques.

        Parameters
        ----------
        position : ndarray, shape (5,)
            Angles of the axes.

        Returns
        -------
        data : mujoco.MjData
            Torques that carry the weight are set; the base is held level likewise.
        torque : ndarray, shape (5,)
            What the actuators give, in MuJoCo's order.
        """
        mj = mujoco()
        data = mj.MjData(self.model)
        data.qpos[BASE:][ORDER] = position
        mj.mj_inverse(self.model, data)
        weight = data.qfrc_inverse.copy()
        data.qfrc_applied[:BASE] = weight[:BASE]
        torque = weight[BASE:]
        data.act[:] = torque
        data.ctrl[:] = torque
        mj.mj_forward(self.model, data)
        return data, torque

    def mass_matrix(self, position: FloatArray) -> FloatArray:
        """Inertia of base and axes, shape (8, 8), kg·m², joints in MuJoCo's order."""
        mj = mujoco()
        data, _ = self.at_rest(position)
        full = np.zeros((self.model.nv, self.model.nv))
        mj.mj_fullM(self.model, data, full)
        return full

    def inertia(self, position: FloatArray) -> FloatArray:
        """What each axis turns when the others stand still, shape (5,), kg·m²."""
        return np.asarray(np.diag(self.mass_matrix(position))[BASE:][ORDER])

    def torques(
        self, position: FloatArray, velocity: FloatArray, acceleration: FloatArray
    ) -> FloatArray:
        """Torque of each axis that a motion takes, the base standing still.

        Weight, inertia, couplings between the axes, centrifugal torques and friction count.

        Parameters
        ----------
        position, velocity, acceleration : ndarray, shape (n, 5)
            The motion of all axes, rad, rad/s, rad/s².

        Returns
        -------
        ndarray, shape (n, 5)
            In N·m.
        """
        mj = mujoco()
        data = mj.MjData(self.model)
        to_joint = np.argsort(ORDER)
        q, v, a = (x[:, to_joint] for x in (position, velocity, acceleration))
        joints = slice(BASE, None)
        result = np.empty_like(q)
        for k in range(q.shape[0]):
            data.qpos[joints] = q[k]
            data.qvel[joints] = v[k]
            data.qacc[joints] = a[k]
            mj.mj_inverse(self.model, data)
            result[k] = data.qfrc_inverse[joints]
        return result[:, ORDER]

    def step(self, position: FloatArray) -> Step:
        """Derivatives of one tick about a point at rest.

        Those of one step of the integration (MuJoCo's `mjd_transitionFD`), composed at a constant
        demand.

        Parameters
        ----------
        position : ndarray, shape (5,)
            Angles of the axes.
        """
        data, _ = self.at_rest(position)
        # A step turns a torque into so small an angle that it needs a nudge of its own size:
        # what suits angles and rates would drown in the rounding of an axis off its middle.
        a, _ = self._differences(data, _NUDGE)
        by_torque, b = self._differences(
            data, 0.1 * float(self.model.actuator_forcerange[:, 1].min())
        )
        torques = 2 * self.model.nv
        a[:, torques:] = by_torque[:, torques:]
        powers = [np.linalg.matrix_power(a, k) for k in range(_STEPS + 1)]
        return Step(a=powers[-1], b=np.sum(powers[:-1], axis=0) @ b)

    def _differences(self, data: Any, nudge: float) -> tuple[FloatArray, FloatArray]:
        size = 2 * self.model.nv + self.model.na
        a, b = np.zeros((size, size)), np.zeros((size, self.model.nu))
        mujoco().mjd_transitionFD(self.model, data, nudge, True, a, b, None, None)
        return a, b


@lru_cache(maxsize=32)
def build(
    axes: tuple[AxisSpec, ...],
    *,
    uut: Rigid | None,
    target: Rigid | None,
    base: Base,
    friction: bool,
    tick: float,
) -> Plant:
    """Compile the table for a controller's tick, s; the other arguments are those of `mjcf`.

    Raises
    ------
    MissingExtraError
        If MuJoCo is not installed.

    Examples
    --------
    >>> from hmpim.rigs.table.axes import FIG_4
    >>> plant = build(FIG_4, uut=None, target=None, base=Base(), friction=False, tick=5e-4)
    >>> plant.inertia(np.zeros(5)).round(2).tolist()
    [0.18, 3.5, 14.1, 400.0, 750.0]
    """
    text = mjcf(axes, uut=uut, target=target, base=base, friction=friction, timestep=tick / _STEPS)
    return Plant(model=mujoco().MjModel.from_xml_string(text))
