"""Run a stimulus on a rig: limits first, then motion, and a stop whatever happens."""

from collections.abc import Mapping, Sequence
from os import PathLike

import numpy as np

from hmpim.arguments import check_argument, generator, shown
from hmpim.errors import ArgumentError
from hmpim.experiment.checks import check_rig
from hmpim.experiment.interrupt import ending_politely
from hmpim.experiment.log import RunLog
from hmpim.experiment.options import RunOptions
from hmpim.experiment.running import EndsWhen, Running, Subscriber
from hmpim.experiment.until import Until
from hmpim.record import Record
from hmpim.rigs import LimitsOfAxes, Rig, Seeded
from hmpim.stimulus import Stimulus

__all__ = ["run"]


def run(
    rig: Rig,
    stimulus: Stimulus | Mapping[str, Stimulus] | Sequence[Stimulus],
    *,
    path: str | PathLike[str] | None = None,
    rng: np.random.Generator | int | None = None,
    limits: LimitsOfAxes = None,
    until: Until | EndsWhen | None = None,
    subscribers: Sequence[Subscriber] = (),
    log: RunLog | None = None,
    options: RunOptions | None = None,
) -> Record:
    """Play a stimulus on a rig and return the record.

    Nothing moves unless the stimulus keeps every limit of the rig. Whatever happens after that,
    an error, Ctrl-C or a polite kill, the rig is stopped before this returns.

    Parameters
    ----------
    rig : Rig
        The unit under test. `run` connects to it; do not enter it with `with` yourself.
    stimulus : Stimulus, or mapping of axis to Stimulus, or sequence of Stimulus
        One stimulus, or one for each axis that moves (in a sequence, `Stimulus.axis` names it).
    path : path-like or None
        File for the record. An .h5 file is written as samples arrive: if the process is killed,
        all but the last half second can be read. A file that cannot be written is refused before
        anything moves.
    rng : numpy.random.Generator, int or None
        Random generator of a simulated unit, or its seed; None gives a different run each time.
    limits : Limits, or mapping of axis to Limits, or None
        Limits in addition to the rig's own; the smaller of the two applies. Needed if the rig
        moves and states none.
    until : Until, callable or None
        Rule that ends the run early: the axis then comes smoothly to rest inside the limits, and
        `Record.stopping` has the details. Or a callable that receives every block played; if it
        returns a string, the run ends at once, and the record gives the string as the reason.
    subscribers : sequence of callable
        Each is called with every block that was played. An exception in one ends the run.
    log : RunLog or None
        Receives each limit check, arming, stop and fault with its time.
    options : RunOptions or None
        Clock, supervision and scheduling.

    Returns
    -------
    Record

    Raises
    ------
    LimitsError
        If a true peak of the stimulus, between samples too, is beyond a limit of the rig, or
        the rig moves and states none; the message says what is enough.
    UnitError
        If the units of stimulus and limits cannot be compared.
    RigError
        If the unit fails.

    Examples
    --------
    >>> from hmpim.rigs import Sensor
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    >>> record = run(Sensor(delay=0.15, noise_std=0.1), stimulus, rng=1)
    >>> record.fs, record.inputs[0].unit
    (200.0, 'deg')
    """
    unit = check_rig(rig)
    given = _mapped(stimulus)
    for name, value, hint in (
        ("path", path, str | PathLike[str] | None),
        ("limits", limits, LimitsOfAxes),
        ("subscribers", subscribers, Sequence[Subscriber]),
        ("until", until, Until | EndsWhen | None),
        ("log", log, RunLog | None),
        ("options", options, RunOptions | None),
    ):
        check_argument(name, value, hint)
    if isinstance(unit, Seeded):
        unit.seed(generator(rng))
    running = Running(
        rig=unit,
        given=given,
        limits=limits,
        subscribers=tuple(subscribers),
        until=until,
        path=path,
        log=RunLog() if log is None else log,
        options=RunOptions() if options is None else options,
    )
    with ending_politely():
        return running.through()


def _mapped(
    stimulus: Stimulus | Mapping[str, Stimulus] | Sequence[Stimulus],
) -> Stimulus | Mapping[str, Stimulus]:
    if isinstance(stimulus, Stimulus | Mapping):
        return stimulus
    if not isinstance(stimulus, Sequence) or not all(isinstance(s, Stimulus) for s in stimulus):
        raise ArgumentError(
            f"{shown(stimulus)} is not a Stimulus; make one with design(...) or "
            "Stimulus(waveform=...)"
        )
    axes = [s.axis for s in stimulus]
    if len(set(axes)) < len(axes) or (len(axes) > 1 and not all(axes)):
        raise ArgumentError(
            f"axes {axes!r} must be different names; give each stimulus its own axis"
        )
    return stimulus[0] if len(stimulus) == 1 else {s.axis: s for s in stimulus}
