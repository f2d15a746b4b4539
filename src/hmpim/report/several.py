"""One page for several records of one test: repeats and their scatter, or levels."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike

import numpy as np

from hmpim.identify import Estimate, Identification, PairIdentification
from hmpim.identify.records.levels import LevelComparison, Levels
from hmpim.identify.records.repeated import RepeatedPair, Repeats
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import in_words
from hmpim.plots.curves import BodeCurve, measured_curve, model_curve
from hmpim.plots.overlay import overlaid_bode
from hmpim.plots.trend import trend
from hmpim.record import Finding
from hmpim.report.about import About, made_by
from hmpim.report.figures import Picture
from hmpim.report.numbers import (
    format_interval,
    format_scatter,
    format_value,
)
from hmpim.report.repeats_text import level_cells, linear_words, marked_value, percent_words
from hmpim.report.study import Grid, Section, StudyPage, write_study_page
from hmpim.report.words import (
    GLOSSARY,
    VERDICTS,
    by_weight,
    doubtful_and_ok,
    label_of,
    listed,
    structure_words,
)

__all__ = ["levels_report", "repeats_report"]

_BY_RUN = (
    "delay",
    "scale_factor",
    "bias",
    "noise_std",
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    "bandwidth_phase90",
    "bandwidth_3db",
)
"""Parameters of the table by run."""

_SHORT = 16  # characters of a name that fits below a picture

_DRAWN = ("bandwidth_phase90", "delay", "natural_frequency", "scale_factor")
"""Parameters that are drawn over the runs."""


def repeats_report(
    repeats: Repeats,
    names: Sequence[str],
    path: str | PathLike[str],
    *,
    about: About | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Write the page of several records of one stimulus.

    Averages with their errors, the chi-squared test of these against the scatter, a table by
    run, and the measured responses over each other.

    Parameters
    ----------
    repeats : Repeats
        From `hmpim.identify_repeats`.
    names : sequence of str
        Of the records, in the order given.
    path : path-like
        The file to write, .html or .pdf; replaced as a whole, or not at all.
    about : About, optional
        Title, unit under test, test, operator, date.
    notes : sequence of str
        Plain sentences under the verdict.

    Raises
    ------
    ArgumentError
        If `path` cannot be written, or is named as something else than a page or a PDF.
    MissingExtraError
        If a PDF is wanted and the extra ``pdf`` is not installed.
    """
    parameters = [parameter for pair in repeats.pairs for parameter in pair.parameters]
    agree = sum(parameter.agree for parameter in parameters)
    doubts = any(f.severity == "doubt" for pair in repeats.pairs for f in pair.findings)
    page = StudyPage(
        title=_title(about, f"{len(names)} records of one stimulus"),
        description="",
        about=tuple((about or About()).rows()),
        notes=tuple(notes),
        headline=f"{len(names)} repeats: the scatter of {agree} of {len(parameters)} parameters "
        "agrees with their stated errors.",
        met=True if parameters else None,
        doubtful=doubts or agree < len(parameters),
        grids=tuple(_averages(pair, several=len(repeats.pairs) > 1) for pair in repeats.pairs),
        sections=tuple(_repeated(pair, repeats.results, names) for pair in repeats.pairs),
        facts=_facts(repeats.results, names),
    )
    write_study_page(page, path)


