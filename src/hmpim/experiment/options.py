"""How a run is to be made, beyond what is played on what."""

from dataclasses import dataclass, field
from typing import Literal

from hmpim.experiment.feel import Feel
from hmpim.experiment.watch import Watch
from hmpim.rigs import Clock

__all__ = ["RunOptions"]


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """How a run is to be made.

    Parameters
    ----------
    clock : Clock or None
        None for the computer's own; `ManualClock` for tests.
    watch : Watch
        What is watched while the rig moves.
    realtime : bool
        Whether to ask for real-time scheduling; the log says whether it was allowed.
    watchdog : bool
        Whether to refuse a rig that moves and has no watchdog: if this process is killed, nothing
        stops it. Where False, the log says so; see `OutlivingRig`.
    feel : Feel, 'unknown' or None
        How to move a rig a little first; 'unknown' does so if it moves and states no limits of
        its own; None plays at the full amplitude at once, whatever the rig.

    Examples
    --------
    >>> RunOptions(watch=Watch(following_error=3.0)).realtime
    True
    """

    clock: Clock | None = None
    watch: Watch = field(default_factory=Watch)
    realtime: bool = True
    watchdog: bool = False
    feel: Feel | Literal["unknown"] | None = "unknown"
