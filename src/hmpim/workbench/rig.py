"""The one rig that is armed and run: who holds it, what it does, how it is stopped."""

import contextlib
import multiprocessing
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Literal

from hmpim.errors import RigError
from hmpim.stimulus import Stimulus
from hmpim.workbench.live import Live
from hmpim.workbench.names import harmless_name
from hmpim.workbench.settings import Settings
from hmpim.workbench.work.driving import Begun, Block, Ended, Order, Said, drive

__all__ = ["RigBench", "State", "known_rigs"]

State = Literal["idle", "armed", "running"]
_LINES = 200  # of the log that are kept for the page


def known_rigs(settings: Settings) -> dict[str, str]:
    """Return the rigs there are, with words: from ``hmpim.toml`` and the command line, no others.

    Parameters
    ----------
    settings : Settings
        How the workbench was started.
    """
    from hmpim.rigs.catalogue import named_rigs, read_description

    found = {"sensor": "sensor: simulated, nothing moves"}
    found |= {
        name: f"{name}: {named.fault or (named.description and named.description.rig) or ''}"
        for name, named in named_rigs().items()
    }
    if settings.rig_file is not None:
        described = read_description(settings.rig_file)
        found[str(settings.rig_file)] = f"{settings.rig_file.name}: {described.rig}"
    found |= {rig: rig for rig in settings.rigs}
    return found


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
        self.lines: deque[str] = deque(maxlen=_LINES)
        self.owner = ""
        self.rig = ""
        self.folder: Path | None = None
        self.ended: Ended | None = None
        self.count = 0
        self._running = False
        self._pipe: Connection | None = None
        self._process: Any = None
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
                raise RigError("a run goes on; wait until it has ended, or stop it")
            if self.owner and self.owner != desk:
                raise RigError("another window has armed a rig; disarm it there first")
            if rig not in known_rigs(self._settings):
                raise RigError(
                    f"there is no rig {rig!r}; describe it in hmpim.toml, or start with --rig"
                )
            self.owner, self.rig = desk, rig
            self._seen = time.monotonic()

    def disarm(self, desk: str) -> None:
        """Give the rig back."""
        with self._lock:
            if self.owner == desk and not self._running:
                self.owner = ""

    def start(
        self, desk: str, stimuli: tuple[Stimulus, ...], *, outliving: bool = False
    ) -> Path:
        """Begin a run of the armed rig; return the folder of its record.

        Raises
        ------
        RigError
            If this desk has not armed, or a run goes on.
        """
        with self._lock:
            if self._running:
                raise RigError("a run goes on already; a second one is not started")
            if not self.owner or self.owner != desk:
                raise RigError("this window has not armed the rig; arm it first")
            folder = self._fresh_folder()
            own = self._settings.rig_file
            described = own is not None and self.rig == str(own)
            order = Order(
                rig="" if described else self.rig,
                rig_file=own if described else None,
                stimuli=stimuli,
                path=folder / "run.h5",
                log=folder / "run.log",
                outliving=outliving,
            )
            context = multiprocessing.get_context("spawn")
            here, there = context.Pipe()
            self.live, self.ended, self.folder = Live(), None, folder
            self.lines.clear()
            self._process = context.Process(target=drive, args=(order, there), daemon=False)
            self._process.start()
            there.close()
            self._pipe, self._running = here, True
            self.count += 1
            self._seen = time.monotonic()
        threading.Thread(target=self._listen, args=(here, self._process), daemon=True).start()
        threading.Thread(target=self._look_after, args=(self.count,), daemon=True).start()
        return folder

    def stop(self, reason: str) -> None:
        """End the run that goes on, smoothly and at once; anyone may."""
        pipe = self._pipe
        if self._running and pipe is not None:
            with contextlib.suppress(OSError, ValueError):
                pipe.send(reason)

    def close(self) -> None:
        """End the run and wait until its rig is at rest."""
        self.stop("the workbench ended")
        if self._process is not None and self._running:
            self._process.join(timeout=30.0)

    def _fresh_folder(self) -> Path:
        stem = time.strftime("%Y-%m-%d_%H%M%S")
        name = f"{stem}_{harmless_name(Path(self.rig).stem or 'rig')}"
        folder, number = self._settings.runs / name, 1
        while folder.exists():
            number += 1
            folder = self._settings.runs / f"{name}-{number}"
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
                elif isinstance(message, Said):
                    self.lines.append(f"{message.kind}: {message.text}")
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
