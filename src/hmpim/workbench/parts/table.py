"""Tables of plain text: every cell is text and nothing else, whatever a file calls its channels."""

from collections.abc import Mapping, Sequence

from nicegui import ui

from hmpim.identify import Estimate, Look, PairIdentification
from hmpim.report import format_number, format_value
from hmpim.report.numbers import typeset
from hmpim.report.words import GLOSSARY, fixed_unit, paper_value

__all__ = ["VERDICT_CLASSES", "look_cells", "parameter_cells", "plain_table"]

_OF_OUTPUT = ("bias", "noise_std")
VERDICT_CLASSES = {
    "ok": "hm-ok", "doubtful": "hm-doubt", "not identifiable": "hm-bad", "fail": "hm-bad",
}  # fmt: skip
"""The colour of a cell that is a verdict."""


def plain_table(columns: Sequence[str], rows: Sequence[Sequence[str]], *, title: str) -> ui.element:
    """Show a table.

    Parameters
    ----------
    columns : sequence of str
        Headings.
    rows : sequence of sequence of str
        Cells.
    title : str
        For those who hear it.
    """
    whole = ui.element("div").classes("hm-table").props('tabindex=0 role="region"')
    whole.props["aria-label"] = title
    with whole, ui.element("table"):
        with ui.element("caption").style("position:absolute;left:-100vw"):
            ui.label(title)
        with ui.element("thead"), ui.element("tr"):
            for column in columns:
                with ui.element("th").props('scope="col"'):
                    ui.label(column)
        with ui.element("tbody"):
            for row in rows:
                with ui.element("tr"):
                    for cell in row:
                        with ui.element("td").classes("hm-number"):
                            ui.label(cell).classes(VERDICT_CLASSES.get(cell, ""))
    return whole


def parameter_cells(
    pair: PairIdentification,
    hand: Mapping[str, float],
    *,
    fitted: PairIdentification | None = None,
    set_by_hand: str = "",
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return headings and rows of a pair's parameters, what was set by hand beside the automatic.

    Parameters
    ----------
    pair : PairIdentification
        What was found automatically.
    hand : mapping of str to float
        Values set by hand, by parameter.
    fitted : PairIdentification, optional
        What was found with structure or interval set by hand.
    set_by_hand : str
        Which, in words.

    Returns
    -------
    tuple
        Headings, and a row for each parameter that has any value.
    """
    shown = pair if fitted is None else fitted
    columns: tuple[str, ...] = ("Parameter", "Automatic", "Unit", "Verdict", "Paper's steps")
    if hand:
        columns = (*columns[:3], "By hand", *columns[3:])
    if fitted is not None:
        columns = (*columns[:3], f"✎ {set_by_hand}, by hand", *columns[3:])
    rows = []
    for words in GLOSSARY:
        estimate = getattr(pair.parameters, words.name)
        other = getattr(shown.parameters, words.name)
        paper = paper_value(shown, words.name)
        by_hand = hand.get(words.name)
        if estimate is None and other is None and paper is None and by_hand is None:
            continue
        known = other if estimate is None else estimate
        cells = [
            words.label,
            "–" if estimate is None else typeset(format_value(estimate)),
            fixed_unit(words.name) if known is None else known.unit,
        ]
        if fitted is not None:
            cells.append("–" if other is None else _marked(other))
        if hand:
            cells.append("" if by_hand is None else f"✎ {by_hand:.5g}, by hand")
        cells.append("" if estimate is None else estimate.verdict)
        cells.append("" if paper is None else typeset(format_number(paper)))
        rows.append(tuple(cells))
    return columns, rows


def _marked(estimate: Estimate) -> str:
    return f"✎ {typeset(format_value(estimate))}" + (
        "" if estimate.verdict == "ok" else ", doubtful"
    )


def look_cells(
    look: Look, *, passed: bool, unit: str = ""
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return headings and rows of the estimate so far.

    Parameters
    ----------
    look : Look
        What is known so far.
    passed : bool
        Whether the whole band has been played: before that, nothing is called ok.
    unit : str
        Of the output, which the stimulus that is played does not know.
    """
    rows: list[tuple[str, ...]] = []
    for words in GLOSSARY:
        estimate = getattr(look.parameters, words.name)
        if estimate is not None:
            early = estimate.verdict == "ok" and not passed
            rows.append(
                (
                    words.label,
                    typeset(format_value(estimate)),
                    unit if words.name in _OF_OUTPUT else estimate.unit,
                    "too early" if early else estimate.verdict,
                )
            )
    return ("Parameter", "So far", "Unit", "Verdict"), rows
