"""The folder of the runs: listed, held against each other and against a specification."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hmpim.errors import ArgumentError
from hmpim.formats.files import read
from hmpim.formats.runs import Run, asked_of, filter_runs, find_runs
from hmpim.formats.saving import load, save
from hmpim.identify import Estimate, Identification, PairIdentification, identify
from hmpim.plots import Figure
from hmpim.plots.curves import measured_curve, model_curve
from hmpim.plots.overlay import overlaid_bode
from hmpim.plots.trend import trend
from hmpim.record import Record
from hmpim.report import format_estimate
from hmpim.report.numbers import typeset
from hmpim.report.words import GLOSSARY, label_of

__all__ = ["Compared", "Listed", "Row", "compared", "listed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """A run as the table shows it; `met` is '' without a specification or a result."""

    name: str
    file: str
    date: str
    channels: str
    length: str
    verdict: str
    met: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Listed:
    """Runs of a folder, and files of ours that are damaged."""

    rows: tuple[Row, ...]
    unreadable: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compared:
    """Runs over each other: cells by parameter, a Bode plot, one parameter from run to run."""

    columns: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    bode: Figure
    trend: Figure


def listed(folder: str, where: str, specification: str) -> Listed:
    """List the runs of a folder that meet a condition.

    Parameters
    ----------
    folder : str
        Where they are.
    where, specification : str
        Conditions as ``hmpim runs --where`` takes them, parted by commas; '' for none.
    """
    found = find_runs(folder)
    kept = filter_runs(found.runs, _conditions(where))
    wanted = _conditions(specification)
    good = {run.name for run in filter_runs(kept, wanted)} if wanted else set()
    return Listed(
        rows=tuple(_row(run, wanted, good) for run in kept),
        unreadable=found.unreadable,
    )


def _conditions(text: str) -> list[str]:
    return [part.strip() for part in text.split(",") if part.strip()]


def _row(run: Run, wanted: Sequence[str], good: set[str]) -> Row:
    met = "" if not wanted or run.found is None else "ok" if run.name in good else "fail"
    return Row(
        name=run.name,
        file="" if run.record is None else run.name,
        date=run.created[:16].replace("T", " "),
        channels=f"{', '.join(run.inputs)} → {', '.join(run.outputs)}",
        length=f"{run.fs:.6g} Hz, {run.duration:.4g} s",
        verdict=run.verdict.replace("_", " "),
        met=met,
    )


def compared(
    folder: str, names: Sequence[str], parameter: str, pair: str, specification: str = ""
) -> Compared:
    """Hold runs against each other; one that was not identified yet is, and its result kept.

    Parameters
    ----------
    folder : str
        Where they are.
    names : sequence of str
        Of two runs or more.
    parameter : str
        Which one is drawn from run to run.
    pair : str
        "output from input" of the pair; the first of each run where it has no such pair.
    specification : str
        Conditions, parted by commas; what they ask of the parameter is drawn.

    Raises
    ------
    ArgumentError
        If fewer than two are chosen, or one is not there.
    """
    if len(names) < 2:
        chosen = "one run is" if names else "no run is"
        raise ArgumentError(f"{chosen} chosen; choose two or more to compare")
    known = {run.name: run for run in find_runs(folder).runs}
    missing = [name for name in names if name not in known]
    if missing:
        raise ArgumentError(f"run {missing[0]!r} no longer exists")
    results = [
        (name, _result(known[name])) for name in sorted(names, key=lambda n: known[n].created)
    ]
    pairs = [(name, _pair(result, pair)) for name, result in results]
    curves = []
    for name, one in pairs:
        response = one.frequency_response
        frequency = response.frequency[response.frequency > 0]
        if frequency.size:
            curves.append((name, measured_curve(response, near=model_curve(one, frequency))))
    values: list[Estimate | None] = [getattr(one.parameters, parameter) for _, one in pairs]
    cells = tuple(
        (w.label, *(_cell(getattr(one.parameters, w.name)) for _, one in pairs))
        for w in GLOSSARY
        if any(getattr(one.parameters, w.name) is not None for _, one in pairs)
    )
    unit = next((value.unit for value in values if value is not None), None)
    labels = _labels([name for name, _ in pairs])
    whose = ("Pair", *(f"{one.output} from {one.input}" for _, one in pairs))
    verdicts = ("Verdict", *(one.verdict.replace("_", " ") for _, one in pairs))
    return Compared(
        columns=("Parameter", *labels),
        cells=(whose, verdicts, *cells),
        bode=overlaid_bode(curves),
        trend=trend(
            labels,
            values,
            name=label_of(parameter),
            specified=()
            if unit is None
            else asked_of(parameter, _conditions(specification), unit=unit),
        ),
    )


def _labels(names: Sequence[str]) -> list[str]:
    """Name each run by its folder; all of them by their files where two are of one folder.

    Examples
    --------
    >>> _labels(["mon_bench/run.h5", "tue_bench/run.h5"]), _labels(["up/a.h5", "up/b.h5"])
    (['mon_bench', 'tue_bench'], ['up/a.h5', 'up/b.h5'])
    """
    folders = [Path(name).parent.name or name for name in names]
    return folders if len(set(folders)) == len(names) else list(names)


def _cell(estimate: Estimate | None) -> str:
    if estimate is None:
        return "–"
    return typeset(format_estimate(estimate)) + ("" if estimate.verdict == "ok" else " (doubtful)")


def _pair(result: Identification, wanted: str) -> PairIdentification:
    for pair in result.pairs:
        if f"{pair.output} from {pair.input}" == wanted:
            return pair
    return result.pairs[0]


def _result(run: Run) -> Identification:
    if run.found is not None:
        return run.found
    if run.record is None:
        raise ArgumentError(f"{run.name} holds neither a record nor a result")
    loaded = load(run.record)
    record = loaded if isinstance(loaded, Record) else read(run.record)
    result = identify(record)
    save(result, run.record.with_suffix(".json"))
    return result
