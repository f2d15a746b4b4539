"""Run a stimulus on a rig: limits first, then motion, and a stop whatever happens."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from hmpim.errors import ArgumentError, HmpimError, RigError
from hmpim.experiment.checks import check_rig, check_stimuli, limits_by_axis
from hmpim.experiment.collect import Collected, Played, default_layout
from hmpim.experiment.interrupt import ending_politely, undisturbed
from hmpim.experiment.log import RunLog
from hmpim.experiment.pacer import Pacer
from hmpim.record import Record
from hmpim.rigs import (
    Clock,
    Commands,
    LimitsOfAxes,
    Reporting,
    Rig,
    RunReport,
    Seeded,
    SystemClock,
    commands_of,
    shared_band,
    stimuli_by_axis,
)
from hmpim.stimulus import Stimulus

__all__ = ["Subscriber", "run"]

Subscriber = Callable[[Played], object]
"""Called with each block as it was played; what it returns is not looked at."""

_BLOCK = 0.02  # s: commands handed to a rig at once, and how often anybody watching is told


def run(
    rig: Rig,
    stimulus: Stimulus | Mapping[str, Stimulus] | Sequence[Stimulus],
    *,
    rng: np.random.Generator | int | None = None,
    limits: LimitsOfAxes = None,
    subscribers: Sequence[Subscriber] = (),
    log: RunLog | None = None,
    clock: Clock | None = None,
) -> Record:
    """Play a stimulus on a rig and return the record.

    Nothing moves unless the stimulus keeps every limit of the rig. Whatever happens after that,
    an error, Ctrl-C or a polite kill, the rig is stopped before this returns.

    Parameters
    ----------
    rig : Rig
        The unit under test. It is entered here: give it as it is, not inside a `with`.
    stimulus : Stimulus, or mapping of axis to Stimulus, or sequence of Stimulus
        What to play: one, or one for each axis that moves (a sequence goes by `Stimulus.axis`).
    rng : numpy.random.Generator, int or None
        Source of what is random in a simulated unit, or its seed; None draws fresh.
    limits : Limits, or mapping of axis to Limits, or None
        To be kept beside the rig's own, whichever is smaller; the only ones if it states none.
    subscribers : sequence of callable
        Each is called with every block that was played. One that raises ends the run.
    log : RunLog or None
        Takes each limit check, arm, stop and fault with its time.
    clock : Clock or None
        None for the computer's own; `ManualClock` for tests.

    Returns
    -------
    Record

    Raises
    ------
    LimitsError
        If a true peak of the stimulus, between samples too, is beyond a limit of the rig, or
        the rig moves and states none; the message says what would do.
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
    if isinstance(unit, Seeded):
        unit.seed(np.random.default_rng(rng))
    running = _Running(
        rig=unit,
        given=given,
        limits=limits,
        clock=SystemClock() if clock is None else clock,
        subscribers=tuple(subscribers),
        log=RunLog() if log is None else log,
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
            f"{stimulus!r} is no Stimulus; make one with design(...) or Stimulus(waveform=...)"
        )
    axes = [s.axis for s in stimulus]
    if len(set(axes)) < len(axes) or (len(axes) > 1 and not all(axes)):
        raise ArgumentError(f"axes {axes!r} are not told apart; give each stimulus its own axis")
    return stimulus[0] if len(stimulus) == 1 else {s.axis: s for s in stimulus}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Running:
    """One run of one rig, from connecting to disconnecting."""

    rig: Rig
    given: Stimulus | Mapping[str, Stimulus]
    limits: LimitsOfAxes
    clock: Clock
    subscribers: tuple[Subscriber, ...]
    log: RunLog

    def through(self) -> Record:
        """Connect, check, play, stop, disconnect; errors of a driver become the rig's own."""
        try:
            with self.rig:
                with self._faults_logged():
                    stimuli, commands = self._check()
                return self._played(stimuli, commands)
        except HmpimError:
            raise
        except _Watching as failure:
            raise failure.error from None
        except Exception as error:  # a driver may raise anything
            raise RigError(
                f"rig {self.rig.name!r} failed: {type(error).__name__}: {error}"
            ) from error

    def _check(self) -> tuple[dict[str, Stimulus], Commands]:
        """Look at everything that can be looked at while nothing moves."""
        stimuli = stimuli_by_axis(self.given, self.rig.axes, name=repr(self.rig.name))
        limits = limits_by_axis(self.rig, stimuli, stated=self.limits)
        check_stimuli(stimuli, limits, rig=self.rig, log=self.log)
        return stimuli, commands_of(stimuli)

    def _played(self, stimuli: dict[str, Stimulus], commands: Commands) -> Record:
        try:
            with self._faults_logged():
                collected = self._play(stimuli, commands)
        finally:
            self._stop()
        with self._faults_logged():
            report = self.rig.report() if isinstance(self.rig, Reporting) else RunReport()
            for finding in report.findings:
                self.log.add("note", finding.message)
            return collected.record(fs=commands.fs, band=shared_band(stimuli), report=report)

    @contextmanager
    def _faults_logged(self) -> Iterator[None]:
        try:
            yield
        except BaseException as error:
            self.log.add("fault", f"{type(error).__name__}: {error}")
            raise

    def _play(self, stimuli: dict[str, Stimulus], commands: Commands) -> Collected:
        pacer = Pacer(self.clock, fs=commands.fs, count=len(commands))
        layout = self.rig.prepare(self.given if isinstance(self.given, Stimulus) else stimuli)
        if layout is None:
            layout = default_layout(commands, name=self.rig.name)
        self.log.add("arm", f"{self.rig.name}: {', '.join(c.name for c in layout.channels)}")
        collected = Collected(layout, name=self.rig.name)
        size = max(1, round(_BLOCK * commands.fs))
        seconds = len(commands) / commands.fs
        self.log.add("start", f"{len(commands)} commands at {commands.fs:g} Hz, {seconds:g} s")
        for block in commands.blocks(size, pace=pacer):
            samples = collected.take(block, self.rig.play(block))
            played = Played(block=block, layout=layout, samples=samples, seconds=seconds)
            for subscriber in self.subscribers:
                try:
                    subscriber(played)
                except Exception as error:
                    raise _Watching(error) from error
        self.log.add("done", f"{len(commands)} commands played")
        return collected

    def _stop(self) -> None:
        """Stop the rig; nothing from outside breaks this off."""
        with undisturbed():
            try:
                self.rig.stop()
            except BaseException as error:
                self.log.add("fault", f"stop failed: {type(error).__name__}: {error}")
                raise
            self.log.add("stop", f"{self.rig.name} was told to stop")


class _Watching(Exception):  # noqa: N818
    """A subscriber failed: its own error passes as it is, and is not the rig's."""

    def __init__(self, error: Exception) -> None:
        super().__init__(f"a subscriber failed: {type(error).__name__}: {error}")
        self.error = error
