"""Records: time-stamped channels, each with its unit, and the quality of the data."""

from hmpim.record.align import Aligned, Signal, uniform
from hmpim.record.clock import Clock, fit_clock
from hmpim.record.finding import Finding, Severity
from hmpim.record.quality import inspect_record, inspect_timing, inspect_values
from hmpim.record.record import ROLES, Channel, Intersample, Record, Role
from hmpim.record.series import Series

__all__ = [
    "ROLES",
    "Aligned",
    "Channel",
    "Clock",
    "Finding",
    "Intersample",
    "Record",
    "Role",
    "Series",
    "Severity",
    "Signal",
    "fit_clock",
    "inspect_record",
    "inspect_timing",
    "inspect_values",
    "uniform",
]
