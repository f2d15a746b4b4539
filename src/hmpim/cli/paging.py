"""Options that say what a report is about, shared by the commands that write one."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from hmpim.identify import Identification
    from hmpim.report import About

__all__ = [
    "Date",
    "Figures",
    "Note",
    "Operator",
    "Sign",
    "Test",
    "Title",
    "UnderTest",
    "about_of",
    "check_paper",
    "tables_in",
    "write_beside",
]

Title = Annotated[str, typer.Option("--title", metavar="WORDS", help="Heading of the report.")]
UnderTest = Annotated[
    str,
    typer.Option("--under-test", metavar="WORDS", help="Unit under test, with its serial number."),
]
Test = Annotated[str, typer.Option("--test", metavar="WORDS", help="Which test this is.")]
Operator = Annotated[str, typer.Option("--operator", metavar="WORDS", help="Who ran the test.")]
Date = Annotated[
    str, typer.Option("--date", metavar="WORDS", help="When the test was run; today by default.")
]
Note = Annotated[
    list[str] | None,
    typer.Option("--note", metavar="WORDS", help="A remark under the verdict; may be repeated."),
]
Sign = Annotated[
    Path | None,
    typer.Option("--sign", metavar="FILE", help="Write one page to sign, .html or .pdf."),
]
Figures = Annotated[
    Path | None,
    typer.Option(
        "--figures", metavar="DIR", help="Write every figure as SVG and PNG, and its data as CSV."
    ),
]


def tables_in(figures: Path | None) -> list[Path]:
    """Tables of --figures, one of which a record in that folder could be."""
    if figures is None:
        return []
    return [figures / "parameters.csv", *sorted(figures.glob("response-*.csv"))]


def about_of(title: str, under_test: str, test: str, operator: str, date: str) -> "About":
    """Put together what the report is about.

    Examples
    --------
    >>> about_of("Gyro", "", "", "", "").title
    'Gyro'
    """
    from hmpim.report import About

    return About(title=title, under_test=under_test, test=test, operator=operator, date=date)


def check_paper(*paths: Path | None) -> None:
    """Refuse a PDF before any work is done if nothing is installed that makes one.

    Raises
    ------
    MissingExtraError
        If one of the paths ends in .pdf, and the extra ``pdf`` is missing.

    Examples
    --------
    >>> check_paper(Path("r.html"), None)
    """
    if any(path is not None and path.suffix.lower() == ".pdf" for path in paths):
        from hmpim.report.pdf import check_pdf

        check_pdf()


def write_beside(
    result: "Identification",
    *,
    sign: Path | None,
    figures: Path | None,
    about: "About",
    notes: Sequence[str] = (),
) -> None:
    """Write the page to sign and the figures, where they are wanted."""
    from hmpim.report import sheet, write_figures

    if sign is not None:
        sheet(result, sign, about=about, notes=notes)
    if figures is not None:
        write_figures(result, figures)
