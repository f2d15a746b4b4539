"""The report on paper: the same content, typeset by Typst."""

import json
import tempfile
from importlib.resources import files
from pathlib import Path
from typing import Any

from hmpim.errors import MissingExtraError
from hmpim.plots.style import printable
from hmpim.report.figures import Picture
from hmpim.report.numbers import typeset, value_and_error

__all__ = ["check_pdf", "pdf"]

_ON_PAPER = 620.0  # px across a page between its margins, so that letters have 9 points


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

    Nothing that a file or a person brought is read as Typst's markup: the text goes into JSON,
    and the template puts it onto the page as it is.

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
    check_pdf()
    import typst

    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        count = 0

        def drawn(picture: Picture) -> dict[str, str]:
            nonlocal count
            count += 1
            file = f"{count}.svg"
            text = picture.figure.to_svg(width=_ON_PAPER, key=f"p{count}")
            (folder / file).write_text(printable(text), encoding="utf-8")
            return {
                "file": file,
                "title": _clean(picture.title),
                "caption": _clean(picture.caption),
                "alt": _clean(picture.description),
            }

        data = _data(view, drawn, sheet=sheet)
        (folder / "data.json").write_text(json.dumps(data), encoding="utf-8")
        template = files("hmpim.report").joinpath("templates", "report.typ")
        (folder / "main.typ").write_text(template.read_text("utf-8"), encoding="utf-8")
        made: bytes = typst.compile(folder / "main.typ", root=folder)
    return made


def _data(view: dict[str, Any], drawn: Any, *, sheet: bool) -> dict[str, Any]:
    """What the template shows, as JSON."""
    pairs = []
    for pair in view["pairs"]:
        whole = not sheet and (pair["counted"] or len(view["pairs"]) == 1)
        first = pair["first"] if whole else pair["first"][:1] if len(view["pairs"]) == 1 else []
        pairs.append(
            {
                "name": _clean(pair["name"]),
                "lopsided": pair["lopsided"],
                "verdict": pair["verdict"],
                "verdict_words": pair["verdict_words"],
                "sentence": _clean(pair["sentence"]),
                "rows": [
                    {key: _clean(value) for key, value in row.items()}
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
        "title": _clean(view["title"]),
        "about": [[name, _clean(value)] for name, value in view["about"]],
        "headline": _clean(view["headline"]),
        "verdict": view["verdict"],
        "notes": [_clean(note) for note in view["notes"]],
        "findings": [
            {
                "where": _clean(f["where"]),
                "message": _clean(f["message"]),
                "advice": f["advice"].replace("`", ""),
            }
            for f in view["findings"]
        ],
        "summary": _clean_summary(view["summary"]),
        "truth": view["with_truth"],
        "pairs": pairs,
        "more": [] if sheet else [drawn(picture) for picture in (*more, *view["pictures"])],
        "facts": [[name, _clean(value)] for name, value in view["facts"]],
    }


def _clean_summary(summary: dict[str, Any] | None) -> dict[str, Any] | None:
    if summary is None:
        return None
    rows = [
        {**r, "cells": ["\n".join(map(_clean, value_and_error(cell))) for cell in r["cells"]]}
        for r in summary["rows"]
    ]
    return {**summary, "rows": rows}


def _clean(text: object) -> str:
    return printable(typeset(str(text)))
