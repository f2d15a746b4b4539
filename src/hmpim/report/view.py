"""Everything that a report shows, as text and pictures: for the page, the PDF and the sheet."""

from collections.abc import Mapping, Sequence
from typing import Any

from hmpim.identify import Identification, PairIdentification
from hmpim.plots.curves import is_measured
from hmpim.record import INTERSAMPLE_WORDS, Finding
from hmpim.report.about import About, made_by
from hmpim.report.advice import leading_findings, said_and_done
from hmpim.report.figures import Picture, pair_pictures, stimulus_picture
from hmpim.report.inputs import inputs_view
from hmpim.report.modes import MODES_SAID, mode_rows
from hmpim.report.numbers import (
    format_estimate,
    format_interval,
    format_number,
    format_value,
    how_to_read,
    typeset,
)
from hmpim.report.untold import untold
from hmpim.report.words import (
    GLOSSARY,
    VERDICTS,
    by_weight,
    fixed_unit,
    headline,
    nonlinear_facts,
    off_by,
    pair_sentence,
    paper_value,
    remark,
    structure_words,
)
from hmpim.stimulus import Stimulus

__all__ = ["report_view"]

_FIRST = ("bode", "deviation")  # pictures that are never folded away
_SUMMARY = ("bandwidth_phase90", "bandwidth_3db", "delay", "scale_factor")


def report_view(
    result: Identification,
    *,
    about: About | None = None,
    truth: Mapping[str, float] | None = None,
    stimulus: Stimulus | None = None,
    notes: Sequence[str] = (),
    pictures: Sequence[Picture] = (),
) -> dict[str, Any]:
    """Return what a report shows, in its order.

    Parameters
    ----------
    result : Identification
        What was found.
    about : About, optional
        Unit under test, test, operator, date.
    truth : mapping of str to float, optional
        True values of parameters, where they are known.
    stimulus : Stimulus, optional
        What was sent.
    notes : sequence of str
        Plain sentences under the verdict.
    pictures : sequence of Picture
        What else was seen in the run.

    Examples
    --------
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> report_view(Identification(record=summary, pairs=()))["headline"]
    'Nothing was identified.'
    """
    about = about or About()
    main = list(result.counted) or list(result.pairs)
    leading = leading_findings([finding for pair in main for finding in pair.warnings])
    remarks = sum(len(pair.warnings) for pair in result.pairs)
    return {
        "title": about.title or _title(result),
        "about": _about(about, result),
        "headline": headline(result),
        "verdict": result.verdict if result.pairs else "not_identifiable",
        "notes": list(notes),
        "findings": [
            {
                **_finding_view(f),
                "where": _where(f, main),
            }
            for f in leading
        ],
        "remarks": remarks,
        "summary": _summary(main) if len(result.pairs) > 1 else None,
        "facts": _facts(result),
        "pairs": [
            {
                **_pair_view(result, pair, truth or {}),
                "id": f"pair-{number}",
                "counted": any(pair is one for one in main),
            }
            for number, pair in enumerate(result.pairs, start=1)
        ],
        "inputs": inputs_view(result),
        "stimulus": None if stimulus is None else stimulus_picture(stimulus),
        "pictures": list(pictures),
        "without_record": result.data is None,
        "compressed": not all(is_measured(pair) for pair in result.pairs),
        "with_truth": bool(truth),
        "glossary": GLOSSARY,
    }


def _title(result: Identification) -> str:
    if len(result.pairs) == 1:
        pair = result.pairs[0]
        return _named(pair)
    inputs, outputs = ({getattr(p, role) for p in result.pairs} for role in ("input", "output"))
    counts = ((len(inputs), "input"), (len(outputs), "output"))
    return ", ".join(f"{count} {role}{'s' * (count != 1)}" for count, role in counts)


def _about(about: About, result: Identification) -> list[tuple[str, str]]:
    """Head of the report; what is not known has a line to be filled in on the sheet."""
    source = result.record.source
    return about.rows(test=str(source) if source else "")


def _named(pair: PairIdentification) -> str:
    return f"{pair.input} → {pair.output}"


def _where(finding: Finding, pairs: Sequence[PairIdentification]) -> str:
    """Name the pairs that remark the same, where there are several; nothing if all do."""
    alike = sum(any(other.code == finding.code for other in pair.warnings) for pair in pairs)
    if alike == len(pairs):
        return ""
    own = next(pair for pair in pairs if any(other is finding for other in pair.warnings))
    first, more = _named(own), alike - 1
    return f"{first} (and {more} more)" if more else first


