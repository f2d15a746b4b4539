"""One page, one file: the verdict, the figures, the Bode plot, what to do, and the rest folded."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hmpim.arguments import checked
from hmpim.errors import ArgumentError
from hmpim.formats.atomic import check_writable, replacing, write_text
from hmpim.identify import Identification
from hmpim.plots.style import printable
from hmpim.report.about import About
from hmpim.report.figures import Picture
from hmpim.report.numbers import typeset, value_and_error
from hmpim.report.svg import inline_svg
from hmpim.report.view import report_view
from hmpim.stimulus import Stimulus

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["check_page", "page_environment", "render", "report", "sheet", "write_page"]

_PAGES = ("", ".html", ".htm")


@checked
def report(
    result: Identification,
    path: str | PathLike[str],
    *,
    about: About | None = None,
    truth: Mapping[str, float] | None = None,
    stimulus: Stimulus | None = None,
    notes: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
) -> None:
    """Write a result as one HTML page that needs no other file and no network, or as a PDF.

    Parameters
    ----------
    result : Identification
        What was found. One that was read back from JSON has no record any more: its page has
        the tables and the Bode plot, and says so.
    path : path-like
        The file to write, .html or .pdf; replaced as a whole, or not at all.
    about : About, optional
        Title, unit under test, test, operator, date.
    truth : mapping of str to float, optional
        True values by the parameters' names, shown next to the estimates if they are known.
    stimulus : Stimulus, optional
        What was sent, to be shown inside its limits.
    notes : sequence of str
        Plain sentences to be shown under the verdict, such as how a held-out part was
        predicted.
    pictures : sequence of Picture
        What else was seen in the run, each with a key of its own.

    Raises
    ------
    ArgumentError
        If `path` cannot be written, or is named as something else than a page or a PDF.
    MissingExtraError
        If a PDF is wanted and the extra ``pdf`` is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     page = Path(folder) / "r.html"
    ...     report(Identification(record=summary, pairs=()), page)
    ...     page.read_text(encoding="utf-8")[:15]
    '<!DOCTYPE html>'
    """
    check_page(path)
    check_writable(path)
    view = report_view(
        result, about=about, truth=truth, stimulus=stimulus, notes=notes, pictures=pictures
    )
    _write(view, path, template="report.html.j2")


@checked
def sheet(
    result: Identification,
    path: str | PathLike[str],
    *,
    about: About | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Write one page to sign: the verdict, the figures, the Bode plot, and two lines for names.

    Parameters
    ----------
    result : Identification
        What was found.
    path : path-like
        The file to write, .html or .pdf.
    about : About, optional
        Title, unit under test, test, operator, date; what is left empty can be filled in by hand.
    notes : sequence of str
        Plain sentences under the verdict.

    Raises
    ------
    ArgumentError
        If `path` cannot be written, or is named as something else than a page or a PDF.
    MissingExtraError
        If a PDF is wanted and the extra ``pdf`` is not installed.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     sheet(Identification(record=summary, pairs=()), Path(folder) / "s.html")
    ...     "Checked by" in (Path(folder) / "s.html").read_text(encoding="utf-8")
    True
    """
    check_page(path)
    check_writable(path)
    view = report_view(result, about=about, notes=notes)
    _write(view, path, template="sheet.html.j2")


def _write(view: dict[str, Any], path: str | PathLike[str], *, template: str) -> None:
    def paper() -> bytes:
        from hmpim.report.pdf import pdf

        return pdf(view, sheet=template.startswith("sheet"))

    write_page(path, page=lambda: _page(view, template), paper=paper)


def write_page(
    path: str | PathLike[str], *, page: Callable[[], str], paper: Callable[[], bytes]
) -> None:
    """Write a page as a PDF if the file is named .pdf, otherwise as HTML.

    Parameters
    ----------
    path : path-like
        The file to write; replaced as a whole, or not at all.
    page, paper : callable
        Return the HTML, and the PDF; only the one that is written is called.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     for name in ("p.pdf", "p.html"):
    ...         write_page(Path(folder) / name, page=lambda: "<p>", paper=lambda: b"%PDF")
    ...         (Path(folder) / name).read_text(encoding="utf-8")
    '%PDF'
    '<p>'
    """
    if Path(path).suffix.lower() == ".pdf":
        with replacing(path) as place:
            place.write_bytes(paper())
    else:
        write_text(path, page())


def check_page(path: str | PathLike[str]) -> None:
    """Refuse a page that is named as something else.

    Raises
    ------
    ArgumentError
        If the suffix is none of .html, .htm and .pdf; none at all is a page.

    Examples
    --------
    >>> check_page("r.docx")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: 'r.docx' ends in .docx, no page or PDF; name it r.html or r.pdf
    """
    place = Path(path)
    if place.suffix.lower() not in (*_PAGES, ".pdf"):
        raise ArgumentError(
            f"{str(place)!r} ends in {place.suffix}, no page or PDF; name it "
            f"{place.with_suffix('.html').name} or {place.with_suffix('.pdf').name}"
        )


def render(
    result: Identification,
    *,
    about: About | None = None,
    truth: Mapping[str, float] | None = None,
    stimulus: Stimulus | None = None,
    notes: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
) -> str:
    """Return the page of `report` as text.

    Parameters
    ----------
    result : Identification
        What was found.
    about : About, optional
        Title, unit under test, test, operator, date.
    truth : mapping of str to float, optional
        True values by the parameters' names.
    stimulus : Stimulus, optional
        What was sent.
    notes : sequence of str
        Plain sentences under the verdict.
    pictures : sequence of Picture
        What else was seen in the run.

    Examples
    --------
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> "Nothing was identified" in render(Identification(record=summary, pairs=()))
    True
    """
    view = report_view(
        result, about=about, truth=truth, stimulus=stimulus, notes=notes, pictures=pictures
    )
    return _page(view, "report.html.j2")


def _page(view: dict[str, Any], template: str) -> str:
    page = page_environment().get_template(template).render(**view)
    return "\n".join(printable(line) for line in page.splitlines()) + "\n"


@cache
def page_environment(*packages: str) -> "Environment":
    """Return what turns the templates of some packages, and of the report, into pages.

    Examples
    --------
    >>> page_environment().from_string("{{ name }}").render(name="<b>")
    '&lt;b&gt;'
    """
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def svg(picture: Picture, key: str) -> Markup:
        # The only text that is not escaped: the drawer has escaped what others wrote.
        return Markup(
            inline_svg(
                picture.figure, key=key, title=picture.title, description=picture.description
            )
        )

    def _with_code(text: str) -> Markup:
        """Words between backticks as code."""
        parts = [
            Markup("<code>{}</code>" if k % 2 else "{}").format(part)
            for k, part in enumerate(text.split("`"))
        ]
        return Markup("").join(parts)

    def shown(value: Any) -> Any:
        return (
            typeset(value) if isinstance(value, str) and not hasattr(value, "__html__") else value
        )

    def whole(text: str) -> Markup:
        """A value and its error, which a line may part but not break; what is doubtful below."""
        shown, doubt, _ = typeset(text).partition(" (doubtful)")
        parts = value_and_error(shown)
        spans = [Markup('<span class="whole">{}</span>').format(part) for part in parts]
        mark = Markup(' <span class="doubt">doubtful</span>') if doubt else ""
        return Markup(" ").join(spans) + mark

    environment = Environment(
        finalize=shown,
        loader=ChoiceLoader([PackageLoader(name) for name in (*packages, "hmpim.report")]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["svg"] = svg
    environment.filters["code"] = _with_code
    environment.filters["whole"] = whole
    return environment
