"""The comparison table: what the paper prints, what comes out here, and why they differ."""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from hmpim.report.numbers import plus_minus

__all__ = [
    "COLUMNS",
    "SCHEMA",
    "Row",
    "agreement",
    "cells",
    "markdown_table",
    "shown",
    "table_dict",
]

SCHEMA = "hmpim/paper/1"
COLUMNS = ("Where", "Quantity", "Paper", "Ours", "True", "Why they differ")


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One quantity of the paper.

    Parameters
    ----------
    figure : int
        Number of the figure it belongs to.
    where : str
        What a reader looks up: a figure, or an equation.
    quantity : str
        In words.
    paper : str
        As the paper prints it, with its unit; empty if it prints none.
    value : float or None
        Ours, in `unit`; None if there is none, or if it is not a number.
    text : str
        Ours where it is not a number, and what is said where `value` is None.
    std, bound : float or None
        Standard deviation of `value`, and the smallest that any unbiased estimator can have
        (Cramér-Rao), in `unit`.
    truth : float or None
        What the simulated unit really has, in `unit`.
    unit : str
        Of the four numbers above.
    why : str
        Whether they agree, and if not, why.

    Examples
    --------
    >>> row = Row(figure=17, where="Fig. 17", quantity="Delay", paper="150 ms", unit="ms",
    ...           value=149.871, std=0.094, bound=0.0955, truth=150.0, why="They agree.")
    >>> row.ours
    '149.871 ± 0.094 ms (bound ± 0.096)'
    """

    figure: int
    where: str
    quantity: str
    paper: str = ""
    value: float | None = None
    text: str = ""
    std: float | None = None
    bound: float | None = None
    truth: float | None = None
    unit: str = ""
    why: str = ""

    @property
    def ours(self) -> str:
        """Our figure as it is shown, with its unit and its error."""
        if self.value is None:
            return self.text
        number = shown(self.value)
        if self.std is not None:
            number = plus_minus(self.value, self.std)
        words = f"{number} {self.unit}".rstrip()
        return words if self.bound is None else f"{words} (bound ± {self.bound:#.2g})"


def shown(value: float) -> str:
    """Write a number to four digits, never with an exponent, with a true minus sign.

    Examples
    --------
    >>> shown(39478.42), shown(-0.15), shown(2.0)
    ('39480', '−0.15', '2')
    """
    rounded = float(f"{value:.3e}")
    text = f"{rounded:.0f}" if abs(rounded) >= 1e3 else f"{rounded:.4g}"
    return text.replace("-", "−")


def agreement(
    value: float | None,
    printed: float,
    *,
    within: float,
    otherwise: str = "Does not agree.",
    because: str = "",
) -> str:
    """Say whether our value lies `within` of the printed one, and if not, `otherwise`.

    Examples
    --------
    >>> agreement(50.6, 50.0, within=1.0), agreement(53.0, 50.0, within=1.0, otherwise="T differs.")
    ('Agrees.', 'T differs.')
    """
    if value is None or not abs(value - printed) <= within:
        return otherwise
    return f"Agrees: {because}." if because else "Agrees."


def cells(row: Row) -> tuple[str, ...]:
    """Return a row as text, one for each of `COLUMNS`; a dash where there is nothing.

    Examples
    --------
    >>> cells(Row(figure=12, where="Fig. 12", quantity="Extinction n", paper="0", value=0.0))
    ('Fig. 12', 'Extinction n', '0', '0', '–', '')
    """
    truth = "–" if row.truth is None else f"{shown(row.truth)} {row.unit}".rstrip()
    return (row.where, row.quantity, row.paper or "–", row.ours or "–", truth, row.why)


def markdown_table(rows: Iterable[Row]) -> str:
    """Return the table as Markdown.

    Examples
    --------
    >>> row = Row(figure=12, where="Fig. 12", quantity="Extinction n", paper="0", value=0.0)
    >>> print(markdown_table([row]), end="")
    | Where | Quantity | Paper | Ours | True | Why they differ |
    | --- | --- | --- | --- | --- | --- |
    | Fig. 12 | Extinction n | 0 | 0 | – |  |
    """
    lines = [COLUMNS, ("---",) * len(COLUMNS), *(cells(row) for row in rows)]
    escaped = ([cell.replace("|", "\\|") for cell in line] for line in lines)
    return "".join(f"| {' | '.join(line)} |\n" for line in escaped)


def table_dict(rows: Sequence[Row]) -> dict[str, Any]:
    """Return the table as plain JSON values, `schema` first.

    Examples
    --------
    >>> row = Row(figure=12, where="Fig. 12", quantity="Extinction n", paper="0", value=0.0)
    >>> table_dict([row])["rows"][0]["value"]
    0.0
    """
    return {"schema": SCHEMA, "rows": [{**asdict(row), "ours": row.ours} for row in rows]}
