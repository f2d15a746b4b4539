"""Section II: units under test, simulated or real, behind one protocol."""

from hmpim.rigs.function import FunctionRig
from hmpim.rigs.protocol import Rig
from hmpim.rigs.sensor import Quantity, Sensor
from hmpim.rigs.table import MotionTable

__all__ = ["FunctionRig", "MotionTable", "Quantity", "Rig", "Sensor"]
