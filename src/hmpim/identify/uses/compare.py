"""Comparison of two results of one unit within their error bars: after a repair, for example."""

import math
from dataclasses import dataclass, replace

from hmpim.arguments import checked
from hmpim.errors import RecordError, UnitError
from hmpim.identify.chance import deviations
from hmpim.identify.result import Estimate, Identification, PairIdentification
from hmpim.identify.result.groups import EVERY, in_words
from hmpim.identify.uses.gains import gain_unit, like_gains
from hmpim.units import conversion_factor

__all__ = ["Change", "compare"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One parameter in two results.

    Parameters
    ----------
    output, input, name : str
        Channels and name of the parameter.
    old, new : Estimate
        In the older and in the newer result, both in the unit of the newer one.
    deviations : float
        Difference over the standard deviation of the difference; 0 where an interval is open.
    limit : float
        Deviations beyond which it has changed.
    """

    output: str
    input: str
    name: str
    old: Estimate
    new: Estimate
    deviations: float
    limit: float

    @property
    def changed(self) -> bool:
        """Whether the difference is more than chance."""
        return abs(self.deviations) > self.limit


@checked
def compare(new: Identification, old: Identification) -> tuple[Change, ...]:
    """Compare every parameter that both results have.

    Parameters
    ----------
    new, old : Identification
        Of the same unit: pairs of the same names.

    Returns
    -------
    tuple of Change
        One for each parameter. The limit is such that an unchanged unit shows any change with a
        chance of 0.01 %, however many parameters there are.

    Raises
    ------
    RecordError
        If the results have no parameter in common, or one is in units that cannot be converted
        into each other.

    Notes
    -----
    Old figures are converted into the units of the new ones where both results state them.

    Examples
    --------
    >>> import hmpim
    >>> from hmpim.identify import identify
    >>> limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> stimulus = hmpim.design(band=(0.1, 10), duration=5, fs=100, limits=limits)
    >>> def found(delay, rng):
    ...     sensor = hmpim.Sensor(delay=delay, noise_std=0.1)
    ...     return identify(hmpim.run(sensor, stimulus, rng=rng))
    >>> [c.name for c in compare(found(0.101, 3), found(0.1, 4)) if c.changed][:1]
    ['delay']
    """
    older = {(pair.output, pair.input): pair for pair in old.pairs}
    both: list[tuple[str, str, str, Estimate, Estimate]] = [
        (pair.output, pair.input, name, _converted(was, name, pair, before), now)
        for pair in new.pairs
        if (before := older.get((pair.output, pair.input))) is not None
        for name in EVERY
        if (was := getattr(before.parameters, name)) is not None
        and (now := getattr(pair.parameters, name)) is not None
    ]
    if not both:
        raise RecordError(
            "the two results have no parameter in common; are they of the same unit, with the "
            "same channel names?"
        )
    limit = deviations(len(both))
    return tuple(
        Change(
            output=output,
            input=source,
            name=name,
            old=was,
            new=now,
            deviations=_deviations(now, was),
            limit=limit,
        )
        for output, source, name, was, now in both
    )


def _converted(
    was: Estimate, name: str, pair: PairIdentification, before: PairIdentification
) -> Estimate:
    """An old figure in the unit of the new one, where both results state a unit."""
    now: Estimate = getattr(pair.parameters, name)
    own, unit = was.unit, now.unit
    if name == "scale_factor":
        own, unit = _units_of_gains(was, now, before, pair)
    elif not (own and unit):
        return was
    if own == unit:
        return was
    try:
        factor = conversion_factor(own, to=unit)
    except UnitError:
        raise RecordError(
            f"the {in_words(name)} of {pair.output!r} from {pair.input!r} is in "
            f"{now.unit or '1'!r}, and in {was.unit or '1'!r} in the older result, which cannot "
            "be converted; compare results in like units"
        ) from None
    low, high = (None if end is None else factor * end for end in was.ci95 or (None, None))
    std = None if was.std is None else factor * was.std
    return replace(was, value=factor * was.value, std=std, ci95=(low, high), unit=now.unit)


def _units_of_gains(
    was: Estimate, now: Estimate, before: PairIdentification, pair: PairIdentification
) -> tuple[str, str]:
    """Units between which an old scale factor is converted; alike where an output has none."""
    old, new = before.parameters.bias, pair.parameters.bias
    if old is None or new is None or not (old.unit and new.unit):
        return "", ""
    unstated = was.unit == gain_unit(before, ("", old.unit))
    unstated = unstated or now.unit == gain_unit(pair, ("", new.unit))
    if unstated and like_gains(before, pair):
        return old.unit, new.unit  # an input without a unit is taken to be in that of the other
    return was.unit, now.unit


def _deviations(now: Estimate, was: Estimate) -> float:
    spread = math.hypot(now.spread, was.spread)
    difference = now.value - was.value
    if difference == 0.0 or math.isinf(spread):
        return 0.0
    return difference / spread if spread > 0.0 else math.copysign(math.inf, difference)