def levels_report(
    levels: Levels,
    names: Sequence[str],
    path: str | PathLike[str],
    *,
    about: About | None = None,
    notes: Sequence[str] = (),
) -> None:
    """Write the page of one stimulus at several levels.

    Parameters
    ----------
    levels : Levels
        From `hmpim.identify.identify_levels`.
    names, path, about, notes
        As for `repeats_report`.

    Raises
    ------
    ArgumentError
        If `path` cannot be written, or is named as something else than a page or a PDF.
    MissingExtraError
        If a PDF is wanted and the extra ``pdf`` is not installed.
    """
    pairs = levels.results[0].pairs
    told = [
        _rising(pair, compared, levels.results, names)
        for pair, compared in zip(pairs, levels.comparisons, strict=True)
    ]
    known = [one for one in told if one.compared.trends]
    unsure = list(dict.fromkeys(label for one in told for label in one.unsure))
    said = "; ".join(
        (f"{one.name} " if len(told) > 1 else "") + linear_words(one.compared, one.unit)
        for one in known
    )
    page = StudyPage(
        title=_title(about, f"{len(names)} levels of one stimulus"),
        description="",
        about=tuple((about or About()).rows()),
        notes=tuple(notes),
        headline=f"{len(names)} levels: {said or 'no trend is known'}."
        f"{f' Some figures are doubtful at {listed(unsure)}.' if unsure else ''}",
        met=True if known else None,
        doubtful=any(
            one.unsure or any(f.severity == "doubt" for f in one.compared.findings) for one in told
        ),
        grids=tuple(_trends(one, several=len(told) > 1) for one in known),
        sections=tuple(_levelled(one) for one in told),
        facts=_facts(levels.results, names),
    )
    write_study_page(page, path)


def _title(about: About | None, otherwise: str) -> str:
    return about.title if about is not None and about.title else otherwise


def _facts(results: Sequence[Identification], names: Sequence[str]) -> tuple[tuple[str, str], ...]:
    first = results[0].record
    sums = (
        f"{name} {result.record.sha256[:16]}" for name, result in zip(names, results, strict=True)
    )
    return (
        ("Records", ", ".join(names)),
        ("Sampling rate", f"{first.fs:.7g} Hz"),
        ("Length", f"{first.samples / first.fs:.6g} s"),
        ("SHA-256", ", ".join(sums)),
        made_by(),
    )


def _repeated(
    pair: RepeatedPair, results: Sequence[Identification], names: Sequence[str]
) -> Section:
    each = [result[pair.output, pair.input] for result in results]
    said = [_sentence(finding) for finding in by_weight(pair.findings)]
    if pair.noise_std is not None:
        noise = f"{format_value(pair.noise_std)} {pair.noise_std.unit}".rstrip()
        said.append(f"Noise, from what differs between the records: {noise}.")
    if np.isfinite(pair.response_scatter):
        said.append(
            f"The measured responses scatter {pair.response_scatter:.2f} times as much as their "
            "stated errors (r.m.s. over the frequencies)."
        )
    if not pair.parameters:
        said.append("No parameter is determined by two records or more.")
    averages = {parameter.name: parameter.mean for parameter in pair.parameters}
    pictures = _pictures(each, results[0].record.fs, names, averages)
    return Section(
        title=f"{pair.input} → {pair.output}",
        observed="",
        found=tuple(said),
        grids=(_by_run(each, names),),
        pictures=pictures,
    )


def _averages(pair: RepeatedPair, *, several: bool) -> Grid:
    found = {parameter.name: parameter for parameter in pair.parameters}
    rows = []
    for words in GLOSSARY:
        one = found.get(words.name)
        if one is None:
            continue
        rows.append(
            (
                words.label,
                format_value(one.mean, positive=words.positive),
                one.mean.unit or "–",
                one.mean.verdict,
                format_interval(one.mean, positive=words.positive),
                format_scatter(one.repeatability, one.mean.value),
                f"{one.chi_squared:.3g} / {one.freedom}",
                percent_words(one.probability),
                "agree" if one.agree else "do not agree",
            )
        )
    return Grid(
        caption="Averages over the runs"
        + (f", {pair.input} → {pair.output}" if several else ""),
        columns=(
            "Parameter", "Mean ± std", "Unit", "Verdict", "95 % interval", "Repeatability",
            "χ² / degrees of freedom", "Chance", "Stated errors",
        ),
        rows=tuple(rows),
        note="Mean: weighted by 1/std². Repeatability: standard deviation from run to run. "
        "χ²: the squared distances of the runs from their mean over their stated variances, "
        "about as large as its degrees of freedom if the stated errors are right. Chance: of a "
        "larger χ² if they are.",
    )  # fmt: skip


