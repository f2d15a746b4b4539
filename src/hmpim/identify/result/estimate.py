"""One figure: its value, its error, its interval, and whether to rely on it."""

import math
from dataclasses import dataclass, fields
from typing import Any, Literal

from hmpim.identify.chance import HALF
from hmpim.identify.result.digits import aside, plus_minus
from hmpim.identify.result.plain import Plain

__all__ = ["Estimate", "Estimates", "ParameterVerdict", "Verdict"]

ParameterVerdict = Literal["ok", "doubtful"]
Verdict = Literal["ok", "doubtful", "not_identifiable"]

_SEEN = 0.5
"""Greatest difference of an interval's sides that are written as one, in standard deviations: about
the rounding of an error to one digit."""


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Estimate(Plain):
    """A value, its standard deviation, and its 95 % interval, all in `unit`.

    Parameters
    ----------
    value : float
        The figure; ``float(estimate)`` gives it.
    std : float or None
        Standard deviation; None where the interval does not come from a normal error. A value that
        is not finite counts as None. Where the interval is withheld it is the effect of noise
        alone; the error of the figure may be larger.
    ci95 : (float or None, float or None), or None
        95 % interval. It may be asymmetric; an end that is open, or infinite, is None; None for
        an interval that is withheld.
    unit : str
        Of value, deviation and interval.
    verdict : {'ok', 'doubtful'}
        Whether the figure is reliable.

    Examples
    --------
    >>> delay = Estimate(value=0.15, std=0.000094, ci95=(0.14981, 0.15019), unit="s")
    >>> print(delay)
    0.15000 ± 0.00009 s
    >>> delay
    Estimate(0.15000 ± 0.00009 s)
    >>> f"{delay:.3f}", round(float(delay) * 1e3)
    ('0.150', 150)
    """

    value: float
    std: float | None
    ci95: tuple[float | None, float | None] | None
    unit: str = ""
    verdict: ParameterVerdict = "ok"

    def __post_init__(self) -> None:
        set_field = object.__setattr__  # frozen from here on
        set_field(self, "std", _finite(self.std))
        if self.ci95 is not None:
            low, high = (_finite(end) for end in self.ci95)
            set_field(self, "ci95", None if low is None and high is None else (low, high))

    @property
    def spread(self) -> float:
        """The standard deviation or, if there is none, the interval's longer side over 1.96.

        Infinite where the interval is open or withheld.
        """
        if self.std is not None:
            return self.std
        low, high = self.ci95 or (None, None)
        if low is None or high is None:
            return math.inf
        return max(self.value - low, high - self.value) / HALF

    @property
    def asymmetric(self) -> bool:
        """Whether ``± std`` would be wrong because the interval is longer on one side.

        False where there is no interval or no standard deviation, or the value lies outside.

        Examples
        --------
        >>> Estimate(value=6.922, std=0.035, ci95=(6.891, 6.990), unit="Hz").asymmetric
        True
        >>> Estimate(value=9.987, std=0.030, ci95=(9.928, 10.046), unit="Hz").asymmetric
        False
        """
        if self.std is None or self.ci95 is None:
            return False
        low, high = self.ci95
        if low is None or high is None:
            return True
        below, above = self.value - low, high - self.value
        return min(below, above) >= 0.0 and abs(above - below) > _SEEN * self.std

    @property
    def text(self) -> str:
        """Value and error with their unit: '0.15000 ± 0.00009 s', '6.922 −0.031 +0.068 Hz'."""
        low, high = self.ci95 or (None, None)
        if self.std is None or self.ci95 is None or self.asymmetric:
            number = aside(self.value, low, high)
        else:
            number = plus_minus(self.value, self.std, short=True)
        return f"{number} {self.unit}".rstrip()

    def __str__(self) -> str:
        return self.text if self.verdict == "ok" else f"{self.text} ({self.verdict})"

    def __repr__(self) -> str:
        doubt = "" if self.verdict == "ok" else f", {self.verdict}"
        return f"Estimate({self.text}{doubt})"

    def __format__(self, spec: str) -> str:
        return format(self.value, spec) if spec else str(self)

    def __float__(self) -> float:
        return float(self.value)


class Estimates(Plain):
    """Base of dataclasses of estimates."""

    __slots__ = ()

    @property
    def given(self) -> dict[str, Estimate]:
        """The estimates that are not None, by name, in the order of the fields."""
        holder: Any = self
        named = ((each.name, getattr(holder, each.name)) for each in fields(holder))
        return {name: estimate for name, estimate in named if estimate is not None}

    def to_dict(self) -> dict[str, Any]:
        """Return a dictionary from names to estimates, null where a value is not finite."""
        estimates = super().to_dict().items()
        return {n: e if e and math.isfinite(e["value"]) else None for n, e in estimates}


def _finite(number: float | None) -> float | None:
    return number if number is not None and math.isfinite(number) else None
