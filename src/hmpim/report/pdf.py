"""Pages on paper: the same content, typeset by Typst."""

import json
import re
import tempfile
from collections.abc import Callable
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from hmpim.errors import MissingExtraError
from hmpim.plots.style import printable
from hmpim.report.figures import Picture
from hmpim.report.numbers import typeset, value_and_error

__all__ = ["UPRIGHT", "Drawn", "check_pdf", "pdf", "printed", "typeset_page"]

UPRIGHT = 174.0  # mm between the margins of an upright page
_PER_MM = 620.0 / UPRIGHT  # px, so that letters have 9 points

Drawn = Callable[[Picture, float], dict[str, Any]]
"""Draws a picture so many mm wide; returns its file, height in mm, title, caption and alt text."""

_SIZE = re.compile(r'viewBox="0 0 ([\d.]+) ([\d.]+)"')


def check_pdf() -> None:
    """Refuse early if nothing is installed that makes a PDF.

    Raises
    ------
    MissingExtraError
        If the extra ``pdf`` is missing.

    Examples
    --------
    >>> check_pdf()
    """
    try:
        import typst  # noqa: F401
    except ImportError:
        raise MissingExtraError(
            "a PDF needs Typst; install the extra with: pip install 'hmpim[pdf]', or write .html"
        ) from None


def pdf(view: dict[str, Any], *, sheet: bool = False) -> bytes:
    """Return a report, or its one-page sheet, as a PDF file.

    Parameters
    ----------
    view : dict
        From `report_view`.
    sheet : bool
        True for the page to sign.

    Raises
    ------
    MissingExtraError
        If the extra ``pdf`` is missing.

    Examples
    --------
    >>> from hmpim.identify import Identification, RecordSummary
    >>> from hmpim.report.view import report_view
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> pdf(report_view(Identification(record=summary, pairs=())))[:5]
    b'%PDF-'
    """
    template = files("hmpim.report").joinpath("templates", "report.typ")

    def data(drawn: Drawn) -> dict[str, Any]:
        return _data(view, lambda picture: drawn(picture, UPRIGHT), sheet=sheet)

    return typeset_page(template, data)


def typeset_page(template: Traversable, data: Callable[[Drawn], dict[str, Any]]) -> bytes:
    """Return a page as a PDF file.

    Nothing that a file or a person brought is read as Typst's markup: the text goes into JSON,
    and the template puts it onto the page as it is.

    Parameters
    ----------
    template : Traversable
        Typst; it may import what ``common.typ`` has, and reads ``data.json``.
    data : callable
        Given what draws its pictures, returns what the template shows.

    Raises
    ------
    MissingExtraError
        If the extra ``pdf`` is missing.
    """
    check_pdf()
    import typst

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        count = 0

        def drawn(picture: Picture, across: float) -> dict[str, Any]:
            nonlocal count
            count += 1
            file = f"{count}.svg"
            text = picture.figure.to_svg(width=_PER_MM * across, key=f"p{count}")
            (folder / file).write_text(printable(text), encoding="utf-8")
            width, height = map(float, _SIZE.findall(text)[0])
            return {
                "file": file,
                "height": across * height / width,
                "title": printed(picture.title),
                "caption": printed(picture.caption),
                "alt": printed(picture.description),
            }

        (folder / "data.json").write_text(json.dumps(data(drawn)), encoding="utf-8")
        common = files("hmpim.report").joinpath("templates", "common.typ")
        for place, source in (("common.typ", common), ("main.typ", template)):
            (folder / place).write_text(source.read_text("utf-8"), encoding="utf-8")
        made: bytes = typst.compile(folder / "main.typ", root=folder)
    return made


def _data(
    view: dict[str, Any], drawn: Callable[[Picture], dict[str, Any]], *, sheet: bool
) -> dict[str, Any]:
    """What the template shows, as JSON."""
    pairs = []
    for pair in view["pairs"]:
        whole = not sheet and (pair["counted"] or len(view["pairs"]) == 1)
        first = pair["first"] if whole else pair["first"][:1] if len(view["pairs"]) == 1 else []
        pairs.append(
            {
                "name": printed(pair["name"]),
                "reading": pair["reading"],
                "verdict": pair["verdict"],
                "verdict_words": pair["verdict_words"],
                "sentence": printed(pair["sentence"]),
                "rows": [
                    {key: printed(value) for key, value in row.items()}
                    for row in pair["rows"]
                    if row["value"] != "–"
                ],
                "first": [drawn(picture) for picture in first],
                "rest": [drawn(picture) for picture in pair["rest"]] if whole else [],
            }
        )
    more = [view["stimulus"]] if view["stimulus"] is not None else []
    return {
        "sheet": sheet,
        "title": printed(view["title"]),
        "about": [[name, printed(value)] for name, value in view["about"]],
        "headline": printed(view["headline"]),
        "verdict": view["verdict"],
        "notes": [printed(note) for note in view["notes"]],
        "findings": [
            {
                "where": printed(f["where"]),
                "message": printed(f["message"]),
                "advice": f["advice"].replace("`", ""),
            }
            for f in view["findings"]
        ],
        "summary": _clean_summary(view["summary"]),
        "truth": view["with_truth"],
        "pairs": pairs,
        "more": [] if sheet else [drawn(picture) for picture in (*more, *view["pictures"])],
        "facts": [[name, printed(value)] for name, value in view["facts"]],
    }


def _clean_summary(summary: dict[str, Any] | None) -> dict[str, Any] | None:
    if summary is None:
        return None
    rows = [
        {**r, "cells": ["\n".join(map(printed, value_and_error(cell))) for cell in r["cells"]]}
        for r in summary["rows"]
    ]
    return {**summary, "rows": rows}


def printed(text: object) -> str:
    r"""Return words as they stand on paper: true minuses, nothing that cannot be printed.

    Examples
    --------
    >>> printed("-0.5\x00")
    '−0.5�'
    """
    return printable(typeset(str(text)))
