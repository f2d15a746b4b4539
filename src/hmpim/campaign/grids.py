"""The tables of a study as text: every case, what was specified, remarked, coupled, changed."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from hmpim.campaign.study import Reading, Row, Study
from hmpim.plots.style import with_error
from hmpim.report.numbers import NOT_DETERMINED
from hmpim.report.study import Grid
from hmpim.report.words import GLOSSARY

__all__ = [
    "PARAMETERS",
    "axis_grid",
    "bounds",
    "case_grid",
    "change_grid",
    "check_grid",
    "coupling_grid",
    "doubtful_words",
    "remark_grid",
]

PARAMETERS = (
    ("bandwidth_phase90", "−90° (Hz)"),
    ("natural_frequency", "fn (Hz)"),
    ("damping_ratio", "ζ"),
    ("delay", "Delay (ms)"),
    ("noise_std", "Noise"),
    ("scale_factor", "Scale"),
    ("bias", "Bias"),
)
"""Parameters of the table of cases, and their columns."""

_POSITIVE = {words.name for words in GLOSSARY if words.positive}
_VAGUE = 10.0  # times its own size: an error of a delay that leaves nothing told
_LABELS = {words.name: words.label for words in GLOSSARY}
_INLINE = {words.name: words.inline for words in GLOSSARY}

_READING = (
    "−90° is that of the fitted model behind the hold, in every mode. −90° of the response is the "
    "same frequency, read off the measured response"
)
_DOUBTFUL = "A ? marks a doubtful figure; the others of its row are reliable"
_SIDES = "−a +b states how far a 95 % interval that is not symmetric reaches to either side"
_EXACT = (
    "−90° exact is the value for the linearised mechanics of the simulated table, without friction"
)
_NEGATIVE = (
    "A negative delay belongs to the fit, not to the unit: where feedforward or friction shape "
    "the response, the fit can trade delay against dynamics"
)


def case_grid(rows: Sequence[Row], caption: str, *, explained: bool = False) -> Grid:
    """Table of rows: every parameter with its error.

    Parameters
    ----------
    rows : sequence of Row
        In the order wanted.
    caption : str
        What stands over the table.
    explained : bool
        True says under the table how its columns are to be read.
    """
    exact = any(row.exact_bandwidth is not None for row in rows)
    units = {row.stimulus["unit"] for row in rows}
    unit = units.pop() if len(units) == 1 else ""
    of_unit = {"Noise": f"Noise ({unit})", "Bias": f"Bias ({unit})"} if unit else {}
    peak = f"Peak acc. ({unit}/s²)" if unit else "Peak acc."
    names = ("Axis", "Verdict", "Test", "Load", "At once", "Mode", "Rate (Hz)", peak)
    found = tuple(of_unit.get(label, label) for _, label in PARAMETERS)
    # A column that says the usual of every row says nothing, of a rig without loads above all.
    usual = {"Load": "acceptance", "Mode": "P", "At once": ""}
    said = [_READING, *([_EXACT] if exact else [])]
    if any(reading.verdict != "ok" for row in rows for reading in row.parameters.values()):
        said.append(_DOUBTFUL)
    if any((delay := row.parameters.get("delay")) and delay.value < 0.0 for row in rows):
        said.append(_NEGATIVE)
    told = [
        {
            **dict(zip(names, _named(row), strict=True)),
            **dict(zip(found, (_cell(row, name) for name, _ in PARAMETERS), strict=True)),
            "−90° of the response (Hz)": _shown(row.measured_bandwidth, "bandwidth_phase90"),
            **({"−90° exact (Hz)": _exact(row)} if exact else {}),
        }
        for row in rows
    ]
    columns = [
        name
        for name in (told[0] if told else names)
        if name not in usual or any(cells[name] != usual[name] for cells in told)
    ]
    if any(" +" in cell for cells in told for cell in cells.values()):
        said.append(_SIDES)
    return Grid(
        caption=caption,
        columns=tuple(columns),
        rows=tuple(tuple(cells[name] for name in columns) for cells in told),
        note=". ".join(said) + "." if explained else "",
        dense=True,
        beneath=("Verdict", "Load", "At once", *(["Rate (Hz)"] if "Mode" in columns else [])),
    )


def axis_grid(study: Study) -> Grid:
    """What is asked first: each axis, its bandwidth, what was specified, and the verdict.

    An axis that misses its specification shows the first case that does; else its first
    specified case, or its first case.
    """
    rows = []
    for axis in dict.fromkeys(row.axis for row in study.rows):
        checks = [check for check in study.checks if check.row.axis == axis]
        failed = [check for check in checks if check.outcome == "fail"]
        shown = next((check.row for check in [*failed, *checks]), None)
        row = shown or next(row for row in study.rows if row.axis == axis)
        wanted = [
            f"{_LABELS.get(c.wanted.quantity, c.wanted.quantity)} "
            f"{bounds(c.wanted.low, c.wanted.high)} {c.reading.unit if c.reading else ''}".rstrip()
            for c in checks
            if c.row is row
        ]
        rows.append(
            (
                axis,
                _cell(row, "bandwidth_phase90"),
                ("fail" if failed else "pass") if checks else "–",
                row.verdict.replace("_", " "),
                "; ".join(wanted) or "–",
                f"{len(checks) - len(failed)} of {len(checks)}" if checks else "–",
                doubtful_words([row]) or "–",
                row.test,
            )
        )
    columns = (
        "Axis",
        "−90° (Hz)",
        "Outcome",
        "Verdict",
        "Specification",
        "Checks met",
        "Doubtful figures",
        "Test",
    )
    caption = "Each axis: value ± standard deviation"
    if any(row[1].endswith("?") for row in rows):
        caption += "; ? marks a doubtful value"
    if any(" +" in row[1] for row in rows):
        caption += f"; {_SIDES}"
    return Grid(caption=caption, columns=columns, rows=tuple(rows))


def doubtful_words(rows: Sequence[Row], *, most: int = 4) -> str:
    """Names of the figures that are doubtful in some rows, the most frequent first.

    Examples
    --------
    >>> doubtful_words([])
    ''
    """
    count: dict[str, int] = {}
    for row in rows:
        for name, reading in row.parameters.items():
            if reading.verdict != "ok" and name in _LABELS:
                count[name] = count.get(name, 0) + 1
    names = sorted(count, key=lambda name: -count[name])
    told = [_INLINE[name] for name in names[:most]]
    return ", ".join([*told, f"{len(names) - most} more"] if len(names) > most else told)


def _named(row: Row) -> tuple[str, ...]:
    """What a row is about, and what it is worth."""
    return (
        row.axis,
        row.verdict.replace("_", " "),
        row.test,
        row.load,
        "axes at once" if row.together else "",
        row.mode,
        f"{row.rate:g}",
        _plain(row.peaks[2]),
    )


def _plain(value: float) -> str:
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.4g}"


def _exact(row: Row) -> str:
    return "–" if row.exact_bandwidth is None else f"{row.exact_bandwidth:.2f}"


def _cell(row: Row, name: str) -> str:
    reading = row.parameters.get(name)
    if name == "delay" and reading is not None and reading.std > _VAGUE * abs(reading.value):
        return "–"
    if name == "delay" and reading is not None:
        reading = _in_ms(reading)
    return _shown(reading, name)


def _in_ms(reading: Reading) -> Reading:
    ends = [None if end is None else 1e3 * end for end in reading.ci95 or ()]
    return replace(
        reading,
        value=1e3 * reading.value,
        std=1e3 * reading.std,
        ci95=(ends[0], ends[1]) if ends else None,
    )


def _with_unit(reading: Reading, name: str) -> str:
    shown = _shown(reading, name)
    return shown if shown == NOT_DETERMINED else f"{shown}\u00a0{reading.unit}".rstrip()


def _shown(reading: Reading | None, name: str) -> str:
    if reading is None:
        return "–"
    if name in _POSITIVE and math.inf > reading.std > abs(reading.value):
        return NOT_DETERMINED
    return with_error(reading.estimate) + ("" if reading.verdict == "ok" else " ?")


def check_grid(study: Study) -> Grid:
    """Every limit of the specification, checked in every case that it is for."""
    rows = []
    for check in study.checks:
        unit = "" if check.reading is None else check.reading.unit
        rows.append(
            (
                check.row.axis,
                check.row.case_id,
                _LABELS.get(check.wanted.quantity, check.wanted.quantity),
                f"{bounds(check.wanted.low, check.wanted.high)} {unit}".rstrip(),
                _shown(check.reading, check.wanted.quantity),
                check.outcome,
            )
        )
    columns = ("Axis", "Case", "Quantity", "Required", "Found", "Outcome")
    failed = sum(check.outcome == "fail" for check in study.checks)
    return Grid(
        caption=f"Specification: {len(rows) - failed} of {len(rows)} checks met",
        columns=columns,
        rows=tuple(rows),
        folded=not failed,
    )


def bounds(low: float, high: float) -> str:
    """Limits in words.

    Examples
    --------
    >>> bounds(20.0, math.inf)
    'at least 20'
    >>> bounds(0.99, 1.01)
    'at least 0.99 and at most 1.01'
    """
    said = [f"at least {low:g}"] if math.isfinite(low) else []
    said += [f"at most {high:g}"] if math.isfinite(high) else []
    return " and ".join(said)


def remark_grid(rows: Sequence[Row]) -> Grid | None:
    """Findings of the identifications: each kind once, with how many rows have it, and the first.

    None where there are none.
    """
    first: dict[str, str] = {}
    share: dict[str, list[bool]] = {}  # of the rows with this remark, whether it casts doubt
    for row in rows:
        warnings = row.pair["warnings"]
        doubts = {w["code"] for w in warnings if w["severity"] == "doubt"}
        for code, message in {w["code"]: w["message"] for w in warnings}.items():
            first.setdefault(code, f"{row.axis}, {row.test}: {message}")
            share.setdefault(code, []).append(code in doubts)
    if not first:
        return None
    unsure = sum(row.verdict != "ok" for row in rows)
    order = sorted(share, key=lambda code: -len(share[code]))
    return Grid(
        caption=f"Findings of the identifications; {unsure} of {len(rows)} verdicts are not ok",
        columns=("Finding", "Rows", "Casts doubt", "Example"),
        rows=tuple(
            (
                code.replace("_", " "),
                f"{len(share[code])}",
                f"{sum(share[code])}",
                first[code],
            )
            for code in order
        ),
        note="A verdict that is not ok means that at least one figure of the row is doubtful: "
        "either a linear model of few poles does not describe the unit fully, because of friction, "
        "for instance, or the record does not determine that parameter. The error bars state how "
        "well the best such model is known.",
    )


def change_grid(study: Study) -> Grid:
    """What differs from the earlier study beyond the errors of both."""
    moved = [change for change in study.changes if change.differs]
    shared = len({(change.case_id, change.axis) for change in study.changes})
    whole = "" if shared == len(study.rows) else f"; {shared} of {len(study.rows)} rows are in both"
    return Grid(
        caption=f"Compared with the earlier study: {len(moved)} of {len(study.changes)} figures "
        f"differ by more than three standard deviations{whole}",
        columns=("Axis", "Quantity", "Before", "Now", "Case"),
        rows=tuple(
            (
                change.axis,
                _LABELS.get(change.quantity, change.quantity),
                _with_unit(change.before, change.quantity),
                _with_unit(change.now, change.quantity),
                change.case_id,
            )
            for change in moved
        ),
    )


def coupling_grid(couplings: Sequence[dict[str, Any]]) -> Grid:
    """Gain from each command to each other position, beside the exact one where it is known."""
    low, high = couplings[0]["band"]
    exact = any(c.get("exact") is not None for c in couplings)
    rows = []
    for c in couplings:
        gain, std, true = c["gain"], c["std"], c.get("exact")
        known = gain is not None and std is not None
        value = f"{100 * gain:.3f} ± {100 * std:.3f}" if known else "–"
        clear = "yes" if known and gain > 3 * std else "no"
        truth = ("–" if true is None else f"{100 * true:.3f}",) if exact else ()
        rows.append((f"{c['from']} → {c['to']}", value, *truth, clear))
    return Grid(
        caption=f"Couplings from {low:g} to {high:g} Hz, median gain",
        columns=(
            "From → to",
            "Gain (% of the command)",
            *(("Exact (%)",) if exact else ()),
            "Above 3 std",
        ),
        rows=tuple(rows),
        note="A gain of less than three standard deviations is mostly noise: it limits how large "
        "the coupling may be, but does not measure it.",
    )
