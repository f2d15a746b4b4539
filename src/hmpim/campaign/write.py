"""Write a study: HTML page, JSON, CSV, and Markdown with its pictures."""

import csv
import io
import json
import math
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hmpim.campaign.compare import HEARD, case_label, findings
from hmpim.campaign.plan import FigurePlan
from hmpim.campaign.study import Reading, Row, Study, study_dict
from hmpim.identify import PairIdentification
from hmpim.plots.curves import BodeCurve, measured_curve, model_curve
from hmpim.plots.fence import picket_fence
from hmpim.plots.overlay import overlaid_bode, overlaid_levels
from hmpim.report.figures import Picture
from hmpim.report.files import replacing
from hmpim.report.numbers import plus_minus
from hmpim.report.study import Grid, Section, StudyPage, render_study

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["markdown", "study_csv", "study_page", "table", "write_study"]

COLUMNS = (
    ("bandwidth_phase90", "−90° (Hz)"),
    ("natural_frequency", "fn (Hz)"),
    ("damping_ratio", "ζ"),
    ("delay", "Delay (ms)"),
    ("noise_std", "Noise"),
    ("scale_factor", "Scale"),
    ("bias", "Bias"),
)

_TOLD = ("delay", "natural_frequency", "damping_ratio", "bandwidth_phase90")
_VAGUE = 10.0  # times its own size: an error that leaves nothing told

_CASES = "Cases of this section"  # left out of the Markdown, which has them all in one table

_CLEAR = 0.3  # share of the response: what is less sure is left out of the pictures


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
    page = study_page(study)
    text = json.dumps(study_dict(study), indent=1, ensure_ascii=False, allow_nan=False)
    _write(folder / "study.json", text + "\n")
    _write(folder / "study.csv", study_csv(study))
    _write(folder / "study.html", render_study(page))
    for place in (folder / "study.md", document):
        if place is None:
            continue
        pictures = place.parent / place.stem
        pictures.mkdir(parents=True, exist_ok=True)
        for number, section in enumerate(page.sections, start=1):
            for picture in section.pictures:
                with replacing(pictures / f"{number}-{picture.key}.png") as path:
                    picture.figure.savefig(path, format="png", dpi=110)
        _write(place, markdown(page, pictures.name))


def _write(path: Path, text: str) -> None:
    with replacing(path) as place:
        place.write_text(text, encoding="utf-8")


def study_page(study: Study) -> StudyPage:
    """Put a study into words, tables and pictures."""
    passed = sum(check.outcome == "pass" for check in study.checks)
    if study.met is None:
        headline = f"{len(study.rows)} identifications; nothing was specified."
    elif study.met:
        headline = (
            f"All {len(study.checks)} checks of the specification are met."
            if len(study.checks) > 1
            else "The one check of the specification is met."
        )
    else:
        headline = f"{len(study.checks) - passed} of {len(study.checks)} checks are not met."
    grids = [table(study.rows, "Every case: value ± standard deviation")]
    if study.checks:
        grids.insert(0, _checks(study))
    if study.changes:
        grids.append(_changes(study))
    return StudyPage(
        title=study.plan.name,
        description=study.plan.description,
        headline=headline,
        met=study.met,
        grids=tuple(grids),
        sections=tuple(_section(study, figure) for figure in study.plan.figures),
        facts=(
            ("Rig", study.plan.rig.kind),
            ("Cases", str(len({row.case_id for row in study.rows}))),
            ("Length of each sweep", f"{study.plan.duration:g} s"),
            ("Seed", str(study.plan.seed)),
            ("Plan", study.plan.digest[:12]),
            ("Made by", f"hmpim {version('hmpim')}"),
        ),
    )


def table(rows: Sequence[Row], caption: str) -> Grid:
    """Table of rows: every parameter with its error, as text."""
    exact = any(row.exact_bandwidth is not None for row in rows)
    names = ("Axis", "Test", "Load", "Mode", "Rate (Hz)", "Peak acc.", "At once")
    found = tuple(label for _, label in COLUMNS)
    return Grid(
        caption=caption,
        columns=(
            *names,
            *found,
            "−90° of the response (Hz)",
            *(("−90° exact (Hz)",) if exact else ()),
            "Verdict",
        ),
        rows=tuple(
            (
                row.axis,
                row.test,
                row.load,
                row.mode,
                f"{row.rate:g}",
                f"{row.peaks[2]:.4g}",
                "yes" if row.together else "",
                *(_cell(row, name) for name, _ in COLUMNS),
                _shown(row.measured_bandwidth),
                *((_exact(row),) if exact else ()),
                row.verdict.replace("_", " "),
            )
            for row in rows
        ),
    )


def _exact(row: Row) -> str:
    return "–" if row.exact_bandwidth is None else f"{row.exact_bandwidth:.2f}"


def _cell(row: Row, name: str) -> str:
    reading = row.parameters.get(name)
    if reading is not None and name in _TOLD and reading.std > _VAGUE * abs(reading.value):
        return "–"
    if name == "delay" and reading is not None:
        reading = Reading(value=1e3 * reading.value, std=1e3 * reading.std)
    return _shown(reading)


def _shown(reading: Reading | None) -> str:
    return "–" if reading is None else plus_minus(reading.value, reading.std)


def _checks(study: Study) -> Grid:
    rows = []
    for check in study.checks:
        low, high = check.wanted.low, check.wanted.high
        bounds = [f"at least {low:g}"] if math.isfinite(low) else []
        bounds += [f"at most {high:g}"] if math.isfinite(high) else []
        unit = "" if check.reading is None else check.reading.unit
        rows.append(
            (
                check.row.axis,
                check.row.case_id,
                check.wanted.quantity,
                f"{' and '.join(bounds)} {unit}".rstrip(),
                _shown(check.reading),
                check.outcome,
            )
        )
    columns = ("Axis", "Case", "Quantity", "Wanted", "Found", "Outcome")
    return Grid(caption="Specification", columns=columns, rows=tuple(rows))


