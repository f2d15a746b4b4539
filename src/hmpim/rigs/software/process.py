"""A program of any language under test, spoken with in lines over standard input and output.

What hmpim writes (``>``) and what the program answers (``<``), one line each::

    > hmpim 1 rate=200 samples=2230 unit=deg quantity=position
    < ready                      or: ready unit=V
    > 0.0                        the first sample
    < 0.0                        what the program makes of it
    > ...
    > end                        no more samples: the program ends by itself

Every number is written so that it reads back as the same double. The program answers each line
before the next is sent, and flushes its output after each. ``error WHY`` in place of an answer
ends the run. Lines for people go to standard error.
"""

import math
import queue
import shlex
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import IO

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RigError
from hmpim.record import Finding, Intersample
from hmpim.rigs.block import Block, Layout, Quantity, RunReport
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.stimuli import feed_of
from hmpim.stimulus import Limits
from hmpim.units import check_unit

__all__ = ["ProcessRig"]

FloatArray = NDArray[np.float64]

_GREETING = "hmpim 1"
_PATIENCE = 2.0  # s for a program to end by itself
_UNREAD = 16  # answers kept before they are asked for; one is too many already
_LONGEST = 4096  # characters of a line that are read at once; a double has 24


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ProcessRig(Simulated):
    """A program as the unit under test; it is started anew for each run.

    Parameters
    ----------
    command : str
        As on a command line; no shell reads it.
    measures : {'position', 'velocity', 'acceleration'}
        Which quantity of the motion is fed.
    output_unit : str or None
        None takes what the program says, or else the input's.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'} or None
        What the record says of the input between samples; a program sees samples only, so that
        None, the default, says 'sampled'.
    startup, answer : float
        Seconds that the program may take to say ``ready``, and for each sample.
    name, input_name, output_name : str
        Name of the rig, and of its record's channels.
    limits : Limits or None
        What the program is made for; None for anything.

    Raises
    ------
    ArgumentError
        If the command is empty or cannot be split, or a time is not positive.

    Examples
    --------
    >>> import sys
    >>> code = '''
    ... input()
    ... print("ready", flush=True)
    ... for line in iter(input, "end"):
    ...     print(2 * float(line), flush=True)
    ... '''
    >>> doubling = ProcessRig(command=shlex.join([sys.executable, "-c", code]))
    >>> from hmpim.experiment import run
    >>> from hmpim.stimulus import Ramp, Stimulus
    >>> run(doubling, Stimulus(waveform=Ramp(duration=1.0), fs=4.0)).outputs[0].values.tolist()
    [0.0, 0.5, 1.0, 1.5]
    """

    command: str
    measures: Quantity = "position"
    output_unit: str | None = None
    intersample: Intersample | None = None
    startup: float = 30.0
    answer: float = 5.0
    name: str = "process"
    input_name: str = "u"
    output_name: str = "y"
    limits: Limits | None = None
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)
    _findings: list[Finding] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        _arguments(self.command)
        for name in ("startup", "answer"):
            value = getattr(self, name)
            if not 0 < value < math.inf:
                raise ArgumentError(f"{name} = {value!r} s must be a positive number of seconds")
        check_unit(self.output_unit or "")

    @property
    def axes(self) -> tuple[str, ...]:
        """Empty: any one stimulus is fed."""
        return ()

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Start the program and greet it.

        Raises
        ------
        RigError
            If it cannot be started, or does not answer ``ready``.
        """
        self.stop()
        self._findings.clear()
        fed = feed_of(stimulus, measures=self.measures, rig=self.name, name=self.input_name)
        talk = Talk(_arguments(self.command), name=self.name)
        self._playing.state = (talk, fed.values)
        said = talk.ask(
            f"{_GREETING} rate={fed.fs!r} samples={fed.values.size} unit={fed.unit or '1'} "
            f"quantity={self.measures}",
            within=self.startup,
        )
        out_unit = _unit_of(said, name=self.name)
        stated = fed.unit if out_unit is None else out_unit
        return fed.layout(
            output=self.output_name,
            unit=stated if self.output_unit is None else self.output_unit,
            intersample=self.intersample or "sampled",
            source=f"program {self.command}",
        )

    def play(self, block: Block, /) -> dict[str, FloatArray]:
        """Send the block's samples, one after the other, and return the answers.

        Raises
        ------
        RigError
            If the program ends, fails, is silent for too long, or answers something else than
            one finite number, or more than one; the message says at which sample.
        """
        talk, fed = self._playing.current(self.name)
        values = np.empty(len(block))
        for k, sample in enumerate(fed[block.start : block.stop].tolist()):
            where = f"sample {block.start + k}, for the input {sample:.6g}"
            said = talk.ask(repr(sample), within=self.answer, where=where)
            try:
                values[k] = float(said)
            except ValueError:
                values[k] = math.nan
            if not math.isfinite(values[k]):
                raise RigError(
                    f"{self.name!r} answered {said[:80]!r} at {where}; it must answer one finite "
                    "number and nothing else on standard output"
                )
        if block.last:
            talk.finish()
        return {self.output_name: values}

    def stop(self) -> None:
        """End the program if it runs."""
        state, self._playing.state = self._playing.state, None
        if state is not None:
            self._findings[:] = state[0].close()

    def report(self) -> RunReport:
        """Say how the program ended, if not by itself and with exit code 0."""
        return RunReport(findings=tuple(self._findings))


class Talk:
    """A running program, asked line by line.

    Parameters
    ----------
    arguments : list of str
        The program and its arguments.
    name : str
        Of the rig, for messages.
    """

    def __init__(self, arguments: list[str], *, name: str) -> None:
        self._name = name
        try:
            self._process = subprocess.Popen(
                arguments,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                bufsize=1,
            )
        except OSError as error:
            raise RigError(f"{name!r}: {arguments[0]!r} cannot be started: {error}") from error
        self._lines: queue.Queue[str | None] = queue.Queue()
        self._leave_at: float | None = None
        self._complaints: deque[str] = deque(maxlen=3)
        assert self._process.stdout is not None
        assert self._process.stderr is not None
        self._threads = (
            threading.Thread(target=self._read, args=(self._process.stdout,), daemon=True),
            threading.Thread(
                target=lambda: self._complaints.extend(_pieces(self._process.stderr)), daemon=True
            ),
        )
        for thread in self._threads:
            thread.start()

    def ask(self, line: str, *, within: float, where: str = "the greeting") -> str:
        """Send a line and return the answer.

        Raises
        ------
        RigError
            If there is none within so many seconds, the program says ``error``, or it has said
            something that was not asked for.
        """
        assert self._process.stdin is not None
        self._nothing_more(f"before {where}", 0.0)
        with suppress(OSError):  # it has ended: what it said before that is still to be read
            self._process.stdin.write(line + "\n")
            self._process.stdin.flush()
        try:
            said = self._lines.get(timeout=within)
        except queue.Empty:
            raise RigError(
                f"{self._name!r} did not answer {where} within {within:g} s; it must flush its "
                "output after each line" + self._complaint()
            ) from None
        if said is None:
            raise RigError(f"{self._name!r} {self._how_it_ended()} at {where}" + self._complaint())
        if said.split(" ", 1)[0] == "error":
            raise RigError(f"{self._name!r} failed at {where}: {said[5:].strip() or 'no reason'}")
        return said

    def finish(self) -> None:
        """Say that there are no more samples, and see that no answer is left over.

        Raises
        ------
        RigError
            If one is: then the answers do not belong to the samples that they were taken for.
        """
        self.end()
        self._nothing_more("after the last sample", _PATIENCE)

    def _nothing_more(self, where: str, seconds: float) -> None:
        try:
            said = self._lines.get(timeout=seconds) if seconds else self._lines.get_nowait()
        except queue.Empty:
            return
        if said is None:
            self._lines.put(None)
            return
        raise RigError(
            f"{self._name!r} wrote {said[:80]!r} {where} without being asked, so its answers do "
            "not belong to their samples; it must write one line for each sample, and messages "
            "to standard error"
        )

    def _how_it_ended(self) -> str:
        try:
            code = self._process.wait(_PATIENCE)
        except subprocess.TimeoutExpired:
            return "closed its standard output"
        return f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"

    def end(self) -> None:
        """Say that there are no more samples."""
        if self._leave_at is None:
            self._leave_at = time.monotonic() + _PATIENCE
        stdin = self._process.stdin
        assert stdin is not None
        if stdin.closed:
            return
        with suppress(OSError):  # it may have ended by itself
            stdin.write("end\n")
        with suppress(OSError):
            stdin.close()

    def close(self) -> list[Finding]:
        """Have the program end: asked first, then made to. Return what is wrong with that."""
        self.end()
        assert self._leave_at is not None
        patience = max(0.0, self._leave_at - time.monotonic())
        stopped = False
        for last in (self._process.terminate, self._process.kill):
            try:
                self._process.wait(patience)
                break
            except subprocess.TimeoutExpired:
                last()
                stopped = True
            patience = _PATIENCE
        self._process.wait()
        for thread in self._threads:
            thread.join(_PATIENCE)
        ended = self._ended(stopped=stopped)
        for stream in (self._process.stdout, self._process.stderr):
            if stream is not None:
                stream.close()
        return ended

    def _ended(self, *, stopped: bool) -> list[Finding]:
        if not stopped and self._process.returncode == 0:
            return []
        how = f"did not end within {_PATIENCE:g} s and was stopped" if stopped else None
        return [
            Finding(
                code="program_end",
                message=(
                    f"After the last sample {self._name!r} {how or self._how_it_ended()}"
                    f"{self._complaint()}. Its answers are complete."
                ),
                severity="info",
                parameters=(),
            )
        ]

    def _read(self, stream: IO[str]) -> None:
        for line in _pieces(stream):
            if self._lines.qsize() < _UNREAD:  # a flood must not fill the memory
                self._lines.put(line.strip())
        self._lines.put(None)

    def _complaint(self) -> str:
        """What it last said on standard error."""
        self._threads[1].join(0.2)
        said = " / ".join(line.strip() for line in self._complaints if line.strip())
        return f"; it said: {said[-300:]}" if said else ""


def _pieces(stream: IO[str] | None) -> Iterator[str]:
    """Lines of a program; one that has no end comes in pieces."""
    assert stream is not None
    return iter(lambda: stream.readline(_LONGEST), "")


def _unit_of(said: str, *, name: str) -> str | None:
    words = said.split()
    if not words or words[0] != "ready" or any("=" not in word for word in words[1:]):
        raise RigError(
            f"{name!r} answered {said[:80]!r} to the greeting; it must answer ready, or for "
            "instance ready unit=V"
        )
    facts = dict(word.split("=", 1) for word in words[1:])
    strange = sorted(set(facts) - {"unit"})
    if strange:
        raise RigError(f"{name!r} says {strange[0]!r}, which is not known; known is unit")
    if "unit" not in facts:
        return None
    return check_unit("" if facts["unit"] == "1" else facts["unit"])


def _arguments(command: str) -> list[str]:
    try:
        words = shlex.split(command, posix=sys.platform != "win32")
    except ValueError as error:
        raise ArgumentError(f"command = {command!r} cannot be split into words: {error}") from None
    if not words:
        raise ArgumentError("the command of the program is empty; write process:COMMAND")
    return words
