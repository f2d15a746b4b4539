"""A unit on a carrier: one moves, the other measures, each with a clock of its own."""

from hmpim.rigs.mounted.arrivals import Arrivals
from hmpim.rigs.mounted.carried import CarriedSensor
from hmpim.rigs.mounted.mounted import Mounted, Unit

__all__ = ["Arrivals", "CarriedSensor", "Mounted", "Unit"]
