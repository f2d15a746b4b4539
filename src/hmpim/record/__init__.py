"""Records: time-stamped channels, each with its unit, and the quality of the data."""

from hmpim.record.align import Aligned, Signal, uniform
from hmpim.record.channel import (
    BETWEEN,
    INTERSAMPLE_WORDS,
    Channel,
    Intersample,
    is_held,
)
from hmpim.record.clock import Clock, fit_clock, rate_of
from hmpim.record.describe import Description, describe
from hmpim.record.finding import Finding, Severity
from hmpim.record.held import Waveform
from hmpim.record.offset import ClockOffset, clock_offset
from hmpim.record.onto import on_grid
from hmpim.record.propose import Proposal, propose
from hmpim.record.quality import inspect_record, inspect_timing, inspect_values
from hmpim.record.record import ROLES, Record, Role
from hmpim.record.series import Series
from hmpim.record.stopping import Stopping
from hmpim.record.sweeps import Motion, find_motions

__all__ = [
    "BETWEEN",
    "INTERSAMPLE_WORDS",
    "ROLES",
    "Aligned",
    "Channel",
    "Clock",
    "ClockOffset",
    "Description",
    "Finding",
    "Intersample",
    "Motion",
    "Proposal",
    "Record",
    "Role",
    "Series",
    "Severity",
    "Signal",
    "Stopping",
    "Waveform",
    "clock_offset",
    "describe",
    "find_motions",
    "fit_clock",
    "inspect_record",
    "inspect_timing",
    "inspect_values",
    "is_held",
    "on_grid",
    "propose",
    "rate_of",
    "uniform",
]
