"""Numbers for people: the error to two digits, the value to match."""

from hmpim.identify import Estimate
from hmpim.identify.result.digits import aside, interval, plus_minus

__all__ = ["format_estimate", "format_interval", "format_number", "format_value", "plus_minus"]

_ROUNDING = 1e-12
"""Error over value that is arithmetic's and not the record's."""


def format_value(estimate: Estimate) -> str:
    """Write an estimate without its unit: ``value ± std``, or how far it may lie to either side.

    Examples
    --------
    >>> format_value(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.987 ± 0.030'
    >>> format_value(Estimate(value=0.15, std=None, ci95=(0.1474, 0.1502), unit="s"))
    '0.15000 −0.00260 +0.00020'
    >>> format_value(Estimate(value=0.003, std=7e-19, ci95=(0.003, 0.003), unit="deg"))
    '0.003 ± 0'

    Without an error, four digits are enough:

    >>> format_value(Estimate(value=35.7572, std=0.2, ci95=None, unit="Hz", verdict="doubtful"))
    '35.76 ± ?'
    >>> format_value(Estimate(value=21.3, std=7183.0, ci95=(-14000.0, 14500.0), unit="Hz"))
    '21 ± 7200'
    """
    if estimate.ci95 is None:
        return f"{format_number(estimate.value)} ± ?"
    if _exact(estimate):
        return f"{estimate.value:.10g} ± 0"
    if estimate.std is not None:
        if estimate.unit == "Hz" and estimate.std > abs(estimate.value):
            # No frequency is 0, as rounding to the error would have it.
            error = float(f"{estimate.std:.2g}")
            return f"{estimate.value:.2g} ± {error:g}"
        return plus_minus(estimate.value, estimate.std)
    return aside(estimate.value, *estimate.ci95)


def format_estimate(estimate: Estimate) -> str:
    """Write an estimate as ``value ± std unit``.

    Examples
    --------
    >>> format_estimate(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.987 ± 0.030 Hz'
    """
    return f"{format_value(estimate)} {estimate.unit}".rstrip()


def _exact(estimate: Estimate) -> bool:
    """Whether nothing but rounding is left of the error."""
    known = estimate.std is not None and estimate.ci95 is not None
    return known and estimate.spread <= _ROUNDING * abs(estimate.value)


def format_interval(estimate: Estimate) -> str:
    """Write the 95 % interval with as many places as the value has.

    Examples
    --------
    >>> format_interval(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.928 to 10.046'
    >>> format_interval(Estimate(value=0.15, std=None, ci95=(0.1474, None), unit="s"))
    '0.1474 or more'
    """
    if _exact(estimate) or estimate.ci95 is None:
        return "–"
    low, high = estimate.ci95 or (None, None)
    return interval(low, high, value=estimate.value, std=estimate.std)


def format_number(value: float | None) -> str:
    """Write a number that has no error bar, to four digits; a dash for none.

    Examples
    --------
    >>> format_number(0.17), format_number(1234.5678), format_number(None)
    ('0.17', '1235', '–')
    """
    return "–" if value is None else f"{value:.4g}"
