"""A study's page on paper, typeset by Typst."""

from collections.abc import Sequence
from importlib.resources import files
from os import PathLike
from typing import Any

from hmpim.report.figures import Picture
from hmpim.report.html import check_page, write_page
from hmpim.report.pdf import UPRIGHT, Drawn, printed, typeset_page
from hmpim.report.study.page import Grid, Section, StudyPage, render_study, unbroken

__all__ = ["study_pdf", "write_study_page"]

_ACROSS = 261.0  # mm between the margins of a page on its side
_GUTTER = 8.0  # mm between two pictures
_HIGHEST = 150.0  # mm of what stands on one page with its captions
_KEPT = ("± ", " ?")  # where no line breaks; the two sides of an error may stand in two lines


def write_study_page(page: StudyPage, path: str | PathLike[str]) -> None:
    """Write a study as one HTML page, or as a PDF if the file is named .pdf.

    Parameters
    ----------
    page : StudyPage
        What it shows.
    path : path-like
        The file to write, .html or .pdf; replaced as a whole, or not at all.

    Raises
    ------
    ArgumentError
        If `path` cannot be written, or is named as something else than a page or a PDF.
    MissingExtraError
        If a PDF is wanted and the extra ``pdf`` is not installed.
    """
    check_page(path)
    write_page(path, page=lambda: render_study(page), paper=lambda: study_pdf(page))


def study_pdf(page: StudyPage) -> bytes:
    """Return a study as a PDF file: what its HTML page prints, in the same order.

    Parameters
    ----------
    page : StudyPage
        What it shows.

    Raises
    ------
    MissingExtraError
        If the extra ``pdf`` is missing.

    Examples
    --------
    >>> page = StudyPage(title="T", description="", headline="All met.", met=True, grids=(),
    ...                  sections=(), facts=())
    >>> study_pdf(page)[:5]
    b'%PDF-'
    """
    template = files("hmpim.report.study").joinpath("templates", "study.typ")
    return typeset_page(template, lambda drawn: _data(page, drawn))


def _data(page: StudyPage, drawn: Drawn) -> dict[str, Any]:
    """What the template shows, as JSON."""
    across = UPRIGHT if page.upright else _ACROSS
    at_end = [grid for section in page.sections for grid in section.grids if grid.at_end]
    return {
        "upright": page.upright,
        "title": printed(page.title),
        "about": [[name, printed(value)] for name, value in page.about if value],
        "description": printed(page.description),
        "verdict": page.verdict,
        "headline": printed(page.headline),
        "notes": [printed(note) for note in page.notes],
        "grids": [_grid(grid) for grid in page.grids if _in_place(grid)],
        "sections": [_section(section, drawn, across) for section in page.sections],
        "at_end": [_grid(grid) for grid in (*(g for g in page.grids if g.at_end), *at_end)],
        "facts": [[name, printed(value)] for name, value in page.facts],
    }


def _in_place(grid: Grid) -> bool:
    return not (grid.on_screen or grid.folded or grid.at_end)


def _section(section: Section, drawn: Drawn, across: float) -> dict[str, Any]:
    return {
        "title": printed(section.title),
        "observed": printed(section.observed),
        "observed_by": section.observed_by,
        "found": [printed(sentence) for sentence in section.found],
        "rows": _rows(section, drawn, across),
        "grids": [_grid(grid) for grid in section.grids if _in_place(grid)],
    }


def _rows(section: Section, drawn: Drawn, across: float) -> list[list[list[dict[str, Any]]]]:
    """Pictures as rows of columns, each with what stands in it from top to bottom.

    Low ones stand in twos beside a tall one, where a page is high enough.
    """

    def columns(pictures: Sequence[Picture], count: int) -> list[dict[str, Any]]:
        return [drawn(one, (across - (count - 1) * _GUTTER) / count) for one in pictures]

    broad = [picture for picture in section.pictures if section.is_broad(picture)]
    tall = [p for p in section.pictures if p not in broad and section.is_tall(p)]
    low = [p for p in section.pictures if p not in broad and p not in tall]
    rows = [[columns([picture], 1)] for picture in broad]
    for picture in tall:
        left = low[: 2 if across == UPRIGHT else 4]
        count = 1 + (len(left) + 1) // 2
        shown = columns(left, count)
        if shown and 2 * max(one["height"] for one in shown) < _HIGHEST:
            rows.append([shown[:2], *([shown[2:]] if shown[2:] else []), columns([picture], count)])
            low = low[len(left) :]
        else:
            rows.append([columns([picture], 2), []])
    shown = columns(low, 2)
    return [*rows, *([shown[k : k + 1], shown[k + 1 : k + 2]] for k in range(0, len(shown), 2))]


def _grid(grid: Grid) -> dict[str, Any]:
    def cells(line: list[list[str]]) -> list[list[str]]:
        return [[printed(unbroken(part, _KEPT)) for part in cell if part] or [""] for cell in line]

    return {
        "caption": printed(grid.caption),
        "heads": cells(grid.heads),
        "lines": [cells(line) for line in grid.lines],
        "note": printed(grid.note),
    }
