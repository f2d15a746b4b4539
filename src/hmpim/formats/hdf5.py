"""What is said of an HDF5 file that cannot be read, in place of the library's own words."""

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from hmpim.errors import FormatError, HmpimError

__all__ = ["fault_of", "faults_named"]

_CUT = re.compile(r"truncated file: eof = (\d+),.* stored_eof = (\d+)")


@contextmanager
def faults_named(path: Path) -> Iterator[None]:
    """Raise `fault_of` for whatever h5py raises within; our own errors pass."""
    try:
        yield
    except HmpimError:
        raise
    except Exception as error:  # OSError, KeyError, RuntimeError, ValueError, TypeError, …
        raise fault_of(path, error) from error


def fault_of(path: Path, error: Exception) -> FormatError:
    """Return the FormatError for an error of h5py's, which may be of many types.

    Examples
    --------
    >>> cut = OSError("… (truncated file: eof = 4548, sblock->base_addr = 0, stored_eof = 9096)")
    >>> print(fault_of(Path("r.h5"), cut))
    'r.h5' is cut short: 4548 of its 9096 bytes are there; copy it again
    """
    if isinstance(error, FileNotFoundError):
        return FormatError(f"there is no file {str(path)!r}; check the path")
    if cut := _CUT.search(str(error)):
        return FormatError(
            f"{path.name!r} is cut short: {cut[1]} of its {cut[2]} bytes are there; copy it again"
        )
    if isinstance(error, OSError) and error.errno:
        return FormatError(
            f"{path.name!r} cannot be opened: {os.strerror(error.errno)}; check its permissions, "
            "and that no other program writes to it"
        )
    return FormatError(f"{path.name!r} is damaged, or no HDF5 file; copy it again")
