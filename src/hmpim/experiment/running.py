"""One run of one rig, from connecting to disconnecting."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from os import PathLike

from hmpim.errors import HmpimError, RigError
from hmpim.experiment.checks import check_stimuli, check_watched, limits_by_axis, moves
from hmpim.experiment.collect import Collected, Played, default_layout
from hmpim.experiment.feel import Feel, feel
from hmpim.experiment.interrupt import undisturbed
from hmpim.experiment.log import RunLog
from hmpim.experiment.options import RunOptions
from hmpim.experiment.pacer import Pacer
from hmpim.experiment.priority import undelayed
from hmpim.experiment.recorder import Recorder
from hmpim.experiment.timing import judge_timing, measure_timing
from hmpim.experiment.watch import Watcher
from hmpim.record import Finding, Record
from hmpim.rigs import (
    Clocked,
    Commands,
    Layout,
    LimitsOfAxes,
    Reporting,
    Rig,
    RunReport,
    SystemClock,
    commands_of,
    shared_band,
    stimuli_by_axis,
)
from hmpim.stimulus import Limits, Stimulus, scaled_stimulus

__all__ = ["Running", "Subscriber", "Until"]

Subscriber = Callable[[Played], object]
"""Called with each block as it was played; what it returns is not looked at."""

Until = Callable[[Played], str | None]
"""Called with each block as it was played; a string ends the run, and is the reason."""

_BLOCK = 0.02  # s: commands handed to a rig at once, and how often anybody watching is told


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Ready:
    """What was looked at, and found in order."""

    stimuli: dict[str, Stimulus]
    limits: dict[str, Limits | None]
    commands: Commands
    pacer: Pacer


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Running:
    """One run of one rig; see `hmpim.run` for the parameters."""

    rig: Rig
    given: Stimulus | Mapping[str, Stimulus]
    limits: LimitsOfAxes
    subscribers: tuple[Subscriber, ...]
    until: Until | None
    path: str | PathLike[str] | None
    log: RunLog
    options: RunOptions

    def through(self) -> Record:
        """Connect, check, play, stop, disconnect; errors of a driver become the rig's own."""
        if self.options.clock is not None and isinstance(self.rig, Clocked):
            self.rig.use_clock(self.options.clock)
        try:
            with self.rig:
                with self._faults_logged():
                    ready = self._check(self._stimuli())
                findings: list[Finding] = []
                how = self.options.feel
                if how == "unknown":
                    how = Feel() if moves(self.rig) and self.rig.limits is None else None
                if how is not None:
                    ready = self._felt(ready, how, findings)
                return self._kept(ready, findings)
        except HmpimError:
            raise
        except _WatcherError as failure:
            raise failure.error from None
        except Exception as error:  # a driver may raise anything
            raise RigError(
                f"rig {self.rig.name!r} failed: {type(error).__name__}: {error}"
            ) from error

    def _stimuli(self) -> dict[str, Stimulus]:
        return stimuli_by_axis(self.given, self.rig.axes, name=repr(self.rig.name))

    def _check(self, stimuli: dict[str, Stimulus]) -> _Ready:
        """Look at everything that can be looked at while nothing moves."""
        check_watched(self.rig, needed=self.options.watchdog, log=self.log)
        limits = limits_by_axis(self.rig, stimuli, stated=self.limits)
        check_stimuli(stimuli, limits, rig=self.rig, log=self.log)
        commands = commands_of(stimuli)
        clock = SystemClock() if self.options.clock is None else self.options.clock
        pacer = Pacer(clock, fs=commands.fs, count=len(commands))
        return _Ready(stimuli=stimuli, limits=limits, commands=commands, pacer=pacer)

    def _felt(self, ready: _Ready, how: Feel, findings: list[Finding]) -> _Ready:
        """Move a little first, and return what may be moved then."""
        grows = self.path is not None and self._recorder(ready, path=self.path).grows
        feeling = replace(self, until=None, subscribers=(), path=self.path if grows else None)

        def play(stimuli: Mapping[str, Stimulus]) -> Record:
            with self._faults_logged():
                ready = self._check(dict(stimuli))
            return feeling._kept(ready, [])

        felt = feel(play, ready.stimuli, ready.limits, how=how)
        findings.extend(felt.findings)
        if felt.share == 1.0:
            return self._check(ready.stimuli)
        return self._check(
            {axis: scaled_stimulus(s, felt.share) for axis, s in ready.stimuli.items()}
        )

    def _recorder(self, ready: _Ready, *, path: str | PathLike[str] | None) -> Recorder:
        bounds = {axis: bound for axis, bound in ready.limits.items() if bound is not None}
        return Recorder(
            path,
            rig=self.rig.name,
            limits=bounds,
            stimuli=tuple(ready.stimuli.values()),
            commands=ready.commands,
            log=self.log,
        )

    def _kept(self, ready: _Ready, findings: list[Finding]) -> Record:
        """Play, and keep what was recorded whatever happens."""
        with self._faults_logged():
            recorder = self._recorder(ready, path=self.path)
        try:
            record = self._played(ready, findings, recorder)
        except BaseException as error:
            with undisturbed():
                kept = recorder.fail(_words(error))
            if kept:
                self.log.add("note", f"what was recorded until then is in {self.path}")
            raise
        recorder.finish(record)
        return record

    def _played(self, ready: _Ready, findings: list[Finding], recorder: Recorder) -> Record:
        try:
            with (
                self._faults_logged(),
                undelayed(realtime=self.options.realtime and moves(self.rig)) as scheduling,
            ):
                if moves(self.rig):
                    self.log.add("note", scheduling)
                layout, collected = self._play(ready, findings, recorder)
        finally:
            self._stop()
        with self._faults_logged():
            report = self.rig.report() if isinstance(self.rig, Reporting) else RunReport()
            clock = self.options.clock
            ticked = clock.report().findings if isinstance(clock, Reporting) else ()
            findings += [*report.findings, *ticked, *self._timing(ready, layout)]
            for finding in findings:
                self.log.add("note", finding.message)
            said = RunReport(findings=tuple(findings), clocks=report.clocks)
            band = shared_band(ready.stimuli)
            return collected.record(fs=ready.commands.fs, band=band, report=said)

    def _play(
        self, ready: _Ready, findings: list[Finding], recorder: Recorder
    ) -> tuple[Layout, Collected]:
        commands = ready.commands
        only = next(iter(ready.stimuli.values()))
        layout = self.rig.prepare(only if isinstance(self.given, Stimulus) else ready.stimuli)
        if layout is None:
            layout = default_layout(commands, name=self.rig.name)
        recorder.open(layout, band=shared_band(ready.stimuli))
        self.log.add("arm", f"{self.rig.name}: {', '.join(c.name for c in layout.channels)}")
        collected = Collected(layout, name=self.rig.name)
        watcher = Watcher(
            self.options.watch, ready.limits, name=self.rig.name, real=moves(self.rig)
        )
        size = max(1, round(_BLOCK * commands.fs))
        seconds = len(commands) / commands.fs
        self.log.add("start", f"{len(commands)} commands at {commands.fs:g} Hz, {seconds:g} s")
        for block in commands.blocks(size, pace=ready.pacer):
            reply = self.rig.play(block)
            samples = collected.take(block, reply, sent=ready.pacer.sent_of(block))
            recorder.take(samples, now=float(block.time[-1]))
            played = Played(block=block, layout=layout, samples=samples, seconds=seconds)
            watcher(played)
            reason = self._told(played)
            if reason is not None:
                findings.append(_ended_early(reason, float(block.time[-1])))
                self.log.add("done", f"ended after {block.stop} commands: {reason}")
                break
        else:
            self.log.add("done", f"{len(commands)} commands played")
        return layout, collected

    def _told(self, played: Played) -> str | None:
        """Tell whoever watches; return the reason to end, if there is one."""
        try:
            for subscriber in self.subscribers:
                subscriber(played)
            return None if self.until is None else self.until(played)
        except Exception as error:
            raise _WatcherError(error) from error

    def _timing(self, ready: _Ready, layout: Layout) -> tuple[Finding, ...]:
        timing = measure_timing(ready.pacer.sent, fs=ready.commands.fs)
        if timing is None:
            return ()
        stamped = all(c.clock for c in (*layout.of("input"), *layout.of("output")))
        return judge_timing(timing, band=shared_band(ready.stimuli), stamped=stamped)

    def _stop(self) -> None:
        """Stop the rig; nothing from outside breaks this off."""
        with undisturbed():
            try:
                self.rig.stop()
            except BaseException as error:
                self.log.add("fault", f"stop failed: {type(error).__name__}: {error}")
                raise
            self.log.add("stop", f"{self.rig.name} was told to stop")

    @contextmanager
    def _faults_logged(self) -> Iterator[None]:
        try:
            yield
        except BaseException as error:
            self.log.add("fault", _words(error))
            raise


def _words(error: BaseException) -> str:
    """What failed, by its own name."""
    if isinstance(error, _WatcherError):
        return str(error)
    return f"{type(error).__name__}: {error}".rstrip(": ")


def _ended_early(reason: str, seconds: float) -> Finding:
    return Finding(
        code="ended_early",
        message=f"The run was ended after {seconds:.3g} s: {reason}.",
        severity="info",
        parameters=(),
    )


class _WatcherError(Exception):
    """A subscriber failed: its own error passes as it is, and is not the rig's."""

    def __init__(self, error: Exception) -> None:
        super().__init__(f"a subscriber failed: {type(error).__name__}: {error}")
        self.error = error
