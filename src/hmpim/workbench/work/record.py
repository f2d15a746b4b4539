"""A file looked at, read and identified."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.files import read
from hmpim.formats.options import ReadOptions
from hmpim.formats.saving import save
from hmpim.formats.survey import survey
from hmpim.identify import Identification, PairIdentification, PaperEstimates, identify
from hmpim.identify.section_iv.paper import paper_analysis
from hmpim.model.dynamics import StructureName
from hmpim.plots import Figure, pair_bode, spectra
from hmpim.record import Channel, Record, uniform
from hmpim.record.clock import fit_clock
from hmpim.report import report
from hmpim.report.by_hand import fit_note, hand_notes
from hmpim.report.figures import Picture, pair_pictures
from hmpim.report.words import structure_words
from hmpim.tables import shortened
from hmpim.workbench.drawn import drawn

__all__ = [
    "Found",
    "Looked",
    "Question",
    "View",
    "Windowed",
    "automatic",
    "found",
    "look",
    "read_record",
    "response_so_far",
    "windowed",
    "write_report",
]

_MOST_REASONS = 12
Samples = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Looked:
    """What a file holds: channels with unit and rate, and what is proposed of them.

    `fs` is None where the file has no time, and the rate must be stated; `reasons` say of each
    channel what speaks for or against it.
    """

    names: tuple[str, ...]
    notes: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    fs: float | None
    reasons: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is to be identified of which file; None for all, any, or what the file says."""

    file: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    fs: float | None = None
    start: float | None = None
    stop: float | None = None
    structure: str | None = None
    intersample: str = "auto"
    reference: str | None = None

    @property
    def automatic(self) -> "Question":
        """The same of the whole record, any structure allowed."""
        return replace(self, start=None, stop=None, structure=None)

    @property
    def set_by_hand(self) -> str:
        """What is set by hand, in words; '' for nothing."""
        words = [] if self.structure is None else [structure_words(self.structure)]
        if self.start is not None or self.stop is not None:
            first = "the beginning" if self.start is None else f"{self.start:g}"
            last = "the end" if self.stop is None else f"{self.stop:g} s"
            words.append(f"{first} to {last}")
        return ", ".join(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """How a result is looked at: which pair, through which window."""

    pair: int = 0
    window: str = "gaussian"
    alpha: float = 1.5


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Found:
    """A result without its samples, and the pictures of one pair, as the report has them.

    `stamp` tells the file as it was then; `drawn` holds each picture as a page takes it, so that
    no page waits until a million samples are thinned.
    """

    result: Identification
    stamp: int
    pictures: tuple[Picture, ...]
    drawn: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Windowed:
    """The paper's figures through another window, and its spectra."""

    estimates: PaperEstimates
    spectra: Figure


def look(path: str) -> Looked:
    """Look at every channel of a file.

    Parameters
    ----------
    path : str
        The file.
    """
    seen = survey(path)
    rates = [d.rate for d in seen.descriptions if d.rate]
    spoilt: dict[str, list[str]] = {}
    for d in seen.descriptions:
        if d.problem:
            spoilt.setdefault(d.problem, []).append(d.name)
    reasons = [f"{shortened(names)}: cannot be used yet: {why}" for why, names in spoilt.items()]
    reasons += [f"{name!r}: {reason}" for name, reason in seen.proposal.reasons]
    stated = seen.contents.inputs and seen.contents.outputs  # a run's own, all of its axes
    return Looked(
        names=tuple(d.name for d in seen.descriptions),
        notes=tuple(_note(d.unit, d.rate) for d in seen.descriptions),
        inputs=seen.proposal.inputs if stated else seen.proposal.inputs[:1],
        outputs=seen.proposal.outputs,
        fs=rates[0] if rates else None,
        reasons=tuple(reasons[:_MOST_REASONS]),
    )


def _note(unit: str, rate: float | None) -> str:
    return ", ".join(word for word in (unit, f"{rate:.6g} Hz" if rate else "") if word)


def read_record(question: Question) -> Record:
    """Read the part of a file that is asked about."""
    return read(
        Path(question.file),
        inputs=question.inputs or None,
        outputs=question.outputs or None,
        references=None if question.reference is None else (question.reference,),
        fs=question.fs,
        options=ReadOptions(start=question.start, stop=question.stop),
    )


def found(question: Question, view: View) -> Found:
    """Identify what is asked about, and describe its pictures.

    Parameters
    ----------
    question : Question
        Which file, which part.
    view : View
        How it is looked at.
    """
    stamp = Path(question.file).stat().st_mtime_ns
    result = _identified(question)
    pair = result.pairs[min(view.pair, len(result.pairs) - 1)]
    pictures = tuple(pair_pictures(result, pair))
    return Found(
        result=_slim(result),
        stamp=stamp,
        pictures=pictures,
        drawn={picture.key: drawn(picture.figure) for picture in pictures},
    )


def automatic(question: Question) -> Identification:
    """Identify the whole record, any structure allowed; return it without its samples."""
    return _slim(_identified(question.automatic))


def _slim(result: Identification) -> Identification:
    pairs = tuple(replace(p, time=None, prediction=None, residual=None) for p in result.pairs)
    return replace(result, pairs=pairs, data=None)


def _identified(question: Question) -> Identification:
    only: tuple[StructureName, ...] | None = None
    if question.structure is not None:
        only = (question.structure,)  # type: ignore[assignment]
    return identify(
        read_record(question),
        structures=only,
        intersample=question.intersample,
        reference=question.reference,
    )


def windowed(question: Question, view: View, pair: PairIdentification) -> Windowed:
    """Do the paper's steps with another window, and describe the spectra that they see."""
    record = read_record(question)
    aligned = uniform(record)
    u, y = aligned.signal(pair.input), aligned.signal(pair.output)
    done = paper_analysis(
        u.values,
        y.values,
        aligned.fs,
        band=record.band,
        window=view.window,  # type: ignore[arg-type]
        alpha=view.alpha,
    )
    figure = spectra(
        done.frequency,
        input_plain=done.input_db,
        input_windowed=done.input_windowed_db,
        output_plain=done.output_db,
        output_windowed=done.output_windowed_db,
        band=done.band,
        input_name=pair.input,
        output_name=pair.output,
    )
    return Windowed(estimates=done.estimates, spectra=figure)


def write_report(
    question: Question,
    path: str,
    pair: int,
    hand: Mapping[str, float],
    automatic: PairIdentification | None = None,
) -> tuple[str, ...]:
    """Identify once more, and write the page and the result beside it; return the notes.

    `automatic` is what was found before structure or interval were set by hand.
    """
    result = _identified(question)
    shown = result.pairs[min(pair, len(result.pairs) - 1)]
    notes = hand_notes(shown if automatic is None else automatic, hand, fs=result.record.fs)
    if automatic is not None:
        notes = (fit_note(automatic, set_by_hand=question.set_by_hand), *notes)
    report(result, path, notes=notes)
    save(result, Path(path).with_suffix(".json"))
    return notes


def response_so_far(
    command: Samples,
    response: Samples,
    names: tuple[str, str],
    units: tuple[str, str],
    band: tuple[float, float] | None,
) -> Figure:
    """Identify what has come in of one axis so far, and describe the response that it shows.

    Parameters
    ----------
    command, response : (ndarray, ndarray)
        Times in s and values.
    names, units : (str, str)
        Of the two.
    band : tuple of float or None
        What will be played, in Hz: the plot is as wide from the beginning, and fills.
    """
    (t, u), (s, y) = command, response
    record = Record(
        inputs=(Channel(name=names[0], time=t, values=u, unit=units[0]),),
        outputs=(Channel(name=names[1], time=s, values=y, unit=units[1]),),
        fs=fit_clock(t).fs,
    )
    pair = identify(record).pairs[0]
    figure = pair_bode(pair, input_unit=units[0], output_unit=units[1], fs=record.fs)
    if band is None:
        return figure
    panels = (replace(p, x=replace(p.x, low=band[0], high=band[1])) for p in figure.panels)
    return replace(figure, panels=tuple(panels))
