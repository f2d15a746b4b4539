"""Numbers for people: the error to two digits, the value to match."""

import math

from hmpim.identify import Estimate

__all__ = ["format_estimate", "format_interval", "format_number", "plus_minus"]

_MOST_PLACES = 7
_LARGEST_PLAIN = 1e7


def plus_minus(value: float, std: float) -> str:
    """Write ``value ± std`` with two digits of the error and the value to match.

    Parameters
    ----------
    value, std : float
        In one unit.

    Examples
    --------
    >>> plus_minus(0.1500213, 0.0001062)
    '0.15002 ± 0.00011'
    >>> plus_minus(12345.6, 340.0)
    '12350 ± 340'
    >>> plus_minus(1.5e-9, 2e-11)
    '(1.500 ± 0.020)e-09'
    >>> plus_minus(3.0, math.inf)
    '3 ± ?'
    """
    places = _places(std)
    if places is None:
        return f"{_plain(value)} ± {'0' if std == 0 else '?'}"
    exponent = _exponent(value, std, places)
    if exponent:
        value, std = value / 10.0**exponent, std / 10.0**exponent
        return f"({_at(value, places + exponent)} ± {_at(std, places + exponent)})e{exponent:+03d}"
    return f"{_at(value, places)} ± {_at(std, places)}"


def format_estimate(estimate: Estimate) -> str:
    """Write an estimate as ``value ± std unit``.

    Examples
    --------
    >>> format_estimate(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.987 ± 0.030 Hz'
    """
    return f"{plus_minus(estimate.value, estimate.std)} {estimate.unit}".rstrip()


def format_interval(estimate: Estimate) -> str:
    """Write the 95 % interval with as many places as the value has.

    Examples
    --------
    >>> format_interval(Estimate(value=9.987, std=0.03, ci95=(9.928, 10.046), unit="Hz"))
    '9.928 to 10.046'
    """
    low, high = estimate.ci95
    places = _places(estimate.std)
    if places is None or _exponent(estimate.value, estimate.std, places):
        return f"{_plain(low)} to {_plain(high)}"
    return f"{_at(low, places)} to {_at(high, places)}"


def format_number(value: float | None) -> str:
    """Write a number that has no error bar, to four digits; a dash for none.

    Examples
    --------
    >>> format_number(0.17), format_number(1234.5678), format_number(None)
    ('0.17', '1235', '–')
    """
    return "–" if value is None else f"{value:.4g}"


def _places(std: float) -> int | None:
    """Decimal places that show two digits of `std`; None if it is no positive number."""
    if not (math.isfinite(std) and std > 0.0):
        return None
    return 1 - int(f"{std:.1e}".partition("e")[2])


def _exponent(value: float, std: float, places: int) -> int:
    """Power of ten to take out, 0 where plain digits read well."""
    largest = max(abs(value), std)
    if places <= _MOST_PLACES and largest < _LARGEST_PLAIN:
        return 0
    return math.floor(math.log10(largest)) if math.isfinite(largest) else 0


def _at(value: float, places: int) -> str:
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{places}f}" if places >= 0 else f"{round(value, places):.0f}"
    return text.removeprefix("-") if float(text) == 0.0 else text


def _plain(value: float) -> str:
    return f"{value:.6g}"
