"""A folder of runs is the database: records and results in it, listed and filtered."""

import operator
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from datetime import UTC, datetime
from fnmatch import fnmatchcase
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

from hmpim.errors import ArgumentError, HmpimError
from hmpim.formats.files import read
from hmpim.formats.readers.text import MARK
from hmpim.formats.recording import read_recording
from hmpim.formats.saving import load
from hmpim.identify import Identification, Parameters
from hmpim.record import Record
from hmpim.units import conversion_factor

__all__ = ["Folder", "Run", "asked_of", "files_of", "filter_runs", "find_runs"]

_RESULT = re.compile(rb'^[^"]*"schema":\s*"hmpim/identification/')
_HDF5 = b"\x89HDF\r\n\x1a\n"
_PARAMETERS = tuple(f.name for f in fields(Parameters))
_WORDS = ("name", "source", "rig", "input", "output", "verdict", "created")
_FIGURES = ("fs", "duration", "samples", *_PARAMETERS)
_CONDITION = re.compile(r"^\s*(?P<name>\w+)\s*(?P<sign><=|>=|!=|=|<|>)\s*(?P<value>.+?)\s*$")
_QUANTITY = re.compile(r"^(?P<number>[-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(?P<unit>\S*)$")
_SIGNS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "=": operator.eq,
    "!=": operator.ne,
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run:
    """A record, the result of it, or both.

    Parameters
    ----------
    name : str
        Its path in the folder; of the record if there is one.
    created : str
        When it was recorded (ISO 8601, UTC), else when the file was last changed.
    source, rig : str
        Where the samples come from, and on what; empty where that is not stated.
    inputs, outputs : tuple of str
        Names of the channels.
    fs, duration : float
        Rate in Hz and length in s; NaN where only a result tells of the run.
    samples : int
        Number of samples.
    record, result : Path or None
        The files.
    found : Identification or None
        What was identified.
    """

    name: str
    created: str
    source: str
    rig: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    fs: float
    duration: float
    samples: int
    record: Path | None = None
    result: Path | None = None
    found: Identification | None = None

    @property
    def verdict(self) -> str:
        """The result's, or '' without one."""
        return "" if self.found is None else str(self.found.verdict)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Folder:
    """What a folder holds.

    Parameters
    ----------
    runs : tuple of Run
        In order of time.
    unreadable : tuple of (str, str)
        Files of ours that are damaged, and why.
    """

    runs: tuple[Run, ...]
    unreadable: tuple[tuple[str, str], ...]


def find_runs(folder: str | PathLike[str]) -> Folder:
    """Read every record and every result in a folder and those below; join those of one run.

    Hidden folders, such as what the workbench keeps for itself, are left out.

    A result belongs to the record whose digest it names; of copies of it, to the nearest.

    Parameters
    ----------
    folder : path-like
        Where to look.

    Raises
    ------
    ArgumentError
        If it is no folder.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.formats import save
    >>> record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0)
    >>> with tempfile.TemporaryDirectory() as place:
    ...     save(record, Path(place) / "first.h5")
    ...     [(run.name, run.inputs, run.samples) for run in find_runs(place).runs]
    [('first.h5', ('u',), 3)]
    """
    place = Path(folder)
    if not place.is_dir():
        raise ArgumentError(f"{str(folder)!r} is not a folder; name one that holds records")
    records: list[tuple[Path, Record, str, str]] = []
    results: list[tuple[Path, Identification]] = []
    unreadable: list[tuple[str, str]] = []
    for path in sorted(p for p in place.rglob("*") if p.is_file()):
        if any(part.startswith(".") for part in path.relative_to(place).parts[:-1]):
            continue
        kind = _kind(path)
        try:
            if kind == "result":
                found = load(path)
                if isinstance(found, Identification):
                    results.append((path, found))
            elif kind == "file":
                whole = read_recording(path)
                records.append((path, whole.record, whole.created, whole.rig))
            elif kind == "table":
                records.append((path, read(path), "", ""))
        except HmpimError as error:
            unreadable.append((str(path.relative_to(place)), str(error)))
    runs = list(_joined(place, records, results))
    return Folder(
        runs=tuple(sorted(runs, key=lambda run: (run.created, run.name))),
        unreadable=tuple(unreadable),
    )


