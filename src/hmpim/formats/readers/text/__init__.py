"""Tables of text: CSV, TSV, blank-separated, with or without headings, packed or not."""

from hmpim.formats.readers.text.headings import named
from hmpim.formats.readers.text.notes import KINDS, MARK, heading_of
from hmpim.formats.readers.text.reader import TEXT, TIME_NAMES, list_table, read_table
from hmpim.formats.readers.text.source import MAX_EXPANDED, MAX_LINE, read_text
from hmpim.formats.readers.text.stamps import unlikely_seconds

__all__ = [
    "KINDS",
    "MARK",
    "MAX_EXPANDED",
    "MAX_LINE",
    "TEXT",
    "TIME_NAMES",
    "heading_of",
    "list_table",
    "named",
    "read_table",
    "read_text",
    "unlikely_seconds",
]
