"""Records: time-stamped channels, each with its unit, and the quality of the data."""

from hmpim.record.quality import Finding, inspect_timing
from hmpim.record.record import Channel, Intersample, Record

__all__ = ["Channel", "Finding", "Intersample", "Record", "inspect_timing"]
