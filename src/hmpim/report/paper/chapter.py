"""What a chapter of the study gives."""

from collections.abc import Mapping
from dataclasses import dataclass

from hmpim.report.figures import Picture
from hmpim.report.paper.rows import Row

__all__ = ["Chapter"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chapter:
    """Figures by their number in the paper, and the rows of the table that belong to them."""

    pictures: Mapping[int, Picture]
    rows: tuple[Row, ...]
