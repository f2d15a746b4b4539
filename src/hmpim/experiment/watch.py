"""What is watched while a rig moves: measured limits, following error, and data that stop."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from hmpim.errors import ArgumentError, RigError
from hmpim.experiment.collect import Played
from hmpim.rigs import ChannelSpec, Layout, Samples
from hmpim.stimulus import Limits
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import conversion_factor

__all__ = ["Watch", "Watcher"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """What ends a run.

    Parameters
    ----------
    margin : float
        Share of a limit by which a measurement may be beyond it: overshoot, and noise.
    following_error : float or None
        Largest distance of a measured position from the command, in the axis's unit; None for
        any, since a slow axis lags by nature.
    stale : float or None
        Seconds of the run without a new sample of a measured position; None for any.
    late : float or None
        Seconds by which a command of a rig that moves may be sent late: after the computer has
        paused, all overdue commands would be sent at once. None for any.
    answer : float or None
        Seconds after the last command of a block is due within which a rig that moves must return
        from `play`; None for any.

    Raises
    ------
    ArgumentError
        If one of them is negative or not a number.

    Examples
    --------
    >>> Watch(following_error=3.0).stale
    0.5
    """

    margin: float = 0.1
    following_error: float | None = None
    stale: float | None = 0.5
    late: float | None = 0.5
    answer: float | None = 5.0

    def __post_init__(self) -> None:
        for name in ("margin", "following_error", "stale", "late", "answer"):
            value = getattr(self, name)
            if value is None and name != "margin":
                continue
            if isinstance(value, bool) or not (isinstance(value, int | float) and value >= 0.0):
                raise ArgumentError(f"{name} = {value!r} must be 0 or positive")


class Watcher:
    """Looks at every block as it comes in, and raises where something is wrong.

    Parameters
    ----------
    watch : Watch
        What ends a run.
    limits : mapping of axis to Limits or None
        Of each axis that moves.
    layout : Layout
        What will come in.
    units : mapping of axis to str
        Unit of each axis that moves.
    name : str
        Of the rig, for messages.
    real : bool
        Whether something real moves; only then data can be stale.

    Raises
    ------
    RigError
        If a following error is to be watched, and the layout has no command to compare with.
    UnitError
        If a measured quantity cannot be turned into the unit of its axis.
    """

    def __init__(
        self,
        watch: Watch,
        limits: Mapping[str, Limits | None],
        *,
        layout: Layout,
        units: Mapping[str, str],
        name: str,
        real: bool,
    ) -> None:
        self._watch, self._name = watch, name
        self._stale = watch.stale if real else None
        self._last: dict[str, float] = {}
        self._newest: dict[str, float] = {}
        self._measured = [
            spec for spec in layout.of("output") if spec.axis is not None and spec.quantity
        ]
        self._bounds = {spec.name: _bound(spec, limits) for spec in self._measured}
        self._commands = {
            spec.name: self._command(spec, layout, units)
            for spec in self._measured
            if spec.quantity == "position" and watch.following_error is not None
        }

    def __call__(self, played: Played) -> None:
        """Look at a block.

        Raises
        ------
        RigError
            If a measurement is beyond a limit or too far from its command, or none came.
        """
        for spec in self._measured:
            samples = played.samples.get(spec.name)
            if samples is not None and samples.time.size:
                newest = float(np.max(samples.time))
                if newest > self._newest.get(spec.name, -math.inf):
                    self._newest[spec.name] = newest
                    self._last[spec.name] = float(played.block.time[-1])
                self._inside(spec, samples)
                if spec.name in self._commands:
                    self._following(spec, samples, played)
            self._fresh(spec, played)

    def _inside(self, spec: ChannelSpec, samples: Samples) -> None:
        bound, factor, own = self._bounds[spec.name]
        if math.isinf(bound):
            return
        k = int(np.argmax(np.abs(samples.values)))
        found = factor * float(samples.values[k])
        if not math.isfinite(found):
            raise RigError(
                f"measured {spec.quantity} of {spec.name} at {samples.time[k]:.3f} s is {found}, "
                f"so the position of its axis is unknown; {self._name!r} is stopped"
            )
        if not abs(found) <= bound * (1.0 + self._watch.margin):
            raise RigError(
                f"measured {spec.quantity} {found:.6g} {own} of {spec.name} at "
                f"{samples.time[k]:.3f} s is beyond the limit {bound:g} {own} by more than "
                f"{100 * self._watch.margin:g} %; {self._name!r} is stopped"
            )

    def _following(self, spec: ChannelSpec, samples: Samples, played: Played) -> None:
        source, theirs, ours, unit = self._commands[spec.name]
        allowed = self._watch.following_error
        command = played.samples.get(source)
        if allowed is None or command is None or not command.time.size:
            return
        wanted = theirs * np.interp(samples.time, command.time, command.values)
        error = np.abs(ours * samples.values - wanted)
        k = int(np.argmax(error))
        if not error[k] <= allowed:
            raise RigError(
                f"{spec.name} is {error[k]:.6g} {unit} from its command at "
                f"{samples.time[k]:.3f} s, more than the following error {allowed:g} {unit} "
                f"allowed; {self._name!r} is stopped"
            )

    def _command(
        self, spec: ChannelSpec, layout: Layout, units: Mapping[str, str]
    ) -> tuple[str, float, float, str]:
        """Command of a measured position, and the factors of both to the axis's unit."""
        unit = units.get(spec.axis or "", spec.unit)
        for other in layout.of("input"):
            if (other.axis, other.quantity) == (spec.axis, "position"):
                theirs = conversion_factor(other.unit, to=unit)
                return other.name, theirs, conversion_factor(spec.unit, to=unit), unit
        raise RigError(
            f"the following error of {spec.name} is to be watched, and {self._name!r} records no "
            f"commanded position of axis {spec.axis!r}; state one as an input, or leave it out"
        )

    def _fresh(self, spec: ChannelSpec, played: Played) -> None:
        if self._stale is None:
            return
        now = float(played.block.time[-1])
        silent = now - self._last.get(spec.name, 0.0)
        if silent > self._stale:
            raise RigError(
                f"no new sample of {spec.name} came for {silent:.3g} s; {self._name!r} is stopped"
            )


def _bound(spec: ChannelSpec, limits: Mapping[str, Limits | None]) -> tuple[float, float, str]:
    """Limit of a measured quantity, the factor to its unit, and that unit."""
    given = limits.get(spec.axis or "")
    bound = math.inf if given is None or spec.quantity is None else getattr(given, spec.quantity)
    if given is None or spec.quantity is None or math.isinf(bound):
        return math.inf, 1.0, ""
    order = QUANTITIES.index(spec.quantity)
    own = given.unit if order == 0 else f"{given.unit or '1'}/s{'²' if order == 2 else ''}"
    return bound, conversion_factor(spec.unit, to=own), own
