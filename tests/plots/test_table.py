"""The drawing of the table stands as the mechanics do."""

import numpy as np
import pytest

from hmpim.plots.table import table_drawing
from hmpim.rigs.table import MotionTable, TablePosition

pytest.importorskip("mujoco", reason="the table needs the extra 'table'")

FRAMES = {"elevation": 0, "azimuth": 2, "pitch": 4, "yaw": 6, "roll": 8}


def frame(name, **start):
    """Corners of a gimbal's frame, shape (n, 3)."""
    axes = table_drawing(MotionTable(start=TablePosition(**start))).axes[0]
    return np.stack(axes.lines[FRAMES[name]].get_data_3d(), axis=1)


def test_outer_axes_carry_the_inner_ones_with_them():
    turn = np.radians(30.0)
    about_y = np.array(
        [[np.cos(turn), 0, np.sin(turn)], [0, 1, 0], [-np.sin(turn), 0, np.cos(turn)]]
    )
    for name in ("pitch", "yaw", "roll"):
        assert np.allclose(frame(name, pitch=30.0), frame(name) @ about_y.T, atol=1e-12)
    for name in ("elevation", "azimuth"):
        assert np.allclose(frame(name, pitch=30.0), frame(name), atol=1e-12)


def test_roll_turns_roll_alone():
    assert np.allclose(frame("yaw", roll=40.0), frame("yaw"), atol=1e-12)
    assert not np.allclose(frame("roll", roll=40.0), frame("roll"), atol=0.05)
