"""``hmpim runs``: a folder of runs is the database."""

from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.files import check_files
from hmpim.cli.terminal import output_console, working

__all__ = ["runs"]


def runs(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Where the runs are.")] = Path("."),
    where: Annotated[
        list[str] | None,
        typer.Option(
            "--where",
            metavar="CONDITION",
            help="Keep only the runs that meet it: 'delay > 3ms', 'verdict = ok', 'name = *roll*', "
            "'created >= 2026-11-20'; may be repeated.",
        ),
    ] = None,
    compare: Annotated[
        bool, typer.Option("--compare", help="Compare each result with the first.")
    ] = False,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the runs as JSON.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print no table.")] = False,
) -> None:
    """List the records and results in a folder; filter them, compare them with the first."""
    check_files(writes={"--json": json})

    from json import dumps

    from hmpim.formats.atomic import write_text
    from hmpim.formats.runs import files_of, filter_runs, find_runs, schema_of
    from hmpim.report.runs import compare_runs, print_changes, print_runs

    with working(f"Reading {folder}"):
        found = find_runs(folder)
    check_files(reads={"one of the runs": files_of(found, folder)}, writes={"--json": json})
    kept = filter_runs(found.runs, where or ())
    changes = compare_runs(kept) if compare else []
    if not quiet:
        print_runs(found, kept, output_console())
        if compare:
            first = next(run for run in kept if run.found is not None)
            print_changes(first, changes, output_console())
    if json is not None:
        data = {
            "schema": "hmpim/runs/1",
            "runs": [schema_of(run) for run in kept],
            "unreadable": dict(found.unreadable),
            "changes": [
                {"run": run.name, "pair": [c.output, c.input], "parameter": c.name}
                for run, held in changes
                for c in held
                if c.changed
            ],
        }
        write_text(json, dumps(data, indent=1) + "\n")
