"""A rig in a process of its own, which outlives ours long enough to bring it to rest.

A killed process cannot stop a rig. Where the far end has no watchdog, whoever speaks to it must
not die with the run: so the rig lives in a child process. It plays what it has been handed, and
stops the rig when the run says so, when the run falls silent, or when the run is gone.
"""

import contextlib
import math
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from multiprocessing.connection import Connection
from types import FrameType, TracebackType
from typing import Any, Self

from hmpim.errors import HmpimError, RigError
from hmpim.experiment.collect import Collected, default_layout
from hmpim.experiment.deadline import Deadline
from hmpim.experiment.pacer import Pacer
from hmpim.rigs import (
    Block,
    Layout,
    LimitsOfAxes,
    Reporting,
    Rig,
    RunReport,
    Samples,
    Stimuli,
    SystemClock,
    commands_of,
    stimuli_by_axis,
)

__all__ = ["OutlivingRig"]

_AHEAD = 5  # blocks handed over before the first answer is awaited: 0.1 s
_SILENCE = 0.5  # s without a block after which the child stops the rig
_START = 30.0  # s in which the child must have begun
_STOP = 30.0  # s in which it must have stopped the rig
_HANGS = 1.0  # s after a stop within which the driver must return from what it does


class OutlivingRig:
    """A rig in a child process.

    Parameters
    ----------
    build : callable
        Makes the rig, in the child; it and its arguments are pickled.
    *arguments : object
        Of `build`.
    """

    def __init__(self, build: Callable[..., Rig], *arguments: Any) -> None:
        self._build, self._arguments = build, arguments
        self._connection: Connection | None = None
        self._process: Any = None
        self._facts: dict[str, Any] = {"name": "rig", "axes": (), "limits": None}
        self._outstanding = 0

    @property
    def name(self) -> str:
        """Name of the rig."""
        return str(self._facts["name"])

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the rig, known once it is connected."""
        return tuple(self._facts["axes"])

    @property
    def limits(self) -> LimitsOfAxes:
        """Limits of the rig, known once it is connected."""
        limits: LimitsOfAxes = self._facts["limits"]
        return limits

    @property
    def moves(self) -> bool:
        """True: else it needs no process of its own."""
        return True

    @property
    def watchdog(self) -> float:
        """Silence of the run in s after which its process stops the rig."""
        return _SILENCE

    @property
    def process(self) -> int | None:
        """Process in which the rig lives, None before it is connected."""
        return None if self._process is None else self._process.pid

    def __enter__(self) -> Self:
        context = multiprocessing.get_context("spawn")
        here, there = context.Pipe()
        self._process = context.Process(
            target=_child, args=(there, self._build, self._arguments), daemon=False
        )
        self._process.start()
        there.close()
        self._connection = here
        try:
            self._facts = self._answer(_START)
        except BaseException:
            self._leave()
            raise
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        self._leave()

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Prepare the rig in the child, which also fills in what was commanded and when."""
        self._outstanding = 0
        layout: Layout = self._ask("prepare", stimulus, seconds=120.0)
        channels = tuple(replace(channel, commanded=False) for channel in layout.channels)
        return replace(layout, channels=channels)

    def play(self, block: Block, /) -> Mapping[str, Samples]:
        """Hand a block over; return what came in for earlier ones."""
        self._tell("play", replace(block, pace=None))
        self._outstanding += 1
        gathered: dict[str, list[Samples]] = {}
        while self._outstanding > (0 if block.last else _AHEAD):
            start, sent, samples = self._answer(60.0)
            self._outstanding -= 1
            if block.pace is not None and sent is not None:
                block.pace.note(start, sent)
            for name, part in samples.items():
                gathered.setdefault(name, []).append(part)
        return {name: Samples.joined(parts) for name, parts in gathered.items()}

    def stop(self) -> None:
        """Stop the rig in the child; blocks that were handed over are not played."""
        if self._connection is None:
            return
        self._tell("stop")
        deadline = time.monotonic() + _STOP
        while True:
            if not self._connection.poll(max(0.0, deadline - time.monotonic())):
                raise RigError(
                    f"the process that drives {self.name!r} did not stop it within {_STOP:g} s"
                )
            what, value = self._connection.recv()
            if what == "stopped":
                if value is not None:
                    raise value
                return

    def report(self) -> RunReport:
        """What the rig says of the run."""
        report: RunReport = self._ask("report", seconds=60.0)
        return report

    def _leave(self) -> None:
        if self._connection is not None:
            with contextlib.suppress(OSError):
                self._connection.send(("exit", None))
            self._connection.close()
            self._connection = None
        if self._process is not None:
            self._process.join(_STOP)
            if self._process.is_alive():  # its driver hangs in compiled code
                self._process.kill()
                self._process.join()

    def _tell(self, what: str, value: object = None) -> None:
        if self._connection is None:
            raise RigError(f"{self.name!r} is not connected; enter it first")
        try:
            self._connection.send((what, value))
        except OSError as error:
            raise RigError(f"the process that drives {self.name!r} has ended") from error

    def _ask(self, what: str, value: object = None, *, seconds: float) -> Any:
        self._tell(what, value)
        return self._answer(seconds)

    def _answer(self, seconds: float) -> Any:
        assert self._connection is not None
        try:
            if not self._connection.poll(seconds):
                raise RigError(
                    f"the process that drives {self.name!r} has not answered for {seconds:g} s"
                )
            what, value = self._connection.recv()
        except (EOFError, OSError) as error:
            raise RigError(f"the process that drives {self.name!r} has ended") from error
        if what == "error":
            raise value
        return value


