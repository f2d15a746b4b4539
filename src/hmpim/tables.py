"""A plain table in HTML, as a notebook shows a value that stands alone in a cell."""

from collections.abc import Sequence
from html import escape

__all__ = ["html_table", "shortened"]

_LONGEST = 200
"""Characters of one cell: names of damaged files may be as long as the file."""

_LONGEST_NOTE = 1000
"""Characters of one line below a table: a finding is read to its end."""


def html_table(
    title: str,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    notes: Sequence[str] = (),
) -> str:
    """Return a table as HTML; every text in it is escaped.

    Parameters
    ----------
    title : str
        What stands above it.
    heads : sequence of str
        Headings of the columns.
    rows : sequence of sequence of str
        Cells by row.
    notes : sequence of str
        Lines below it.

    Examples
    --------
    >>> print(html_table("Channels", ["name"], [["<script>"]]))
    <table><caption>Channels</caption>
    <thead><tr><th scope="col">name</th></tr></thead>
    <tbody><tr><td>&lt;script&gt;</td></tr></tbody></table>
    """
    head = "".join(f'<th scope="col">{_text(cell)}</th>' for cell in heads)
    body = "\n".join(
        "<tr>" + "".join(f"<td>{_text(cell)}</td>" for cell in row) + "</tr>" for row in rows
    )
    below = "".join(f"\n<p>{_text(note, most=_LONGEST_NOTE)}</p>" for note in notes)
    return (
        f"<table><caption>{_text(title)}</caption>\n<thead><tr>{head}</tr></thead>\n"
        f"<tbody>{body}</tbody></table>{below}"
    )


def shortened(names: Sequence[str], *, most: int = 4) -> str:
    """Return the first few names, and how many more there are.

    Examples
    --------
    >>> shortened(["u", "v"]), shortened(list("abcdef"), most=2)
    ('u, v', 'a, b and 4 more')
    """
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(_plain(name) for name in names[:most]) + more


def _text(words: str, *, most: int = _LONGEST) -> str:
    return escape(_plain(words, most=most))


def _plain(words: str, *, most: int = _LONGEST) -> str:
    """Words without what steers a terminal or a page, and not without end."""
    short = words if len(words) <= most else words[:most] + "…"
    return "".join(c if c.isprintable() else " " for c in short)
