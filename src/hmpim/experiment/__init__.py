"""Run a stimulus on a rig, safely."""

from hmpim.experiment.clock import Clock, ManualClock, SystemClock
from hmpim.experiment.collect import Played
from hmpim.experiment.log import Event, RunLog
from hmpim.experiment.run import Subscriber, run

__all__ = [
    "Clock",
    "Event",
    "ManualClock",
    "Played",
    "RunLog",
    "Subscriber",
    "SystemClock",
    "run",
]
