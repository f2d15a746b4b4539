"""Numbers for people: the error to its digits, the value to match."""

import math
from collections.abc import Sequence

__all__ = ["aside", "interval", "percent", "plus_minus"]

_MOST_PLACES = 7
_LARGEST_PLAIN = 1e7
_SMALLEST_LONG = 0.01
"""Value from which on plain digits read better than a power of ten, however many there are."""

_ROUNDING = 1e-10
"""Error over value below which the value's digits are no longer written out to it."""

_ROUGHLY = 0.01
"""Ratio of an interval's sides down to which the shorter one decides the digits."""

_ONE_DIGIT = 355
"""First three digits of an error from which one digit is enough (Particle Data Group)."""


def plus_minus(value: float, std: float, *, short: bool = False) -> str:
    """Write ``value ± std`` with two digits of the error and the value to match.

    Parameters
    ----------
    value, std : float
        In one unit.
    short : bool
        One digit of an error that begins with 355 or more, as the Particle Data Group rounds.

    Examples
    --------
    >>> plus_minus(0.1500213, 0.0001062)
    '0.15002 ± 0.00011'
    >>> plus_minus(0.1500013, 0.0000945), plus_minus(0.1500013, 0.0000945, short=True)
    ('0.150001 ± 0.000095', '0.15000 ± 0.00009')
    >>> plus_minus(12345.6, 340.0)
    '12350 ± 340'
    >>> plus_minus(0.31247002, 2.1e-7)
    '0.31247002 ± 0.00000021'
    >>> plus_minus(1.5e-9, 2e-11)
    '(1.500 ± 0.020)e-09'
    >>> plus_minus(3.0, math.inf)
    '3 ± ?'
    >>> plus_minus(0.9999999999999996, 1.1e-14)  # exact but for rounding
    '1 ± 1e-14'
    """
    if 0.0 < std < _ROUNDING * abs(value):
        return f"{value:.10g} ± {std:.0e}"
    places, exponent = _digits(value, [std], short=short)
    if places is None:
        return f"{value:.6g} ± {'0' if std == 0 else '?'}"
    number, error = (_at(each / 10.0**exponent, places + exponent) for each in (value, std))
    return _with_power(f"{number} ± {error}", exponent)


def aside(value: float, low: float | None, high: float | None) -> str:
    """Write a value with the distances to the ends of its interval; None for an open end.

    Examples
    --------
    >>> aside(0.15, 0.1474, 0.1502)
    '0.15000 −0.00260 +0.00020'
    >>> aside(0.15, 0.1474, None)
    '0.1500 −0.0026 +?'
    >>> aside(0.15, None, None)
    '0.15 ± ?'
    >>> aside(3.1e-15, 0.0, 3.4e-15), aside(3.2e9, 3.18e9, None)
    ('(3.10 −3.10 +0.30)e-15', '(3.200 −0.020 +?)e+09')
    >>> aside(0.15, 0.15 - 2e-12, 0.15 + 2.4e-7)  # one side much smaller than the other
    '0.1500000000 −0.0000000000 +0.0000002400'
    >>> aside(0.035, 0.035 - 2e-17, 0.035 + 5e-16)  # exact but for rounding
    '0.035 ± 5e-16'
    """
    reach = [None if end is None else abs(end - value) for end in (low, high)]
    known = [length for length in reach if length]
    if known and len(known) == len(reach) and max(known) < _ROUNDING * abs(value):
        return plus_minus(value, max(known))
    places, exponent = _digits(value, known)
    if places is None:
        return f"{value:.6g} ± ?"
    lengths = [None if length is None else length / 10.0**exponent for length in reach]
    places += exponent
    down, up = ("?" if length is None else _at(length, places) for length in lengths)
    return _with_power(f"{_at(value / 10.0**exponent, places)} −{down} +{up}", exponent)


def interval(low: float | None, high: float | None, *, value: float, std: float | None) -> str:
    """Write an interval with as many places as the value has; an open end in words.

    Parameters
    ----------
    low, high : float or None
        The ends; None for an open one.
    value : float
        The value between them.
    std : float or None
        Error that decides the digits of the value; None where `aside` writes it.

    Examples
    --------
    >>> interval(9.928, 10.046, value=9.987, std=0.03)
    '9.928 to 10.046'
    >>> interval(0.1474, None, value=0.15, std=None), interval(None, None, value=0.15, std=None)
    ('0.1474 or more', 'not known')
    >>> interval(4.8903e-11, 5.0594e-11, value=4.975e-11, std=4.3e-13)
    '(4.890 to 5.059)e-11'
    >>> interval(1.05e-15, 1.48e-15, value=1.23e-15, std=None)  # not symmetric: digits of `aside`
    '(1.05 to 1.48)e-15'
    """
    ends = [end for end in (low, high) if end is not None]
    if not ends:
        return "not known"
    known = [abs(end - value) for end in ends if end != value] if std is None else [std]
    places, exponent = _digits(value, known)
    if places is None or max(known) < _ROUNDING * abs(value):
        shown, exponent = [f"{end:.6g}" for end in ends], 0
    else:
        shown = [_at(end / 10.0**exponent, places + exponent) for end in ends]
    if len(shown) == 2:
        return _with_power(" to ".join(shown), exponent)
    power = f"e{exponent:+03d}" if exponent else ""
    return f"{shown[0]}{power} or {'less' if low is None else 'more'}"


def percent(share: float) -> str:
    """Write a share in per cent, to two digits.

    Examples
    --------
    >>> percent(0.0213), percent(0.999), percent(1.4)
    ('2.1', '100', '140')
    """
    return f"{float(f'{100.0 * share:.2g}'):g}"


def _digits(
    value: float, errors: Sequence[float], *, short: bool = False
) -> tuple[int | None, int]:
    """Decimal places for two digits of the errors, or one, and the power of ten to factor out.

    There are no places without a positive error, and no power where plain digits are readable.
    """
    std = max(min(errors), _ROUGHLY * max(errors)) if errors else 0.0
    if not (math.isfinite(std) and std > 0.0):
        return None, 0
    places = 1 - int(f"{std:.1e}".partition("e")[2])
    digits, _, exponent = f"{std:.2e}".partition("e")
    if short and _ONE_DIGIT <= int(digits.replace(".", "")) < 950:
        places = -int(exponent)
    largest = max(abs(value), *errors)
    few = places <= _MOST_PLACES or largest >= _SMALLEST_LONG
    if (few and largest < _LARGEST_PLAIN) or not math.isfinite(largest):
        return places, 0
    return places, math.floor(math.log10(largest))


def _with_power(text: str, exponent: int) -> str:
    return f"({text})e{exponent:+03d}" if exponent else text


def _at(value: float, places: int) -> str:
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.{places}f}" if places >= 0 else f"{round(value, places):.0f}"
    return text.removeprefix("-") if float(text) == 0.0 else text
