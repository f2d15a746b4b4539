"""A run in a process of its own: what it is told, and what it tells as it goes.

The process speaks to the workbench through a pipe. If the workbench is killed the pipe breaks, and
the run ends as if it had been stopped: the rig comes to rest and the record is kept.
"""

import _thread
import signal
import threading
import time
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, HmpimError
from hmpim.experiment import Event, OutlivingRig, Played, RunLog, RunOptions, run
from hmpim.experiment.checks import moves
from hmpim.rigs import Rig
from hmpim.rigs.catalogue import Description, FoundRig, find_rig, read_description
from hmpim.stimulus import Limits, Stimulus

__all__ = ["Begun", "Block", "Ended", "Order", "Said", "drive", "find_one"]

FloatArray = NDArray[np.float64]
_PATIENCE = 0.5  # s between a wish to end and an interruption, where nobody asks for the wish


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """What is to be played on what, and where the record goes.

    `outliving` drives a rig without a watchdog in a further process, which lives on to stop it.
    """

    rig: str
    stimuli: tuple[Stimulus, ...]
    path: Path
    log: Path
    rig_file: Path | None = None
    outliving: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Begun:
    """A run has begun: its channels as (name, role, axis, unit), its limits by axis, its length."""

    channels: tuple[tuple[str, str, str, str], ...]
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """What came in: times and values by channel, at a time of the run (s)."""

    end: float
    samples: dict[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """A line of the run's log."""

    kind: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """The run is over: why, where that was not as planned, and whether a record was kept."""

    fault: str
    reason: str
    kept: bool


def find_one(rig: str, rig_file: Path | None) -> FoundRig:
    """Make the rig that is meant: by name, by kind, or as a file describes it."""
    described: Description | None = None
    if rig_file is not None:
        described = read_description(rig_file)
    return find_rig(rig, description=described)


def drive(order: Order, pipe: Connection) -> None:
    """Play an order, and tell of it; the body of the process.

    Parameters
    ----------
    order : Order
        What to do.
    pipe : Connection
        To the workbench: a string that comes through it ends the run, and is the reason.
    """
    wish = _Wish(pipe)
    fault, interrupted = "", False
    try:
        _played(order, pipe, wish)
    except KeyboardInterrupt:
        interrupted = True
    except (HmpimError, OSError) as error:
        fault = " ".join(str(error).split())
    except BrokenPipeError:
        interrupted = True
    except Exception as error:  # a defect is shown on the page, not lost in a process
        fault = f"{type(error).__name__}: {error}"
    wish.done = True
    reason = wish.reason or ("interrupted" if interrupted else "")
    _tell(pipe, Ended(fault=fault, reason=reason, kept=order.path.exists()))


def _played(order: Order, pipe: Connection, wish: "_Wish") -> None:
    found = find_one(order.rig, order.rig_file)
    stimuli = _aimed(order.stimuli, found.description.axes or found.rig.axes)
    rig: Rig = found.rig
    if order.outliving and moves(rig) and found.description.watchdog is None:
        rig = OutlivingRig(_again, order.rig, order.rig_file)
    with RunLog(order.log) as log:
        log.follow(lambda event: _tell(pipe, _said(event)))
        run(
            rig,
            stimuli,
            path=order.path,
            limits=_stated(found),
            until=wish.asked,
            subscribers=[_Teller(pipe)],
            log=log,
            options=RunOptions(
                watchdog=not order.outliving and found.description.watchdog is None,
                feel="unknown",
            ),
        )


def _stated(found: FoundRig) -> Any:
    limits = found.limits
    return limits if limits is None or isinstance(limits, Limits) else dict(limits)


def _again(rig: str, rig_file: Path | None) -> Rig:
    return find_one(rig, rig_file).rig


def _aimed(stimuli: tuple[Stimulus, ...], axes: tuple[str, ...]) -> list[Stimulus]:
    """Give a stimulus that names no axis the only one there is."""
    if len(stimuli) == 1 and not stimuli[0].axis and axes:
        if len(axes) > 1:
            raise ArgumentError(
                f"the design names no axis, and the rig has {', '.join(axes)}; name one in the "
                "design"
            )
        return [replace(stimuli[0], axis=axes[0])]
    return list(stimuli)


def _said(event: Event) -> Said:
    return Said(kind=event.kind, text=event.message)


def _tell(pipe: Connection, message: object) -> None:
    """Say something; a workbench that is gone is told by the wish to end, not by a fault."""
    try:
        pipe.send(message)
    except (OSError, ValueError):
        return


class _Teller:
    """A subscriber that hands every block on."""

    def __init__(self, pipe: Connection) -> None:
        self._pipe = pipe
        self._begun = False

    def __call__(self, played: Played) -> None:
        if not self._begun or played.block.start == 0:
            self._begun = True
            channels = tuple(
                (c.name, c.role, c.axis or "", c.unit) for c in played.layout.channels
            )
            _tell(self._pipe, Begun(channels=channels, seconds=played.seconds))
        samples = {name: (s.time, s.values) for name, s in played.samples.items()}
        _tell(self._pipe, Block(end=float(played.block.time[-1]), samples=samples))


class _Wish:
    """The wish to end, listened for while the run goes on."""

    def __init__(self, pipe: Connection) -> None:
        self.reason = ""
        self.done = False
        self._heard = False
        self._pipe = pipe
        threading.Thread(target=self._listen, daemon=True).start()

    def asked(self, _: Played) -> str | None:
        """Return the reason to end, if there is one; asked between two blocks."""
        self._heard = bool(self.reason)
        return self.reason or None

    def _listen(self) -> None:
        try:
            self.reason = str(self._pipe.recv())
        except (EOFError, OSError):
            self.reason = "the workbench is gone"
        time.sleep(_PATIENCE)
        if not (self._heard or self.done):  # nothing is played yet, or the rig does not answer
            _interrupt()


def _interrupt() -> None:
    """Interrupt the main thread as Ctrl-C does, out of a wait too where the system allows it."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, signal.SIGINT)
    else:
        _thread.interrupt_main()
