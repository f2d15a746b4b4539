"""The one rig that is armed and run: who holds it, what it does, how it is stopped."""

import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

from hmpim.errors import RigError
from hmpim.experiment.readiness import Light
from hmpim.rigs.catalogue import Description, describe, named_rigs, read_description
from hmpim.stimulus import Stimulus
from hmpim.workbench.live import Live
from hmpim.workbench.looks import Looks, begun_looks
from hmpim.workbench.names import harmless_name
from hmpim.workbench.processes import process_context
from hmpim.workbench.settings import Settings
from hmpim.workbench.work.driving import (
    Begun,
    Block,
    Ended,
    Order,
    Questions,
    drive,
)

__all__ = ["RigBench", "State", "known_rigs"]

State = Literal["idle", "armed", "running"]
DEMO = "demo"
"""The rig that is there without any description: the sensor of the paper's Fig. 17."""
_DEMO = describe(
    {
        "rig": "sensor",
        "unlimited": True,
        "options": {
            "delay": 0.15,
            "natural_frequency": 10.0,
            "damping_ratio": 0.4,
            "bias": 0.6,
            "noise_std": 0.1,
        },
    }
)
_LINES = 12  # of the log that are shown


def known_rigs(settings: Settings) -> dict[str, str]:
    """Return the rigs there are, with words: from ``hmpim.toml`` and the command line, no others.

    Parameters
    ----------
    settings : Settings
        How the workbench was started.
    """
    found = {
        name: f"{name}: {named.fault or (named.description and named.description.rig) or ''}"
        for name, named in named_rigs().items()
    }
    if settings.rig_file is not None:
        described = read_description(settings.rig_file)
        found[settings.rig_file.name] = f"{settings.rig_file.name}: {described.rig}"
    found |= {rig: rig for rig in settings.rigs}
    return found | {DEMO: "demo: a simulated sensor, nothing moves"}


def described_rig(settings: Settings, rig: str) -> tuple[str, Description | None]:
    """Return how a rig is found: what `hmpim run --rig` takes, and what describes it.

    Raises
    ------
    RigError
        If there is no such rig.
    """
    if rig not in known_rigs(settings):
        raise RigError(f"there is no rig {rig!r}; describe it in hmpim.toml, or start with --rig")
    if settings.rig_file is not None and rig == settings.rig_file.name:
        return "", read_description(settings.rig_file)
    return ("", _DEMO) if rig == DEMO else (rig, None)


