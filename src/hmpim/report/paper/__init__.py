"""The paper again: its figures and its printed numbers, next to the results of the method here."""

from hmpim.report.paper.rows import Row, markdown_table, table_dict
from hmpim.report.paper.study import FIGURES, Chapter, Study, make_study
from hmpim.report.paper.write import write_study

__all__ = [
    "FIGURES",
    "Chapter",
    "Row",
    "Study",
    "make_study",
    "markdown_table",
    "table_dict",
    "write_study",
]
