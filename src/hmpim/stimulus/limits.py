"""What an axis may do (Fig. 3): bounds on position, velocity, acceleration and jerk."""

import math
from dataclasses import dataclass

from hmpim.arguments import check_size, checked
from hmpim.errors import ArgumentError, UnitError
from hmpim.stimulus.motion import Peaks
from hmpim.units import check_unit, conversion_factor, rate_label

__all__ = ["QUANTITIES", "Limits", "three_digits"]

QUANTITIES = ("position", "velocity", "acceleration", "jerk")


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Largest magnitudes allowed, measured from the position at rest.

    Parameters
    ----------
    position, velocity, acceleration, jerk : float
        In `unit`, `unit`/s, `unit`/s² and `unit`/s³. Infinite where nothing bounds.
    unit : str
        Unit of the position; empty for none.

    Raises
    ------
    ArgumentError
        If one of them is NaN, zero or negative, not a number, or too large or small to compute
        with.
    UnitError
        If the unit is not known.

    Examples
    --------
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> round(limits.to("rad").position, 6)
    0.174533
    """

    position: float = math.inf
    velocity: float = math.inf
    acceleration: float = math.inf
    jerk: float = math.inf
    unit: str = ""

    def __post_init__(self) -> None:
        check_unit(self.unit)
        for order, name in enumerate(QUANTITIES):
            given = getattr(self, name)
            try:
                value = float(given)
            except (TypeError, ValueError):
                value = math.nan
            if isinstance(given, (str, bytes, bool)) or not value > 0:
                shown = f"{given!r} {rate_label(self.unit, order)}".rstrip()
                raise ArgumentError(
                    f"{name} limit = {shown} bounds nothing that could move; "
                    "give a positive number, or leave it out for no limit"
                )
            check_size(f"{name} limit", value, rate_label(self.unit, order))
            object.__setattr__(self, name, value)

    @checked
    def to(self, unit: str) -> "Limits":
        """Return the same limits in another unit.

        Raises
        ------
        UnitError
            If the unit is unknown or of another dimension, or only one of the two is a unit.

        Examples
        --------
        >>> round(Limits(velocity=1.0, unit="rad").to("deg").velocity, 3)
        57.296
        >>> Limits(position=5.0).to("deg")
        Traceback (most recent call last):
        hmpim.errors.UnitError: limits in no unit cannot be turned into 'deg'; state their unit
        """
        bound = any(math.isfinite(getattr(self, name)) for name in QUANTITIES)
        # Pint takes no unit for rad; here it means that nobody said.
        if bound and (self.unit == "") != (unit == ""):
            has, wants = (f"{u!r}" if u else "no unit" for u in (self.unit, unit))
            raise UnitError(
                f"limits in {has} cannot be turned into {wants}; "
                + ("state their unit" if not self.unit else "state a unit")
            )
        if not bound:
            return Limits(unit=unit)
        factor = conversion_factor(self.unit, to=unit)
        return Limits(
            position=self.position * factor,
            velocity=self.velocity * factor,
            acceleration=self.acceleration * factor,
            jerk=self.jerk * factor,
            unit=unit,
        )

    def use(self, peaks: Peaks) -> float:
        """Largest share of a limit that `peaks` take, 1 being the limit itself.

        Examples
        --------
        >>> Limits(velocity=4.0).use(Peaks(position=9.0, velocity=1.0, acceleration=9.0))
        0.25
        """
        shares = [0.0]
        for name in QUANTITIES:
            limit: float = getattr(self, name)
            if math.isfinite(limit):  # what has no limit may be infinite
                shares.append(getattr(peaks, name) / limit)
        return max(shares)


def three_digits(value: float, *, up: bool) -> str:
    """Write `value` with three significant digits, rounded so that the number still does.

    Examples
    --------
    >>> three_digits(0.12345, up=True), three_digits(6789.0, up=False)
    ('0.124', '6780')
    """
    scale = 10.0 ** (math.floor(math.log10(value)) - 2)
    rounded = (math.ceil(value / scale) if up else math.floor(value / scale)) * scale
    return f"{rounded:.6g}"