class RigBench:
    """Where a rig is armed by one window at a time, and run in a process of its own.

    Parameters
    ----------
    settings : Settings
        How the workbench was started.
    present : callable
        Whether a desk is open in some window.
    """

    def __init__(self, settings: Settings, *, present: Callable[[str], bool]) -> None:
        self._settings, self._present = settings, present
        self.live = Live()
        self.owner = ""
        self.rig = ""
        self.folder: Path | None = None
        self.ended: Ended | None = None
        self.lights: dict[str, Light] = {}
        self.stimuli: tuple[Stimulus, ...] = ()
        self._looks: dict[str, Looks | None] = {}
        self.checking = False
        self.count = 0
        self._running = False
        self._pipe: Connection | None = None
        self._process: Any = None
        self._spare: tuple[Connection, Any] | None = None
        self._closed = False
        self._lock = threading.Lock()
        self._seen = time.monotonic()

    @property
    def state(self) -> State:
        """What it does now."""
        if self._running:
            return "running"
        return "armed" if self.owner else "idle"

    def arm(self, desk: str, rig: str) -> None:
        """Take the rig for a desk; only that desk can start a run.

        Raises
        ------
        RigError
            If another desk has armed, a run goes on, or there is no such rig.
        """
        with self._lock:
            if self._running:
                raise RigError("a run is in progress; wait until it has ended, or stop it")
            if self.owner and self.owner != desk:
                raise RigError("another window has armed a rig; disarm it there first")
            described_rig(self._settings, rig)
            self.owner, self.rig = desk, rig
            self._seen = time.monotonic()

    def looks(self, axis: str) -> Looks | None:
        """What looks on at an axis of the run; None where no estimate so far can be made of it."""
        if axis not in self._looks:
            played = [s for s in self.stimuli if s.axis == axis or len(self.stimuli) == 1]
            self._looks[axis] = begun_looks(played[0], self.live.intersample) if played else None
        return self._looks[axis]

    def disarm(self, desk: str) -> None:
        """Give the rig back."""
        with self._lock:
            if self.owner == desk and not self._running:
                self.owner = ""

    def start(
        self,
        desk: str,
        stimuli: tuple[Stimulus, ...],
        *,
        outliving: bool = False,
        questions: Questions | None = None,
    ) -> Path:
        """Begin a run of the armed rig, or a check of it; return the folder of its record.

        Raises
        ------
        RigError
            If this desk has not armed, or a run goes on.
        """
        with self._lock:
            if self._running:
                raise RigError("a run is already in progress; a second one is not started")
            if not self.owner or self.owner != desk:
                raise RigError("this window has not armed the rig; arm it first")
            folder = self._fresh_folder("check" if questions is not None else "")
            text, description = described_rig(self._settings, self.rig)
            order = Order(
                rig=text,
                description=description,
                stimuli=stimuli,
                path=folder / "run.h5",
                log=folder / "run.log",
                outliving=outliving,
                questions=questions,
            )
            here, process = self._spare or _spawned()
            self._spare = None
            here.send(order)
            self.live, self.ended, self.folder = Live(), None, folder
            self.stimuli = stimuli
            self.lights, self._looks = {}, {}
            self.checking = questions is not None
            self._pipe, self._process, self._running = here, process, True
            self.count += 1
            self._seen = time.monotonic()
        threading.Thread(target=self._listen, args=(here, process), daemon=True).start()
        threading.Thread(target=self._look_after, args=(self.count,), daemon=True).start()
        return folder

    def stop(self, reason: str) -> None:
        """End the run that goes on, smoothly and at once; anyone may."""
        with self._lock:  # a run that is just being started is ended as well
            pipe = self._pipe
            if self._running and pipe is not None:
                with contextlib.suppress(OSError, ValueError):
                    pipe.send(reason)

    def close(self) -> None:
        """End the run and wait until its rig is at rest."""
        self._closed = True
        if self._spare is not None:
            self._spare[1].kill()  # it has done nothing yet
            self._spare[0].close()
        self.stop("the workbench ended")
        if self._process is not None and self._running:
            self._process.join(timeout=30.0)

    def _fresh_folder(self, kind: str) -> Path:
        words = [
            time.strftime("%Y-%m-%d_%H%M%S"),
            harmless_name(Path(self.rig).stem or "rig"),
            kind,
        ]
        name = "_".join(word for word in words if word)
        within = self._settings.checks if kind else self._settings.runs
        folder, number = within / name, 1
        while folder.exists():
            number += 1
            folder = within / f"{name}-{number}"
        folder.mkdir(parents=True)
        return folder

    def _listen(self, pipe: Connection, process: Any) -> None:
        """Take what the run tells until it is over."""
        ended = Ended(fault="the process of the run was killed", reason="", kept=False)
        try:
            while True:
                message = pipe.recv()
                if isinstance(message, Block):
                    self.live.take(message)
                elif isinstance(message, Begun):
                    self.live.begin(message)
                elif isinstance(message, Light):
                    self.lights[message.name] = message
                elif isinstance(message, Ended):
                    ended = message
                    break
        except (EOFError, OSError):
            pass
        process.join(timeout=30.0)
        folder = self.folder
        kept = folder is not None and (folder / "run.h5").exists()
        self.ended = replace(ended, kept=kept)
        self._running, self._pipe = False, None
        self._seen = time.monotonic()
        pipe.close()
        self.prepare()

    def prepare(self) -> None:
        """Have a process wait for the next order, so that a run begins at once."""
        if self._spare is None and not self._closed:
            self._spare = _spawned()

    @property
    def lines(self) -> list[str]:
        """The last lines of the log."""
        if self.folder is None:
            return []
        try:
            return (self.folder / "run.log").read_text(encoding="utf-8").splitlines()[-_LINES:]
        except (OSError, ValueError):
            return []

    def _look_after(self, count: int) -> None:
        """End a run whose window is gone for too long."""
        while self._running and self.count == count:
            if self._present(self.owner):
                self._seen = time.monotonic()
            elif time.monotonic() - self._seen > self._settings.grace:
                self.stop("the window that armed the rig is gone")
                return
            time.sleep(0.1)

    def release(self) -> None:
        """Give back a rig that was armed by a window that is gone for long."""
        if self.owner and not self._running:
            if self._present(self.owner):
                self._seen = time.monotonic()
            elif time.monotonic() - self._seen > self._settings.grace:
                self.owner = ""


def _spawned() -> tuple[Connection, Any]:
    context = process_context()
    here, there = context.Pipe()
    process = context.Process(target=drive, args=(there,), daemon=False)
    process.start()
    there.close()
    return here, process
