"""Names of files that come from a browser, made harmless."""

import re
import unicodedata
from pathlib import Path

__all__ = ["free_place", "harmless_name"]

_LONGEST = 100
_RESERVED = re.compile(r"(?i)^(con|prn|aux|nul|com\d|lpt\d)(\..*)?$")


def harmless_name(given: str) -> str:
    r"""Return a name that is a plain file name on every system, like the one given.

    Parameters
    ----------
    given : str
        As a browser sends it: it may hold folders, control characters or nothing at all.

    Examples
    --------
    >>> harmless_name("../../etc/passwd"), harmless_name("C:\\test\\a b.csv")
    ('passwd', 'a b.csv')
    >>> harmless_name(".."), harmless_name("nul.csv"), harmless_name("<i>.csv")
    ('file', '_nul.csv', '_i_.csv')
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", given))[-1]
    kept = "".join(c if c.isalnum() or c in " -_.+()=" else "_" for c in last)
    kept = kept.strip(" .") or "file"
    stem, dot, suffix = kept.rpartition(".")
    if len(kept) > _LONGEST:
        kept = f"{stem[: _LONGEST - 12]}{dot}{suffix[:10]}" if dot else kept[:_LONGEST]
    return f"_{kept}" if _RESERVED.match(kept) else kept


def free_place(folder: Path, name: str) -> Path:
    """Return a path in a folder that no file has yet, and take it.

    Parameters
    ----------
    folder : Path
        Made if it is missing.
    name : str
        Wanted; made harmless, and numbered where it is taken.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     places = [free_place(Path(folder), "a.csv") for _ in range(2)]
    >>> [place.name for place in places]
    ['a.csv', 'a-2.csv']
    """
    folder.mkdir(parents=True, exist_ok=True)
    wanted = folder / harmless_name(name)
    place, number = wanted, 1
    while True:
        try:
            place.touch(exist_ok=False)
        except FileExistsError:
            number += 1
            place = wanted.with_name(f"{wanted.stem}-{number}{wanted.suffix}")
        else:
            return place