def files_of(found: Folder, folder: Path) -> list[Path]:
    """Return every file of the runs in a folder, damaged ones included."""
    whole = [path for run in found.runs for path in (run.record, run.result) if path is not None]
    return [*whole, *(folder / name for name, _ in found.unreadable)]


def filter_runs(runs: Sequence[Run], conditions: Sequence[str]) -> tuple[Run, ...]:
    """Keep the runs that meet every condition.

    Parameters
    ----------
    runs : sequence of Run
        Runs.
    conditions : sequence of str
        Such as ``delay > 3ms``, ``verdict = ok``, ``name = *roll*``, ``created >= 2026-11-20``.
        A parameter's condition is met if any pair of the run meets it.

    Raises
    ------
    ArgumentError
        If a condition cannot be read.

    Examples
    --------
    >>> filter_runs([], ["speed > 3"])
    Traceback (most recent call last):
    ...
    hmpim.errors.ArgumentError: 'speed > 3' uses 'speed', which no run has; choose one of \
name, source, rig, input, output, verdict, created, fs, duration, samples, delay, ...
    """
    tests = [_condition(text) for text in conditions]
    return tuple(run for run in runs if all(test(run) for test in tests))


def asked_of(name: str, conditions: Sequence[str], *, unit: str) -> tuple[tuple[str, float], ...]:
    """Return what conditions ask of one figure: words, and the value in a unit.

    Parameters
    ----------
    name : str
        Of the figure, such as ``delay``.
    conditions : sequence of str
        As for `filter_runs`.
    unit : str
        Of the values that are returned.

    Raises
    ------
    ArgumentError
        If a condition cannot be read.

    Examples
    --------
    >>> asked_of("delay", ["delay < 3ms", "verdict = ok"], unit="s")
    (('< 3ms', 0.003),)
    """
    asked = []
    for text in conditions:
        _condition(text)
        about, sign, value = _parts(text)
        if about == name and name in _FIGURES:
            number, own = _quantity(value, text)
            asked.append(
                (f"{sign} {value}", number * (conversion_factor(own, to=unit) if own else 1.0))
            )
    return tuple(asked)


def _quantity(value: str, text: str) -> tuple[float, str]:
    """Number and unit of a condition's value."""
    match = _QUANTITY.match(value)
    try:
        if match is None:
            raise ValueError(value)
        return float(match["number"]), match["unit"]
    except ValueError:
        raise ArgumentError(
            f"{text!r}: {value!r} is not a number; write it as 3ms or 0.003"
        ) from None


def _kind(path: Path) -> str:
    """What a file is of ours, told by its content: '' for anything else."""
    try:
        with path.open("rb") as file:
            head = file.read(65_536)
    except OSError:
        return ""
    if head.startswith(_HDF5) and b"hmpim/record/" in head:
        return "file"
    if head.startswith(b"# " + MARK.encode()):
        return "table"
    return "result" if head[:1] == b"{" and _RESULT.search(head[:400]) else ""


def _joined(
    place: Path,
    records: Sequence[tuple[Path, Record, str, str]],
    results: Sequence[tuple[Path, Identification]],
) -> Iterator[Run]:
    alike: dict[str, list[Path]] = {}
    for path, record, *_ in records:
        alike.setdefault(record.sha256, []).append(path)
    of_record: dict[Path, list[tuple[Path, Identification]]] = {}
    left: list[tuple[Path, Identification]] = []
    for path, found in results:
        same = alike.get(found.record.sha256, [])
        kept = of_record.setdefault(min(same, key=partial(_apart, path)), []) if same else left
        kept.append((path, found))
    for path, record, created, rig in records:
        mine: list[tuple[Path | None, Identification | None]] = [*of_record.get(path, [])]
        for result, identified in mine or [(None, None)]:
            yield _of_record(
                place, path, record, created or _changed(path), rig, result, identified
            )
    for path, found in left:
        yield Run(
            name=str(path.relative_to(place)),
            created=_changed(path),
            source="",
            rig="",
            inputs=tuple(dict.fromkeys(pair.input for pair in found.pairs)),
            outputs=tuple(dict.fromkeys(pair.output for pair in found.pairs)),
            fs=found.record.fs,
            duration=found.record.samples / found.record.fs,
            samples=found.record.samples,
            result=path,
            found=found,
        )


