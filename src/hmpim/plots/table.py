"""The motion table as it stands: gimbals, axes and loads, placed by its own mechanics."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.style import COLOURS, FONT_SIZE, WIDTH, Colour

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D  # type: ignore[import-untyped]

    from hmpim.rigs.table import MotionTable

__all__ = ["table_drawing"]

FloatArray = NDArray[np.float64]

# Frame of each gimbal, in its own axes: half sizes along x, y, z (m, not to scale), and colour.
_FRAMES: dict[str, tuple[tuple[float, float, float], Colour]] = {
    "elevation": ((0.0, 1.25, 1.05), "limit"),
    "azimuth": ((0.95, 0.0, 0.9), "other"),
    "pitch": ((0.0, 0.7, 0.6), "input"),
    "yaw": ((0.45, 0.0, 0.5), "output"),
    "roll": ((0.0, 0.28, 0.28), "model"),
}
_DIRECTION = {"roll": 0, "pitch": 1, "elevation": 1, "yaw": 2, "azimuth": 2}
_SHAFT = {"elevation": 1.5, "azimuth": 1.05, "pitch": 1.25, "yaw": 0.6, "roll": 0.45}
_LABEL = {  # where, in the gimbal's own axes
    "elevation": (0.0, 1.25, -0.85),
    "azimuth": (-0.95, 0.0, 0.75),
    "pitch": (0.0, -0.7, 0.62),
    "yaw": (-0.45, 0.0, -0.5),
    "roll": (0.0, 0.3, -0.34),
}


def table_drawing(table: "MotionTable") -> "Figure":
    """Draw the five gimbals where the table starts, from MuJoCo's own placement of its bodies.

    The frames stand for the gimbals, their sizes mean nothing; dashed lines are the axes of
    rotation. The inner axes carry the unit under test, the outer two the target.

    Parameters
    ----------
    table : MotionTable
        Its `start` is drawn.

    Raises
    ------
    MissingExtraError
        If MuJoCo is not installed.

    Examples
    --------
    >>> from hmpim.rigs import MotionTable
    >>> figure = table_drawing(MotionTable())
    >>> [text.get_text() for text in figure.axes[0].texts][:2]
    ['elevation, about y', 'azimuth, about z']
    """
    from matplotlib.figure import Figure
    from mpl_toolkits.mplot3d import Axes3D

    data, _ = table.plant.at_rest(table.start_angles)
    model = table.plant.model
    figure = Figure(figsize=(WIDTH, 0.86 * WIDTH))
    axes = Axes3D(
        figure, rect=(-0.06, -0.02, 1.12, 1.12), auto_add_to_figure=False, computed_zorder=False
    )
    figure.add_axes(axes)
    for name, (half, colour) in _FRAMES.items():
        turn = np.array(data.xmat[model.body(name).id]).reshape(3, 3)
        _draw_gimbal(axes, name, np.array(half), turn, COLOURS[colour])
    roll, azimuth = (
        np.array(data.xmat[model.body(name).id]).reshape(3, 3) for name in ("roll", "azimuth")
    )
    _draw_box(axes, np.zeros(3), np.array([0.3, 0.12, 0.12]), roll, "unit under test")
    _draw_box(axes, np.array([0.95, 0, 0]), np.array([0.12, 0.3, 0.16]), azimuth, "target")
    _draw_base(axes, -1.4)
    for i, name in enumerate("xyz"):
        tip = np.zeros(3)
        tip[i] = 0.4
        at = np.array([-0.6, -1.75, 0.5])
        axes.plot(*np.stack((at, at + tip), axis=1), color=COLOURS["muted"], linewidth=1.0)
        axes.text(*(at + 1.25 * tip), name, fontsize=FONT_SIZE, color=COLOURS["muted"])
    axes.set_box_aspect((1.0, 1.0, 1.0), zoom=1.25)
    for limits in (axes.set_xlim, axes.set_ylim, axes.set_zlim):
        limits(-1.5, 1.5)
    axes.set_axis_off()
    axes.view_init(elev=20.0, azim=-38.0)
    return figure


def _draw_gimbal(
    axes: "Axes3D", name: str, half: FloatArray, turn: FloatArray, colour: str
) -> None:
    flat = np.flatnonzero(half)
    if name == "roll":  # a ring about its axis
        angle = np.linspace(0.0, 2.0 * np.pi, 80)
        corners = np.zeros((80, 3))
        corners[:, flat[0]] = half[flat[0]] * np.cos(angle)
        corners[:, flat[1]] = half[flat[1]] * np.sin(angle)
    else:
        corners = np.zeros((5, 3))
        corners[:, flat[0]] = half[flat[0]] * np.array([1, 1, -1, -1, 1])
        corners[:, flat[1]] = half[flat[1]] * np.array([1, -1, -1, 1, 1])
    axes.plot(*(turn @ corners.T), color=colour, linewidth=3.5, solid_joinstyle="round")
    along = np.zeros(3)
    along[_DIRECTION[name]] = _SHAFT[name]
    # A rotation leaves its own axis where it is.
    ends = np.stack((-along, along), axis=1)
    axes.plot(*(turn @ ends), color=colour, linewidth=1.0, linestyle=(0, (6, 3)))
    axes.text(
        *(turn @ np.array(_LABEL[name])),
        f"{name}, about {'xyz'[_DIRECTION[name]]}",
        fontsize=FONT_SIZE,
        color=colour,
        zorder=10,
        bbox={"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none"},
    )


def _draw_box(
    axes: "Axes3D", at: FloatArray, half: FloatArray, turn: FloatArray, label: str
) -> None:
    from mpl_toolkits.mplot3d.art3d import (  # type: ignore[import-untyped]
        Poly3DCollection,
    )

    sides = []
    for i in range(3):
        for sign in (-1.0, 1.0):
            j, k = (i + 1) % 3, (i + 2) % 3
            corners = np.zeros((4, 3))
            corners[:, i] = sign * half[i]
            corners[:, j] = half[j] * np.array([-1, 1, 1, -1])
            corners[:, k] = half[k] * np.array([-1, -1, 1, 1])
            sides.append((turn @ (corners + at).T).T)
    axes.add_collection3d(
        Poly3DCollection(
            sides, facecolor="#c9ced4", edgecolor=COLOURS["muted"], linewidth=0.6, zorder=5
        )
    )
    where = turn @ (at + np.array([0.0, 0.0, half[2] + 0.06]))
    axes.text(*where, label, fontsize=FONT_SIZE, color=COLOURS["ink"], ha="center", zorder=10)


def _draw_base(axes: "Axes3D", level: float) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    floor = [(x, y, level) for x, y in ((-0.6, -1.5), (0.6, -1.5), (0.6, 1.5), (-0.6, 1.5))]
    axes.add_collection3d(
        Poly3DCollection(
            [floor], facecolor="#e6e8eb", edgecolor=COLOURS["muted"], linewidth=0.8, zorder=-5
        )
    )
    for y in (-1.5, 1.5):
        axes.plot([0, 0], [y, y], [level, 0.0], color=COLOURS["muted"], linewidth=3.0)
    for y in (-1.25, 1.25):
        axes.plot([0, 0], [y, y], [level, 0.0], color=COLOURS["muted"], linewidth=1.5)
    axes.text(0.7, -1.0, level, "base", fontsize=FONT_SIZE, color=COLOURS["muted"])
