"""Binary logs of others: each a module that parses one format into a `Log`."""

from hmpim.formats.readers.logs.log import Column, Group, Log, list_log, take_series

__all__ = ["Column", "Group", "Log", "list_log", "take_series"]
