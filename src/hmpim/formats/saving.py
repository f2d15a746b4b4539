"""`save` and `load`: a value to a file and back, unchanged.

One row of `_KINDS` for each kind of value: its suffixes, and how it is written. What a file
holds is told from the file itself.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any, cast, get_type_hints

import numpy as np

from hmpim.arguments import check_argument, checked
from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.atomic import write_text
from hmpim.formats.csv import write_csv
from hmpim.formats.files import read
from hmpim.formats.readers.text import read_text
from hmpim.formats.recording import read_recording, save_recording
from hmpim.formats.statistics_files import FAMILY as STATISTICS
from hmpim.formats.statistics_files import read_statistics, save_statistics
from hmpim.formats.stimulus_files import STIMULUS_SUFFIXES, save_stimulus
from hmpim.formats.stimulus_spec import read_stimulus_toml
from hmpim.identify import Identification, PairIdentification, Statistics
from hmpim.record import Record
from hmpim.stimulus import Stimulus

__all__ = ["Saved", "load", "save", "suffixes_of"]

Saved = Record | Stimulus | Identification | Statistics
"""What can be saved."""


@checked
def save(thing: Saved, path: str | PathLike[str]) -> None:
    """Write a record, a stimulus, a result or statistics to a file, so that `load` gives it back.

    Parameters
    ----------
    thing : Record, Stimulus, Identification or Statistics
        What to save.
    path : str or path-like
        The file; replaced as a whole, or not at all. Its suffix says in which form: `.h5` for a
        record, or `.csv` if all its channels have one clock; `.toml` for a
        stimulus; `.json` for a result; `.h5` for statistics. A stimulus is also written for its
        rig, as `.csv`, `.h5`, `.mat`, `.h` or `.c`; `load` does not take those.

    Raises
    ------
    ArgumentError
        If such a thing cannot be saved, not with this suffix, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save(record, Path(folder) / "r.h5")
    ...     load(Path(folder) / "r.h5") == record
    True
    """
    for kind in _KINDS:
        if isinstance(thing, kind.type):
            suffix = Path(path).suffix.lower()
            if suffix not in kind.suffixes:
                raise ArgumentError(
                    f"{kind.name} cannot be saved as {str(path)!r}; name a file that ends in "
                    f"{' or '.join(kind.suffixes)}"
                )
            kind.write(thing, path)
            return
    raise ArgumentError(
        f"{type(thing).__name__} cannot be saved; give {', '.join(k.name for k in _KINDS)}"
    )


def suffixes_of(kind: type) -> tuple[str, ...]:
    """Suffixes with which a kind of value can be saved.

    Examples
    --------
    >>> ".csv" in suffixes_of(Record)
    True
    """
    return next((known.suffixes for known in _KINDS if known.type is kind), ())


@checked
def load(path: str | PathLike[str]) -> Saved:
    """Read back what `save` wrote.

    Parameters
    ----------
    path : str or path-like
        The file.

    Raises
    ------
    FormatError
        If there is no such file, or it holds nothing that `save` writes.

    Examples
    --------
    >>> load("nowhere.json")
    Traceback (most recent call last):
    hmpim.errors.FormatError: there is no file 'nowhere.json'; check the path
    """
    file = Path(path)
    head = _head(file)
    for kind in _KINDS:
        if kind.knows(head):
            return kind.read(file)
    raise FormatError(
        f"{str(path)!r} holds nothing that hmpim.save writes; a record that other programs wrote "
        "is read with hmpim.read, and identified with hmpim identify"
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kind:
    """A kind of value that can be saved: as what, and how its files are known and read."""

    name: str
    type: type
    suffixes: tuple[str, ...]
    write: Callable[[Any, str | PathLike[str]], None]
    knows: Callable[[bytes], bool]
    read: Callable[[Path], Saved]


def _head(path: Path) -> bytes:
    """The first 64 kB of a file."""
    if path.is_dir():
        raise FormatError(f"{str(path)!r} is a folder; name the file in it")
    try:
        with path.open("rb") as file:
            return file.read(65_536)
    except FileNotFoundError:
        raise FormatError(f"there is no file {str(path)!r}; check the path") from None
    except (OSError, ValueError) as error:  # a NUL in the path is a ValueError
        reason = getattr(error, "strerror", None) or error
        raise FormatError(f"{str(path)!r} cannot be opened: {reason}") from None


def _write_record(record: Record, path: str | PathLike[str]) -> None:
    if Path(path).suffix.lower() == ".csv":
        write_csv(record, path)
    else:
        save_recording(record, path)


def _knows_record(head: bytes) -> bool:
    return b"hmpim/record/" in head


def _read_record(path: Path) -> Record:
    ours = path.suffix.lower() in (".h5", ".hdf5")
    return read_recording(path).record if ours else read(path)


def _knows_statistics(head: bytes) -> bool:
    return STATISTICS.encode() in head


def _write_result(result: Identification, path: str | PathLike[str]) -> None:
    write_text(path, json.dumps(result.to_dict(), indent=1, allow_nan=False) + "\n")


def _knows_result(head: bytes) -> bool:
    return head.lstrip().startswith(b"{")


_OTHER_DOCUMENTS = {
    "repeats": "what repeats have in common",
    "levels": "a comparison of levels",
    "validation": "a validation",
    "model": "an exported model",
    "channels": "a list of channels",
    "study": "a study",
    "campaign": "a case of a campaign",
    "batch": "a batch",
    "montecarlo": "a Monte Carlo study",
    "gentlest": "a stimulus that was designed for an accuracy",
    "paper": "figures of the paper",
    "rigs": "a list of rigs",
    "runs": "a list of runs",
}
"""What other JSON of hmpim holds, by the name in its schema."""


def _read_result(path: Path) -> Identification:
    try:
        data = json.loads(read_text(path))
    except ValueError as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{str(path)!r} cannot be read as JSON: {error}") from None
    if not isinstance(data, dict):
        raise FormatError(f"{str(path)!r} holds no result of hmpim")
    kind = str(data.get("schema")).removeprefix("hmpim/").partition("/")[0]
    if kind in _OTHER_DOCUMENTS:
        raise FormatError(
            f"{str(path)!r} holds {_OTHER_DOCUMENTS[kind]}, and the result of one record is "
            "needed; give what hmpim identify --json wrote of one"
        )
    try:
        result = Identification.from_dict(data)
        _check_fields(result, "result")
        for pair in result.pairs:
            _check_covariance(pair)
    except (FormatError, ArgumentError) as error:
        raise FormatError(f"{str(path)!r}: {error}") from None
    except KeyError as error:
        raise FormatError(f"{str(path)!r} is not a complete result: {error} is missing") from error
    except (TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{str(path)!r} is not a complete result: {error}") from error
    return result


def _check_fields(value: Any, name: str) -> None:
    """Refuse a value that holds, at any depth, what its annotations exclude."""
    if isinstance(value, tuple):
        for place, one in enumerate(value):
            _check_fields(one, f"{name}[{place}]")
    elif is_dataclass(value):
        for field, hint in _hints(value.__class__).items():
            inner = getattr(value, field)
            check_argument(f"{name}.{field}", inner, hint)
            _check_fields(inner, f"{name}.{field}")


def _check_covariance(pair: PairIdentification) -> None:
    found = pair.covariance
    if found is None:
        return
    if found.ndim != 2 or found.shape[0] != found.shape[1] or not np.isfinite(found).all():
        raise FormatError(
            f"the covariance of {pair.output!r} from {pair.input!r} is not a square "
            "matrix of finite numbers"
        )


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    known = get_type_hints(kind)
    return {field.name: known[field.name] for field in fields(cast(Any, kind))}


_SAMPLES_OF_STIMULI = (b"# hmpim stimulus", b"/* hmpim stimulus")


def _knows_stimulus(head: bytes) -> bool:
    return b"hmpim/stimulus/" in head or head.startswith(_SAMPLES_OF_STIMULI)


def _read_stimulus(path: Path) -> Stimulus:
    if path.suffix.lower() != ".toml" and path.suffix.lower() in STIMULUS_SUFFIXES:
        raise FormatError(
            f"{str(path)!r} holds the samples of a stimulus, of which the stimulus itself cannot "
            "be restored; save it as .toml, or read the samples with "
            "hmpim.formats.stimulus_files.read_stimuli"
        )
    found = read_stimulus_toml(path)
    if len(found) != 1:
        raise FormatError(
            f"{str(path)!r} holds {len(found)} stimuli; read them with "
            "hmpim.formats.stimulus_files.read_stimuli"
        )
    return found[0]


# One row for each kind; the first that knows a file reads it.
_KINDS = (
    _Kind(
        name="a record",
        type=Record,
        suffixes=(".h5", ".hdf5", ".csv"),
        write=_write_record,
        knows=_knows_record,
        read=_read_record,
    ),
    _Kind(
        name="statistics",
        type=Statistics,
        suffixes=(".h5", ".hdf5"),
        write=save_statistics,
        knows=_knows_statistics,
        read=read_statistics,
    ),
    _Kind(
        name="a stimulus",
        type=Stimulus,
        suffixes=STIMULUS_SUFFIXES,
        write=save_stimulus,
        knows=_knows_stimulus,
        read=_read_stimulus,
    ),
    _Kind(
        name="a result",
        type=Identification,
        suffixes=(".json",),
        write=_write_result,
        knows=_knows_result,
        read=_read_result,
    ),
)
