"""Sections II and V: a five-axis flight motion simulator in MuJoCo, and its exact responses."""

from hmpim.rigs.table.axes import AXES, FIG_4, AxisName, AxisSpec, CommandMode, TablePosition
from hmpim.rigs.table.bodies import LOADS, Base, LoadName, Rigid, both_loads
from hmpim.rigs.table.servo import Gains
from hmpim.rigs.table.simulate import History
from hmpim.rigs.table.table import MotionTable
from hmpim.rigs.table.truth import exact_bandwidth, linear_response

__all__ = [
    "AXES",
    "FIG_4",
    "LOADS",
    "AxisName",
    "AxisSpec",
    "Base",
    "CommandMode",
    "Gains",
    "History",
    "LoadName",
    "MotionTable",
    "Rigid",
    "TablePosition",
    "both_loads",
    "exact_bandwidth",
    "linear_response",
]
