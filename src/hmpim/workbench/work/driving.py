"""A run in a process of its own: what it is told, and what it tells as it goes.

The process speaks to the workbench through a pipe. If the workbench is killed the pipe breaks, and
the run ends as if it had been stopped: the rig comes to rest and the record is kept.
"""

import _thread
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, HmpimError
from hmpim.experiment import OutlivingRig, Played, RunLog, RunOptions, run
from hmpim.experiment.checks import moves
from hmpim.experiment.readiness import (
    Light,
    answer_light,
    error_light,
    independence_light,
    limits_light,
)
from hmpim.optimal import RoughModel
from hmpim.record import Intersample, Record
from hmpim.rigs import LimitsOfAxes, Rig
from hmpim.rigs.catalogue import Description, FoundRig, check_described, find_rig
from hmpim.stimulus import Limits, Stimulus

__all__ = ["Begun", "Block", "Ended", "Order", "Questions", "drive"]

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
    description: Description | None = None
    outliving: bool = False
    questions: "Questions | None" = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Questions:
    """What is asked before a run: error bars for a rough model; `wanted` in Hz (95 %)."""

    model: RoughModel
    noise_std: float
    wanted: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Begun:
    """A run has begun: channels as (name, role, axis, unit), largest positions by axis, length.

    `intersample` is what the inputs do between their samples; None where the rig does not say.
    """

    channels: tuple[tuple[str, str, str, str], ...]
    limits: dict[str, float]
    seconds: float
    intersample: Intersample | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Block:
    """What came in: times and values by channel, at a time of the run (s)."""

    end: float
    samples: dict[str, tuple[FloatArray, FloatArray]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """The run is over: why, where that was not as planned, and whether a record was kept."""

    fault: str
    reason: str
    kept: bool


def drive(pipe: Connection) -> None:
    """Wait for an order, play it, and tell of it; the body of the process.

    Parameters
    ----------
    pipe : Connection
        To the workbench: an `Order` comes through it first; a string that follows ends the run,
        and is the reason.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)  # also where a shell ignores it
    try:
        order = pipe.recv()
    except (EOFError, OSError, KeyboardInterrupt):
        return
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
    found = find_rig(order.rig, description=order.description)
    stimuli = _aimed(order.stimuli, found.description.axes or found.rig.axes)
    check_described(stimuli, found)
    rig: Rig = found.rig
    if order.outliving and moves(rig) and found.description.watchdog is None:
        rig = OutlivingRig(_again, order.rig, order.description)
    stated = _stated(found)
    options = RunOptions(
        watchdog=not order.outliving and found.description.watchdog is None,
        feel="unknown" if order.questions is None else None,
    )
    with RunLog(order.log) as log:

        def play(given: Sequence[Stimulus]) -> Record:
            return run(
                rig,
                given,
                path=order.path,
                limits=stated,
                until=wish.asked,
                subscribers=[_Teller(pipe, rig, stated)],
                log=log,
                options=options,
            )

        if order.questions is None:
            play(stimuli)
        else:
            for light in _lights(order.questions, rig, stimuli, stated, play, wish):
                _tell(pipe, light)


def _lights(
    asked: Questions,
    rig: Rig,
    stimuli: list[Stimulus],
    stated: Any,
    play: Callable[[Sequence[Stimulus]], Record],
    wish: "_Wish",
) -> Iterator[Light]:
    """Ask one question after another; the rig is moved only if all else is well."""
    lights = [limits_light(rig, stimuli, stated=stated)]
    yield lights[-1]
    lights.append(
        error_light(stimuli, model=asked.model, noise_std=asked.noise_std, wanted=asked.wanted)
    )
    yield lights[-1]
    lights.append(independence_light(stimuli))
    yield lights[-1]
    if all(light.green for light in lights):
        light = answer_light(rig, stimuli, lambda named: play([*named.values()]), stated=stated)
        if wish.reason:
            light = Light(name="answer", green=False, words=f"stopped: {wish.reason}")
        yield light
    else:
        yield Light(name="answer", green=False, words="not checked: the rig has not been moved yet")


def _stated(found: FoundRig) -> Any:
    limits = found.limits
    return limits if limits is None or isinstance(limits, Limits) else dict(limits)


def _again(rig: str, description: Description | None) -> Rig:
    return find_rig(rig, description=description).rig


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


def _tell(pipe: Connection, message: object) -> None:
    """Say something; a workbench that is gone is told by the wish to end, not by a fault."""
    try:
        pipe.send(message)
    except (OSError, ValueError):
        return


class _Teller:
    """A subscriber that hands every block on."""

    def __init__(self, pipe: Connection, rig: Rig, stated: LimitsOfAxes) -> None:
        self._pipe, self._rig, self._stated = pipe, rig, stated

    def __call__(self, played: Played) -> None:
        if played.block.start == 0:
            channels = tuple((c.name, c.role, c.axis or "", c.unit) for c in played.layout.channels)
            limits = dict(self._limits({axis for _, role, axis, _ in channels if role == "input"}))
            begun = Begun(
                channels=channels,
                limits=limits,
                seconds=played.seconds,
                intersample=played.layout.intersample,
            )
            _tell(self._pipe, begun)
        samples = {name: (s.time, s.values) for name, s in played.samples.items()}
        _tell(self._pipe, Block(end=float(played.block.time[-1]), samples=samples))

    def _limits(self, axes: set[str]) -> Iterator[tuple[str, float]]:
        for axis in axes:
            for limits in (self._rig.limits, self._stated):
                own = limits.get(axis) if isinstance(limits, Mapping) else limits
                if own is not None and math.isfinite(own.position):
                    yield axis, own.position


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
