"""Stimuli to players and back: HDF5, MAT, C header; each file whole or not there at all.

A `.c` is a program that computes the samples (`hmpim.formats.realtime`); it is not read back.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.atomic import replacing, write_text
from hmpim.formats.hdf5 import faults_named
from hmpim.formats.realtime import save_stimulus_program
from hmpim.formats.stimulus import (
    check_together,
    identifier,
    save_stimulus_csv,
    stimulus_columns,
)
from hmpim.formats.stimulus_spec import read_stimulus_toml, save_stimulus_toml
from hmpim.stimulus import SampledMotion, Stimulus
from hmpim.stimulus.motion import FloatArray

__all__ = [
    "STIMULUS_SUFFIXES",
    "PlayedStimulus",
    "read_stimuli",
    "read_stimulus",
    "save_stimulus",
    "save_stimulus_c",
    "save_stimulus_hdf5",
    "save_stimulus_mat",
]

_SIGNALS = ("position", "velocity", "acceleration")
_FORMAT = "hmpim/stimulus/1"
_Several = Stimulus | Sequence[Stimulus]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PlayedStimulus:
    """Samples of one axis as a file of samples holds them.

    Parameters
    ----------
    axis, unit : str
        Name of the axis and unit of its position; empty where the file does not say.
    fs : float
        Hz.
    time, position, velocity, acceleration : ndarray, shape (n,)
        Bit for bit as they were saved.
    band : tuple of float or None
        Excited band in Hz, where the file says.
    """

    axis: str
    unit: str
    fs: float
    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    acceleration: FloatArray
    band: tuple[float, float] | None = None


def save_stimulus(stimuli: _Several, path: str | PathLike[str]) -> None:
    """Write one or several stimuli to the kind of file that the suffix names.

    Parameters
    ----------
    stimuli : Stimulus or sequence of Stimulus
        Several must have one sampling rate, and each an axis of its own.
    path : path
        Ending in one of `STIMULUS_SUFFIXES`; replaced if there, and only once the new file
        is complete.

    Raises
    ------
    ArgumentError
        If the suffix is not known, or the stimuli do not go together.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.stimulus import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus(sine, Path(folder) / "s.h5")
    ...     [played] = read_stimulus(Path(folder) / "s.h5")
    >>> bool(np.array_equal(played.position, sine.position))
    True
    """
    suffix = Path(path).suffix.lower()
    if suffix not in _WRITERS:
        raise ArgumentError(
            f"a stimulus cannot be written to {str(path)!r}; name a file that ends in "
            f"{', '.join(STIMULUS_SUFFIXES)}"
        )
    _WRITERS[suffix](stimuli, path)


def save_stimulus_hdf5(stimuli: _Several, path: str | PathLike[str]) -> None:
    """Write samples as HDF5: a group for each axis, `stimulus` where it has no name.

    Each group holds `time`, `position`, `velocity`, `acceleration` and the attributes `fs`
    and `unit`.

    Parameters
    ----------
    stimuli, path
        As for `save_stimulus`.

    Examples
    --------
    >>> import tempfile
    >>> import h5py
    >>> from hmpim.stimulus import Sine
    >>> roll = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0, axis="roll")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus_hdf5(roll, Path(folder) / "s.h5")
    ...     with h5py.File(Path(folder) / "s.h5") as file:
    ...         list(file), file["roll"]["position"].shape
    (['roll'], (20,))
    """
    import h5py  # type: ignore[import-untyped, unused-ignore]

    several = check_together(stimuli)

    with replacing(path) as place, h5py.File(place, "w") as file:
        file.attrs["format"] = _FORMAT
        for stimulus in several:
            group = file.create_group(stimulus.axis.replace("/", "_") or "stimulus")
            group.attrs["axis"] = stimulus.axis
            group.attrs["unit"] = stimulus.unit
            group.attrs["fs"] = stimulus.fs
            for name, values in stimulus_columns(stimulus, several).items():
                group.create_dataset(name, data=values, track_times=False)


def save_stimulus_mat(stimuli: _Several, path: str | PathLike[str]) -> None:
    """Write samples as a MAT file (version 5): a struct for each axis.

    Fields are `time`, `position`, `velocity`, `acceleration` (columns), `fs`, `unit`, `axis`.

    Parameters
    ----------
    stimuli, path
        As for `save_stimulus`.

    Examples
    --------
    >>> import tempfile
    >>> from scipy.io import loadmat
    >>> from hmpim.stimulus import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus_mat(sine, Path(folder) / "s.mat")
    ...     loadmat(Path(folder) / "s.mat", simplify_cells=True)["stimulus"]["fs"]
    10.0
    """
    from scipy.io import savemat

    several = check_together(stimuli)
    structs: dict[str, Any] = {}
    for stimulus in several:
        columns = stimulus_columns(stimulus, several)
        structs[identifier(stimulus.axis, taken=structs)] = {
            **{name: values[:, None] for name, values in columns.items()},
            "fs": stimulus.fs,
            "unit": stimulus.unit,
            "axis": stimulus.axis,
        }

    with replacing(path) as place:
        savemat(str(place), structs, appendmat=False)


def save_stimulus_c(stimuli: _Several, path: str | PathLike[str]) -> None:
    """Write samples as a C header for an embedded player: constant arrays of double.

    Numbers are hexadecimal floating constants (C99), so the very bits arrive.

    Parameters
    ----------
    stimuli, path
        As for `save_stimulus`.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.stimulus import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=4.0, unit="deg")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus_c(sine, Path(folder) / "s.h")
    ...     text = (Path(folder) / "s.h").read_text()
    >>> print(text.splitlines()[4], text.splitlines()[5], sep="; ")
    #define STIMULUS_SAMPLES 8; #define STIMULUS_RATE_HZ 0x1.0000000000000p+2
    """
    several = check_together(stimuli)
    guard = re.sub(r"\W", "_", Path(path).name.upper())
    lines = ["/* hmpim stimulus */", f"#ifndef HMPIM_{guard}", f"#define HMPIM_{guard}", ""]
    names: dict[str, Any] = {}
    for stimulus in several:
        name = identifier(stimulus.axis, taken=names)
        names[name] = stimulus
        columns = stimulus_columns(stimulus, several)
        lines.append(f"#define {name.upper()}_SAMPLES {columns['time'].size}")
        lines.append(f"#define {name.upper()}_RATE_HZ {stimulus.fs.hex()}")
        lines.append(f'#define {name.upper()}_UNIT "{stimulus.unit}"')
        for signal in _SIGNALS:
            lines.append(f"static const double {name}_{signal}[{columns[signal].size}] = {{")
            lines += [f"    {value.hex()}," for value in columns[signal].tolist()]
            lines.append("};")
        lines.append("")
    lines.append("#endif")
    text = "\n".join(lines) + "\n"
    write_text(path, text)


def read_stimulus(path: str | PathLike[str]) -> list[Stimulus] | list[PlayedStimulus]:
    """Read stimuli back: complete ones from TOML, samples from CSV, HDF5, MAT or a C header.

    Parameters
    ----------
    path : path
        As written by `save_stimulus`.

    Returns
    -------
    list of Stimulus
        From TOML, made anew: the same samples, bit for bit.
    list of PlayedStimulus
        From the others.

    Raises
    ------
    FormatError
        If the file is not what its suffix claims.
    ArgumentError
        If the suffix is not known.

    Examples
    --------
    >>> read_stimulus("s.doc")
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: no stimulus can be read from 's.doc'; name a file that ends in ...
    """
    suffix = Path(path).suffix.lower()
    if suffix == ".toml":
        return read_stimulus_toml(path)
    if suffix not in _READERS:
        raise ArgumentError(
            f"no stimulus can be read from {str(path)!r}; name a file that ends in "
            f"{', '.join(('.toml', *_READERS))}"
        )
    try:
        found = _READERS[suffix](Path(path))
    except FormatError:
        raise
    except (OSError, KeyError, ValueError, IndexError, TypeError, NotImplementedError) as error:
        raise FormatError(f"{str(path)!r} cannot be read as a stimulus: {error}") from error
    if not found:
        raise FormatError(f"{str(path)!r} holds no stimulus; make one with hmpim design")
    return found


def read_stimuli(path: str | PathLike[str]) -> list[Stimulus]:
    """Read what a rig is to play: one stimulus for each axis.

    Parameters
    ----------
    path : path
        As for `read_stimulus`. Where the file holds samples alone, they are joined by a
        `SampledMotion`.

    Raises
    ------
    FormatError
        If the file is not what its suffix claims.
    ArgumentError
        If the suffix is not known.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.stimulus import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0, unit="deg")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus(sine, Path(folder) / "s.csv")
    ...     [read] = read_stimuli(Path(folder) / "s.csv")
    >>> bool(np.array_equal(read.position, sine.position)), read.unit
    (True, 'deg')
    """
    if not Path(path).exists():
        raise FormatError(f"there is no file {str(path)!r}; check the path")
    return [s if isinstance(s, Stimulus) else _joined(s, path) for s in read_stimulus(path)]


def _joined(played: PlayedStimulus, path: str | PathLike[str]) -> Stimulus:
    clock = np.arange(played.time.size) / played.fs
    if played.time.size < 2 or np.abs(played.time - clock).max() > 1e-6 / played.fs:
        raise FormatError(
            f"the times of {str(path)!r} are not those of {played.time.size} samples at "
            f"{played.fs:g} Hz from 0 on; save the stimulus anew"
        )
    motion = SampledMotion(
        fs=played.fs,
        position=played.position,
        velocity=played.velocity,
        acceleration=played.acceleration,
        band=played.band,
    )
    return Stimulus(waveform=motion, fs=played.fs, unit=played.unit, axis=played.axis)


def _read_hdf5(path: Path) -> list[PlayedStimulus]:
    import h5py  # type: ignore[import-untyped, unused-ignore]

    with faults_named(path):
        file = h5py.File(path)
    with file:
        return [
            PlayedStimulus(
                axis=str(group.attrs["axis"]),
                unit=str(group.attrs["unit"]),
                fs=float(group.attrs["fs"]),
                time=np.asarray(group["time"][()], dtype=np.float64),
                position=np.asarray(group["position"][()], dtype=np.float64),
                velocity=np.asarray(group["velocity"][()], dtype=np.float64),
                acceleration=np.asarray(group["acceleration"][()], dtype=np.float64),
            )
            for group in file.values()
            if "axis" in group.attrs
        ]


def _read_mat(path: Path) -> list[PlayedStimulus]:
    from scipy.io import loadmat

    structs = loadmat(path, simplify_cells=True)
    return [
        PlayedStimulus(
            axis=str(s["axis"]) if len(s["axis"]) else "",
            unit=str(s["unit"]) if len(s["unit"]) else "",
            fs=float(s["fs"]),
            time=np.atleast_1d(s["time"]),
            position=np.atleast_1d(s["position"]),
            velocity=np.atleast_1d(s["velocity"]),
            acceleration=np.atleast_1d(s["acceleration"]),
        )
        for s in structs.values()
        if isinstance(s, dict) and "axis" in s
    ]


def _read_c(path: Path) -> list[PlayedStimulus]:
    text = path.read_text(encoding="utf-8")
    arrays = {
        name: np.array([float.fromhex(v) for v in body.replace(",", " ").split()])
        for name, body in re.findall(r"double (\w+)\[\d+\] = \{(.*?)\};", text, flags=re.DOTALL)
    }
    defined = dict(re.findall(r"#define (\w+) (\S.*)", text))
    found = []
    for name in (key.removesuffix("_position") for key in arrays if key.endswith("_position")):
        rate = float.fromhex(defined[f"{name.upper()}_RATE_HZ"])
        found.append(
            PlayedStimulus(
                axis="" if name == "stimulus" else name,
                unit=defined[f"{name.upper()}_UNIT"].strip('"'),
                fs=rate,
                time=np.arange(arrays[f"{name}_position"].size) / rate,
                position=arrays[f"{name}_position"],
                velocity=arrays[f"{name}_velocity"],
                acceleration=arrays[f"{name}_acceleration"],
            )
        )
    return found


def _read_csv(path: Path) -> list[PlayedStimulus]:
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    rows = [line for line in lines if line and not line.startswith("#")]
    if not rows or not comments:
        raise FormatError(f"{str(path)!r} has no heading of a stimulus; make one with hmpim design")
    names = rows[0].split(",")
    _refuse_cut(path, rows, comments[0])
    table = np.array([[float(v) for v in row.split(",")] for row in rows[1:]])
    columns = dict(zip(names, table.T, strict=True))
    found = []
    for comment in comments:
        said = re.match(r"# hmpim stimulus; (?:(.*?): )?fs = (\S+) Hz, unit = ([^,]*)", comment)
        if said is None:
            continue
        axis, rate, unit = said.groups()
        prefix = f"{axis}." if f"{axis}.position" in columns else ""
        found.append(
            PlayedStimulus(
                axis=axis or "",
                unit="" if unit == "none" else unit,
                fs=float(rate),
                band=_band(comment),
                time=columns["time"],
                position=columns[f"{prefix}position"],
                velocity=columns[f"{prefix}velocity"],
                acceleration=columns[f"{prefix}acceleration"],
            )
        )
    return found


def _refuse_cut(path: Path, rows: Sequence[str], comment: str) -> None:
    """Refuse a table that is cut short, which would end the motion before it comes to rest."""
    whole = [row for row in rows[1:] if row.count(",") == rows[0].count(",")]
    stated = re.search(r", samples = (\d+)", comment)
    samples = len(rows) - 1 if stated is None else int(stated[1])
    if not len(whole) == len(rows) - 1 == samples:
        raise FormatError(
            f"{str(path)!r} is damaged: {len(whole)} of its {samples} samples are "
            "complete; copy it "
            "again, or save the stimulus anew"
        )


def _band(comment: str) -> tuple[float, float] | None:
    said = re.search(r", band = (\S+) (\S+) Hz", comment)
    return None if said is None else (float(said[1]), float(said[2]))


_WRITERS: dict[str, Callable[[_Several, str | PathLike[str]], None]] = {
    ".csv": save_stimulus_csv,
    ".h5": save_stimulus_hdf5,
    ".hdf5": save_stimulus_hdf5,
    ".mat": save_stimulus_mat,
    ".h": save_stimulus_c,
    ".c": save_stimulus_program,
    ".toml": save_stimulus_toml,
}
_READERS: dict[str, Callable[[Path], list[PlayedStimulus]]] = {
    ".csv": _read_csv,
    ".h5": _read_hdf5,
    ".hdf5": _read_hdf5,
    ".mat": _read_mat,
    ".h": _read_c,
}
STIMULUS_SUFFIXES = tuple(_WRITERS)
