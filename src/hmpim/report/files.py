"""Files that are whole or not there: written beside their place, then moved into it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["replacing"]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a path to write to; move it to `path` when all went well, remove it when not.

    What is not a plain file, such as a pipe or ``/dev/stdout``, is given as it is.

    Parameters
    ----------
    path : path-like
        Where the file is wanted. Its folder must exist.

    Raises
    ------
    OSError
        If the folder does not exist or cannot be written to.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with replacing(Path(folder) / "a.txt") as place:
    ...         _ = place.write_text("whole")
    ...     [p.name for p in Path(folder).iterdir()]
    ['a.txt']
    """
    wanted = Path(path).resolve()  # through a link, so that the link stays
    if wanted.exists() and not wanted.is_file():
        if wanted.is_dir():
            raise IsADirectoryError(f"{path} is a folder; name a file in it")
        yield wanted
        return
    if not wanted.parent.is_dir():
        raise FileNotFoundError(f"folder {wanted.parent} does not exist; make it first")
    place = wanted.with_name(f".{wanted.name}.{os.getpid()}.part")
    try:
        yield place
        os.replace(place, wanted)
    finally:
        place.unlink(missing_ok=True)
