"""One page for a whole study: what passed, every case, and what was compared."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from hmpim.plots.style import printable
from hmpim.report.figures import Picture
from hmpim.report.html import page_environment

__all__ = ["Grid", "Section", "StudyPage", "render_study", "unbroken"]

_VALUE = re.compile(r"(-?[\d.]+) ((?:±|−).+?)((?: \?)?)")
"""A value, its error, and the mark of a doubtful one."""

_BESIDE = 8.5  # inches: a wider picture has none beside it


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """A table of text: its caption, its columns, its rows; the first column names the row.

    `note` stands below it: how it is to be read. A `folded` one shows its caption until it is
    opened. On paper one `at_end` stands opened behind the sections, and one `on_screen` not at all.
    A `dense` one has its errors beneath their values, and each column that `beneath` names beneath
    the column before, so that more fits on a line. `hints` say what the names of the rows are
    short for, none or one for each.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    folded: bool = False
    at_end: bool = False
    on_screen: bool = False
    dense: bool = False
    beneath: tuple[str, ...] = ()
    hints: tuple[str, ...] = ()

    @property
    def heads(self) -> list[list[str]]:
        """Columns as the page has them: what stands over each, and what beneath that."""
        return self._together(self.columns)

    @property
    def lines(self) -> list[list[list[str]]]:
        """Rows as the page has them: of each cell what it says, and what stands beneath."""
        return [self._together([*map(self._split, row)]) for row in self.rows]

    def _together(self, cells: Sequence[str | Sequence[str]]) -> list[list[str]]:
        found: list[list[str]] = []
        for column, cell in zip(self.columns, cells, strict=True):
            own = [cell] if isinstance(cell, str) else [*cell]
            if column in self.beneath and found:
                found[-1] += own
            else:
                found.append(own)
        return found

    def _split(self, cell: str) -> list[str]:
        number = _VALUE.fullmatch(cell) if self.dense else None
        if number is None:
            return [cell]
        value, error, doubt = number.groups()
        return [value + doubt, error]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """A heading, what was observed before, what was found, with tables and pictures."""

    title: str
    observed: str
    found: tuple[str, ...]
    grids: tuple[Grid, ...]
    pictures: tuple[Picture, ...]

    @property
    def observed_by(self) -> str:
        """Who observed what was observed before."""
        return "The paper" if "Fig" in self.title else "Observed before"

    @property
    def is_low(self) -> bool:
        """Whether its pictures have one panel each, so that three sections fill a sheet."""
        return len(self.pictures) > 1 and all(len(p.figure.heights) == 1 for p in self.pictures)

    def is_broad(self, picture: Picture) -> bool:
        """Whether a picture takes the width of two."""
        return picture.figure.width > _BESIDE

    def is_tall(self, picture: Picture) -> bool:
        """Whether a picture is twice as high as another of its section, beside which it stands."""
        return sum(picture.figure.heights) >= 2.0 * min(
            sum(p.figure.heights) for p in self.pictures
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyPage:
    """Everything that the page shows, its first table above all.

    `met` is None where nothing was specified; `doubtful` says that some figures are, whether what
    is met rests on them or not; `about` stands above all, `notes` below the headline; `sheets` are
    names and addresses of pages beside it. One `upright` is printed in portrait: its tables are
    narrow.
    """

    title: str
    description: str
    headline: str
    met: bool | None
    grids: tuple[Grid, ...]
    sections: tuple[Section, ...]
    facts: tuple[tuple[str, str], ...]
    sheets: tuple[tuple[str, str], ...] = ()
    about: tuple[tuple[str, str], ...] = ()
    notes: tuple[str, ...] = ()
    doubtful: bool = False
    upright: bool = False

    @property
    def verdict(self) -> str:
        """Colour of the headline, by the name of a verdict; none where nothing was specified."""
        if self.met and self.doubtful:
            return "doubtful"
        return {True: "ok", False: "not_identifiable", None: ""}[self.met]


def render_study(page: StudyPage) -> str:
    """Return the page as HTML that needs no other file and no network.

    Examples
    --------
    >>> page = StudyPage(title="T", description="", headline="All met.", met=True, grids=(),
    ...                  sections=(), facts=())
    >>> "All met." in render_study(page)
    True
    """
    text = (
        page_environment("hmpim.report.study")
        .get_template("study.html.j2")
        .render(page=page, unbroken=unbroken)
    )
    return "\n".join(printable(line) for line in text.splitlines()) + "\n"


def unbroken(cell: str, marks: Sequence[str] = ("± ", " +", " ?")) -> str:
    """Break no line at the blanks of these marks, which belong to an error or to a doubt.

    Examples
    --------
    >>> unbroken("0.5 ± 0.1 ?").count(chr(0xA0))
    2
    """
    for mark in marks:
        cell = cell.replace(mark, mark.replace(" ", "\N{NO-BREAK SPACE}"))
    return cell
