"""Statistics in a file: arrays in HDF5, one group for each run."""

import hashlib
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.errors import FormatError
from hmpim.formats.atomic import replacing
from hmpim.formats.hdf5 import faults_named
from hmpim.identify import Statistics
from hmpim.identify.statistics.reach import Reach
from hmpim.identify.statistics.run import Run, begun

__all__ = ["FAMILY", "SCHEMA", "holds_statistics", "read_statistics", "save_statistics"]

FAMILY = "hmpim/statistics/"
"""How the schema of each version begins."""

SCHEMA = f"{FAMILY}2"

_FIRST = f"{FAMILY}1"
"""Without what tells of more than linear systems."""

_ARRAYS = tuple(name for name in Run.__dataclass_fields__ if name != "samples")
_BEYOND = ("scale", "ww", "wu", "vw", "stood")


def save_statistics(statistics: Statistics, path: str | PathLike[str]) -> None:
    """Write statistics to a file, whole or not at all.

    Parameters
    ----------
    statistics : Statistics
        What to save.
    path : path-like
        Ends in .h5 or .hdf5; replaced if there.

    Raises
    ------
    ArgumentError
        If the file cannot be written.
    """
    import h5py

    with replacing(path) as place, h5py.File(place, "w", libver="latest") as file:
        file.attrs["schema"] = SCHEMA
        file.attrs["fs"] = statistics.fs
        file.attrs["lags"] = statistics.reach.lags
        file.attrs["beyond"] = statistics.reach.beyond
        file.attrs["knots"] = np.array(statistics.reach.knots, dtype=np.int64)
        file.attrs["names"] = list(statistics.names)
        file.attrs["units"] = list(statistics.units)
        file.attrs["bias"] = statistics.bias
        file.attrs["intersample"] = statistics.intersample or ""
        file.attrs["band"] = np.array(statistics.band or (), dtype=np.float64)
        for i, run in enumerate(statistics.runs):
            group = file.create_group(f"run {i}")
            group.attrs["samples"] = run.samples
            for name in _ARRAYS:
                group[name] = getattr(run, name)
        file.attrs["runs"] = len(statistics.runs)
        file.attrs["sha256"] = _digest(statistics.runs)


def holds_statistics(path: str | PathLike[str]) -> bool:
    """Whether a file is one that `save_statistics` writes; False of one that cannot be opened.

    Examples
    --------
    >>> holds_statistics("nowhere.h5")
    False
    """
    if not Path(path).is_file():  # a pipe would be read empty
        return False
    import h5py

    try:
        with faults_named(Path(path)), h5py.File(Path(path), "r") as file:
            return str(file.attrs.get("schema", "")).startswith(FAMILY)
    except FormatError:  # no HDF5, or damaged
        return False


def read_statistics(path: str | PathLike[str]) -> Statistics:
    """Read back what `save_statistics` wrote.

    Raises
    ------
    FormatError
        If the file is not whole, or was changed.
    """
    import h5py

    with faults_named(Path(path)), h5py.File(Path(path), "r") as file:
        schema = str(file.attrs.get("schema", ""))
        if schema not in (SCHEMA, _FIRST):
            raise FormatError(
                f"{str(path)!r} holds {schema or 'no schema'}, and statistics are of schema "
                f"{SCHEMA} or {_FIRST}; take a newer hmpim, or another file"
            )
        statistics = _read(file)
        digest = str(file.attrs["sha256"])
    if digest != _digest(statistics.runs):
        raise FormatError(f"{str(path)!r} was changed after it was written; compress again")
    return statistics


def _read(file: Any) -> Statistics:
    told = file.attrs
    whole = str(told["schema"]) != _FIRST
    reach = Reach(
        lags=int(told["lags"]),
        knots=tuple(int(knot) for knot in told["knots"]),
        beyond=whole and bool(told["beyond"]),
    )
    runs, empty = [], begun(reach, 0.0, 0.0)
    for i in range(int(told["runs"])):
        group = file[f"run {i}"]
        arrays = {
            name: np.asarray(group[name][()], dtype=np.float64)
            if whole or name not in _BEYOND
            else getattr(empty, name)
            for name in _ARRAYS
        }
        runs.append(Run(samples=int(group.attrs["samples"]), **arrays))
    band = [float(edge) for edge in told["band"]]
    return Statistics(
        fs=float(told["fs"]),
        reach=reach,
        runs=tuple(runs),
        names=(str(told["names"][0]), str(told["names"][1])),
        units=(str(told["units"][0]), str(told["units"][1])),
        intersample=str(told["intersample"]) or None,  # type: ignore[arg-type]
        band=(band[0], band[1]) if band else None,
        bias=str(told["bias"]),  # type: ignore[arg-type]
    )


def _digest(runs: tuple[Run, ...]) -> str:
    digest = hashlib.sha256()
    for run in runs:
        digest.update(str(run.samples).encode())
        for name in _ARRAYS:
            digest.update(np.ascontiguousarray(getattr(run, name)).tobytes())
    return digest.hexdigest()
