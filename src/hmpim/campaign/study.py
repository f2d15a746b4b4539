"""All cases of a campaign as rows: parameters with their errors, checks, couplings, comparison."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from hmpim.campaign.cases import expand
from hmpim.campaign.plan import QUANTITIES, Plan, Specification
from hmpim.errors import FormatError
from hmpim.identify import Estimate, ParameterVerdict

__all__ = [
    "SCHEMA",
    "Change",
    "Check",
    "Reading",
    "Row",
    "Study",
    "check_earlier",
    "earlier_parameters",
    "make_study",
    "study_dict",
]

SCHEMA = "hmpim/study/2"
_COMPARED = (SCHEMA, "hmpim/study/1")  # the first has no verdict for each figure
_APART = 3.0  # standard deviations, beyond which two readings count as different
_ROUNDING = 1e-9  # share of a reading: a step of the encoder is known to the last digit or two


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """A value, its standard deviation, infinite where the record cannot tell, and its verdict.

    `ci95` is its 95 % interval, None for one that is withheld or not known.
    """

    value: float
    std: float
    unit: str = ""
    verdict: ParameterVerdict = "ok"
    ci95: tuple[float | None, float | None] | None = None

    @property
    def estimate(self) -> Estimate:
        """The same as an estimate, which has no infinite error."""
        return Estimate(
            value=self.value, std=self.std, ci95=self.ci95, unit=self.unit, verdict=self.verdict
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Row:
    """One axis of one case.

    `pair` is what was identified, as in the result's JSON; `torque` the largest share of its
    limit that the axis was predicted to take, all that move together.
    """

    case_id: str
    test: str
    axis: str
    mode: str
    rate: float
    level: float
    load: str
    together: bool
    peaks: tuple[float, float, float]
    verdict: str
    parameters: dict[str, Reading]
    measured_bandwidth: Reading | None
    paper_bandwidth: float | None
    exact_bandwidth: float | None
    inertia: float | None
    torque: float | None
    stimulus: dict[str, Any]
    pair: dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Check:
    """One specification held against one row; `reading` is None where there is no figure."""

    row: Row
    wanted: Specification
    reading: Reading | None
    outcome: Literal["pass", "fail"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A quantity now and in an earlier study, and whether the two differ beyond their errors."""

    case_id: str
    axis: str
    quantity: str
    now: Reading
    before: Reading
    differs: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Study:
    """What a campaign found."""

    plan: Plan
    rows: tuple[Row, ...]
    checks: tuple[Check, ...]
    couplings: tuple[dict[str, Any], ...]
    changes: tuple[Change, ...]

    @property
    def met(self) -> bool | None:
        """Whether every specification is met; None where there is none."""
        if not self.plan.specifications:
            return None
        return all(check.outcome == "pass" for check in self.checks)


def make_study(
    plan: Plan, cases: Sequence[dict[str, Any]], *, earlier: Path | None = None
) -> Study:
    """Put the cases of a campaign together.

    Parameters
    ----------
    plan : Plan
        For its specifications.
    cases : sequence of dict
        As `run_campaign` returns them.
    earlier : Path, optional
        ``study.json`` of an earlier campaign to compare with.

    Raises
    ------
    FormatError
        If `earlier` is no study, or a specification fits no case.

    Examples
    --------
    >>> from hmpim.campaign.plan import read_plan
    >>> from hmpim.campaign.shipped import shipped_plan
    >>> from dataclasses import replace
    >>> plan = replace(read_plan(shipped_plan("example")), specifications=())
    >>> make_study(plan, []).met is None
    True
    """
    rows = tuple(
        _row(case, pair, stimulus)
        for case in cases
        for pair, stimulus in zip(case["pairs"], case["stimuli"], strict=True)
    )
    checks = []
    for number, wanted in enumerate(plan.specifications, start=1):
        subject = [row for row in rows if _concerns(wanted, row)]
        if not subject:
            raise FormatError(
                f"specification[{number}] fits no case of the plan; change or drop it"
            )
        checks += [_check(wanted, row) for row in subject]
    return Study(
        plan=plan,
        rows=rows,
        checks=tuple(checks),
        couplings=tuple(
            {"case": case["id"], **coupling} for case in cases for coupling in case["couplings"]
        ),
        changes=() if earlier is None else _changes(rows, earlier),
    )


def reading_of(data: dict[str, Any] | None) -> Reading | None:
    """Reading of an estimate in JSON; null has become of what was no number.

    Examples
    --------
    >>> reading_of({"value": 2.0, "std": None, "unit": "Hz"})
    Reading(value=2.0, std=inf, unit='Hz', verdict='ok', ci95=None)
    """
    if data is None or data["value"] is None:
        return None
    std = data["std"]
    return Reading(
        value=data["value"],
        std=math.inf if std is None else std,
        unit=data.get("unit", ""),
        verdict=data.get("verdict", "ok"),
        ci95=None if (ends := data.get("ci95")) is None else (ends[0], ends[1]),
    )


