"""One run of one rig, from connecting to disconnecting."""

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass, replace
from os import PathLike

from hmpim.errors import HmpimError, RigError
from hmpim.experiment.checks import (
    check_stimuli,
    check_watched,
    follows_commands,
    limits_by_axis,
    moves,
)
from hmpim.experiment.collect import Collected, Played, default_layout
from hmpim.experiment.deadline import Deadline
from hmpim.experiment.feel import Feel, feel
from hmpim.experiment.interrupt import AskedToEnd, undisturbed
from hmpim.experiment.log import RunLog
from hmpim.experiment.options import RunOptions
from hmpim.experiment.pacer import Pacer
from hmpim.experiment.priority import quick_to_switch, undelayed
from hmpim.experiment.recorder import Recorder
from hmpim.experiment.sure import Leave, Sure
from hmpim.experiment.timing import judge_timing, measure_timing
from hmpim.experiment.until import Until
from hmpim.experiment.watch import Watcher
from hmpim.record import Finding, Record, Stopping
from hmpim.rigs import (
    Block,
    Clock,
    Clocked,
    Commands,
    Layout,
    LimitsOfAxes,
    ManualClock,
    Reply,
    Reporting,
    Rig,
    RunReport,
    SystemClock,
    commands_of,
    shared_band,
    stimuli_by_axis,
)
from hmpim.rigs.block import Pace
from hmpim.rigs.simulated import Simulated
from hmpim.stimulus import Limits, Stimulus, scaled_stimulus

__all__ = ["EndsWhen", "Running", "Subscriber"]

Subscriber = Callable[[Played], object]
"""Called with each block as it was played; what it returns is not looked at."""

EndsWhen = Callable[[Played], str | None]
"""Called with each block as it was played; a string ends the run, and is the reason."""

