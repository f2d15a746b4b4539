"""Reports: one HTML page for a browser, one table for a terminal."""

from hmpim.report.about import About
from hmpim.report.files import write_figures
from hmpim.report.html import check_page, render, report, sheet
from hmpim.report.numbers import (
    format_estimate,
    format_interval,
    format_number,
    format_value,
    plus_minus,
)
from hmpim.report.repeats_text import print_levels, print_repeats, repeats_table
from hmpim.report.text import parameter_table, print_result

__all__ = [
    "About",
    "check_page",
    "format_estimate",
    "format_interval",
    "format_number",
    "format_value",
    "parameter_table",
    "plus_minus",
    "print_levels",
    "print_repeats",
    "print_result",
    "render",
    "repeats_table",
    "report",
    "sheet",
    "write_figures",
]
