"""Section II: units under test, simulated or real, behind one protocol."""

from hmpim.rigs.block import Block, ChannelSpec, Layout, Quantity, Reply, Samples
from hmpim.rigs.function import FunctionRig
from hmpim.rigs.protocol import LimitsOfAxes, Rig, Seeded, Stimuli
from hmpim.rigs.sensor import Sensor
from hmpim.rigs.stimuli import Commands, commands_of, shared_band, stimuli_by_axis
from hmpim.rigs.table import MotionTable

__all__ = [
    "Block",
    "ChannelSpec",
    "Commands",
    "FunctionRig",
    "Layout",
    "LimitsOfAxes",
    "MotionTable",
    "Quantity",
    "Reply",
    "Rig",
    "Samples",
    "Seeded",
    "Sensor",
    "Stimuli",
    "commands_of",
    "shared_band",
    "stimuli_by_axis",
]
