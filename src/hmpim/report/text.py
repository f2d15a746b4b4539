"""The result on a terminal: a table of estimates, the verdict, the warnings."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

from hmpim.identify import Identification, PairIdentification
from hmpim.plots.style import printable
from hmpim.record import Finding
from hmpim.report.inputs import gain_rows
from hmpim.report.modes import MODES_SAID, mode_rows
from hmpim.report.numbers import format_interval, format_number, format_value
from hmpim.report.untold import untold
from hmpim.report.words import (
    GLOSSARY,
    VERDICTS,
    by_weight,
    headline,
    leading,
    off_by,
    pair_sentence,
    paper_value,
)

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

__all__ = ["finding_line", "parameter_table", "print_result"]

_STYLES = {"ok": "green", "doubtful": "bold yellow"}  # of a row's verdict
_COLOURS = {"ok": "green", "doubtful": "yellow", "not_identifiable": "red"}


def parameter_table(
    pair: PairIdentification, *, truth: Mapping[str, float] | None = None
) -> "Table":
    """Return a pair's estimates as a table for a terminal.

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    truth : mapping of str to float, optional
        True values by parameter name, if they are known; shown next to the estimates.

    Examples
    --------
    >>> from hmpim.identify import Estimate, FrequencyResponse, PaperEstimates, Parameters
    >>> import numpy as np
    >>> none = np.empty(0)
    >>> delay = Estimate(value=0.15, std=0.0001, ci95=(0.1498, 0.1502), unit="s")
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=100.0,
    ...     parameters=Parameters(delay=delay), paper=PaperEstimates(delay=0.17), candidates=(),
    ...     frequency_response=FrequencyResponse(frequency=none, response=none, std=none),
    ...     numerator=(1.0,), denominator=(1.0,), verdict="ok", warnings=())
    >>> table = parameter_table(pair, truth={"delay": 0.15})
    >>> [str(next(column.cells)) for column in table.columns][:2]
    ['Delay, pure', '0.15000 ± 0.00010']
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("Parameter", min_width=11)
    table.add_column("Value ± std", justify="right")
    table.add_column("Unit")
    table.add_column("95 % interval", justify="right")
    table.add_column("Verdict")
    table.add_column("Paper", justify="right")
    if truth is not None:
        table.add_column("Truth", justify="right")
        table.add_column("Off by", justify="right")
    for words in GLOSSARY:
        estimate = getattr(pair.parameters, words.name)
        paper = paper_value(pair, words.name)
        known = None if truth is None else truth.get(words.name)
        if estimate is None and paper is None and known is None:
            continue
        cells = [words.label]
        if estimate is None:
            cells += ["–", "", "", ""]
        else:
            cells += [
                format_value(estimate, positive=words.positive),
                estimate.unit,
                format_interval(estimate, positive=words.positive),
                estimate.verdict,
            ]
        cells.append(format_number(paper) if words.differs else "")
        if truth is not None:
            cells.append("" if known is None else f"{known:.5g}")
            cells.append("" if known is None or estimate is None else off_by(estimate, known))
        table.add_row(*(Text(cell, style=_STYLES.get(cell, "")) for cell in cells))
    return table


def print_result(
    result: Identification, console: "Console", *, truth: Mapping[str, float] | None = None
) -> None:
    """Print the verdict, and for each pair its table and its warnings.

    Parameters
    ----------
    result : Identification
        What was found.
    console : rich.console.Console
        Where to.
    truth : mapping of str to float, optional
        True values by parameter name, where they are known.

    Examples
    --------
    >>> from rich.console import Console
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> print_result(Identification(record=summary, pairs=()), Console())
    Nothing was identified.
    """
    from rich.text import Text

    if len(result.pairs) != 1:
        console.print(Text(headline(result), style="bold"))
    if result.inputs is not None:
        console.print(_gain_table(result))
    for pair in result.pairs:
        title = Text(printable(f"{pair.input} → {pair.output}"), style="bold")
        colour = _COLOURS[pair.verdict]
        sentence = Text.assemble(
            (f"{VERDICTS[pair.verdict]}: ", f"bold {colour}"), pair_sentence(pair)
        )
        console.print(title, sentence, sep="\n")
        several = result.inputs is not None and pair.parameters.scale_factor is None
        if not several:
            console.print(parameter_table(pair, truth=truth))
            if modes := mode_rows(pair):
                console.print(_mode_table(modes))
        said = leading(pair)  # the sentence says it
        for warning in by_weight(pair.warnings):
            if warning is not said:
                console.print(finding_line(warning))
        missing = untold(pair)
        if missing and not several:
            console.print(Text(missing, style="dim"))


def finding_line(finding: Finding) -> "Text":
    """Return a finding as a line for a terminal, with its weight before it.

    Examples
    --------
    >>> str(finding_line(Finding(code="x", message="Late.", severity="doubt", parameters=())))
    'Doubt: Late.'
    """
    from rich.text import Text

    lead = ("Doubt: ", "bold yellow") if finding.severity == "doubt" else ("Note: ", "bold")
    return Text.assemble(lead, printable(finding.message))


def _mode_table(modes: list[tuple[str, str]]) -> "Table":
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column(MODES_SAID)
    table.add_column("Natural frequency, Hz", justify="right")
    table.add_column("Damping ratio", justify="right")
    for number, (natural, damping) in enumerate(modes, 1):
        table.add_row(str(number), natural, damping)
    return table


def _gain_table(result: Identification) -> "Table":
    """Scale factor from every input to every output."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("Scale factor, from \\ to")
    for output in dict.fromkeys(pair.output for pair in result.pairs):
        table.add_column(printable(output))
    for row in gain_rows(result):
        table.add_row(*(Text(printable(cell)) for cell in (row["name"], *row["cells"])))
    return table
