"""``hmpim report``: a saved result as a page, a PDF, a sheet to sign, figures and tables."""

from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.paging import (
    Date,
    Figures,
    Note,
    Operator,
    Sign,
    Test,
    Title,
    UnderTest,
    about_of,
    check_paper,
    write_beside,
)
from hmpim.cli.terminal import working
from hmpim.errors import ArgumentError

__all__ = ["report"]


def report(
    result: Annotated[
        Path, typer.Argument(metavar="RESULT", help="JSON file written by `hmpim identify`.")
    ],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="Page to write, .html or .pdf."),
    ] = None,
    sign: Sign = None,
    figures: Figures = None,
    title: Title = "",
    under_test: UnderTest = "",
    test: Test = "",
    operator: Operator = "",
    date: Date = "",
    note: Note = None,
) -> None:
    """Write a saved result as a page or PDF, a sheet to sign, or figures and tables.

    A saved result does not contain the signals; `hmpim identify --report` shows them as well.
    """
    check_files(
        reads={"the result": result},
        writes={"--out": out, "--sign": sign},
        folders={"--figures": figures},
    )
    if out is None and sign is None and figures is None:
        raise ArgumentError("nothing to write: give --out r.html, --sign s.pdf or --figures DIR")
    check_paper(out, sign)

    from hmpim.formats import load
    from hmpim.identify import Identification
    from hmpim.report import report as write_page

    loaded = load(result)
    if not isinstance(loaded, Identification):
        raise ArgumentError(
            f"{result} holds a {type(loaded).__name__}, not a result; identify it first: "
            f"hmpim identify {result} --report r.html"
        )
    about = about_of(title, under_test, test, operator, date)
    with working("Drawing the pages"):
        if out is not None:
            write_page(loaded, out, about=about, notes=note or ())
        write_beside(loaded, sign=sign, figures=figures, about=about, notes=note or ())
