"""Files that a command reads and writes, checked before any work is done."""

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import combinations
from pathlib import Path

from hmpim.errors import ArgumentError

__all__ = ["check_files", "plan_file"]

Paths = Path | Sequence[Path] | None


def check_files(
    *,
    reads: Mapping[str, Paths] | None = None,
    writes: Mapping[str, Paths] | None = None,
    folders: Mapping[str, Paths] | None = None,
    owned: Mapping[str, Paths] | None = None,
) -> None:
    """Refuse outputs that cannot be written, and outputs that are an input or another output.

    Links are followed, and relative paths count as what they lead to.

    Parameters
    ----------
    reads : mapping of str to path or paths
        Files that are read, by what they are: "the record".
    writes : mapping of str to path or paths
        Files that are going to be written, by the option that names them.
    folders : mapping of str to path or paths
        Folders that are made where they are missing, by the option that names them.
    owned : mapping of str to path or paths
        Such folders in which everything belongs to the command.

    Raises
    ------
    ArgumentError
        If a file or folder cannot be written, or stands for two things.

    Examples
    --------
    >>> check_files(reads={"the record": Path("a.csv")}, writes={"--json": Path("r.json")})
    >>> check_files(reads={"the record": Path("a.csv")}, writes={"--json": Path("./a.csv")})
    Traceback (most recent call last):
    ...
    hmpim.errors.ArgumentError: --json a.csv is the record itself, which would be lost; ...
    """
    read, written = [*_each(reads)], [*_each(writes)]
    made = [*_each(folders), *_each(owned)]
    for option, folder in made:
        _check_folder(option, folder)
        for other, path in (*read, *written):
            alone = (option, folder) in _each(owned)
            if _inside(folder, path) or (alone and _inside(path, folder)):
                raise ArgumentError(
                    f"{other} {path} and the folder {folder} of {option} are in each other's "
                    "way; name another file"
                )
    for option, path in written:
        for what, source in read:
            if _same(path, source):
                raise ArgumentError(
                    f"{option} {path} is {what} itself, which would be lost; name another file"
                )
    for (option, path), (other, second) in combinations(written, 2):
        if _same(path, second):
            raise ArgumentError(
                f"{option} {path} and {other} {second} are one file, and one of the two would be "
                "lost; name another"
            )
    for option, path in written:
        if not any(path.parent.resolve() == folder.resolve() for _, folder in made):
            _check_file(option, path)


def _each(named: Mapping[str, Paths] | None) -> Iterator[tuple[str, Path]]:
    for name, paths in (named or {}).items():
        for path in [paths] if isinstance(paths, Path) else paths or ():
            yield name, path


def _check_file(option: str, path: Path) -> None:
    from hmpim.formats.atomic import check_writable

    if path.is_dir():
        raise ArgumentError(f"{option}: {path} is a folder; name a file in it")
    if not path.parent.exists():
        raise ArgumentError(f"{option}: folder {path.parent} does not exist; make it first")
    if not path.parent.is_dir():
        raise ArgumentError(f"{option}: {path.parent} is a file, not a folder; name another folder")
    try:
        if option in ("--report", "--sign"):
            from hmpim.report import check_page

            check_page(path)
        check_writable(path)
    except ArgumentError as error:
        raise ArgumentError(f"{option}: {error}") from None


def _check_folder(option: str, folder: Path) -> None:
    for part in (folder, *folder.parents):
        if not os.path.lexists(part):
            continue
        if not part.is_dir():
            kind = "a file" if part.exists() else "a link that leads nowhere"
            raise ArgumentError(f"{option}: {part} is {kind}; name a folder")
        if not os.access(part, os.W_OK | os.X_OK):
            raise ArgumentError(f"{option}: folder {part} may not be written to; name another")
        return


def _same(one: Path, other: Path) -> bool:
    """Whether two paths lead to one file; never for what keeps nothing, as /dev/null."""
    if one.exists() and not one.is_file():
        return False
    if one.exists() and other.exists() and one.samefile(other):
        return True
    return one.resolve() == other.resolve()


def _inside(path: Path, folder: Path) -> bool:
    path, folder = path.resolve(), folder.resolve()
    return path == folder or folder in path.parents


def plan_file(plan: str, ships: Sequence[str], shipped: Callable[[str], Path]) -> Path:
    """Return the file of a plan: the one of that name, or else the one that ships.

    A folder is no plan, so that one named `demo` does not hide the plan `demo`.

    Parameters
    ----------
    plan : str
        A path, or the name of a plan that ships.
    ships : sequence of str
        Names of the plans that ship.
    shipped : callable
        Path of one of them.

    Raises
    ------
    ArgumentError
        If there is neither.

    Examples
    --------
    >>> plan_file("nothing", ("demo",), Path)
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: there is no plan nothing; give a file, or one that ships: demo
    """
    path = Path(plan)
    if path.exists() and not path.is_dir():
        return path
    if plan in ships:
        return shipped(plan)
    raise ArgumentError(
        f"there is no plan {plan}; give a file, or one that ships: {', '.join(ships)}"
    )