class _Told(BaseException):
    """The child is to stop the rig now."""


class _Inbox:
    """Messages of the run; "stop", and that the run is gone, overtake the others."""

    def __init__(self, connection: Connection, deadline: Deadline) -> None:
        self._connection, self._deadline = connection, deadline
        self._messages: deque[tuple[str, Any]] = deque()
        self._came = threading.Condition()
        self.stop = False
        self.gone = False
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while True:
            try:
                what, value = self._connection.recv()
            except (EOFError, OSError):
                what, value = "gone", None
            with self._came:
                if what in ("stop", "gone", "exit"):
                    self.stop = self.stop or what == "stop"
                    self.gone = self.gone or what != "stop"
                    self._deadline.shorten(_HANGS)
                else:
                    self._messages.append((what, value))
                self._came.notify()
                if self.gone:
                    return

    def next(self, seconds: float | None) -> tuple[str, Any] | None:
        """Return the next message; None where it is time to stop, or nothing came."""
        with self._came:
            self._came.wait_for(lambda: self._messages or self.stop or self.gone, seconds)
            if self.stop or self.gone or not self._messages:
                return None
            return self._messages.popleft()

    def clear(self) -> None:
        """Forget what was handed over before the stop."""
        with self._came:
            self._messages.clear()
            self.stop = False


class _ChildPacer(Pacer):
    """The pace of the run in the child; between two commands it looks whether to go on."""

    inbox: _Inbox

    def wait(self, number: int) -> None:
        if self.inbox.stop or self.inbox.gone:
            raise _Told
        super().wait(number)


def _child(connection: Connection, build: Callable[..., Rig], arguments: tuple[Any, ...]) -> None:
    """Drive the rig until the run is over or gone; what the process does."""
    if hasattr(os, "setsid"):
        os.setsid()  # Ctrl-C at the terminal is for the run, which then says stop
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def hangs() -> None:
        _stopped(rig)
        if inbox.gone:
            os._exit(1)

    deadline = Deadline(SystemClock(), instead=hangs)
    inbox = _Inbox(connection, deadline)

    def end(_number: int, _frame: FrameType | None) -> None:
        inbox.gone = True
        deadline.shorten(_HANGS)

    signal.signal(signal.SIGTERM, end)
    try:
        rig = build(*arguments)
        with rig, deadline:
            _say(connection, "ok", {"name": rig.name, "axes": rig.axes, "limits": rig.limits})
            try:
                _drive(rig, connection, inbox, deadline)
            finally:
                _stopped(rig)
    except BaseException as error:
        _say(connection, "error", _portable(error))


def _drive(rig: Rig, connection: Connection, inbox: _Inbox, deadline: Deadline) -> None:
    """Do what the run says, until it is gone."""
    collected: Collected | None = None
    pacer: _ChildPacer | None = None
    playing = False
    while not inbox.gone:
        message = inbox.next(_SILENCE if playing else None)
        if message is None:
            if inbox.gone or (playing and not inbox.stop):
                break
            inbox.clear()
            playing = False
            _say(connection, "stopped", _stopped(rig))
            continue
        what, value = message
        try:
            if what == "prepare":
                collected, pacer, layout = _prepared(rig, value, inbox)
                _say(connection, "ok", layout)
            elif what == "play" and collected is not None and pacer is not None:
                playing = not value.last
                with deadline.within(math.inf, "it did not return from play"):
                    if inbox.stop or inbox.gone:
                        raise _Told
                    reply = rig.play(replace(value, pace=pacer))
                sent = pacer.sent_of(value)
                samples = collected.take(value, reply, sent=sent)
                _say(connection, "ok", (value.start, sent, dict(samples)))
            elif what == "report":
                said = rig.report() if isinstance(rig, Reporting) else RunReport()
                _say(connection, "ok", said)
        except _Told:
            continue
        except BaseException as error:
            playing = False
            _say(connection, "error", _portable(error))


def _prepared(rig: Rig, stimulus: Stimuli, inbox: _Inbox) -> tuple[Collected, _ChildPacer, Layout]:
    commands = commands_of(stimuli_by_axis(stimulus, rig.axes, name=repr(rig.name)))
    layout = rig.prepare(stimulus)
    if layout is None:
        layout = default_layout(commands, name=rig.name)
    pacer = _ChildPacer(SystemClock(), fs=commands.fs, count=len(commands), latest=_SILENCE)
    pacer.inbox = inbox
    return Collected(layout, name=rig.name), pacer, layout


def _stopped(rig: Rig) -> BaseException | None:
    try:
        rig.stop()
    except BaseException as error:
        return _portable(error)
    return None


def _portable(error: BaseException) -> BaseException:
    """Return the error as one that survives the pipe."""
    if isinstance(error, HmpimError):
        return error
    return RigError(f"{type(error).__name__}: {error}")


def _say(connection: Connection, what: str, value: object) -> None:
    with contextlib.suppress(OSError):  # the run is gone: nobody to tell
        connection.send((what, value))
