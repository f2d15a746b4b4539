"""One page, one file: what was found, how sure it is, and every picture of section IV."""

from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

from hmpim.arguments import checked
from hmpim.errors import ArgumentError
from hmpim.formats.atomic import check_writable, write_text
from hmpim.identify import Identification, PairIdentification
from hmpim.plots.candidates import INTERSAMPLE_WORDS
from hmpim.plots.style import printable
from hmpim.report.figures import Picture, pair_pictures, stimulus_picture
from hmpim.report.inputs import inputs_view
from hmpim.report.numbers import format_interval, format_number, format_value
from hmpim.report.svg import inline_svg
from hmpim.report.words import (
    GLOSSARY,
    VERDICTS,
    by_weight,
    headline,
    nonlinear_facts,
    pair_sentence,
    paper_value,
    remark,
    structure_words,
    untold,
)
from hmpim.stimulus import Stimulus

__all__ = ["check_page", "render", "report"]


@checked
def report(
    result: Identification,
    path: str | PathLike[str],
    *,
    stimulus: Stimulus | None = None,
    notes: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
) -> None:
    """Write a result as one HTML page that needs no other file and no network.

    Parameters
    ----------
    result : Identification
        What was found. One that was read back from JSON has no record any more: its page has
        the tables and the Bode plot, and says so.
    path : path-like
        The file to write; replaced as a whole, or not at all.
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
        If `path` cannot be written, or is named as something else than a page.

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
    text = render(result, stimulus=stimulus, notes=notes, pictures=pictures)
    write_text(path, text)


def check_page(path: str | PathLike[str]) -> None:
    """Refuse a page that is named as something else.

    Raises
    ------
    ArgumentError
        If the suffix is neither .html nor .htm; none is as good.

    Examples
    --------
    >>> check_page("r.docx")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: 'r.docx' ends in .docx, and a report is an HTML page; name it r.html
    """
    place = Path(path)
    if place.suffix.lower() not in ("", ".html", ".htm"):
        raise ArgumentError(
            f"{str(place)!r} ends in {place.suffix}, and a report is an HTML page; name it "
            f"{place.with_suffix('.html').name}"
        )


def render(
    result: Identification,
    *,
    stimulus: Stimulus | None = None,
    notes: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
) -> str:
    """Return the page of `report` as text.

    Parameters
    ----------
    result : Identification
        What was found.
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
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from markupsafe import Markup

    def svg(picture: Picture, key: str) -> Markup:
        # The only text that is not escaped: made by an XML writer, which has escaped it.
        return Markup(
            inline_svg(
                picture.figure, key=key, title=picture.title, description=picture.description
            )
        )

    environment = Environment(
        loader=PackageLoader("hmpim.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["svg"] = svg
    page = environment.get_template("report.html.j2").render(
        title=_title(result),
        headline=headline(result),
        verdict=result.verdict if result.pairs else "not_identifiable",
        notes=notes,
        facts=_facts(result),
        pairs=[_pair_view(result, pair) for pair in result.pairs],
        inputs=inputs_view(result),
        stimulus=None if stimulus is None else stimulus_picture(stimulus),
        pictures=pictures,
        without_record=result.data is None,
        glossary=GLOSSARY,
    )
    return "\n".join(printable(line) for line in page.splitlines()) + "\n"


def _title(result: Identification) -> str:
    if len(result.pairs) == 1:
        pair = result.pairs[0]
        return f"{pair.input} → {pair.output}"
    return f"{len(result.pairs)} pairs of channels"


def _facts(result: Identification) -> list[tuple[str, str]]:
    record = result.record
    facts = [
        ("Source", record.source or "given as arrays"),
        ("Sampling rate", f"{record.fs:.7g} Hz"),
        ("Samples", str(record.samples)),
        ("Length", f"{record.samples / record.fs:.6g} s"),
    ]
    if result.data is not None and result.data.band is not None:
        low, high = result.data.band
        facts.append(("Excited band", f"{low:g} to {high:g} Hz"))
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return [
        *facts,
        ("SHA-256 of the record", record.sha256 or "unknown"),
        ("Made by", f"hmpim {version('hmpim')}, {now}"),
    ]


def _pair_view(result: Identification, pair: PairIdentification) -> dict[str, Any]:
    """Everything the template shows of a pair, as text."""
    rows = []
    for words in GLOSSARY:
        estimate = getattr(pair.parameters, words.name)
        paper = paper_value(pair, words.name)
        if estimate is None and paper is None:
            continue
        rows.append(
            {
                "name": words.name,
                "label": words.label,
                "value": "–" if estimate is None else format_value(estimate),
                "unit": "" if estimate is None else estimate.unit,
                "interval": "" if estimate is None else format_interval(estimate),
                "verdict": "" if estimate is None else estimate.verdict,
                "paper": format_number(paper) if words.differs else "",
                "remark": remark(words, estimate, paper),
            }
        )
    lowest = min((c.criterion for c in pair.candidates), default=0.0)
    return {
        "name": f"{pair.input} → {pair.output}",
        "verdict": pair.verdict,
        "verdict_words": VERDICTS[pair.verdict],
        "sentence": pair_sentence(pair),
        "warnings": by_weight(pair.warnings),
        "rows": rows,
        "untold": untold(pair),
        "candidates": [
            {
                "structure": structure_words(c.structure),
                "between": INTERSAMPLE_WORDS[c.intersample],
                "behind": f"{c.criterion - lowest:.1f}",
                "fit": f"{c.fit_percent:.2f}",
                "chosen": c.chosen,
            }
            for c in sorted(pair.candidates, key=lambda c: c.criterion)
        ],
        "nonlinear": nonlinear_facts(pair),
        "pictures": pair_pictures(result, pair),
    }
