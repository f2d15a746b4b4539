"""Write a study: HTML page, JSON, CSV, and Markdown with its pictures."""

import csv
import io
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from hmpim.campaign.compare import findings
from hmpim.campaign.grids import (
    PARAMETERS,
    axis_grid,
    case_grid,
    change_grid,
    check_grid,
    coupling_grid,
    doubtful_words,
    remark_grid,
)
from hmpim.campaign.pictures import section_pictures
from hmpim.campaign.plan import FigurePlan
from hmpim.campaign.sheets import write_sheets
from hmpim.campaign.study import Study, study_dict
from hmpim.formats.atomic import replacing, write_text
from hmpim.report.about import made_by
from hmpim.report.numbers import typeset
from hmpim.report.study import Grid, Section, StudyPage, render_study

__all__ = [
    "STUDY_FILES",
    "headline",
    "markdown",
    "pictures_folder",
    "study_csv",
    "study_page",
    "write_study",
]

STUDY_FILES = ("study.json", "study.csv", "study.html", "study.md")
"""What `write_study` writes, its pictures aside."""


_CASES = "Cases of this section"  # left out of the Markdown, which has them all in one table


def write_study(study: Study, folder: Path, *, document: Path | None = None) -> None:
    """Write ``study.html``, ``study.json``, ``study.csv``, ``study.md`` and its pictures.

    Parameters
    ----------
    study : Study
        What was found.
    folder : Path
        Where; it must exist.
    document : Path, optional
        A second place for the Markdown; its pictures go to a folder of its name beside it.
    """
    page = replace(study_page(study), sheets=write_sheets(study, folder))
    text = json.dumps(study_dict(study), indent=1, ensure_ascii=False, allow_nan=False)
    json_file, csv_file, html_file, markdown_file = (folder / name for name in STUDY_FILES)
    write_text(json_file, text + "\n")
    write_text(csv_file, study_csv(study))
    write_text(html_file, render_study(page))
    for place in (markdown_file, document):
        if place is None:
            continue
        pictures = pictures_folder(place)
        pictures.mkdir(parents=True, exist_ok=True)
        for number, section in enumerate(page.sections, start=1):
            for picture in section.pictures:
                with replacing(pictures / f"{number}-{picture.key}.svg") as path:
                    picture.figure.savefig(path, format="svg")
        write_text(place, markdown(page, pictures.name))


def pictures_folder(document: Path) -> Path:
    """Folder of the pictures of a Markdown document: beside it, and named as it is.

    Examples
    --------
    >>> pictures_folder(Path("out/study.md")).name
    'study'
    """
    return document.parent / document.stem


def headline(study: Study) -> str:
    """Whether the specification is met, and what is doubtful all the same."""
    count = len(study.checks)
    unsure = [row for row in study.rows if row.verdict != "ok"]
    resting = _resting(study)
    if study.met is None:
        said = f"{len(study.rows)} identifications; nothing was specified."
    elif study.met and count == 1:
        said = "The one check of the specification is met."
    elif study.met:
        said = f"All {count} checks of the specification are met."
    else:
        failed = sum(check.outcome == "fail" for check in study.checks)
        said = f"{failed} of {count} checks are not met."
    if resting:
        said += f" {resting} of them {'rests' if resting == 1 else 'rest'} on a doubtful figure."
    elif unsure and count:
        said += " No check rests on a doubtful figure."
    if unsure:
        names = doubtful_words(unsure)
        other = "other " if count and not resting else ""
        said += f" {len(unsure)} of {len(study.rows)} rows have {other}doubtful figures"
        said += f": {names}." if names else "."
    return said


def _resting(study: Study) -> int:
    """How many checks rest on a doubtful figure."""
    return sum(
        check.reading is not None and check.reading.verdict != "ok" for check in study.checks
    )


