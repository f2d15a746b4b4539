"""Records: time-stamped channels, each with its unit, and the quality of the data."""

from hmpim.record.align import Aligned, Signal, uniform
from hmpim.record.clock import Clock, fit_clock
from hmpim.record.finding import Finding, Severity
from hmpim.record.quality import inspect_record, inspect_timing, inspect_values
from hmpim.record.record import Channel, Intersample, Record
from hmpim.record.series import Series

__all__ = [
    "Aligned",
    "Channel",
    "Clock",
    "Finding",
    "Intersample",
    "Record",
    "Series",
    "Severity",
    "Signal",
    "fit_clock",
    "inspect_record",
    "inspect_timing",
    "inspect_values",
    "uniform",
]