def _by_run(
    each: Sequence[PairIdentification],
    names: Sequence[str],
    at: tuple[str, Sequence[str]] | None = None,
    *,
    without: Sequence[str] = (),
) -> Grid:
    """Table with a row for each run; `at` is one more column, its heading and its cells."""
    known = [
        name
        for name in _BY_RUN
        if name not in without and any(getattr(p.parameters, name) is not None for p in each)
    ]
    units = {name: _unit(each, name) for name in known}
    return Grid(
        caption="By run: value ± standard deviation; ? marks a doubtful value",
        dense=True,
        columns=(
            "Run",
            *([] if at is None else [at[0]]),
            "Verdict",
            "Structure",
            "Fit (%)",
            *(label_of(name) + (f" ({units[name]})" if units[name] else "") for name in known),
        ),
        rows=tuple(
            (
                name,
                *([] if at is None else [at[1][k]]),
                VERDICTS[pair.verdict],
                structure_words(pair.structure),
                f"{pair.fit_percent:.2f}",
                *(marked_value(getattr(pair.parameters, one), one) for one in known),
            )
            for k, (name, pair) in enumerate(zip(names, each, strict=True))
        ),
    )


def _unit(each: Sequence[PairIdentification], name: str) -> str:
    known: list[Estimate] = [e for p in each if (e := getattr(p.parameters, name)) is not None]
    return known[0].unit


def _pictures(
    each: Sequence[PairIdentification],
    fs: float,
    names: Sequence[str],
    averages: dict[str, Estimate],
    *,
    by: str = "of each record",
) -> tuple[Picture, ...]:
    pictures = []
    short = _told_apart(names)
    curves = [(name, c) for name, pair in zip(short, each, strict=True) if (c := _curve(pair, fs))]
    if curves:
        bandwidth = averages.get("bandwidth_phase90")
        mark = bandwidth if bandwidth is not None and bandwidth.spread < bandwidth.value else None
        caption = f"Measured frequency response {by}."
        caption += " The vertical line marks the mean −90° bandwidth." if mark else ""
        pictures.append(
            Picture(
                key="responses",
                title="Measured responses",
                caption=caption,
                description=f"Bode plot of {len(curves)} measured responses over each other.",
                figure=overlaid_bode(curves, bandwidths=[mark], pairs=False),
            )
        )
    for name in _DRAWN:
        estimates = [getattr(pair.parameters, name) for pair in each]
        if sum(estimate is not None for estimate in estimates) < 2:
            continue
        label, mean = label_of(name), averages.get(name)
        words = in_words(name)
        pictures.append(
            Picture(
                key=name,
                title=label,
                caption=f"{words[:1].upper()}{words[1:]} {by} with its 95 % interval"
                + ("" if all(e is None or e.ci95 for e in estimates) else " where it is known")
                + (", and the mean with its own." if mean is not None else "."),
                description=f"{label} {by}: {', '.join(names)}.",
                figure=trend(short, estimates, name=label, mean=mean),
            )
        )
    return _in_columns(pictures)


def _told_apart(names: Sequence[str]) -> Sequence[str]:
    """Names for pictures: of long ones, the part in which they differ.

    Examples
    --------
    >>> _told_apart(["bench-7_10-00_gimbal.csv", "bench-7_11-00_gimbal.csv"])
    ['…10', '…11']
    >>> _told_apart(["run0.csv", "another run of the same unit.csv"])
    ['run0…', 'another run of …']
    """
    if max(map(len, names)) <= _SHORT:
        return names
    parts = [re.split(r"([_./ -])", name) for name in names]
    least = min(map(len, parts))
    head = _alike(parts, least - 1)
    tail = _alike([one[::-1] for one in parts], least - 1 - head)
    marks = ("…", "") if head else ("", "…" * (tail > 0))
    short = ["".join(one[head : len(one) - tail]).join(marks) for one in parts]
    short = [one if len(one) <= _SHORT else f"{one[: _SHORT - 1]}…" for one in short]
    return short if len(set(short)) == len(names) else names


def _alike(parts: Sequence[Sequence[str]], most: int) -> int:
    """How many parts are the same in all, from the first one on."""
    return next((k for k in range(most) if len({one[k] for one in parts}) > 1), most)


