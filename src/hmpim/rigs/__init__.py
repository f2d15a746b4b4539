"""Section II: units under test, simulated or real, behind one protocol."""

from hmpim.rigs.block import Block, ChannelSpec, Layout, Quantity, Reply, RunReport, Samples
from hmpim.rigs.clock import Clock, ManualClock, SkewedClock, SystemClock
from hmpim.rigs.fake import FakeRig
from hmpim.rigs.function import FunctionRig
from hmpim.rigs.mounted import CarriedSensor, Mounted
from hmpim.rigs.protocol import Clocked, LimitsOfAxes, Reporting, Rig, Seeded, Stimuli
from hmpim.rigs.pulses import SerialTicks, UdpTicks, find_ticks, pulse_bytes
from hmpim.rigs.sensor import Sensor
from hmpim.rigs.stimuli import Commands, commands_of, shared_band, stimuli_by_axis
from hmpim.rigs.table import MotionTable
from hmpim.rigs.tick import TickClock

__all__ = [
    "Block",
    "CarriedSensor",
    "ChannelSpec",
    "Clock",
    "Clocked",
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
    "SerialTicks",
    "SkewedClock",
    "Stimuli",
    "SystemClock",
    "TickClock",
    "UdpTicks",
    "commands_of",
    "find_ticks",
    "pulse_bytes",
    "shared_band",
    "stimuli_by_axis",
]
