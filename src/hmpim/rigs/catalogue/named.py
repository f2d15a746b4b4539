"""Rigs by name: ``[rigs.NAME]`` in ``hmpim.toml``, the project's before the user's."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hmpim.errors import FormatError
from hmpim.rigs.catalogue.description import Description, describe, read_toml

__all__ = ["NamedRig", "config_files", "named_rigs"]

_FILE = "hmpim.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedRig:
    """A rig that a configuration file describes.

    Parameters
    ----------
    name : str
        As in ``[rigs.NAME]``.
    path : Path
        The file.
    description : Description or None
        What the file says; None where that is wrong.
    fault : str
        What is wrong; empty if nothing is.
    """

    name: str
    path: Path
    description: Description | None = None
    fault: str = ""


def config_files(start: Path | None = None) -> tuple[Path, ...]:
    """Files that are read: ``hmpim.toml`` here or in the nearest folder above, then the user's.

    Parameters
    ----------
    start : Path or None
        Folder to begin at; None for the current one.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     place = Path(folder, "a", "b")
    ...     place.mkdir(parents=True)
    ...     _ = Path(folder, "hmpim.toml").write_text("")
    ...     config_files(place)[0] == Path(folder, "hmpim.toml").resolve()
    True
    """
    from platformdirs import user_config_path

    here = (Path.cwd() if start is None else start).resolve()
    project = next(
        (folder / _FILE for folder in (here, *here.parents) if (folder / _FILE).is_file()), None
    )
    user = user_config_path("hmpim", appauthor=False) / _FILE
    found = [] if project is None else [project]
    if user.is_file() and user != project:
        found.append(user)
    return tuple(found)


def named_rigs(start: Path | None = None) -> dict[str, NamedRig]:
    r"""Return all rigs that the configuration files describe; the project's win over the user's.

    A description that is wrong is kept with its fault, so that the others can be used.

    Raises
    ------
    FormatError
        If a file cannot be read, or is no TOML.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = Path(folder, "hmpim.toml").write_text('[rigs.bench]\nrig = "table"')
    ...     named_rigs(Path(folder))["bench"].description.rig
    'table'
    """
    found: dict[str, NamedRig] = {}
    for path in reversed(config_files(start)):
        rigs = read_toml(path).get("rigs", {})
        if not isinstance(rigs, dict) or not all(isinstance(r, dict) for r in rigs.values()):
            raise FormatError(f"{str(path)!r}: 'rigs' must hold tables; write [rigs.NAME]")
        found |= {name: _named(name, data, path) for name, data in rigs.items()}
    return found


def _named(name: str, data: Any, path: Path) -> NamedRig:
    where = f"{str(path)!r}, [rigs.{name}]"
    try:
        described = describe(data, where=where)
    except FormatError as error:
        return NamedRig(name=name, path=path, fault=str(error))
    if not described.rig:
        fault = (
            f"{where}: 'rig' is missing; say what it is, for instance "
            'rig = "udp://127.0.0.1:5005"'
        )
        return NamedRig(name=name, path=path, fault=fault)
    return NamedRig(name=name, path=path, description=described)
