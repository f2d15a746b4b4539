"""Run a stimulus on a rig, safely."""

from hmpim.experiment.collect import Played
from hmpim.experiment.feel import Feel
from hmpim.experiment.log import Event, RunLog
from hmpim.experiment.options import RunOptions
from hmpim.experiment.outliving import OutlivingRig
from hmpim.experiment.run import run
from hmpim.experiment.running import EndsWhen, Subscriber
from hmpim.experiment.timing import Timing, measure_timing
from hmpim.experiment.until import Until, until_of
from hmpim.experiment.watch import Watch
from hmpim.rigs import Clock, ManualClock, SystemClock

__all__ = [
    "Clock",
    "EndsWhen",
    "Event",
    "Feel",
    "ManualClock",
    "OutlivingRig",
    "Played",
    "RunLog",
    "RunOptions",
    "Subscriber",
    "SystemClock",
    "Timing",
    "Until",
    "Watch",
    "measure_timing",
    "run",
    "until_of",
]
