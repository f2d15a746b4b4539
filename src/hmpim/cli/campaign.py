"""``hmpim campaign``: a whole study from one plan."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from hmpim.cli.terminal import output_console, say
from hmpim.errors import ArgumentError

__all__ = ["campaign"]


def campaign(
    plan: Annotated[
        str | None,
        typer.Argument(
            metavar="PLAN.toml",
            help="A plan, or one that ships: demo, example, section_v, section_v_reduced.",
            show_default=False,
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", help="Folder for the cases and the study.")
    ] = Path("out/campaign"),
    resume: Annotated[
        bool,
        typer.Option(
            "--resume/--fresh",
            help="Go on where an earlier run of the same plan stopped, or start anew.",
        ),
    ] = True,
    json_file: Annotated[
        Path | None, typer.Option("--json", help="A second place for study.json.")
    ] = None,
    document: Annotated[
        Path | None,
        typer.Option("--document", help="A second place for the Markdown, with its pictures."),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar and no table.")] = False,
    example: Annotated[
        bool, typer.Option("--example", help="Print a plan to start from, and stop.")
    ] = False,
) -> None:
    """Run a study: axes, command modes, update rates, levels and loads from one plan.

    Writes study.html, study.json, study.csv and study.md. Exit code 1: a limit of the
    specification is not met.
    """
    from hmpim.campaign.plan import read_plan
    from hmpim.campaign.shipped import PLANS, shipped_plan

    if example:
        print(shipped_plan("example").read_text(encoding="utf-8"), end="")
        return
    if plan is None:
        raise ArgumentError("PLAN.toml is missing; 'hmpim campaign --example' prints one")
    path = Path(plan)
    if plan not in PLANS and not path.exists():
        raise ArgumentError(
            f"there is no plan {plan}; give a file, or one that ships: {', '.join(PLANS)}"
        )
    wanted = read_plan(shipped_plan(plan) if plan in PLANS and not path.exists() else path)

    from hmpim.campaign.run import run_campaign
    from hmpim.campaign.study import earlier_parameters, make_study
    from hmpim.campaign.write import write_study
    from hmpim.cli.terminal import check_target

    check_target(json_file, "--json")
    check_target(document, "--document")
    earlier = None if not wanted.compare else path.parent / wanted.compare
    if earlier is not None and not earlier.is_file():
        raise ArgumentError(f"compare = {wanted.compare!r}: there is no file {earlier}")
    if earlier is not None:
        earlier_parameters(earlier)  # what cannot be read is refused before anything moves
    with _counting(quiet) as tick:
        cases = run_campaign(wanted, out, fresh=not resume, progress=tick)
        study = make_study(wanted, cases, earlier=earlier)
        write_study(study, out, document=document)
    if json_file is not None:
        json_file.write_text((out / "study.json").read_text(encoding="utf-8"), encoding="utf-8")
    if not quiet:
        _print(study)
        say(f"Page:    {out / 'study.html'}")
        say(f"Study:   {out / 'study.json'}")
    if study.met is False:
        raise typer.Exit(1)


def _print(study: object) -> None:
    from rich.table import Table

    from hmpim.campaign.study import Study
    from hmpim.campaign.write import study_page

    assert isinstance(study, Study)
    page = study_page(study)
    console = output_console()
    shown = Table(title=page.title, box=None, header_style="bold", pad_edge=False)
    names = ("−90° (Hz)", "fn (Hz)", "ζ", "Delay (ms)", "Verdict")
    several = len({row.case_id for row in study.rows}) > 1
    heads = (*(("Case",) if several else ()), "Axis", *names)
    for column in (*heads, *(("Specification",) if study.checks else ())):
        shown.add_column(column, overflow="fold")
    whole = page.grids[1] if study.checks else page.grids[0]
    at = [whole.columns.index(c) for c in names]
    for row, cells in zip(study.rows, whole.rows, strict=True):
        outcomes = [check.outcome for check in study.checks if check.row is row]
        met = ["fail" if "fail" in outcomes else "pass" if outcomes else ""]
        first = (row.case_id, row.axis) if several else (row.axis,)
        shown.add_row(*first, *(cells[i] for i in at), *(met if study.checks else ()))
    console.print(shown)
    for check in study.checks:
        if check.outcome == "fail":
            found = "no figure" if check.reading is None else f"{check.reading.value:.5g}"
            console.print(
                f"fail: {check.wanted.quantity} of {check.row.axis} in {check.row.case_id}: {found}"
            )
    console.print(page.headline)
    if study.changes:
        console.print(page.grids[-1].caption + ".")


@contextmanager
def _counting(quiet: bool) -> Iterator[Callable[[int, int, str], None]]:
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
    off = quiet or not console.is_terminal
    with Progress(*columns, console=console, transient=True, disable=off) as bar:
        task = bar.add_task("plan", total=None)
        yield lambda done, total, what: bar.update(
            task, completed=done, total=total, description=what
        )