def study_page(study: Study) -> StudyPage:
    """Put a study into words, tables and pictures."""
    remarks = remark_grid(study.rows)
    grids = [
        *([axis_grid(study)] if study.rows else []),
        *([check_grid(study)] if study.checks else []),
        *([change_grid(study)] if study.changes else []),
        replace(
            case_grid(study.rows, "Every case: value ± standard deviation", explained=True),
            folded=True,
            at_end=True,
        ),
        *([] if remarks is None else [replace(remarks, folded=True, at_end=True)]),
    ]
    return StudyPage(
        title=study.plan.name,
        description=study.plan.description,
        headline=headline(study),
        met=study.met,
        doubtful=any(row.verdict != "ok" for row in study.rows),
        grids=tuple(grids),
        sections=tuple(_section(study, figure) for figure in study.plan.figures),
        facts=(
            ("Rig", study.plan.rig.kind),
            ("Cases", str(len({row.case_id for row in study.rows}))),
            ("Length of each test", f"{study.plan.duration:g} s, plus the return to rest"),
            ("Seed", str(study.plan.seed)),
            ("Plan", study.plan.digest[:12]),
            made_by(),
        ),
    )


def _section(study: Study, figure: FigurePlan) -> Section:
    axes = figure.axes
    rows = [row for row in study.rows if row.test in figure.tests and row.axis in axes]
    joint = {row.case_id for row in rows if row.together}
    if figure.compare == "excitation":
        rates = {row.rate for row in rows if row.together}
        rows = [row for row in rows if row.rate in rates]
        rows.sort(key=lambda row: axes.index(row.axis))
    elif figure.compare == "loads" and rows:
        rows = [row for row in rows if row.rate == max(r.rate for r in rows)]
    coupled = figure.compare in ("excitation", "axes")
    couplings = [c for c in study.couplings if c["case"] in joint and coupled]
    whole = len(rows) == len(study.rows)  # the page has them all in one table already
    grids = [] if whole else [replace(case_grid(rows, _CASES), on_screen=True)]
    if couplings:
        grids.append(coupling_grid(couplings))
    found = findings(rows, couplings, figure.compare)
    return Section(
        title=figure.title,
        observed=figure.observed,
        found=found,
        grids=tuple(grids),
        pictures=tuple(section_pictures(rows, figure, found)),
    )


def study_csv(study: Study) -> str:
    """Table of a study as CSV, one row for each axis of each case."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [name for name, _ in PARAMETERS]
    head = [
        "case",
        "test",
        "axis",
        "load",
        "mode",
        "rate",
        "level",
        "peak_acceleration",
        "together",
    ]
    for name in names:
        head += [name, f"{name}_std"]
    extra = ["bandwidth_from_response", "bandwidth_paper", "bandwidth_exact", "verdict"]
    writer.writerow([*head, *extra])
    for row in study.rows:
        cells: list[object] = [row.case_id, row.test, row.axis, row.load, row.mode, row.rate]
        cells += [row.level, row.peaks[2], int(row.together)]
        for name in names:
            reading = row.parameters.get(name)
            known = reading is not None and math.isfinite(reading.std)
            cells += [reading.value if reading else "", reading.std if reading and known else ""]
        measured = row.measured_bandwidth
        cells += [measured.value if measured else "", row.paper_bandwidth, row.exact_bandwidth]
        writer.writerow(["" if cell is None else cell for cell in [*cells, row.verdict]])
    return out.getvalue()


def markdown(page: StudyPage, pictures: str) -> str:
    """Study as Markdown; its pictures are in the folder `pictures` beside it."""
    lines = [f"# {page.title}", "", page.description, "", f"**{page.headline}**", ""]
    for number, section in enumerate(page.sections, start=1):
        lines += [f"## {section.title}", ""]
        if section.observed:
            lines += [
                f"The paper: {section.observed}"
                if "Fig" in section.title
                else f"Observed before: {section.observed}",
                "",
            ]
        lines += [f"- {sentence}" for sentence in section.found]
        lines += [""]
        for picture in section.pictures:
            lines += [f"![{picture.title}]({pictures}/{number}-{picture.key}.svg)", ""]
        for grid in section.grids:
            if grid.caption != _CASES:
                lines += _grid(grid)
    for grid in page.grids:
        lines += _grid(grid)
    lines += ["## About this study", ""]
    lines += [f"- {name}: {value}" for name, value in page.facts]
    return "\n".join(lines) + "\n"


def _grid(grid: Grid) -> list[str]:
    def line(cells: Sequence[str]) -> str:
        return "| " + " | ".join(typeset(cell).replace("|", "\\|") for cell in cells) + " |"

    ruler = line(["---"] * len(grid.columns))
    note = [grid.note, ""] if grid.note else []
    rows = map(line, grid.rows)
    return [f"**{grid.caption}**", "", line(grid.columns), ruler, *rows, "", *note]
