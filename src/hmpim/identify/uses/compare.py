"""Comparison of two results of one unit within their error bars: after a repair, for example."""

import math
from dataclasses import dataclass

from hmpim.arguments import checked
from hmpim.errors import RecordError
from hmpim.identify.chance import deviations
from hmpim.identify.result import Estimate, Identification, Parameters
from hmpim.identify.result.groups import EVERY

__all__ = ["Change", "compare"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One parameter in two results.

    Parameters
    ----------
    output, input, name : str
        Channels and name of the parameter.
    old, new : Estimate
        In the older and in the newer result.
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
        If the results have no parameter in common.

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
    older = {(pair.output, pair.input): pair.parameters for pair in old.pairs}
    none = Parameters()
    both: list[tuple[str, str, str, Estimate, Estimate]] = [
        (pair.output, pair.input, name, was, now)
        for pair in new.pairs
        for name in EVERY
        if (was := getattr(older.get((pair.output, pair.input), none), name)) is not None
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


def _deviations(now: Estimate, was: Estimate) -> float:
    spread = math.hypot(now.spread, was.spread)
    difference = now.value - was.value
    if difference == 0.0 or math.isinf(spread):
        return 0.0
    return difference / spread if spread > 0.0 else math.copysign(math.inf, difference)
