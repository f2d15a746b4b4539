"""Run a stimulus on a rig, safely."""

from hmpim.experiment.collect import Played
from hmpim.experiment.log import Event, RunLog
from hmpim.experiment.run import Subscriber, run
from hmpim.rigs import Clock, ManualClock, SystemClock

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