_AHEAD = 0.1  # s of commands between a decision beside the run and what follows from it
_SWITCH = 5e-4  # s that whoever looks at the estimate may keep the commands waiting
_STOP = 60.0  # s that a rig may take to come to rest; OutlivingRig gives its process 30
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
    until: Until | EndsWhen | None
    path: str | PathLike[str] | None
    log: RunLog
    options: RunOptions

    def through(self) -> Record:
        """Connect, check, play, stop, disconnect; errors of a driver become the rig's own."""
        if self.options.clock is not None and isinstance(self.rig, Clocked):
            self.rig.use_clock(self.options.clock)
        try:
            with self._connected():
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

    @contextmanager
    def _connected(self) -> Iterator[None]:
        """Enter the rig, and leave it; what fails there hides no error and costs no record."""
        self.rig.__enter__()
        cause: BaseException | None = None
        try:
            yield
        except BaseException as error:
            cause = error
            raise
        finally:
            try:
                self.rig.__exit__(type(cause) if cause else None, cause, None)
            except Exception as error:
                self.log.add("fault", f"disconnecting failed: {_words(error)}")

    def _stimuli(self) -> dict[str, Stimulus]:
        return stimuli_by_axis(self.given, self.rig.axes, name=repr(self.rig.name))

    def _check(self, stimuli: dict[str, Stimulus]) -> _Ready:
        """Look at everything that can be looked at while nothing moves."""
        check_watched(self.rig, needed=self.options.watchdog, log=self.log)
        limits = limits_by_axis(self.rig, stimuli, stated=self.limits)
        check_stimuli(stimuli, limits, rig=self.rig, log=self.log)
        commands = commands_of(stimuli)
        clock = SystemClock() if self.options.clock is None else self.options.clock
        late = self.options.watch.late if moves(self.rig) else None
        latest = math.inf if late is None else late
        pacer = Pacer(clock, fs=commands.fs, count=len(commands), latest=latest)
        return _Ready(stimuli=stimuli, limits=limits, commands=commands, pacer=pacer)

    def _felt(self, ready: _Ready, how: Feel, findings: list[Finding]) -> _Ready:
        """Move a little first, and return what may be moved then."""
        growing = self._recorder(ready, path=self.path).growing
        feeling = replace(self, until=None, subscribers=(), path=growing)

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
                if kept is not None:
                    self.log.add("kept", f"what was recorded until then is in {kept}")
            raise
        try:
            recorder.finish(record)
        except HmpimError:
            self.log.add("kept", f"what was recorded is in {recorder.growing}")
            raise
        return record

    def _played(self, ready: _Ready, findings: list[Finding], recorder: Recorder) -> Record:
        try:
            with (
                self._faults_logged(),
                undelayed(realtime=self.options.realtime and moves(self.rig)) as scheduling,
            ):
                if moves(self.rig):
                    self.log.add("note", scheduling)
                with (
                    quick_to_switch(_SWITCH if isinstance(self.until, Until) else None),
                    Deadline(self._watch_clock(), instead=self._stop_beside) as deadline,
                ):
                    layout, collected = self._play(ready, findings, recorder, deadline)
        except BaseException as cause:
            self._stop_after(cause)
            raise
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
        self, ready: _Ready, findings: list[Finding], recorder: Recorder, deadline: Deadline
    ) -> tuple[Layout, Collected]:
        commands = ready.commands
        only = next(iter(ready.stimuli.values()))
        layout = self.rig.prepare(only if isinstance(self.given, Stimulus) else ready.stimuli)
        if layout is None:
            layout = default_layout(commands, name=self.rig.name)
        collected = Collected(layout, name=self.rig.name)
        recorder.open(layout, collected, band=shared_band(ready.stimuli))
        self.log.add("arm", f"{self.rig.name}: {', '.join(c.name for c in layout.channels)}")
        watcher = Watcher(
            self.options.watch,
            ready.limits,
            layout=layout,
            units=dict(zip(commands.axes, commands.units, strict=True)),
            name=self.rig.name,
            real=moves(self.rig),
        )
        sure = self._sure(ready, layout)
        size = max(1, round(_BLOCK * commands.fs))
        seconds = len(commands) / commands.fs
        self.log.add("start", f"{len(commands)} commands at {commands.fs:g} Hz, {seconds:g} s")
        playing = _Playing(commands, size=size, pace=ready.pacer)
        for block in playing:
            reply = self._reply(block, deadline)
            samples = collected.take(block, reply, sent=ready.pacer.sent_of(block))
            recorder.take(samples, now=float(block.time[-1]))
            played = Played(block=block, layout=layout, samples=samples, seconds=seconds)
            watcher(played)
            reason = self._told(played)
            if reason is not None:
                findings.append(_ended_early(reason, float(block.time[-1])))
                self.log.add("done", f"ended after {block.stop} commands: {reason}")
                break
            leave = None if sure is None else sure(played)
            if leave is not None:
                sure = None
                collected.stopping = self._left(leave, ready, playing)
        else:
            self.log.add("done", f"{len(playing.commands)} commands played")
        return layout, collected

    def _reply(self, block: Block, deadline: Deadline) -> Reply:
        """Play a block; a rig that moves must answer in time."""
        patience = self.options.watch.answer if moves(self.rig) else None
        if patience is None:
            return self.rig.play(block)
        assert block.pace is not None
        seconds = max(0.0, block.pace.left(block.stop - 1)) + patience
        missing = (
            f"{self.rig.name!r} did not return from play within {patience:g} s after command "
            f"{block.stop - 1} was due, at {block.time[-1]:.3g} s of the run; does its driver wait "
            "for an answer that does not come?"
        )
        with deadline.within(seconds, missing):
            return self.rig.play(block)

    def _watch_clock(self) -> Clock:
        """Clock that another thread may read, as that of an external tick is not."""
        given = self.options.clock
        return given if isinstance(given, ManualClock) else SystemClock()

    def _stop_beside(self) -> None:
        """Stop a rig whose driver hangs in compiled code, from another thread."""
        self.log.add("fault", f"play of {self.rig.name} hangs; it is stopped from another thread")
        with suppress(Exception):
            self.rig.stop()

    def _sure(self, ready: _Ready, layout: Layout) -> Sure | None:
        """Whoever looks whether enough is known, beside the run if that is in real time."""
        if not isinstance(self.until, Until):
            return None
        waits = not moves(self.rig) or isinstance(self.options.clock, ManualClock)
        return Sure(self.until, ready.stimuli, ready.limits, layout, ahead=0.0 if waits else _AHEAD)

    def _left(self, leave: Leave, ready: _Ready, playing: "_Playing") -> Stopping:
        """Play the way to rest instead of what is left; what nothing moves ends at once."""
        before = len(ready.commands)
        if follows_commands(self.rig):
            playing.commands = commands_of(dict(leave.stimuli))
            left = len(playing.commands)
        else:
            left = playing.commands_until(leave.after)
        fs = ready.commands.fs
        stopping = Stopping(
            rule=str(self.until),
            looks=leave.looks,
            time=leave.after / fs,
            saved=(before - left) / fs,
        )
        self.log.add(
            "note",
            f"sure after {stopping.time:.3g} s and {stopping.looks} looks: {stopping.rule}; "
            f"{stopping.saved:.3g} s saved",
        )
        return stopping

    def _told(self, played: Played) -> str | None:
        """Tell whoever watches; return the reason to end, if there is one."""
        try:
            for subscriber in self.subscribers:
                subscriber(played)
            return None if isinstance(self.until, Until | None) else self.until(played)
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
        late = f"stop did not return within {_STOP:g} s; stop {self.rig.name!r} by hand"
        with undisturbed(), Deadline(self._watch_clock()) as deadline:
            try:
                # The stop that simulations share only forgets: there is nothing to watch.
                shared = getattr(type(self.rig), "stop", None) is Simulated.stop
                with nullcontext() if shared else deadline.within(_STOP, late):
                    self.rig.stop()
            except BaseException as error:
                self.log.add("fault", f"stop failed: {type(error).__name__}: {error}")
                raise
            self.log.add("stop", f"{self.rig.name} was commanded to stop")

    def _stop_after(self, cause: BaseException) -> None:
        """Stop the rig after a failure; where that fails, too, the cause is said first."""
        try:
            self._stop()
        except Exception as error:
            why = _words(cause)
            more = "" if str(error) in why else f": {_words(error)}"
            raise RigError(
                f"rig {self.rig.name!r} failed: {why}; then it could not be stopped{more}"
            ) from cause

    @contextmanager
    def _faults_logged(self) -> Iterator[None]:
        try:
            yield
        except BaseException as error:
            self.log.add("fault", _words(error))
            raise


class _Playing:
    """Blocks of commands, which may be exchanged for others that begin alike."""

    def __init__(self, commands: Commands, *, size: int, pace: Pace) -> None:
        self.commands, self._size, self._pace = commands, size, pace

    def __iter__(self) -> Iterator[Block]:
        first = 0
        while first < len(self.commands):
            block = self.commands.block(first, self._size, pace=self._pace)
            yield block
            first = block.stop

    def commands_until(self, count: int) -> int:
        """Leave out all commands from `count` on; return how many are left."""
        self.commands = self.commands.cut(count)
        return len(self.commands)


def _words(error: BaseException) -> str:
    """What failed: in its own words, or by its name where those are not ours."""
    if isinstance(error, KeyboardInterrupt):
        return "Ctrl-C"
    if isinstance(error, _WatcherError | AskedToEnd | HmpimError):
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
