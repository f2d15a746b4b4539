"""What the command line says: results to standard output, the rest to standard error."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["output_console", "say", "stopping", "warn", "working"]

_WIDTH_OF_FILES = 120  # columns where the output is no terminal, so that no row is cut


def output_console() -> "Console":
    """Return the console for results.

    Examples
    --------
    >>> output_console().print("delay 0.15 s")
    delay 0.15 s
    """
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    if not console.is_terminal:
        console = Console(highlight=False, width=_WIDTH_OF_FILES)
    return console


def say(text: str) -> None:
    """Print one line of plain text, such as where a file went.

    Examples
    --------
    >>> say("Page: r.html")
    Page: r.html
    """
    from hmpim.plots.style import printable

    print(printable(text))


def warn(text: str) -> None:
    """Print one line of plain text to standard error.

    Examples
    --------
    >>> warn("a reader is skipped")
    """
    from hmpim.plots.style import printable

    print(f"hmpim: {printable(text)}", file=sys.stderr)


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show on a terminal that something is under way; say nothing in a pipe or a log.

    Examples
    --------
    >>> with working("Fitting"):
    ...     pass
    """
    from rich.console import Console

    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(f"{what} …"):
        yield


@contextmanager
def stopping(folder: Path, files: str, what: str) -> Iterator[None]:
    """Say on Ctrl-C that nothing is lost, and how many `files` of the folder there are.

    Parameters
    ----------
    folder : Path
        Where the work is kept.
    files : str
        Pattern of what is done, below the folder.
    what : str
        What they are called.
    """
    try:
        yield
    except KeyboardInterrupt:
        done = len(list(folder.glob(files)))
        warn(
            f"stopped; {folder} keeps what is done ({what}: {done}), and the same command "
            "goes on from there"
        )
        raise
