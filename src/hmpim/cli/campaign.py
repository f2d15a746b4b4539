"""``hmpim campaign``: a whole study from one plan."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from hmpim.cli.files import check_files, plan_file
from hmpim.cli.terminal import output_console, say, stopping
from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from hmpim.campaign.study import Study

__all__ = ["campaign"]

_MOST_TOLD = 8  # doubtful rows that the terminal names


def campaign(
    plan: Annotated[
        str | None,
        typer.Argument(
            metavar="PLAN.toml",
            help="A plan file, or a built-in plan: demo, example, section_v, section_v_reduced.",
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
            help="Continue where an earlier run of the same plan stopped, or start afresh.",
        ),
    ] = True,
    json_file: Annotated[
        Path | None, typer.Option("--json", metavar="FILE", help="A second place for study.json.")
    ] = None,
    document: Annotated[
        Path | None,
        typer.Option(
            "--document", metavar="FILE", help="A second place for the Markdown, with its pictures."
        ),
    ] = None,
    quiet: Annotated[bool, typer.Option("--quiet", help="No progress bar and no table.")] = False,
    example: Annotated[
        bool, typer.Option("--example", help="Print a plan that has every key, and stop.")
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
    path = plan_file(plan, PLANS, shipped_plan)
    wanted = read_plan(path)

    from hmpim.campaign.run import run_campaign
    from hmpim.campaign.study import check_earlier, make_study
    from hmpim.campaign.write import write_study
    from hmpim.formats.atomic import write_text

    earlier = None if not wanted.compare else path.parent / wanted.compare
    if earlier is not None and not earlier.is_file():
        raise ArgumentError(f"compare = {wanted.compare!r}: there is no file {earlier}")
    _check_files(out, {"the plan": path, "the earlier study": earlier}, json_file, document)
    if earlier is not None:
        check_earlier(wanted, earlier)
    with stopping(out, "cases/*.json", "cases"), _counting(quiet) as tick:
        cases = run_campaign(wanted, out, fresh=not resume, progress=tick)
        study = make_study(wanted, cases, earlier=earlier)
        write_study(study, out, document=document)
    if json_file is not None:
        write_text(json_file, (out / "study.json").read_text(encoding="utf-8"))
    if not quiet:
        _print(study)
        say(f"Page:    {out / 'study.html'}")
        say(f"Study:   {out / 'study.json'}")
    if study.met is False:
        raise typer.Exit(1)


def _check_files(
    out: Path, reads: Mapping[str, Path | None], json_file: Path | None, document: Path | None
) -> None:
    from hmpim.campaign.run import STAMP
    from hmpim.campaign.write import STUDY_FILES, pictures_folder

    if document is not None and not document.suffix:
        raise ArgumentError(f"--document {document} has no suffix; name it {document}.md")
    check_files(
        reads=reads,
        writes={
            "--json": json_file,
            "--document": document,
            "--out": [out / name for name in (STAMP, *STUDY_FILES)],
        },
        folders={"--out": out},
        owned={
            "--out": [out / "cases", pictures_folder(out / "study.md")],
            "--document": None if document is None else pictures_folder(document),
        },
    )


def _print(study: "Study") -> None:
    from rich.table import Table

    from hmpim.campaign.grids import bounds, case_grid, change_grid, doubtful_words
    from hmpim.campaign.write import headline

    whole = case_grid(study.rows, "")
    console = output_console()
    shown = Table(title=study.plan.name, box=None, header_style="bold", pad_edge=False)
    several = len({row.case_id for row in study.rows}) > 1
    # Of several cases the page has the rest: here each row is to stay on one line.
    more = () if several else ("fn (Hz)", "ζ")
    names = ("Axis", *_varied(study), "−90° (Hz)", *more, "Delay (ms)", "Verdict")
    at = [i for name in names for i, column in enumerate(whole.columns) if column.startswith(name)]
    for i in at:
        shown.add_column(whole.columns[i], overflow="fold", no_wrap=True)
    if study.checks:
        shown.add_column("Specification")
    for row, cells in zip(study.rows, whole.rows, strict=True):
        outcomes = [check.outcome for check in study.checks if check.row is row]
        met = ["fail" if "fail" in outcomes else "pass" if outcomes else ""]
        shown.add_row(*(cells[i] for i in at), *(met if study.checks else ()))
    console.print(shown)
    unsure = [row for row in study.rows if row.verdict != "ok"]
    several = len({row.test for row in study.rows}) > 1
    for row in unsure[:_MOST_TOLD]:
        where = f"{row.axis}, {row.test}" if several else row.axis
        figures = doubtful_words([row]) or "every figure"
        console.print(f"{row.verdict.replace('_', ' ')}: {where}: {figures}")
    if len(unsure) > _MOST_TOLD:
        console.print(f"and {len(unsure) - _MOST_TOLD} more rows, which the page names")
    for check in study.checks:
        if check.outcome == "fail":
            read = check.reading
            found = "no figure" if read is None else f"{read.value:.5g} {read.unit}".rstrip()
            wish = bounds(check.wanted.low, check.wanted.high)
            console.print(
                f"fail: {check.wanted.quantity} of {check.row.axis} in {check.row.case_id}: "
                f"{found}, wanted {wish}"
            )
    console.print(headline(study))
    if study.changes:
        console.print(change_grid(study).caption + ".")


def _varied(study: "Study") -> tuple[str, ...]:
    """Columns that tell the rows apart: the test, and what is not the same within one."""
    if not study.rows:
        return ()
    tests = {row.test for row in study.rows}
    fields = {"load": "Load", "mode": "Mode", "rate": "Rate (Hz)", "level": "Peak acc."}
    within = tuple(
        column
        for field, column in fields.items()
        if any(len({getattr(r, field) for r in study.rows if r.test == test}) > 1 for test in tests)
    )
    return (*(("Test",) if len(tests) > 1 else ()), *within)


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