def _row(case: dict[str, Any], pair: dict[str, Any], stimulus: dict[str, Any]) -> Row:
    what = case["case"]
    found = {name: reading_of(pair["parameters"].get(name)) for name in QUANTITIES}
    return Row(
        case_id=case["id"],
        test=what["test"],
        axis=pair["axis"],
        mode=what["mode"],
        rate=what["rate"],
        level=what["level"],
        load=what["load"],
        together=what["together"],
        peaks=tuple(stimulus["peaks"]),
        verdict=pair["verdict"],
        parameters={name: reading for name, reading in found.items() if reading is not None},
        measured_bandwidth=reading_of(pair["bandwidths_from_response"]["bandwidth_phase90"]),
        paper_bandwidth=pair["paper"]["bandwidth_phase90"],
        exact_bandwidth=pair["known"].get("exact_bandwidth"),
        inertia=pair["known"].get("inertia"),
        torque=case["torque"].get(pair["axis"]),
        stimulus=stimulus,
        pair=pair,
    )


def _concerns(wanted: Specification, row: Row) -> bool:
    return all(
        limit is None or limit == getattr(row, name)
        for name, limit in (
            ("test", wanted.test),
            ("axis", wanted.axis),
            ("mode", wanted.mode),
            ("load", wanted.load),
            ("rate", wanted.rate),
        )
    )


def _check(wanted: Specification, row: Row) -> Check:
    reading = row.parameters.get(wanted.quantity)
    met = reading is not None and wanted.low <= reading.value <= wanted.high
    return Check(row=row, wanted=wanted, reading=reading, outcome="pass" if met else "fail")


def earlier_parameters(path: Path) -> dict[tuple[str, str], dict[str, Any]]:
    """Parameters of an earlier study by case and axis, from its ``study.json``.

    Raises
    ------
    FormatError
        If the file is no study.
    """
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        if data["schema"] not in _COMPARED:
            raise FormatError(f"{path} has schema {data['schema']!r}; {SCHEMA!r} is needed")
        return {(row["case"], row["axis"]): row["parameters"] for row in data["rows"]}
    except (ValueError, KeyError, TypeError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path} is not a study to compare with: {error!r}") from error


def check_earlier(plan: Plan, path: Path) -> None:
    """Refuse an earlier study with which there is nothing to compare, before anything moves.

    Raises
    ------
    FormatError
        If the file is no study, or has no case of the plan.
    """
    before = earlier_parameters(path)
    if not any((case.id, axis) in before for case in expand(plan) for axis in case.axes):
        known = next(iter(before), ("none",))[0]
        raise FormatError(
            f"{path} has no case of this plan (its first is {known}); compare with a study of "
            "the same tests, or drop compare"
        )


def _changes(rows: Sequence[Row], earlier: Path) -> tuple[Change, ...]:
    before = earlier_parameters(earlier)
    changes = []
    for row in rows:
        for quantity, now in row.parameters.items():
            then = reading_of(before.get((row.case_id, row.axis), {}).get(quantity))
            if then is None:
                continue
            spread = _APART * math.hypot(now.std, then.std)
            differs = abs(now.value - then.value) > max(spread, _ROUNDING * abs(then.value))
            changes.append(
                Change(
                    case_id=row.case_id,
                    axis=row.axis,
                    quantity=quantity,
                    now=now,
                    before=then,
                    differs=differs,
                )
            )
    return tuple(changes)


def study_dict(study: Study) -> dict[str, Any]:
    """Return a study as plain JSON values."""
    return {
        "schema": SCHEMA,
        "name": study.plan.name,
        "plan": study.plan.digest,
        "met": study.met,
        "rows": [
            {
                "case": row.case_id,
                "test": row.test,
                "axis": row.axis,
                "mode": row.mode,
                "rate": row.rate,
                "level": row.level,
                "load": row.load,
                "together": row.together,
                "peaks": list(row.peaks),
                "verdict": row.verdict,
                "parameters": {name: _json(r) for name, r in row.parameters.items()},
                "bandwidth_from_response": _json(row.measured_bandwidth),
                "bandwidth_paper": row.paper_bandwidth,
                "bandwidth_exact": row.exact_bandwidth,
                "torque_share": row.torque,
            }
            for row in study.rows
        ],
        "checks": [
            {
                "case": check.row.case_id,
                "axis": check.row.axis,
                "quantity": check.wanted.quantity,
                "min": _number(check.wanted.low),
                "max": _number(check.wanted.high),
                "value": None if check.reading is None else check.reading.value,
                "outcome": check.outcome,
            }
            for check in study.checks
        ],
        "couplings": list(study.couplings),
        "changes": [
            {
                "case": change.case_id,
                "axis": change.axis,
                "quantity": change.quantity,
                "now": _json(change.now),
                "before": _json(change.before),
                "differs": change.differs,
            }
            for change in study.changes
        ],
    }


def _json(reading: Reading | None) -> dict[str, Any] | None:
    if reading is None:
        return None
    return {
        "value": reading.value,
        "std": _number(reading.std),
        "unit": reading.unit,
        "verdict": reading.verdict,
        "ci95": None if reading.ci95 is None else list(reading.ci95),
    }


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
