"""Runs of a folder on a terminal: a list, and a comparison with the first."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from hmpim.errors import ArgumentError, RecordError
from hmpim.formats.runs import Folder, Run
from hmpim.identify import Identification
from hmpim.identify.uses.compare import Change, compare
from hmpim.plots.style import printable

if TYPE_CHECKING:
    from rich.console import Console

__all__ = ["compare_runs", "print_changes", "print_runs"]

_SHOWN = ("delay", "natural_frequency", "damping_ratio", "bandwidth_phase90", "scale_factor")


def print_runs(folder: Folder, runs: Sequence[Run], console: "Console") -> None:
    """Print a row for each run, and what could not be read.

    Parameters
    ----------
    folder : Folder
        What was found.
    runs : sequence of Run
        Those to show.
    console : rich.console.Console
        Where.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    table.add_column("Run", overflow="fold")
    table.add_column("Date", no_wrap=True)
    table.add_column("Channels", overflow="fold")
    table.add_column("Rate, length", justify="right")
    table.add_column("Verdict")
    table.add_column("Found", overflow="fold")
    for run in runs:
        cells = (
            run.name,
            run.created[:16].replace("T", " "),
            f"{', '.join(run.inputs)} → {', '.join(run.outputs)}",
            f"{run.fs:.6g} Hz, {run.duration:.4g} s",
            run.verdict.replace("_", " ") or "–",
            _found(run),
        )
        table.add_row(*(Text(printable(cell)) for cell in cells))
    console.print(f"{len(runs)} of {len(folder.runs)} runs")
    if runs:
        console.print(table)
    for name, why in folder.unreadable:
        console.print(Text(printable(f"{name} cannot be read: {why}")))


def compare_runs(runs: Sequence[Run]) -> list[tuple[Run, tuple[Change, ...]]]:
    """Compare the result of each run with that of the first; () where they share no parameter.

    Raises
    ------
    ArgumentError
        If fewer than two have one.
    """
    told = [run for run in runs if run.found is not None]
    if len(told) < 2:
        raise ArgumentError(
            f"{len(told)} of these runs have a result; to compare, at least two need one: "
            "hmpim identify RECORD --json RESULT"
        )
    first = told[0].found
    assert first is not None
    return [(run, _compared(run.found, first)) for run in told[1:] if run.found is not None]


def _compared(found: Identification, first: Identification) -> tuple[Change, ...]:
    try:
        return compare(found, first)
    except RecordError:  # nothing in common
        return ()


def print_changes(
    first: Run, changes: Sequence[tuple[Run, tuple[Change, ...]]], console: "Console"
) -> None:
    """Print what differs from the first run by more than both bars allow.

    Parameters
    ----------
    first : Run
        The one that the others are held against.
    changes : sequence of (Run, tuple of Change)
        As `compare_runs` returns them.
    console : rich.console.Console
        Where.
    """
    from rich.box import SIMPLE_HEAD
    from rich.table import Table
    from rich.text import Text

    console.print(Text(printable(f"Against {first.name}:")))
    table = Table(box=SIMPLE_HEAD, pad_edge=False)
    for name in ("Run", "Pair", "Parameter", "First", "This", "Deviations", ""):
        table.add_column(name)
    for run, found in changes:
        if not found:
            console.print(
                Text(printable(f"{run.name} has no parameter in common with {first.name}."))
            )
        shown = [c for c in found if c.changed or c.name in _SHOWN]
        for c in shown:
            cells = (
                run.name,
                f"{c.input} → {c.output}",
                c.name.replace("_", " "),
                str(c.old),
                str(c.new),
                f"{c.deviations:+.1f}",
                "changed" if c.changed else "",
            )
            table.add_row(*(Text(printable(cell)) for cell in cells))
    if table.row_count:
        console.print(table)


def _found(run: Run) -> str:
    """Parameters of the first pair that tells any, in words."""
    for pair in () if run.found is None else run.found.pairs:
        parts = [
            f"{name.replace('_', ' ')} {estimate}"
            for name in _SHOWN[:4]
            if (estimate := getattr(pair.parameters, name)) is not None
        ]
        if parts:
            more = (
                f" (and {len(run.found.pairs) - 1} pairs)"
                if run.found and run.found.pairs[1:]
                else ""
            )
            return "; ".join(parts) + more
    return "–"