def _curve(pair: PairIdentification, fs: float) -> BodeCurve | None:
    seen = pair.frequency_response.frequency
    seen = seen[seen > 0]
    if not seen.size:
        return None
    return measured_curve(pair.frequency_response, near=model_curve(pair, seen, fs=fs))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Levelled:
    """One pair at all levels, by rising amplitude; `labels` are what the levels are called."""

    name: str
    input: str
    unit: str
    fs: float
    compared: LevelComparison
    runs: tuple[str, ...]
    each: tuple[PairIdentification, ...]
    labels: tuple[str, ...]

    @property
    def unsure(self) -> list[str]:
        """Levels at which the record by itself is not called ok."""
        pairs = zip(self.labels, self.each, strict=True)
        return [label for label, pair in pairs if pair.verdict != "ok"]


def _rising(
    pair: PairIdentification,
    compared: LevelComparison,
    results: Sequence[Identification],
    names: Sequence[str],
) -> _Levelled:
    order = sorted(range(len(names)), key=lambda k: compared.amplitudes[k])
    return _Levelled(
        name=f"{pair.input} → {pair.output}",
        input=pair.input,
        unit=compared.unit,
        fs=results[0].record.fs,
        compared=compared,
        runs=tuple(names[k] for k in order),
        each=tuple(results[k][pair.output, pair.input] for k in order),
        labels=tuple(f"{compared.amplitudes[k]:.4g} {compared.unit}".rstrip() for k in order),
    )


def _levelled(one: _Levelled) -> Section:
    said = [_sentence(finding) for finding in by_weight(one.compared.findings)]
    for label, pair in zip(one.labels, one.each, strict=True):
        bad, good = doubtful_and_ok(pair)
        if bad:
            said.append(f"Doubtful at {label}: {', '.join(bad) if good else 'every figure'}.")
    if not one.compared.trends:
        said.append("No parameter is determined at two levels or more.")
    alike = len({pair.structure for pair in one.each}) == 1  # else each has figures of its own
    shown = [moved.name for moved in one.compared.trends] if alike else []
    pictures = _pictures(one.each, one.fs, one.labels, {}, by="at each amplitude")
    return Section(
        title=one.name,
        observed="",
        found=tuple(said),
        grids=(_by_run(one.each, one.runs, ("Amplitude", one.labels), without=shown),),
        pictures=pictures,
    )


def _in_columns(pictures: Sequence[Picture]) -> tuple[Picture, ...]:
    """Parameters first; the responses, as high as two of them, where two columns come out even."""
    low = [picture for picture in pictures if picture.key != "responses"]
    high = [picture for picture in pictures if picture.key == "responses"]
    at = max(len(low) - 1 + len(low) % 2, 0)
    return (*low[:at], *high, *low[at:])


def _trends(one: _Levelled, *, several: bool) -> Grid:
    """How each parameter goes with the amplitude, as compared: by one structure at all levels."""
    amplitudes = sorted(one.compared.amplitudes)
    rows = []
    for moved in one.compared.trends:
        own = [getattr(pair.parameters, moved.name) for pair in one.each]
        cells = level_cells(moved, one.each, amplitudes)
        unit = f" ({own[0].unit})" if own[0] is not None and own[0].unit else ""
        change = f"{'+' if moved.change > 0 else ''}{percent(moved.change)} %"
        chance = percent_words(moved.probability)
        rows.append((label_of(moved.name) + unit, *cells, change, chance))
    caption = f"By amplitude of {one.input}" + (f", {one.name}" if several else "")
    doubt = any(cell.endswith("?") for row in rows for cell in row)
    return Grid(
        caption=caption + f": value ± standard deviation{'; ? marks a doubtful value' * doubt}",
        columns=("Parameter", *one.labels, "Change", "Chance"),
        rows=tuple(rows),
        note="Amplitude: half the range that the input covers. Change: from the smallest to the "
        "largest amplitude. Chance: of such differences if the parameter were the same at every "
        "level.",
    )


def _sentence(finding: Finding) -> str:
    return f"{'Doubt' if finding.severity == 'doubt' else 'Note'}: {finding.message}"