def _apart(result: Path, record: Path) -> tuple[bool, bool]:
    """How unlike two places are: folder first, then name; of copies the nearest has the result."""
    return record.parent != result.parent, not result.stem.startswith(record.stem)


def _of_record(
    place: Path,
    path: Path,
    record: Record,
    created: str,
    rig: str,
    result: Path | None,
    found: Identification | None,
) -> Run:
    time = record.outputs[0].time
    return Run(
        name=str(path.relative_to(place)),
        created=created,
        source=record.source or "",
        rig=rig,
        inputs=tuple(c.name for c in record.inputs),
        outputs=tuple(c.name for c in record.outputs),
        fs=record.fs,
        duration=float(time[-1] - time[0]) + 1.0 / record.fs,
        samples=time.size,
        record=path,
        result=result,
        found=found,
    )


def _changed(path: Path) -> str:
    return datetime.fromtimestamp(path.stat().st_mtime, tz=UTC).strftime("%Y-%m-%dT%H:%M:%S+0000")


def _parts(text: str) -> tuple[str, str, str]:
    """Name, sign and value of a condition."""
    match = _CONDITION.match(text)
    if match is None:
        raise ArgumentError(f"{text!r} is not a condition; write it as 'delay > 3ms'")
    return match["name"], match["sign"], match["value"]


def _condition(text: str) -> Callable[[Run], bool]:
    name, sign, value = _parts(text)
    if name in _WORDS:
        return _of_words(name, sign, value, text)
    if name in _FIGURES:
        return _of_figures(name, sign, value, text)
    raise ArgumentError(
        f"{text!r} uses {name!r}, which no run has; choose one of {', '.join((*_WORDS, *_FIGURES))}"
    )


def _of_words(name: str, sign: str, value: str, text: str) -> Callable[[Run], bool]:
    """A condition on words: '=' takes a pattern; created is compared too."""
    if sign not in ("=", "!=") and name != "created":
        raise ArgumentError(f"{text!r}: {name} is a word; use = or != with a pattern, as *roll*")

    def test(run: Run) -> bool:
        words: Any = {"input": run.inputs, "output": run.outputs}.get(name)
        words = (getattr(run, name),) if words is None else words
        if sign in ("=", "!="):
            return any(fnmatchcase(word, value) for word in words) == (sign == "=")
        compared = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
        return bool(compared[sign](str(words[0]), value))

    return test


def _of_figures(name: str, sign: str, value: str, text: str) -> Callable[[Run], bool]:
    number, unit = _quantity(value, text)

    def test(run: Run) -> bool:
        return any(
            _SIGNS[sign](figure, number * (conversion_factor(unit, to=own) if unit else 1.0))
            for figure, own in _figures(run, name)
        )

    return test


def _figures(run: Run, name: str) -> Iterator[tuple[float, str]]:
    """Values of a figure in a run, with their units: of each pair that has it."""
    if name in ("fs", "duration", "samples"):
        yield float(getattr(run, name)), {"fs": "Hz", "duration": "s"}.get(name, "")
        return
    for pair in () if run.found is None else run.found.pairs:
        estimate = getattr(pair.parameters, name)
        if estimate is not None:
            yield float(estimate.value), estimate.unit


def schema_of(run: Run) -> dict[str, Any]:
    """Return a run as plain JSON values."""
    return {
        "name": run.name,
        "created": run.created,
        "source": run.source,
        "rig": run.rig,
        "inputs": list(run.inputs),
        "outputs": list(run.outputs),
        "fs": run.fs,
        "duration": run.duration,
        "samples": run.samples,
        "record": None if run.record is None else str(run.record),
        "result": None if run.result is None else str(run.result),
        "identification": None if run.found is None else run.found.to_dict(),
    }
