"""The page of a batch: each parameter's distribution, what stands out, trends, groups, bounds."""

import re
from collections.abc import Sequence
from datetime import datetime
from os import PathLike
from os.path import commonprefix

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.batch.between import between_units
from hmpim.batch.expect import Bound, Outcome, held_against
from hmpim.batch.pictures import FOR_A_MEDIAN, distribution, groups, sequence
from hmpim.batch.summary import ParameterSummary, Summary, column, summary_of
from hmpim.batch.table import BatchTable
from hmpim.formats.atomic import write_text
from hmpim.report.about import made_by
from hmpim.report.figures import Picture
from hmpim.report.numbers import plus_minus
from hmpim.report.study import Grid, Section, StudyPage, render_study
from hmpim.report.words import label_of
from hmpim.units import conversion_factor

__all__ = ["outliers", "study_page", "trend", "write_study"]

_HALF = 1.96
_TIMES = ("recorded", "date", "time", "datetime", "timestamp", "created")
"""Columns of metadata that may say when a record was made, before any other that holds dates."""

_BY_NAME = "Record, by name"
_SPANS = (("Days", 86_400.0), ("Hours", 3600.0), ("Minutes", 60.0), ("Seconds", 1.0))

_FALSE_ALARM = 0.01
"""Chance that any of a fleet of equal units, normally distributed, stands out."""

_FEWEST_ALONG, _MOST_ALONG = 10, 400
"""Values that a trend is looked for in at least, and medians of neighbours that tell it at most."""

_MOST_ROWS = 30
_FEWEST_IN_GROUP = 3
_MOST_GROUPS = 24

Real = NDArray[np.float64]


def write_study(
    table: BatchTable,
    path: str | PathLike[str],
    *,
    bounds: Sequence[Bound] = (),
    by: Sequence[str] = (),
) -> tuple[Outcome, ...]:
    """Write the page, and return how the bounds are met.

    Parameters
    ----------
    table : BatchTable
        What was found.
    path : path-like
        The HTML file.
    bounds : sequence of Bound
        What each record is held against.
    by : sequence of str
        Columns of metadata to group by; all that have 2 to 24 values by default.
    """
    outcomes = tuple(held_against(table, bound) for bound in bounds)
    write_text(path, render_study(study_page(table, outcomes=outcomes, by=by)))
    return outcomes


def study_page(
    table: BatchTable, *, outcomes: Sequence[Outcome] = (), by: Sequence[str] = ()
) -> StudyPage:
    """Put the page together.

    Parameters
    ----------
    table : BatchTable
        What was found.
    outcomes : sequence of Outcome
        How the bounds are met.
    by : sequence of str
        Columns of metadata to group by.
    """
    found = summary_of(table)
    failed = sum(failure.count for failure in found.failures)
    missed = sum(outcome.failed for outcome in outcomes)
    ok = found.verdicts.get("ok", 0)
    rows = sum(found.verdicts.values())
    headline = f"{found.records - failed} of {found.records} records identified; {ok} of {rows} ok."
    unsure = sum(outcome.unsure for outcome in outcomes)
    untold = sum(outcome.untold for outcome in outcomes)
    if missed:
        headline += f" {missed} outside the specification."
    elif outcomes:
        decided = not unsure and not untold
        headline += " All bounds are met." if decided else " None is outside the specification."
    headline += f" {unsure} undecided: the interval contains the bound." if unsure else ""
    headline += f" {untold} without the figure." if untold else ""
    labels = _labels(table, by)
    return StudyPage(
        title=f"{found.records} records",
        description="",
        headline=headline,
        met=None if not outcomes else missed == 0,
        doubtful=unsure + untold > 0,
        grids=(
            *_specified(outcomes),
            _figures(found),
            *_between(table, found),
            *_failures(table, found),
        ),
        sections=tuple(
            _section(table, row, outcomes, labels)
            for row in found.parameters
            if row.count > 1 or found.records == 1
        ),
        facts=(
            ("Folder", str(table.folder)),
            *([("Records in", folder)] if (folder := _folder(table)) else []),
            ("Parts", str(len(table.paths))),
            ("Settings", f"{table.request.keep}; inputs {table.request.inputs or 'as stated'}; "
             f"outputs {table.request.outputs or 'as stated'}"),
            made_by(),
        ),
    )  # fmt: skip


