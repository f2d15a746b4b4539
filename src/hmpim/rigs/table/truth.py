"""Exact linear responses of the table, with which an identification is compared."""

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError
from hmpim.rigs.table.axes import AXES, AxisName, CommandMode, TablePosition
from hmpim.rigs.table.linear import close_loop, hold_response, phase_crossing
from hmpim.rigs.table.table import MotionTable

__all__ = ["Hold", "exact_bandwidth", "linear_response"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

Hold = Literal["included", "removed"]
"""Whether a response contains what holding the command between its samples does.

All commands are held. A fit to a record that states this finds the table behind the hold.
"""

_GRID = 0.25  # Hz; the phase turns by a few degrees at most in between


def linear_response(
    table: MotionTable,
    frequency: ArrayLike,
    *,
    axis_in: AxisName,
    axis_out: AxisName | None = None,
    mode: CommandMode | None = None,
    operating_point: TablePosition | None = None,
    fs: float = 1000.0,
    hold: Hold = "removed",
) -> ComplexArray:
    """Exact frequency response of the simulated table to a small command, friction off.

    MuJoCo's derivatives of one step (`mjd_transitionFD`), with the servos closed around it, and
    command hold and transport delay summed exactly: samples of the true position over samples
    of the command, without the hold's own response unless `hold` is 'included'.

    Parameters
    ----------
    table : MotionTable
        Loads, base, delay and gains are taken from it.
    frequency : array_like, shape (m,)
        Hz, positive and below fs/2.
    axis_in, axis_out : str
        Axis commanded and axis watched; None watches the one commanded.
    mode : {'P', 'PV', 'PVA'} or None
        Commands that are sent; None for the table's.
    operating_point : TablePosition or None
        Where the axes stand; None for the table's start.
    fs : float
        Rate of the commands, Hz.
    hold : {'removed', 'included'}
        'included' is the ratio of the samples' spectra, which slower commands make worse.
        'removed' divides by the hold's own response, which leaves the table behind the hold:
        that is what `identify` finds in the table's own records, and what Fig. 4 is tuned to.

    Returns
    -------
    complex ndarray, shape (m,)

    Raises
    ------
    ArgumentError
        For an axis not known, a frequency out of range, or a load so light that the servos,
        which know nothing of it, are not stable.

    Examples
    --------
    >>> at = linear_response(MotionTable(), [0.01, 43.0], axis_in="roll")
    >>> bool(abs(at[0] - 1) < 0.01), np.degrees(np.angle(at)).round(1).tolist()[1]
    (True, -90.0)
    """
    f = np.atleast_1d(np.asarray(frequency, dtype=np.float64))
    if f.ndim != 1 or not np.all((f > 0.0) & (f < 0.5 * fs)):
        raise ArgumentError(
            f"frequency = {frequency!r} Hz must lie above 0 and below half the rate, {0.5 * fs:g}"
        )
    for axis in (axis_in, axis_out or axis_in):
        if axis not in AXES:
            raise ArgumentError(f"axis {axis!r} is not known; use one of {AXES}")
    if hold not in ("included", "removed"):
        raise ArgumentError(f"hold = {hold!r} is not known; use 'included' or 'removed'")
    at = replace(
        table,
        mode=table.mode if mode is None else mode,
        start=table.start if operating_point is None else operating_point,
        friction=False,
    )
    timing = at.timing(fs)
    loop = close_loop(at.plant.step(at.start_angles), at.gains, mode=at.mode, tick=timing.tick)
    if loop.slowest_decay >= 1.0:
        raise ArgumentError(
            f"with these loads the servos are not stable (an eigenvalue of "
            f"{loop.slowest_decay:.4f}), and there is no response; carry more, or tune for less"
        )
    response = loop.response(
        f,
        axis_in=AXES.index(axis_in),
        axis_out=AXES.index(axis_out or axis_in),
        hold=timing.hold,
        late=timing.late,
    )
    return response if hold == "included" else np.asarray(response / hold_response(f, fs=fs))


def exact_bandwidth(
    table: MotionTable,
    *,
    axis: AxisName,
    mode: CommandMode | None = None,
    operating_point: TablePosition | None = None,
    fs: float = 1000.0,
    hold: Hold = "removed",
) -> float:
    """Frequency in Hz at which an axis lags its command by 90°, friction off; behind the hold.

    Parameters
    ----------
    table, axis, mode, operating_point, fs, hold
        As for `linear_response`.

    Returns
    -------
    float

    Raises
    ------
    ArgumentError
        If the phase does not fall so far below half the command's rate.

    Examples
    --------
    >>> round(exact_bandwidth(MotionTable(), axis="elevation"), 2)
    7.0
    """
    f = np.arange(_GRID, 0.5 * fs - _GRID, _GRID)
    response = linear_response(
        table, f, axis_in=axis, mode=mode, operating_point=operating_point, fs=fs, hold=hold
    )
    return phase_crossing(f, response)
