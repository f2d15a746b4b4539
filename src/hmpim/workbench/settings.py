"""How a workbench was started: folder, rigs, port."""

from dataclasses import dataclass
from pathlib import Path

__all__ = ["Settings"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """What the command line said.

    Parameters
    ----------
    runs : Path
        Folder of the runs; everything that the workbench writes is in it.
    rigs : tuple of str
        Rigs beside those of ``hmpim.toml``, as ``hmpim run --rig`` takes them.
    rig_file : Path or None
        A file that describes one more rig.
    port : int
        Where to listen on loopback; 0 for any free port.
    largest : int
        Bytes that one upload may have.
    grace : float
        Seconds without the window that armed a rig after which its run is ended.
    """

    runs: Path
    rigs: tuple[str, ...] = ()
    rig_file: Path | None = None
    port: int = 0
    largest: int = 2_000_000_000
    grace: float = 5.0

    @property
    def uploads(self) -> Path:
        """Folder of the files that were dropped on a page."""
        return self.runs / "uploads"

    @property
    def checks(self) -> Path:
        """Folder of the small runs by which rigs were checked."""
        return self.desks / "checks"

    @property
    def desks(self) -> Path:
        """Folder of what was typed and set on the pages."""
        return self.runs / ".workbench"
