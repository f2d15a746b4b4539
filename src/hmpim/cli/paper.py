"""``hmpim paper``: the paper's figures and its printed numbers, made again."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.terminal import say
from hmpim.errors import ArgumentError

__all__ = ["paper"]


def paper(
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for pictures, table and page.")
    ] = Path("out/paper"),
    figures: Annotated[
        list[str] | None,
        typer.Option(
            "--figures",
            metavar="NUMBER...",
            help="Only these figures, such as 12 13; by default all that need no motion table.",
        ),
    ] = None,
    more: Annotated[list[str] | None, typer.Argument(metavar="[NUMBER]...", hidden=True)] = None,
) -> None:
    """Reproduce the paper's figures, and a table of its printed values next to ours.

    Writes each figure as PNG and SVG, the table as table.md and table.json, and index.html
    with all of it.
    """
    wanted = _numbers(figures or [], more or [])
    check_files(folders={"--out": out})

    from hmpim.report.paper import FIGURES, make_study, write_study

    with _counting(2 * len(wanted or FIGURES) + 3) as tick:
        study = make_study(wanted, tick=tick)
        write_study(study, out, tick=tick)
    say(f"Figures: {len(study.pictures)}, rows of the table: {len(study.rows)}")
    say(f"Page:    {out / 'index.html'}")


def _numbers(given: Sequence[str], more: Sequence[str]) -> list[int] | None:
    """Numbers of ``--figures 12 13``, of which only the first belongs to the option itself.

    Examples
    --------
    >>> _numbers(["12"], ["13"]), _numbers(["12,13"], []), _numbers([], [])
    ([12, 13], [12, 13], None)
    """
    if more and not given:
        raise ArgumentError(f"{more[0]!r} is not understood; write --figures {more[0]}")
    words = [word for text in (*given, *more) for word in text.split(",") if word]
    for word in words:
        if not word.isdecimal():
            raise ArgumentError(
                f"--figures {word!r} is not a figure's number; write --figures 12 13"
            )
    return sorted({int(word) for word in words}) or None


@contextmanager
def _counting(total: int) -> Iterator[Callable[[str], None]]:
    """Give what is to be told of each step; a bar on a terminal, nothing elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.percentage:>3.0f} %"),
        BarColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.description}"),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as bar:
        task = bar.add_task("Fig. 2", total=total)
        yield lambda what: bar.update(task, advance=1, description=what)
