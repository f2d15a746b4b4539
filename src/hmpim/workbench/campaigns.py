"""The one campaign that goes on, watched by every window."""

import threading
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from hmpim.errors import ArgumentError
from hmpim.workbench.names import harmless_name
from hmpim.workbench.processes import process_context
from hmpim.workbench.settings import Settings
from hmpim.workbench.work.conducting import Done, Failed, Step, checked_plan, conduct

__all__ = ["Campaigns"]


class Campaigns:
    """Starts a campaign, tells how far it is, and stops it; started again, it goes on.

    Parameters
    ----------
    settings : Settings
        How the workbench was started.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self.step = Step(share=0.0, what="")
        self.end: Done | Failed | None = None
        self.folder: Path | None = None
        self._process: Any = None
        self._stopped = False

    @property
    def running(self) -> bool:
        """Whether a campaign goes on."""
        return self._process is not None

    def start(self, text: str, name: str, *, fresh: bool = False) -> Path:
        """Begin a campaign, or go on where it stopped; return its folder.

        Raises
        ------
        ArgumentError, FormatError
            If another one goes on, or the plan is wrong.
        """
        if self.running:
            raise ArgumentError("a campaign is in progress; stop it first")
        checked_plan(text)
        self.folder = self._settings.runs / harmless_name(name or "campaign")
        context = process_context()
        here, there = context.Pipe()
        arguments = (there, text, str(self.folder), fresh)
        self._process = context.Process(target=conduct, args=arguments, daemon=True)
        self.step, self.end, self._stopped = Step(share=0.0, what="starting"), None, False
        self._process.start()
        there.close()
        threading.Thread(target=self._listen, args=(here, self._process), daemon=True).start()
        return self.folder

    def stop(self) -> None:
        """Stop it; the cases that are done are kept."""
        process = self._process
        if process is not None:
            self._stopped = True
            process.terminate()

    def _listen(self, pipe: Connection, process: Any) -> None:
        try:
            while self.end is None:
                message = pipe.recv()
                if isinstance(message, Step):
                    self.step = message
                else:
                    self.end = message
        except (EOFError, OSError):
            why = "stopped; start it again to go on" if self._stopped else "its process was killed"
            self.end = Failed(why=why)
        process.join()
        pipe.close()
        self._process = None
