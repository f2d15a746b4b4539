"""One look for every picture: colours, fonts, names that are safe, axes that state their unit."""

from typing import TYPE_CHECKING, Literal
from unicodedata import category

if TYPE_CHECKING:
    from hmpim.identify import Estimate

__all__ = [
    "COLOURS",
    "FONT_SIZE",
    "WIDTH",
    "Colour",
    "axis_label",
    "is_exact",
    "plain",
    "printable",
    "with_error",
]

ROUNDING = 1e-10
"""Error over value that is arithmetic's and not the record's: a stop's level, seen often."""

Colour = Literal["paper", "ink", "muted", "grid", "input", "output", "model", "limit", "other"]

# After Okabe and Ito (2008): told apart with every common colour blindness, and in grey.
COLOURS: dict[Colour, str] = {
    "paper": "#ffffff",
    "ink": "#1f2328",
    "muted": "#5b636b",
    "grid": "#d5d9de",
    "input": "#0072b2",
    "output": "#d55e00",
    "model": "#111827",
    "limit": "#b0417f",
    "other": "#009e73",
}
WIDTH = 7.6  # inches; a page column
FONT_SIZE = 9.0
LONGEST_NAME = 40


def plain(text: str) -> str:
    r"""Make a foreign name fit to draw: printable, not too long.

    Examples
    --------
    >>> plain("a\x00b")
    'a�b'
    """
    shown = printable(text)
    if len(shown) > LONGEST_NAME:
        shown = shown[: LONGEST_NAME - 1] + "…"
    return shown


def printable(text: str) -> str:
    r"""Replace what no page or picture may hold: controls, direction marks, half characters.

    Examples
    --------
    >>> printable("a\x1b[31m\u202eb")
    'a�[31m�b'
    """
    if text.isprintable():
        return text
    return "".join(
        "\N{REPLACEMENT CHARACTER}" if category(c) in ("Cc", "Cf", "Cs") else c for c in text
    )


def axis_label(quantity: str, unit: str) -> str:
    """Name of an axis with its unit, a dash where there is none.

    Examples
    --------
    >>> axis_label("Position", "deg"), axis_label("u", "")
    ('Position (deg)', 'u (–)')
    """
    return f"{plain(quantity)} ({plain(unit) or '–'})"


def is_exact(estimate: "Estimate") -> bool:
    """Whether nothing but rounding is left of the error."""
    known = estimate.std is not None and estimate.ci95 is not None
    return known and estimate.spread <= ROUNDING * abs(estimate.value)


def with_error(estimate: "Estimate") -> str:
    """Write a value with its standard deviation, or with both sides of an asymmetric interval.

    A withheld interval has the standard deviation of the noise alone.

    Examples
    --------
    >>> from hmpim.identify import Estimate
    >>> with_error(Estimate(value=6.9223, std=0.0348, ci95=(6.8911, 6.9905), unit="Hz"))
    '6.922 −0.031 +0.068'
    >>> with_error(Estimate(value=6.9223, std=0.0348, ci95=None, unit="Hz"))
    '6.922 ± 0.035'
    >>> with_error(Estimate(value=-6.0, std=1e-10, ci95=(-6.0, -6.0), unit="deg"))
    '-6 ± 0'
    """
    from hmpim.identify.result.digits import aside, plus_minus  # not at the start of a command

    if is_exact(estimate):
        return f"{estimate.value:.10g} ± 0"
    if estimate.ci95 is not None and (estimate.std is None or estimate.asymmetric):
        return aside(estimate.value, *estimate.ci95)
    return plus_minus(estimate.value, estimate.spread)
