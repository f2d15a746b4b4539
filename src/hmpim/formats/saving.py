"""`save` and `load`: a value to a file and back, unchanged.

One row of `_KINDS` for each kind of value: its suffixes, and how it is written. What a file
holds is told from the file itself.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.atomic import write_text
from hmpim.formats.csv import write_csv
from hmpim.formats.files import read
from hmpim.formats.readers.text import read_text
from hmpim.formats.stimulus_files import STIMULUS_SUFFIXES, read_stimulus, save_stimulus
from hmpim.identify import Identification
from hmpim.identify.repeats import Repeats
from hmpim.record import Record
from hmpim.stimulus import Stimulus

__all__ = ["Saved", "load", "save", "suffixes_of"]

Saved = Record | Stimulus | Identification | Repeats
"""What can be saved."""


def save(thing: Saved, path: str | PathLike[str]) -> None:
    """Write a record, a stimulus or a result to a file, so that `load` gives it back.

    Parameters
    ----------
    thing : Record, Stimulus, Identification or Repeats
        What to save.
    path : str or path-like
        The file; replaced as a whole, or not at all. Its suffix says in which form: `.csv` for a
        record, `.toml` for a stimulus (`.csv`, `.h5`, `.mat` and `.h` hold its samples alone),
        `.json` for a result.

    Raises
    ------
    ArgumentError
        If such a thing cannot be saved, not with this suffix, or the file cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save(record, Path(folder) / "r.csv")
    ...     load(Path(folder) / "r.csv").sha256 == record.sha256
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
    reader = _READERS.get(file.suffix.lower())
    if reader is None:
        raise FormatError(
            f"{str(path)!r} has the suffix {file.suffix!r}, which save never gives; "
            f"it gives {', '.join(_READERS)}"
        )
    return reader(file)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kind:
    """A kind of value that can be saved."""

    name: str
    type: type
    suffixes: tuple[str, ...]
    write: Callable[[Any, str | PathLike[str]], None]


def _write_json(result: Identification | Repeats, path: str | PathLike[str]) -> None:
    write_text(path, json.dumps(result.to_dict(), indent=1, allow_nan=False) + "\n")


def _read_json(path: Path) -> Identification:
    try:
        data = json.loads(read_text(path))
    except ValueError as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{str(path)!r} cannot be read as JSON: {error}") from None
    if not isinstance(data, dict):
        raise FormatError(f"{str(path)!r} holds no result of hmpim")
    try:
        return Identification.from_dict(data)
    except FormatError as error:
        raise FormatError(f"{str(path)!r}: {error}") from None
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise FormatError(f"{str(path)!r} is not a whole result: {error!r}") from error


def _read_toml(path: Path) -> Stimulus:
    found = read_stimulus(path)
    if len(found) != 1:
        raise FormatError(
            f"{str(path)!r} holds {len(found)} stimuli; read it with "
            "hmpim.formats.stimulus_files.read_stimulus"
        )
    (stimulus,) = found
    assert isinstance(stimulus, Stimulus)
    return stimulus


_KINDS = (
    _Kind(name="a record", type=Record, suffixes=(".csv",), write=write_csv),
    _Kind(name="a stimulus", type=Stimulus, suffixes=STIMULUS_SUFFIXES, write=save_stimulus),
    _Kind(name="a result", type=Identification, suffixes=(".json",), write=_write_json),
    _Kind(name="repeats", type=Repeats, suffixes=(".json",), write=_write_json),
)
_READERS: dict[str, Callable[[Path], Saved]] = {
    ".csv": read,
    ".json": _read_json,
    ".toml": _read_toml,
}