def _finding_view(finding: Finding) -> dict[str, str]:
    """What was found, and what to do about it."""
    message, todo = said_and_done(finding)
    return {
        "message": message,
        "code": finding.code,
        "severity": finding.severity,
        "advice": todo,
    }


def _summary(pairs: Sequence[PairIdentification]) -> dict[str, Any]:
    """One row for each pair that counts: its leading figures and its verdict."""
    labels = {words.name: words.label for words in GLOSSARY}
    names = [n for n in _SUMMARY if any(getattr(p.parameters, n) is not None for p in pairs)]
    return {
        "columns": [labels[name] for name in names],
        "rows": [
            {
                "name": _named(pair),
                "cells": [_told(pair, name) for name in names],
                "verdict": pair.verdict,
                "verdict_words": VERDICTS[pair.verdict],
            }
            for pair in pairs
        ],
    }


def _told(pair: PairIdentification, name: str) -> str:
    estimate = getattr(pair.parameters, name)
    if estimate is None:
        return "–"
    return typeset(format_estimate(estimate)) + ("" if estimate.verdict == "ok" else " (doubtful)")


def _facts(result: Identification) -> list[tuple[str, str]]:
    record = result.record
    facts = [
        ("Source", record.source or "given as arrays"),
        ("Sampling rate", f"{record.fs:.7g} Hz"),
        ("Samples", str(record.samples)),
        ("Length", f"{record.samples / record.fs:.6g} s"),
    ]
    if result.data is not None and result.data.band is not None:
        low, high = result.data.band
        facts.append(("Excited band", f"{low:g} to {high:g} Hz"))
    return [*facts, ("SHA-256 of the record", record.sha256 or "unknown"), made_by()]


def _pair_view(
    result: Identification, pair: PairIdentification, truth: Mapping[str, float]
) -> dict[str, Any]:
    """Everything that is shown of a pair, as text."""
    lowest = min((c.criterion for c in pair.candidates), default=0.0)
    rows = _rows(pair, truth)
    drawn = pair_pictures(result, pair)
    return {
        "name": _named(pair),
        "verdict": pair.verdict,
        "verdict_words": VERDICTS[pair.verdict],
        "sentence": pair_sentence(pair),
        "warnings": [_finding_view(w) for w in by_weight(pair.warnings)],
        "rows": rows,
        "reading": how_to_read([row["value"] for row in rows]),
        "untold": untold(pair),
        "modes": mode_rows(pair),
        "modes_said": MODES_SAID,
        "candidates": [
            {
                "structure": structure_words(c.structure),
                "between": INTERSAMPLE_WORDS[c.intersample],
                "behind": f"{c.criterion - lowest:.1f}",
                "fit": f"{c.fit_percent:.2f}",
                "chosen": c.chosen,
            }
            for c in sorted(pair.candidates, key=lambda c: c.criterion)
        ],
        "nonlinear": nonlinear_facts(pair),
        "first": [picture for picture in drawn if picture.key in _FIRST],
        "rest": [p for p in drawn if p.key not in (*_FIRST, "candidates", "harmonics")],
        "named": {p.key: p for p in drawn if p.key in ("candidates", "harmonics")},
    }


def _rows(pair: PairIdentification, truth: Mapping[str, float]) -> list[dict[str, str]]:
    rows = []
    for words in GLOSSARY:
        estimate = getattr(pair.parameters, words.name)
        paper = paper_value(pair, words.name)
        if estimate is None and paper is None:
            continue
        true = truth.get(words.name)
        off = "" if true is None or estimate is None else off_by(estimate, true)
        rows.append(
            {
                "name": words.name,
                "label": words.label,
                "value": "–"
                if estimate is None
                else format_value(estimate, positive=words.positive),
                "unit": fixed_unit(words.name) if estimate is None else estimate.unit,
                "interval": ""
                if estimate is None
                else format_interval(estimate, positive=words.positive),
                "verdict": "" if estimate is None else estimate.verdict,
                "paper": format_number(paper) if words.differs else "",
                "remark": remark(words, estimate, paper),
                "truth": format_number(true) if true is not None else "",
                "off": off,
            }
        )
    return rows
