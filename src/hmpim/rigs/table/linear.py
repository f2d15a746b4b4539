"""The closed loop, linearised: exact frequency responses of the table with its servos.

One tick of the plant is differentiated by MuJoCo, the servo's law closes the loop, and what the
command does (held over whole ticks, late by whole ticks) is summed in closed form. Nothing is
made continuous on the way, so that this is what a small command really does in the simulation,
encoder steps and dry friction apart.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError
from hmpim.rigs.table.axes import CommandMode
from hmpim.rigs.table.plant import BASE, ORDER, Step
from hmpim.rigs.table.servo import Gains, feedforward

__all__ = ["ClosedLoop", "close_loop", "hold_response", "phase_crossing"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ClosedLoop:
    """x[k+1] = A x[k] + position·r[k] + velocity·ṙ[k] + acceleration·r̈[k], tick by tick.

    Parameters
    ----------
    a : ndarray, shape (21, 21)
        State as in `Step`.
    position, velocity, acceleration : ndarray, shape (21, 5)
        What the commands of the axes add, `AXES` in order, rad, rad/s, rad/s².
    tick : float
        Period of the controller, s.
    """

    a: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    tick: float

    @property
    def slowest_decay(self) -> float:
        """Largest magnitude of an eigenvalue of `a`; the loop is stable below 1.

        Examples
        --------
        >>> import numpy as np
        >>> still = np.zeros((1, 5))
        >>> loop = ClosedLoop(
        ...     a=np.array([[-0.5]]), position=still, velocity=still, acceleration=still, tick=1.0
        ... )
        >>> loop.slowest_decay
        0.5
        """
        return float(np.abs(np.linalg.eigvals(self.a)).max())

    def response(
        self, frequency: ArrayLike, *, axis_in: int, axis_out: int, hold: int, late: int
    ) -> ComplexArray:
        """Position samples over command samples of a sine, both at the command's rate.

        Parameters
        ----------
        frequency : array_like, shape (m,)
            Hz.
        axis_in, axis_out : int
            Places in `AXES`.
        hold, late : int
            Ticks for which each command is held, and by which it comes late.

        Returns
        -------
        complex ndarray, shape (m,)
        """
        f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
        s = 2j * math.pi * f
        z = np.exp(s * hold * self.tick)
        drive = (
            self.position[:, axis_in]
            + s[:, None] * self.velocity[:, axis_in]
            + (s * s)[:, None] * self.acceleration[:, axis_in]
        )
        # One period of the command, tick by tick: x <- A x + drive · (command in force).
        forced = np.zeros_like(drive)
        for i in range(hold):
            forced = forced @ self.a.T + drive * (z ** ((i - late) // hold))[:, None]
        over = np.linalg.matrix_power(self.a, hold)
        eye = np.eye(self.a.shape[0])
        state = np.linalg.solve(z[:, None, None] * eye - over, forced[:, :, None])[:, :, 0]
        return np.asarray(state[:, BASE + ORDER[axis_out]])


def close_loop(step: Step, gains: Gains, *, mode: CommandMode, tick: float) -> ClosedLoop:
    """Close the servos of all axes around one step of the plant.

    Parameters
    ----------
    step : Step
        Derivatives of the plant.
    gains : Gains
        Of the servos.
    mode : {'P', 'PV', 'PVA'}
        Which commands count.
    tick : float
        Period of the controller, s.
    """
    joints = step.a.shape[0] // 2 - 2  # 8 angles, 8 rates, 5 torques
    to_joint = np.argsort(ORDER)
    inertia, rate, position = (
        getattr(gains, name)[to_joint] for name in ("inertia", "rate", "position")
    )
    stiffness, damping = inertia * rate * position, inertia * rate
    angles = BASE + np.arange(5)
    feedback = np.zeros((5, step.a.shape[0]))
    feedback[np.arange(5), angles] = stiffness
    feedback[np.arange(5), joints + angles] = damping
    with_velocity, with_acceleration = feedforward(mode)
    return ClosedLoop(
        a=step.a - step.b @ feedback,
        position=(step.b * stiffness)[:, ORDER],
        velocity=(step.b * (with_velocity * damping))[:, ORDER],
        acceleration=(step.b * (with_acceleration * inertia))[:, ORDER],
        tick=tick,
    )


def hold_response(frequency: ArrayLike, *, fs: float) -> ComplexArray:
    """Response of holding a command over 1/fs.

    Examples
    --------
    >>> bool(abs(hold_response(100.0, fs=1000.0)[0]) < 1)
    True
    """
    turn = np.atleast_1d(np.asarray(frequency, dtype=np.float64)) / fs
    return np.asarray(np.sinc(turn) * np.exp(-1j * math.pi * turn))


def phase_crossing(frequency: FloatArray, response: ComplexArray, *, phase: float = -90.0) -> float:
    """First frequency in Hz at which the unwrapped phase falls to `phase` degrees.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, rising, from well below the crossing and close enough to follow the phase.
    response : complex ndarray, shape (m,)
    phase : float
        Degrees.

    Raises
    ------
    ArgumentError
        If the phase stays above.

    Examples
    --------
    >>> f = np.linspace(0.1, 20.0, 2000)
    >>> round(phase_crossing(f, np.exp(-2j * np.pi * f * 0.025)), 6)
    10.0
    """
    turned = np.degrees(np.unwrap(np.angle(response)))
    below = np.flatnonzero(turned <= phase)
    if below.size == 0 or below[0] == 0:
        raise ArgumentError(
            f"the phase does not fall to {phase:g} deg between {frequency[0]:g} Hz and "
            f"{frequency[-1]:g} Hz; widen the span"
        )
    k = int(below[0])
    share = (turned[k - 1] - phase) / (turned[k - 1] - turned[k])
    return float(frequency[k - 1] + share * (frequency[k] - frequency[k - 1]))
