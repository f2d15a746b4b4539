"""What happened in a run, line by line, each with its time."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from types import TracebackType
from typing import Literal, Self, TextIO

from hmpim.errors import ArgumentError

__all__ = ["Event", "EventKind", "RunLog"]

EventKind = Literal["check", "arm", "start", "done", "stop", "kept", "fault", "note"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Event:
    """Something that happened in a run.

    Parameters
    ----------
    seconds : float
        After the log was begun.
    kind : {'check', 'arm', 'start', 'done', 'stop', 'kept', 'fault', 'note'}
        What it was; 'kept' says where what was recorded before a failure is.
    message : str
        In words.

    Examples
    --------
    >>> print(Event(seconds=0.25, kind="arm", message="table, 5 axes"))
      0.250000 s  arm    table, 5 axes
    """

    seconds: float
    kind: EventKind
    message: str

    def __str__(self) -> str:
        return f"{self.seconds:10.6f} s  {self.kind:<5}  {self.message}"


class RunLog:
    """Events in the order they happened; written to a file as they happen, if there is one.

    Parameters
    ----------
    path : path or None
        File to append to. Each line is written through at once.

    Raises
    ------
    ArgumentError
        If the file cannot be written.

    Examples
    --------
    >>> with RunLog() as log:
    ...     log.add("note", "hello")
    >>> [event.message for event in log.events]
    ['hello']
    """

    def __init__(self, path: str | PathLike[str] | None = None) -> None:
        self._begun = time.perf_counter()
        self._file: TextIO | None = None
        self._events: list[Event] = []
        self._follower: Callable[[Event], object] | None = None
        if path is not None:
            try:
                self._file = Path(path).open("a", encoding="utf-8", buffering=1)  # noqa: SIM115
            except OSError as error:
                raise ArgumentError(f"log {str(path)!r} cannot be written: {error}") from error
        self._line(f"# hmpim run, begun {time.strftime('%Y-%m-%dT%H:%M:%S%z')}")

    @property
    def events(self) -> tuple[Event, ...]:
        """All so far."""
        return tuple(self._events)

    def add(self, kind: EventKind, message: str) -> None:
        """Note something that has just happened."""
        seconds = time.perf_counter() - self._begun
        event = Event(seconds=seconds, kind=kind, message=" ".join(message.split()))
        self._events.append(event)
        if self._follower is not None:
            self._follower(event)
        self._line(str(event))

    def follow(self, follower: Callable[[Event], object] | None) -> None:
        """Tell `follower` each further event as it happens; None tells nobody."""
        self._follower = follower

    def text(self) -> str:
        """Return all events, one a line."""
        return "".join(f"{event}\n" for event in self._events)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
        /,
    ) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _line(self, text: str) -> None:
        if self._file is None:
            return
        try:
            self._file.write(text + "\n")
        except OSError:  # a full disk must not keep a rig from being stopped
            self._file = None