def outliers(values: Real, error: float = 0.0) -> tuple[Real, float]:
    """How far each value is from the middle, in robust deviations, and how far is too far.

    The deviation is 1.4826 times the median distance from the median, but no less than `error`.
    The threshold is the one that the farthest of so many normal values passes with a chance of
    1 %.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Finite.
    error : float
        Standard deviation of one value by its own noise or rounding: most values may be equal.

    Examples
    --------
    >>> away, limit = outliers(np.append(np.linspace(-1, 1, 99), 50.0))
    >>> np.flatnonzero(away > limit).tolist(), round(limit, 2)
    ([99], 3.89)
    >>> away, limit = outliers(np.append(np.full(99, 0.045), 0.040), error=0.0014)
    >>> bool((away > limit).any())
    False
    """
    middle = np.median(values)
    spread = max(1.4826 * float(np.median(np.abs(values - middle))), error)
    limit = float(-scipy.special.ndtri(_FALSE_ALARM / 2 / max(values.size, 1)))
    if spread == 0.0:
        return np.where(values == middle, 0.0, np.inf), limit
    return np.abs(values - middle) / spread, limit


def trend(places: Real, values: Real) -> tuple[float, float, float] | None:
    """Slope of values along their places, with its 99 % interval; None where that holds 0.

    The median of the slopes between all pairs (Theil and Sen), which a few outliers do not move; of
    many values between medians of neighbours.

    Parameters
    ----------
    places, values : ndarray, shape (n,)
        In the order of the places.

    Examples
    --------
    >>> day = np.arange(60.0)
    >>> noise = np.random.default_rng(0).standard_normal(60)
    >>> trend(day, noise) is None
    True
    >>> slope, low, high = trend(day, noise + 0.2 * day)
    >>> low < 0.2 < high
    True
    """
    if values.size < _FEWEST_ALONG or places[0] == places[-1]:
        return None
    shares = max(min(values.size, _MOST_ALONG), 1)
    at = np.array([np.median(part) for part in np.array_split(places, shares)])
    level = np.array([np.median(part) for part in np.array_split(values, shares)])
    slope, _, low, high = scipy.stats.theilslopes(level, at, alpha=1.0 - _FALSE_ALARM)
    return (float(slope), float(low), float(high)) if low > 0.0 or high < 0.0 else None


def _figures(found: Summary) -> Grid:
    return Grid(
        caption="Results",
        columns=("Parameter", "Records", "Median", "5 %", "95 %", "Doubtful"),
        rows=tuple(
            (
                label_of(row.name) + (f" ({row.unit})" if row.unit else ""),
                str(row.count),
                *(f"{value:.5g}" for value in (row.median, row.low, row.high)),
                str(row.doubtful),
            )
            for row in found.parameters
        ),
    )  # fmt: skip


def _between(table: BatchTable, found: Summary) -> tuple[Grid, ...]:
    """Mean of all records, and how much they differ beyond their error bars."""
    rows = []
    for row in found.parameters:
        values, errors = column(table, row.name), _own_errors(table, row.name)
        kept = np.isfinite(values) & np.isfinite(errors) & (errors > 0)
        if np.count_nonzero(kept) < _FEWEST_IN_GROUP:
            continue
        told = between_units(values[kept], errors[kept])
        low, high = told.spread_ci95
        rows.append(
            (
                label_of(row.name) + (f" ({row.unit})" if row.unit else ""),
                str(told.units),
                plus_minus(told.mean, told.mean_std),
                f"{told.spread:.3g}",
                f"{low:.3g} to {high:.3g}",
                f"{100 * told.share:.0f} %",
            )
        )
    if not rows:
        return ()
    grid = Grid(
        caption="Between records",
        columns=("Parameter", "Records", "Mean", "Spread", "95 % interval", "Share"),
        rows=tuple(rows),
        note=(
            "Spread: standard deviation between records beyond their error bars (random effects, "
            "restricted maximum likelihood). Share: part of the variance that is between records. "
            "Where intervals cover several models, the error bars are those of the likeliest one; "
            "another model would shift all records alike."
        ),
    )
    return (grid,)


def _specified(outcomes: Sequence[Outcome]) -> tuple[Grid, ...]:
    if not outcomes:
        return ()
    grid = Grid(
        caption="Specification",
        columns=("Bound", "Met", "Not met", "Undecided", "No figure", "Outcome"),
        rows=tuple(
            (
                o.bound.text,
                *(str(n) for n in (o.passed, o.failed, o.unsure, o.untold)),
                "fail" if o.failed else "undecided" if o.unsure or o.untold else "pass",
            )
            for o in outcomes
        ),
        note="Met and not met: the whole 95 % interval is on one side of the bound.",
    )
    return (grid,)


