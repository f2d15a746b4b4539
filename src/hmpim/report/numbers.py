"""Numbers for people: the error to two digits, the value to match."""

import re
from collections.abc import Sequence

from hmpim.identify import Estimate
from hmpim.identify.result.digits import interval, plus_minus
from hmpim.plots.style import is_exact, with_error

__all__ = [
    "NOT_DETERMINED",
    "format_estimate",
    "format_interval",
    "format_number",
    "format_scatter",
    "format_value",
    "how_to_read",
    "plus_minus",
    "typeset",
    "value_and_error",
]

NOT_DETERMINED = "not determined"
"""In place of a positive figure that may be nothing, and whose error exceeds it."""

_MINUS = re.compile(r"(?<![\w./=-])-(?=\d)")
_POWER = re.compile(r"(?<=[\d)])e([+-])0*(\d+)\b")
_RAISED = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")

_ERROR = re.compile(r" (?=± |[−+][\d?])")
_NO_REACH = re.compile(r"(?<=[−+])0\.0+(?![.\d])")


def format_value(estimate: Estimate, *, positive: bool = False) -> str:
    """Write an estimate without its unit: ``value ± std``, or how far it may lie to either side.

    The second where there is no standard deviation, or where the 95 % interval is not symmetric.

    Parameters
    ----------
    estimate : Estimate
        What was found.
    positive : bool
        Whether it is of a quantity that cannot be 0 or less, as any in Hz.

    Examples
    --------
    >>> format_value(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.987 ± 0.030'
    >>> format_value(Estimate(value=0.15, std=None, ci95=(0.1474, 0.1502), unit="s"))
    '0.15000 −0.00260 +0.00020'
    >>> format_value(Estimate(value=6.9223, std=0.0348, ci95=(6.8911, 6.9905), unit="Hz"))
    '6.922 −0.031 +0.068'
    >>> format_value(Estimate(value=0.02, std=None, ci95=(0.02, 0.03), unit="s"))
    '0.020 −0 +0.010'
    >>> format_value(Estimate(value=-6.0, std=1e-10, ci95=(-6.0, -6.0), unit="deg"))
    '-6 ± 0'

    Without an error, four digits are enough:

    >>> format_value(Estimate(value=35.7572, std=0.2, ci95=None, unit="Hz", verdict="doubtful"))
    '35.76 ± ?'
    >>> format_value(Estimate(value=21.3, std=7183.0, ci95=(-14000.0, 14500.0), unit="Hz"))
    'not determined'
    """
    if _undetermined(estimate, positive):
        return NOT_DETERMINED
    if estimate.ci95 is None:
        return f"{format_number(estimate.value)} ± ?"
    return _NO_REACH.sub("0", with_error(estimate))


def format_estimate(estimate: Estimate) -> str:
    """Write an estimate as ``value ± std unit``.

    Examples
    --------
    >>> format_estimate(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.987 ± 0.030 Hz'
    """
    value = format_value(estimate)
    return value if value == NOT_DETERMINED else f"{value} {estimate.unit}".rstrip()


def _undetermined(estimate: Estimate, positive: bool) -> bool:
    """Whether a positive figure may be nothing, and its error exceeds it."""
    low = (estimate.ci95 or (None, None))[0]
    return (
        (positive or estimate.unit == "Hz")
        and estimate.ci95 is not None
        and (low is None or low <= 0.0)
        and estimate.spread > abs(estimate.value)
    )


def format_interval(estimate: Estimate, *, positive: bool = False) -> str:
    """Write the 95 % interval with as many places as the value has.

    Parameters
    ----------
    estimate : Estimate
        What was found.
    positive : bool
        As for `format_value`: such an interval does not reach below 0.

    Examples
    --------
    >>> format_interval(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.928 to 10.046'
    >>> format_interval(Estimate(value=0.15, std=None, ci95=(0.1474, None), unit="s"))
    '0.1474 or more'
    >>> format_interval(Estimate(value=4.46, std=None, ci95=(4.08895, 4.92893), unit="Hz"))
    '4.09 to 4.93'
    >>> format_interval(Estimate(value=6.9223, std=0.0348, ci95=(6.8911, 6.9905), unit="Hz"))
    '6.891 to 6.990'
    >>> format_interval(Estimate(value=3.0, std=5.0, ci95=(-7.0, 13.0), unit="Hz"))
    '13.0 or less'
    """
    if is_exact(estimate) or estimate.ci95 is None:
        return "–"
    low, high = estimate.ci95
    if high is not None and _undetermined(estimate, positive):
        low = None
    std = None if estimate.asymmetric else estimate.std
    return interval(low, high, value=estimate.value, std=std)


def format_number(value: float | None) -> str:
    """Write a number that has no error bar, to four digits; a dash for none.

    Examples
    --------
    >>> format_number(0.17), format_number(1234.5678), format_number(None)
    ('0.17', '1235', '–')
    """
    return "–" if value is None else f"{value:.4g}"


def format_scatter(std: float, value: float) -> str:
    """Write the scatter of a value without an exponent where the value has none, to two digits.

    Parameters
    ----------
    std : float
        Standard deviation from run to run, in the unit of the value.
    value : float
        What scatters.

    Examples
    --------
    >>> format_scatter(2.864e-5, 0.15)
    '0.000029'
    """
    return plus_minus(value, std).partition("± ")[2].rstrip("?") or "–"


_LOPSIDED = (
    "Where the interval is not symmetric, −a +b states how far it reaches to either side, in place "
    "of the standard deviation."
)
_WITHHELD = (
    "± ? means that no error bar can be stated: the findings say what the record contradicts."
)


def how_to_read(values: Sequence[str]) -> str:
    """Say how written values without a plain standard deviation are read; '' where all have one.

    Examples
    --------
    >>> how_to_read(["0.1499 ± 0.0001", "9.983 ± ?"])[:32]
    '± ? means that no error bar can '
    """
    said = [
        _LOPSIDED if any(" −" in value for value in values) else "",
        _WITHHELD if any(value.endswith("?") for value in values) else "",
    ]
    return " ".join(filter(None, said))


def typeset(text: str) -> str:
    """Return text with a true minus before numbers, and powers of ten as powers.

    Examples
    --------
    >>> typeset("-0.5 to 1.2e-07, 2026-11-23, u-1, --from -3")
    '−0.5 to 1.2·10⁻⁷, 2026-11-23, u-1, --from −3'
    """
    raised = _POWER.sub(lambda m: "·10" + (m[1].strip("+") + m[2]).translate(_RAISED), text)
    return _MINUS.sub("−", raised)


def value_and_error(text: str) -> list[str]:
    """Part a written estimate where a narrow column may break it: before its error, if any.

    Examples
    --------
    >>> value_and_error("0.15000 −0.00260 +0.00020 s"), value_and_error("0.2")
    (['0.15000', '−0.00260 +0.00020 s'], ['0.2'])
    """
    return _ERROR.split(text, maxsplit=1)
