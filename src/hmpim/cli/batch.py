"""``hmpim batch``: many records, one table, one page."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.cli.crew import Scheduler, Workers
from hmpim.cli.files import check_files
from hmpim.cli.identify import Between
from hmpim.cli.reading import Input, Output, Rate, Time, Unit, units_of
from hmpim.cli.terminal import output_console, say, stopping, warn
from hmpim.errors import ArgumentError, RecordError

if TYPE_CHECKING:
    from hmpim.batch.run import State
    from hmpim.batch.table import BatchTable

__all__ = ["batch"]


class Kept(StrEnum):
    """How much is kept of each record."""

    RESULTS = "results"
    PARAMETERS = "parameters"


def batch(
    paths: Annotated[
        list[str],
        typer.Argument(
            metavar="PATHS",
            help="Folders, globs and files with records, local or any address of fsspec. A Parquet "
            "file with a column of records, or an HDF5 file with one group per record, holds many.",
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the table's parts.")
    ],
    input_: Input = None,
    output: Output = None,
    fs: Rate = None,
    time: Time = None,
    unit: Unit = None,
    intersample: Annotated[
        Between,
        typer.Option("--intersample", help="What the input does between samples."),
    ] = Between.AUTO,
    keep: Annotated[
        Kept,
        typer.Option(
            "--keep",
            help="Keep everything that identify finds, or only the parameters, which is faster.",
        ),
    ] = Kept.RESULTS,
    metadata: Annotated[
        Path | None,
        typer.Option("--metadata", metavar="FILE", help="CSV or Parquet with one row per record."),
    ] = None,
    record_column: Annotated[
        str,
        typer.Option("--record-column", metavar="NAME", help="Column that names the record."),
    ] = "record",
    group: Annotated[
        str, typer.Option("--group", metavar="PATH", help="HDF5 group that holds the records.")
    ] = "/",
    pool_by: Annotated[
        str,
        typer.Option(
            "--pool-by",
            metavar="NAME",
            help="Identify the records that share this column of metadata as one, such as a "
            "unit's serial number; all: one model for all records. Samples are not copied.",
        ),
    ] = "",
    lags: Annotated[
        int | None,
        typer.Option(
            "--lags",
            metavar="N",
            help="With --pool-by: window in samples, into which delay and settling time fit; a "
            "fifth of the first record by default.",
        ),
    ] = None,
    scheduler: Scheduler = None,
    workers: Workers = None,
    per_task: Annotated[
        int,
        typer.Option(
            "--per-task", metavar="N", help="Records per task, and per part of the table."
        ),
    ] = 100,
    expect: Annotated[
        list[str] | None,
        typer.Option(
            "--expect",
            metavar="BOUND",
            help="Check each record against this bound: 'delay < 5ms'; may be repeated.",
        ),
    ] = None,
    by: Annotated[
        list[str] | None,
        typer.Option("--by", metavar="NAME", help="Column of metadata to group by, on the page."),
    ] = None,
    report: Annotated[
        Path | None,
        typer.Option(
            "--report", metavar="FILE", help="File for the page; DIR/study.html by default."
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume/--fresh",
            help="Continue where an earlier run of the same batch stopped, or start afresh.",
        ),
    ] = True,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no table.")] = False,
) -> None:
    """Identify many records, on all cores or on a cluster.

    Writes Parquet parts that pandas, Polars and DuckDB read, and one page.
    A record that fails gets a row with the reason.
    If it is stopped, the same command continues from there.
    Exit code 1: a record does not meet a bound. 2: every record was refused.
    """
    page = out / "study.html" if report is None else report
    check_files(reads={"the metadata": metadata}, writes={"--report": page}, folders={"--out": out})
    if scheduler is not None and workers is not None:
        raise ArgumentError("--workers are those of this computer; --scheduler has its own")

    from hmpim.batch import Request
    from hmpim.batch.expect import read_bound
    from hmpim.batch.run import Cluster
    from hmpim.batch.run import batch as run
    from hmpim.batch.study import write_study

    bounds = [read_bound(text) for text in expect or ()]

    request = Request(
        inputs=tuple(input_ or ()),
        outputs=tuple(output or ()),
        fs=fs,
        time=time,
        units=units_of(unit),
        intersample=intersample.value,
        keep=keep.value,
        record_column=record_column,
        group=group,
        metadata="" if metadata is None else str(metadata.absolute()),
        pool_by=pool_by,
        lags=lags,
    )
    cluster = Cluster(scheduler=scheduler, workers=workers, per_task=per_task)
    with stopping(out, "parts/*.parquet", "parts"), _counting(quiet) as tick:
        table = run(
            paths, out=out, request=request, cluster=cluster, fresh=not resume, progress=tick
        )
    for name in by or ():
        if name not in table.metadata:
            known = ", ".join(table.metadata) or "none"
            raise ArgumentError(f"--by {name!r} is not a column of metadata; those are {known}")
    outcomes = write_study(table, page, bounds=bounds, by=by or ())
    if not quiet:
        _print(table)
        for outcome in outcomes:
            say(
                f"{outcome.bound.text}: {outcome.passed} meet it, {outcome.failed} do not, "
                f"{outcome.unsure} undecided, {outcome.untold} without the figure"
            )
        say(f"Parts: {out / 'parts'}")
        say(f"Page:  {page}")
    _check_any(table, page)
    if any(outcome.failed for outcome in outcomes):
        raise typer.Exit(1)


def _check_any(table: "BatchTable", page: Path) -> None:
    """Fail if every record was refused, as one such record does."""
    verdicts = table.to_arrow(["verdict"]).column(0)
    if not len(verdicts) or verdicts.null_count < len(verdicts):
        return
    from hmpim.batch.summary import summary_of

    why = summary_of(table).failures[0]
    raise RecordError(f"no record could be identified, as {page} shows; {why.first}: {why.reason}")


def _print(table: "BatchTable") -> None:
    """A line for each parameter: how many records have it, and how it is distributed."""
    from rich.table import Table

    from hmpim.batch.summary import summary_of

    found = summary_of(table)
    shown = Table(box=None, header_style="bold", pad_edge=False)
    for name in ("Parameter", "Records", "Median", "5 %", "95 %", "Doubtful"):
        shown.add_column(name, justify="left" if name == "Parameter" else "right")
    for row in found.parameters:
        shown.add_row(
            f"{row.name} ({row.unit})" if row.unit else row.name,
            str(row.count),
            *(f"{value:.5g}" for value in (row.median, row.low, row.high)),
            str(row.doubtful),
        )
    console = output_console()
    console.print(shown)
    console.print(
        f"{found.records} records; verdicts: "
        + (", ".join(f"{n} {v}" for v, n in found.verdicts.items()) or "none")
    )
    for failure in found.failures[:5]:
        more = f" and {failure.count - 1} more" if failure.count > 1 else ""
        console.print(
            f"Not identified: {failure.first}{more}: {failure.reason}",
            markup=False,
            highlight=False,
        )


@contextmanager
def _counting(quiet: bool) -> Iterator[Callable[["State"], None]]:
    """Give what is to be told of progress; a bar on a terminal, messages alone elsewhere."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    columns = (
        TextColumn("{task.completed:.0f} of {task.total:.0f}"),
        BarColumn(),
        TextColumn("{task.fields[rate]}"),
    )
    console = Console(stderr=True)
    off = quiet or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=off) as bar:
        task = bar.add_task("records", total=1, rate="starting")

        def tick(state: "State") -> None:
            if state.message and not quiet:
                warn(state.message)
            bar.update(task, completed=state.records, total=state.total, rate=_rate(state))

        yield tick


def _rate(state: "State") -> str:
    if state.rate <= 0:
        return "starting"
    left = state.left
    clock = f"{left / 3600:.1f} h" if left > 5400 else f"{left / 60:.0f} min" if left > 90 else ""
    failed = f", {state.failures} failed" if state.failures else ""
    return f"{state.rate:.1f}/s, {clock or f'{left:.0f} s'} left{failed}"
