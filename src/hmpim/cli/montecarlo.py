"""``hmpim montecarlo``: systems drawn and identified, held against the truth."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.cli.crew import Scheduler, Workers
from hmpim.cli.files import check_files, plan_file
from hmpim.cli.terminal import output_console, say, warn
from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from contextlib import AbstractContextManager

    from hmpim.batch.pool import Pool

__all__ = ["montecarlo"]


def montecarlo(
    plan: Annotated[
        str,
        typer.Argument(
            metavar="PLAN.toml", help="A plan file, or a built-in plan: field, random_systems."
        ),
    ],
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the draws and the page.")
    ] = Path("out/montecarlo"),
    draws: Annotated[
        int | None,
        typer.Option("--draws", metavar="N", help="Number of draws, in place of the plan's."),
    ] = None,
    scheduler: Scheduler = None,
    workers: Workers = None,
    json: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="Write the figures as JSON.")
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress, no table.")] = False,
) -> None:
    """Draw systems, stimuli and noise; identify each; compare the results with the truth.

    The same seed gives the same figures, whatever the number of workers. If it is stopped, the
    same command continues from there.
    """
    from dataclasses import replace
    from json import dumps

    from rich.console import Console
    from rich.progress import Progress

    from hmpim.batch.montecarlo import (
        PLANS,
        montecarlo_page,
        read_plan,
        run_montecarlo,
        shipped_plan,
        sum_up,
    )
    from hmpim.batch.pool import dask_pool, here_pool
    from hmpim.formats.atomic import write_text
    from hmpim.report.study import render_study

    path = plan_file(plan, PLANS, shipped_plan)
    wanted = read_plan(path)
    if draws is not None:
        if draws < 1:
            raise ArgumentError(f"--draws {draws}: give 1 or more")
        wanted = replace(wanted, draws=draws)
    page = out / "study.html"
    check_files(
        reads={"the plan": path}, writes={"--json": json, "--out": page}, folders={"--out": out}
    )

    def pool() -> "AbstractContextManager[Pool]":
        if workers == 0:
            return here_pool()
        return dask_pool(scheduler=scheduler, workers=workers, say=warn)

    console = Console(stderr=True)
    off = quiet or not console.is_terminal
    with Progress(console=console, transient=True, disable=off) as bar:
        task = bar.add_task("draws", total=wanted.draws)
        table = run_montecarlo(
            wanted, out, pool=pool, progress=lambda done, total: bar.update(task, completed=done)
        )
    found = sum_up(wanted, table)
    shown = montecarlo_page(wanted, found)
    write_text(page, render_study(shown))
    if json is not None:
        write_text(json, dumps(found.to_dict(), indent=1, allow_nan=False) + "\n")
    if quiet:
        return
    from rich.table import Table

    for grid in shown.grids:
        text = Table(title=grid.caption, box=None, header_style="bold", pad_edge=False)
        for name in grid.columns:
            text.add_column(name)
        for row in grid.rows:
            text.add_row(*row)
        output_console().print(text)
    say(shown.headline)
    say(f"Page: {page}")