def _failures(table: BatchTable, found: Summary) -> tuple[Grid, ...]:
    if not found.failures:
        return ()
    some, folder = found.failures[:_MOST_ROWS], _folder(table)
    grid = Grid(
        caption="Not identified",
        columns=("First of them", "Records", "Reason"),
        rows=tuple((f.first.removeprefix(folder), str(f.count), f.reason) for f in some),
        hints=tuple(f.first for f in some),
    )
    return (grid,)


def _labels(table: BatchTable, by: Sequence[str]) -> dict[str, list[str | None]]:
    """Columns to group by, with the value of each row."""
    labels = {}
    for name in by or table.metadata:
        values = table.to_arrow([f"meta_{name}"]).column(0).to_pylist()
        kinds = {v for v in values if v is not None}
        if by or (2 <= len(kinds) <= _MOST_GROUPS and not all(map(_is_moment, kinds))):
            labels[name] = values
    return labels


def _section(
    table: BatchTable,
    row: ParameterSummary,
    outcomes: Sequence[Outcome],
    labels: dict[str, list[str | None]],
) -> Section:
    values = column(table, row.name)
    there = np.flatnonzero(np.isfinite(values))
    bounds = tuple(
        o.bound.number * (conversion_factor(o.bound.unit, to=row.unit) if o.bound.unit else 1.0)
        for o in outcomes
        if o.bound.name == row.name
    )
    some = values[there]
    title = label_of(row.name)
    shown = Picture(
        key=f"{row.name}-distribution",
        title=f"{title}: distribution",
        caption="Number of records; outliers are counted in the outermost bars.",
        description=f"Histogram of {row.name}.",
        figure=distribution(some, name=row.name, unit=row.unit, bounds=bounds),
    )
    course, drift = _course(table, row, some, there, bounds)
    said, grids = _standing_out(table, row, some, there)
    return Section(
        title=title,
        observed="",
        found=(*said, *drift),
        grids=grids,
        pictures=(shown, course, *_by_group(row, some, there, labels)),
    )


def _course(
    table: BatchTable,
    row: ParameterSummary,
    some: Real,
    there: NDArray[np.int64],
    bounds: tuple[float, ...],
) -> tuple[Picture, tuple[str, ...]]:
    """One record after the other, and what is said of a trend, if there is one."""
    places, along = _order(table, there)
    named = along == _BY_NAME
    order = np.argsort(places, kind="stable")
    picture = Picture(
        key=f"{row.name}-trend",
        title=f"{label_of(row.name)}: one after the other",
        caption=("Each record, by name" if named else f"Each record: {along.lower()}")
        + (", with the running median." if some.size >= FOR_A_MEDIAN else "."),
        description=f"{row.name} along {along.lower()}.",
        figure=sequence(
            places[order],
            some[order],
            name=row.name,
            unit=row.unit,
            along=along,
            bounds=bounds,
            names=_names(table, there) if named else (),
        ),
    )
    drift = trend(places[order], some[order])
    if drift is None:
        return picture, ()
    each = "record" if named else along.split("s since", 1)[0].lower()
    return picture, (_drift(drift, f"{row.unit} a {each}".strip()),)


def _by_group(
    row: ParameterSummary,
    some: Real,
    there: NDArray[np.int64],
    labels: dict[str, list[str | None]],
) -> tuple[Picture, ...]:
    """A picture for each column of metadata that parts the records into groups."""
    split = {by: _grouped(some, [words[k] for k in there]) for by, words in labels.items()}
    told = {by: grouped for by, grouped in split.items() if len(grouped) > 1}
    return tuple(
        Picture(
            key=f"{row.name}-by-{k}",
            title=f"{label_of(row.name)} by {by}",
            caption="Median of each group, with its range from 5 % to 95 %.",
            description=f"{row.name} by {by}.",
            figure=groups(grouped, name=row.name, unit=row.unit, by=by),
        )
        for k, (by, grouped) in enumerate(told.items(), start=2)
    )


def _drift(drift: tuple[float, float, float], unit: str) -> str:
    slope, *ends = drift
    verb = "rises" if slope > 0 else "falls"
    low, high = sorted(map(abs, ends))
    return f"It {verb} by {abs(slope):.3g} {unit} (99 % interval {low:.3g} to {high:.3g})."


