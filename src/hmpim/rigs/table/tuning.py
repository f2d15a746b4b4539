"""Gains from the specification: each axis's -90° frequency is put where Fig. 4 has it."""

import math
from functools import lru_cache

import numpy as np
import scipy

from hmpim.errors import ArgumentError
from hmpim.rigs.table.axes import AxisSpec
from hmpim.rigs.table.bodies import Base, load_named
from hmpim.rigs.table.linear import close_loop, hold_response
from hmpim.rigs.table.plant import build
from hmpim.rigs.table.servo import Gains

__all__ = ["tune"]

_ROUNDS = 4  # the axes hardly feel each other: the second round moves gains by less than 1e-3
_SPAN = (0.5, 3.0)  # of the servo's own frequency over the bandwidth wanted


@lru_cache(maxsize=16)
def tune(axes: tuple[AxisSpec, ...], *, base: Base, tick: float, hold: int, late: int) -> Gains:
    """Find the gains at which each axis has its bandwidth with position commands.

    With the acceptance loads, without friction and about the middle of the travel. The servo
    reckons with the inertia an axis then has. Its two poles have the axis's `damping_ratio`,
    and their frequency is solved so that the position lags the held command by 90° at
    `AxisSpec.bandwidth`, actuator lag and transport delay included. What holding the command
    adds is no property of the table: it comes on top, and depends on the rate of the commands.

    Parameters
    ----------
    axes : tuple of AxisSpec
        The five axes, in the order of `AXES`.
    base : Base
        The block underneath.
    tick : float
        Period of the controller, s.
    hold, late : int
        Ticks for which a command is held, and by which it comes late.

    Returns
    -------
    Gains

    Raises
    ------
    ArgumentError
        If no gains give an axis its bandwidth, or the loop would not be stable.

    Examples
    --------
    >>> from hmpim.rigs.table.axes import FIG_4
    >>> gains = tune(FIG_4, base=Base(), tick=5e-4, hold=2, late=2)
    >>> gains.inertia.round(2).tolist()
    [0.54, 4.45, 15.05, 760.0, 1100.0]
    """
    plant = build(
        axes,
        uut=load_named("uut", "acceptance"),
        target=load_named("target", "acceptance"),
        base=base,
        friction=False,
        tick=tick,
    )
    middle = np.zeros(5)
    step, inertia = plant.step(middle), plant.inertia(middle)
    wanted = np.array([axis.bandwidth for axis in axes])
    damping = np.array([axis.damping_ratio for axis in axes])
    ratio = np.full(5, 1.15)

    def gains(ratio: np.ndarray[tuple[int], np.dtype[np.float64]]) -> Gains:
        omega = math.tau * wanted * ratio
        return Gains(position=omega / (2.0 * damping), rate=2.0 * damping * omega, inertia=inertia)

    for _ in range(_ROUNDS):
        for i, axis in enumerate(axes):

            def in_phase(share: float, i: int = i) -> float:
                trial = ratio.copy()
                trial[i] = share
                loop = close_loop(step, gains(trial), mode="P", tick=tick)
                at = loop.response(wanted[i], axis_in=i, axis_out=i, hold=hold, late=late)
                behind = complex((at / hold_response(wanted[i], fs=1.0 / (hold * tick)))[0])
                return behind.real / abs(behind)

            if not in_phase(_SPAN[0]) < 0.0 < in_phase(_SPAN[1]):
                raise ArgumentError(
                    f"no gains give {axis.name} a bandwidth of {axis.bandwidth:g} Hz with an "
                    f"actuator lag of {axis.actuator_lag * 1e3:g} ms and commands "
                    f"{late * tick * 1e3:g} ms late; ask for less, or a faster actuator"
                )
            ratio[i] = scipy.optimize.brentq(in_phase, *_SPAN, xtol=1e-10)
    found = gains(ratio)
    decay = close_loop(step, found, mode="P", tick=tick).slowest_decay
    if decay >= 1.0:
        raise ArgumentError(
            f"the tuned servos would not be stable (an eigenvalue of {decay:.4f}); "
            "ask for less bandwidth, or a faster actuator"
        )
    return found
