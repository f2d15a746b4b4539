"""What a run records, on the disk as it comes: killed at any moment, it can be read."""

import contextlib
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path

from hmpim.errors import HmpimError
from hmpim.experiment.collect import Collected
from hmpim.experiment.log import Event, RunLog
from hmpim.formats.atomic import check_writable
from hmpim.formats.recording import RecordWriter, check_free, save_recording
from hmpim.formats.saving import save
from hmpim.record import Finding, Record
from hmpim.rigs import Commands, Layout, LimitsOfAxes, RunReport, Samples
from hmpim.stimulus import Stimulus

__all__ = ["Recorder"]

_EVERY = 0.25  # s of the run between two writings: half of what a kill may cost
_BYTES = 64  # of a sample of one channel: stamp and value, twice over while it is closed
_GROWING = (".h5", ".hdf5")


class Recorder:
    """Keeps a run.

    Parameters
    ----------
    path : path-like or None
        File to write; one that ends in .h5 grows as samples come. Any other is written at the
        end, or when the run fails; until then a file NAME.partial.h5 beside it grows. None keeps
        nothing.
    rig : str
        On what it is played.
    limits : Limits, or mapping of axis to Limits, or None
        Limits of the rig.
    stimuli : sequence of Stimulus
        What is played.
    commands : Commands
        As many samples are to be expected.
    log : RunLog
        What happens; kept with the samples.

    Raises
    ------
    ArgumentError
        If the file cannot be written there, another run writes it, or the disk is too full.
    """

    def __init__(
        self,
        path: str | PathLike[str] | None,
        *,
        rig: str,
        limits: LimitsOfAxes,
        stimuli: Sequence[Stimulus],
        commands: Commands,
        log: RunLog,
    ) -> None:
        self._path = None if path is None else Path(path)
        self._rig, self._limits, self._stimuli = rig, limits, tuple(stimuli)
        self._commands, self._log = commands, log
        self._writer: RecordWriter | None = None
        self._collected: Collected | None = None
        self._band: tuple[float, float] | None = None
        self._waiting: dict[str, list[Samples]] = {}
        self._next = 0.0
        if self._path is not None:
            channels = 2 * len(commands.axes)
            check_writable(self._path, size=_BYTES * channels * len(commands))
        if self.growing is not None:
            check_free(self.growing)

    @property
    def growing(self) -> Path | None:
        """File to which samples go as they come."""
        if self._path is None or self._path.suffix.lower() in _GROWING:
            return self._path
        return self._path.with_name(f"{self._path.name}.partial.h5")

    def open(
        self, layout: Layout, collected: Collected, *, band: tuple[float, float] | None
    ) -> None:
        """Lay out the file, before anything moves; one that does not grow takes `collected`."""
        self._collected, self._band = collected, band
        if self.growing is None:
            return
        self._writer = RecordWriter(
            self.growing,
            layout,
            fs=self._commands.fs,
            samples=len(self._commands),
            band=band,
            stimuli=self._stimuli,
            rig=self._rig,
            limits=self._limits,
        )
        for event in self._log.events:
            self._write_event(event)
        self._log.follow(self._write_event)

    def take(self, samples: Mapping[str, Samples], *, now: float) -> None:
        """Take what has come in; write it if it is time to, `now` being the run's time in s."""
        if self._writer is None:
            return
        for name, part in samples.items():
            self._waiting.setdefault(name, []).append(part)
        if now >= self._next:
            self._next = now + _EVERY
            self._flush()

    def finish(self, record: Record) -> None:
        """Keep the whole record, its stamps put right and its findings with it.

        Raises
        ------
        HmpimError
            If it cannot be written; what was recorded is then in `growing`.
        """
        self._log.follow(None)
        if self._path is None or self._writer is None:
            return
        self._flush()
        self._writer.close()
        if self._path != self.growing:
            save(record, self._path)
            self._remove_grown()
            return
        save_recording(
            record,
            self._path,
            stimuli=self._stimuli,
            rig=self._rig,
            limits=self._limits,
            log=[str(event) for event in self._log.events],
        )

    def fail(self, reason: str) -> Path | None:
        """Keep what there is, marked incomplete; return where it is, None if there is nothing."""
        self._log.follow(None)
        if self._writer is None:
            return None
        writer, self._writer = self._writer, None
        with contextlib.suppress(HmpimError):  # a full disk: what was written before is kept
            self._flush_to(writer)
        kept = writer.samples > 1
        with contextlib.suppress(HmpimError):  # the file stays as it grew, and can be read
            writer.close(ended=reason or "the run failed")
        if self._path != self.growing and self._saved_so_far(reason):
            self._remove_grown()
            return self._path
        return self.growing if kept else None

    def _remove_grown(self) -> None:
        """Remove the file that grew beside the one that was asked for."""
        if self.growing is not None:
            self.growing.unlink(missing_ok=True)

    def _saved_so_far(self, reason: str) -> bool:
        """Save what was collected to a file that did not grow."""
        if self._path is None or self._collected is None:
            return False
        early = Finding(
            code="incomplete",
            message=f"The run ended early ({reason or 'it failed'}).",
            severity="info",
            parameters=(),
        )
        report = RunReport(findings=(early,))
        try:
            save(
                self._collected.record(fs=self._commands.fs, band=self._band, report=report),
                self._path,
            )
        except HmpimError:  # too little for a record, or a full disk
            return False
        return True

    def _flush(self) -> None:
        if self._writer is not None:
            self._flush_to(self._writer)

    def _flush_to(self, writer: RecordWriter) -> None:
        waiting, self._waiting = self._waiting, {}
        writer.append({name: Samples.joined(parts) for name, parts in waiting.items()})

    def _write_event(self, event: Event) -> None:
        if self._writer is not None:
            self._writer.log(str(event))