def _standing_out(
    table: BatchTable, row: ParameterSummary, some: Real, there: NDArray[np.int64]
) -> tuple[tuple[str, ...], tuple[Grid, ...]]:
    """What is said of records far from the others, and the farthest of them."""
    errors = _own_errors(table, row.name)[there]
    errors = errors[np.isfinite(errors)]
    away, limit = outliers(some, float(np.median(errors)) if errors.size else 0.0)
    far = np.flatnonzero(away > limit)
    if not far.size:
        return (f"No record stands out (none beyond {limit:.1f} robust deviations).",), ()
    worst = far[np.argsort(-away[far], kind="stable")][:_MOST_ROWS]
    names = table.to_arrow(["record"]).column(0).take(there[worst]).to_pylist()
    folder = _folder(table)
    ends = [column(table, f"{row.name}_{end}")[there[worst]] for end in ("low", "high")]
    grid = Grid(
        caption="Records that stand out",
        columns=("Record", "Value", "95 % interval", "Robust deviations"),
        rows=tuple(
            (
                name.removeprefix(folder),
                f"{some[k]:.6g}",
                _interval(low, high),
                f"{away[k]:.1f}" if away[k] < 1e6 else "∞",
            )
            for name, k, low, high in zip(names, worst, *ends, strict=True)
        ),
        hints=tuple(names),
    )
    count = "1 record lies" if far.size == 1 else f"{far.size} records lie"
    return (f"{count} beyond {limit:.1f} robust deviations.",), (grid,)


def _own_errors(table: BatchTable, name: str) -> Real:
    """Standard deviation of each record's figure by its own noise, shape (n,).

    Of an interval that covers several models it is the shorter side over 1.96: the other reaches
    to what they say.
    """
    low, high = (column(table, f"{name}_{end}") for end in ("low", "high"))
    value, std = column(table, name), column(table, f"{name}_std")
    return np.where(np.isfinite(std), std, np.minimum(value - low, high - value) / _HALF)


def _interval(low: float, high: float) -> str:
    """An interval in words; an end that is open or withheld is a dash."""
    told = [f"{end:.6g}" if np.isfinite(end) else "–" for end in (low, high)]
    return " to ".join(told) if told != ["–", "–"] else "–"


def _order(table: BatchTable, there: NDArray[np.int64]) -> tuple[Real, str]:
    """When each record was made; without that, its place by name, `unit2` before `unit10`.

    Stamps closer than a second on average are when files were written, not when tests were made.
    """
    named = [name for name in _TIMES if name in table.metadata]
    for name in (*named, *(name for name in table.metadata if name not in named)):
        words = table.to_arrow([f"meta_{name}"]).column(0).take(there).to_pylist()
        if not words or _stamp(words[0]) is None:
            continue
        stamps = [_stamp(word) for word in words]
        if all(stamp is not None for stamp in stamps):
            seconds = np.array(stamps, dtype=np.float64)
            seconds -= seconds.min()
            if seconds.max() < seconds.size:
                continue
            unit, length = next(u for u in _SPANS if seconds.max() >= 2.0 * u[1] or u[1] == 1.0)
            return seconds / length, f"{unit} since the first ({name})"
    names = table.to_arrow(["record"]).column(0).take(there).to_pylist()
    order = sorted(range(len(names)), key=lambda k: _counted(names[k]))
    places = np.empty(len(names))
    places[order] = np.arange(len(names))
    return places, _BY_NAME


def _counted(name: str) -> tuple[str | int, ...]:
    """A name in pieces that compare as people count: words and whole numbers in turn."""
    return tuple(int(w) if k % 2 else w for k, w in enumerate(re.split("([0-9]+)", name)))


def _names(table: BatchTable, there: NDArray[np.int64]) -> tuple[str, ...]:
    """Names of the records in their order, without the folder that all have in common."""
    names = table.to_arrow(["record"]).column(0).take(there).to_pylist()
    names.sort(key=_counted)
    folder = _folder(table)
    return tuple(name.removeprefix(folder) for name in names)


def _folder(table: BatchTable) -> str:
    """The folder that all records have in common, up to its slash; empty if there is none."""
    names = table.to_arrow(["record"]).column(0).to_pylist()
    begun = str(commonprefix(names))  # noqa: RUF071 - addresses, not paths; cut at a slash
    return begun[: begun.rfind("/") + 1]


def _stamp(word: str | None) -> float | None:
    try:
        # A serial number such as 20260101 is no date.
        return datetime.fromisoformat(word).timestamp() if word and {"-", "T"} & set(word) else None
    except ValueError:
        return None


def _is_moment(word: str) -> bool:
    """Whether a label is a time of day: those of one minute are no group."""
    return ":" in word and _stamp(word) is not None


def _grouped(values: Real, labels: Sequence[str | None]) -> dict[str, Real]:
    """Values by label, groups of three and more, in the order of their names."""
    kinds: dict[str, list[float]] = {}
    for value, label in zip(values, labels, strict=True):
        if label is not None:
            kinds.setdefault(label, []).append(float(value))
    return {k: np.array(kinds[k]) for k in sorted(kinds) if len(kinds[k]) >= _FEWEST_IN_GROUP}
