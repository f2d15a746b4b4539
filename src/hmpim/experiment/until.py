"""What must be known before a run may end: the rule of `hmpim.run(until=...)`."""

import math
import re
from dataclasses import dataclass
from typing import Any

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, UnitError
from hmpim.identify import Estimate
from hmpim.identify.result import Parameters
from hmpim.units import conversion_factor

__all__ = ["TARGETS", "Until", "until_of"]

TARGETS = {
    "delay": "s",
    "natural_frequency": "Hz",
    "damping_ratio": "",
    "time_constant": "s",
    "scale_factor": "",
    "bias": "",
}
"""Parameters that may have a target, and their units; scale factor and bias: the channels' own."""

_OWN = ("scale_factor", "bias")
_LOOKS = 3  # in a row at which the rule must hold: study in docs/live.md
_EVERY = 0.05  # s between two looks


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Until:
    """End a run as soon as these are known: each target is a standard deviation.

    A run never ends before the stimulus has covered the whole band once and the output has
    responded, while one of these figures is doubtful, or before the rule holds at several looks
    in a row.

    Parameters
    ----------
    delay, time_constant : float, optional
        In s.
    natural_frequency : float, optional
        In Hz.
    damping_ratio, scale_factor, bias : float, optional
        In the channels' own unit, if they have one.
    relative : tuple of str
        Names of the targets that are shares of the estimate, 0.01 being 1 %.
    looks : int
        In a row at which the rule must hold.
    every : float
        Seconds between two looks.
    pair : (str, str), optional
        Names of output and input, as in ``result["y", "u"]``; needed if there are several.

    Raises
    ------
    ArgumentError
        If no target is given, or a number is out of range.

    Examples
    --------
    >>> print(Until(delay=4e-4, natural_frequency=0.01, relative=("natural_frequency",)))
    delay=0.0004s,natural_frequency=1%
    """

    delay: float | None = None
    natural_frequency: float | None = None
    damping_ratio: float | None = None
    time_constant: float | None = None
    scale_factor: float | None = None
    bias: float | None = None
    relative: tuple[str, ...] = ()
    looks: int = _LOOKS
    every: float = _EVERY
    pair: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        if not self.targets:
            raise ArgumentError(f"no target is given; give one of {', '.join(TARGETS)}")
        for name, value in (*self.targets.items(), ("every", self.every)):
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} = {value!r} must be a positive, finite number")
        if self.looks < 1:
            raise ArgumentError(f"looks = {self.looks!r} must be 1 or more")
        object.__setattr__(self, "relative", tuple(self.relative))
        for name in self.relative:
            if name not in self.targets:
                raise ArgumentError(
                    f"relative = {name!r} is not a target; those are {self._names()}"
                )

    def __str__(self) -> str:
        return ",".join(
            f"{name}={100 * value:.6g}%" if name in self.relative else f"{name}={value:.6g}{unit}"
            for name, value in self.targets.items()
            for unit in (TARGETS[name],)
        )

    @property
    def targets(self) -> dict[str, float]:
        """What is asked for: standard deviation, or share, by name."""
        asked = {name: getattr(self, name) for name in TARGETS}
        return {name: float(value) for name, value in asked.items() if value is not None}

    def is_met(self, parameters: Parameters) -> bool:
        """Whether all that is asked for is known well enough, and not doubtful.

        Examples
        --------
        >>> sure = Estimate(value=0.15, std=3e-4, ci95=(0.1494, 0.1506), unit="s")
        >>> Until(delay=4e-4).is_met(Parameters(delay=sure))
        True
        """
        return all(
            self._is_known(name, getattr(parameters, name), target)
            for name, target in self.targets.items()
        )

    def _is_known(self, name: str, estimate: Estimate | None, target: float) -> bool:
        if estimate is None or estimate.verdict != "ok" or estimate.std is None:
            return False
        most = target * abs(estimate.value) if name in self.relative else target
        return 0.0 < estimate.std <= most

    def _names(self) -> str:
        return ", ".join(self.targets)


_PART = re.compile(r"\s*([a-z_]+)\s*=\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*(\S*)\s*")


def until_of(text: str, *, pair: tuple[str, str] | None = None) -> Until:
    """Read a rule as the command line has it.

    Parameters
    ----------
    text : str
        Targets with a unit or in % of the estimate, between commas.
    pair : (str, str), optional
        Names of output and input.

    Raises
    ------
    ArgumentError
        If a target is not known, has no number or a unit of another kind.

    Examples
    --------
    >>> print(until_of("delay=0.4ms,natural_frequency=1%"))
    delay=0.0004s,natural_frequency=1%
    """
    asked: dict[str, Any] = {}
    relative = []
    for part in text.split(","):
        found = _PART.fullmatch(part)
        if found is None:
            raise ArgumentError(
                f"--until {part!r} is not a target; write one as delay=0.4ms or "
                "natural_frequency=1%"
            )
        name, number, unit = found.groups()
        if name not in TARGETS:
            raise ArgumentError(f"--until {name!r} is not known; use one of {', '.join(TARGETS)}")
        if name in asked:
            raise ArgumentError(f"--until {name!r} is given twice; give it once")
        try:
            value = float(number)
        except ValueError:
            raise ArgumentError(f"--until {part!r}: {number!r} is not a number") from None
        if unit == "%":
            relative.append(name)
            asked[name] = value / 100.0
        else:
            asked[name] = value * _factor(name, unit)
    return Until(**asked, relative=tuple(relative), pair=pair)


def _factor(name: str, unit: str) -> float:
    """From the unit given to that of the parameter."""
    own = TARGETS[name]
    if unit == own:
        return 1.0
    if not unit:
        raise ArgumentError(
            f"--until {name} needs a unit, {own} for instance, or % of the estimate"
        )
    if not own:
        what = "is in the channel's own unit" if name in _OWN else "has no unit"
        raise ArgumentError(f"--until {name} {what}: leave {unit!r} out, or give % of the estimate")
    try:
        return conversion_factor(unit, to=own)
    except UnitError as error:
        raise ArgumentError(f"--until {name}: {error}") from None
