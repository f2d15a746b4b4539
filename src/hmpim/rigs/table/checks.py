"""Limits are law: what is refused before anything moves."""

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import LimitsError
from hmpim.rigs.table.axes import AXES, AxisSpec

__all__ = ["check_torques"]

FloatArray = NDArray[np.float64]

_ROUNDING = 1e-9  # a stimulus may stand on a limit


def check_torques(time: FloatArray, torque: FloatArray, axes: tuple[AxisSpec, ...]) -> None:
    """Refuse a motion of all axes together that takes more torque than an axis has.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    torque : ndarray, shape (n, 5)
        What the motion takes, N·m, in the order of `AXES`.
    axes : tuple of AxisSpec
        With their torque limits.

    Raises
    ------
    LimitsError
        If the torque of an axis is beyond its limit; the message says when and by how much.

    Examples
    --------
    >>> from hmpim.rigs.table.axes import FIG_4
    >>> check_torques(np.zeros(1), np.full((1, 5), 400.0), FIG_4)
    Traceback (most recent call last):
    hmpim.errors.LimitsError: at 0.000 s the motion of all axes together takes 400 N·m of roll, ...
    """
    allowed = np.array([axis.torque_limit for axis in axes])
    share = np.abs(torque) / allowed
    k, i = np.unravel_index(int(np.argmax(share)), share.shape)
    if share[k, i] > 1.0 + _ROUNDING:
        raise LimitsError(
            f"at {time[k]:.3f} s the motion of all axes together takes {abs(torque[k, i]):.4g} N·m "
            f"of {AXES[i]}, beyond its limit {allowed[i]:g} N·m; scale the stimuli by "
            f"{1.0 / share[k, i]:.3g} or so, or run fewer axes at once"
        )