def _changes(study: Study) -> Grid:
    moved = [change for change in study.changes if change.differs]
    return Grid(
        caption=f"Against the earlier study: {len(moved)} of {len(study.changes)} figures differ "
        "by more than three standard deviations",
        columns=("Axis", "Case", "Quantity", "Before", "Now"),
        rows=tuple((c.axis, c.case_id, c.quantity, _shown(c.before), _shown(c.now)) for c in moved),
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
    grids = [] if whole else [table(rows, _CASES)]
    if couplings:
        grids.append(_couplings(couplings))
    found = findings(rows, couplings, figure.compare)
    return Section(
        title=figure.title,
        observed=figure.observed,
        found=found,
        grids=tuple(grids),
        pictures=tuple(_pictures(rows, figure, found)),
    )


def _couplings(couplings: Sequence[dict[str, Any]]) -> Grid:
    low, high = couplings[0]["band"]
    rows = []
    for c in couplings:
        gain, std = c["gain"], c["std"]
        known = gain is not None and std is not None
        value = f"{100 * gain:.3f} ± {100 * std:.3f}" if known else "–"
        clear = "yes" if known and gain > 3 * std else "no"
        rows.append((f"{c['from']} → {c['to']}", value, clear))
    return Grid(
        caption=f"Couplings from {low:g} to {high:g} Hz, median gain",
        columns=("From → to", "Gain (% of the command)", "Beyond three std"),
        rows=tuple(rows),
    )


def _pictures(rows: Sequence[Row], figure: FigurePlan, found: Sequence[str]) -> list[Picture]:
    pictures = []
    words = " ".join(found)
    if figure.compare == "stimulus":
        levels = [
            (
                case_label(row, "stimulus"),
                np.array(row.stimulus["frequency"]),
                np.array(row.stimulus["level_db"]),
            )
            for row in rows
        ]
        unit = rows[0].stimulus["unit"] if rows else ""
        return [
            _picture("levels", figure.title, words, overlaid_levels(levels, unit=unit, level=HEARD))
        ]
    if figure.compare == "axes":
        every = [
            (case_label(row, "axes"), curve) for row in rows if (curve := _curve(row)) is not None
        ]
        return [_picture("axes", figure.title, words, overlaid_bode(every))] if every else []
    for axis in dict.fromkeys(row.axis for row in rows):
        if figure.compare == "fence":
            drawn = _fence([row for row in rows if row.axis == axis])
            pictures.append(_picture(axis, f"{figure.title}: {axis}", words, drawn))
            continue
        curves = [
            (case_label(row, figure.compare), curve)
            for row in rows
            if row.axis == axis and (curve := _curve(row)) is not None
        ]
        if curves:
            pictures.append(_picture(axis, f"{figure.title}: {axis}", words, overlaid_bode(curves)))
    return pictures


def _fence(rows: Sequence[Row]) -> "Figure":
    """Close-up of the upper half of the band, bin by bin."""
    low, high = rows[0].stimulus["band"]
    records = []
    for row in rows:
        bins = row.pair["bins"]
        ratio = np.array(bins["real"]) + 1j * np.array(bins["imag"])
        records.append((case_label(row, "fence"), np.array(bins["frequency"]), ratio, _curve(row)))
    return picket_fence(records, band=(max(low, 0.55 * high), 0.75 * high))


def _picture(key: str, title: str, words: str, drawn: "Figure") -> Picture:
    return Picture(key=key, title=title, caption=title + ".", description=words, figure=drawn)


def _curve(row: Row) -> BodeCurve | None:
    """Measured response of a row; its phase unwrapped beside the model's."""
    parameters = {
        name: estimate if estimate and estimate["std"] is not None else None
        for name, estimate in row.pair["parameters"].items()
    }
    scale = row.pair["parameters"]["scale_factor"]
    if scale is not None:  # a curve needs its value alone
        sure = {"std": 0.0, "ci95": [scale["value"], scale["value"]], "unit": scale["unit"]}
        parameters["scale_factor"] = {"value": scale["value"], **sure}
    response = dict(row.pair["frequency_response"])
    response["std"] = [math.inf if std is None else std for std in response["std"]]
    response["coherence"] = None
    runs: list[list[int]] = [[]]  # of neighbouring frequencies that are clear
    for k, std in enumerate(response["std"]):
        if std < _CLEAR * math.hypot(response["real"][k], response["imag"][k]):
            runs[-1].append(k)
        else:
            runs.append([])
    clear = max(runs, key=len)
    for name in ("frequency", "real", "imag", "std"):
        response[name] = [response[name][k] for k in clear]
    pair = PairIdentification.from_dict(
        {
            **row.pair,
            "parameters": parameters,
            "frequency_response": response,
            "bandwidths_from_response": {},
            "candidates": [],
        }
    )
    seen = pair.frequency_response.frequency
    seen = seen[seen > 0]
    if not seen.size:
        return None
    return measured_curve(pair.frequency_response, near=model_curve(pair, seen, fs=row.rate))


def study_csv(study: Study) -> str:
    """Table of a study as CSV, one row for each axis of each case."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [name for name, _ in COLUMNS]
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
            lines += [f"![{picture.title}]({pictures}/{number}-{picture.key}.png)", ""]
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
        return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"

    ruler = line(["---"] * len(grid.columns))
    return [f"**{grid.caption}**", "", line(grid.columns), ruler, *map(line, grid.rows), ""]
