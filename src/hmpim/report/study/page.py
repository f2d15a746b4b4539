"""One page for a whole study: what passed, every case, and what was compared."""

from dataclasses import dataclass

from hmpim.plots.style import printable
from hmpim.report.figures import Picture
from hmpim.report.html import page_environment

__all__ = ["Grid", "Section", "StudyPage", "render_study"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Grid:
    """A table of text: its caption, its columns, its rows; the first column names the row.

    `note` stands below it: how it is to be read. A `folded` one shows its caption until it is
    opened. On paper one `at_end` stands opened behind the sections, and one `on_screen` not at all.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    folded: bool = False
    at_end: bool = False
    on_screen: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """A heading, what was observed before, what was found, with tables and pictures."""

    title: str
    observed: str
    found: tuple[str, ...]
    grids: tuple[Grid, ...]
    pictures: tuple[Picture, ...]

    def is_tall(self, picture: Picture) -> bool:
        """Whether a picture is twice as high as another of its section, beside which it stands."""
        return sum(picture.figure.heights) >= 2.0 * min(
            sum(p.figure.heights) for p in self.pictures
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StudyPage:
    """Everything that the page shows, its first table above all.

    `met` is None where nothing was specified; `doubtful` says that some of what is met rests on
    doubtful figures; `sheets` are names and addresses of pages beside it.
    """

    title: str
    description: str
    headline: str
    met: bool | None
    grids: tuple[Grid, ...]
    sections: tuple[Section, ...]
    facts: tuple[tuple[str, str], ...]
    sheets: tuple[tuple[str, str], ...] = ()
    doubtful: bool = False


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
        .render(page=page, verdict=_verdict(page))
    )
    return "\n".join(printable(line) for line in text.splitlines()) + "\n"


def _verdict(page: StudyPage) -> str:
    if page.met and page.doubtful:
        return "doubtful"
    return {True: "ok", False: "not_identifiable", None: ""}[page.met]
