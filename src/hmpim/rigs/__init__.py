"""Section II: units under test, simulated or real, behind one protocol."""

from hmpim.rigs.block import Block, ChannelSpec, Layout, Quantity, Reply, RunReport, Samples
from hmpim.rigs.clock import Clock, ManualClock, SkewedClock, SystemClock
from hmpim.rigs.fake import FakeRig
from hmpim.rigs.function import FunctionRig
from hmpim.rigs.mounted import CarriedSensor, Mounted
from hmpim.rigs.protocol import LimitsOfAxes, Reporting, Rig, Seeded, Stimuli
from hmpim.rigs.sensor import Sensor
from hmpim.rigs.stimuli import Commands, commands_of, shared_band, stimuli_by_axis
from hmpim.rigs.table import MotionTable

__all__ = [
    "Block",
    "CarriedSensor",
    "ChannelSpec",
    "Clock",
    "Commands",
    "FakeRig",
    "FunctionRig",
    "Layout",
    "LimitsOfAxes",
    "ManualClock",
    "MotionTable",
    "Mounted",
    "Quantity",
    "Reply",
    "Reporting",
    "Rig",
    "RunReport",
    "Samples",
    "Seeded",
    "Sensor",
    "SkewedClock",
    "Stimuli",
    "SystemClock",
    "commands_of",
    "shared_band",
    "stimuli_by_axis",
]
