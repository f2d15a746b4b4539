"""A file looked at, read and identified."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.files import read
from hmpim.formats.options import ReadOptions
from hmpim.formats.saving import save
from hmpim.formats.survey import survey
from hmpim.identify import Identification, PairIdentification, identify
from hmpim.model.dynamics import StructureName
from hmpim.plots import Figure, pair_bode
from hmpim.record import Channel, Record
from hmpim.record.clock import fit_clock
from hmpim.report import report

__all__ = ["Looked", "Question", "found", "look", "read_record", "so_far", "write_report"]

Samples = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Looked:
    """What a file holds: channels with unit and rate, and what is proposed of them.

    `fs` is None where the file has no time, and the rate must be stated.
    """

    names: tuple[str, ...]
    notes: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    fs: float | None


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


def look(path: str) -> Looked:
    """Look at every channel of a file.

    Parameters
    ----------
    path : str
        The file.
    """
    seen = survey(path)
    rates = [d.rate for d in seen.descriptions if d.rate]
    return Looked(
        names=tuple(d.name for d in seen.descriptions),
        notes=tuple(_note(d.unit, d.rate) for d in seen.descriptions),
        inputs=seen.proposal.inputs,
        outputs=seen.proposal.outputs,
        fs=rates[0] if rates else None,
    )


def _note(unit: str, rate: float | None) -> str:
    return ", ".join(word for word in (unit, f"{rate:.6g} Hz" if rate else "") if word)


def read_record(question: Question) -> Record:
    """Read the part of a file that is asked about."""
    return read(
        Path(question.file),
        inputs=question.inputs or None,
        outputs=question.outputs or None,
        fs=question.fs,
        options=ReadOptions(start=question.start, stop=question.stop),
    )


def found(question: Question) -> Identification:
    """Identify what is asked about."""
    only: tuple[StructureName, ...] | None = None
    if question.structure is not None:
        only = (question.structure,)  # type: ignore[assignment]
    return identify(read_record(question), structures=only)


def write_report(result: Identification, path: str, notes: tuple[str, ...]) -> None:
    """Write the page of a result, and the result beside it."""
    report(result, path, notes=notes)
    save(replace(result), Path(path).with_suffix(".json"))


def so_far(
    command: Samples, response: Samples, names: tuple[str, str], units: tuple[str, str]
) -> tuple[PairIdentification, Figure]:
    """Identify what has come in of one axis so far, and describe its Bode plot.

    Parameters
    ----------
    command, response : (ndarray, ndarray)
        Times in s and values.
    names, units : (str, str)
        Of the two.
    """
    (t, u), (s, y) = command, response
    record = Record(
        inputs=(Channel(name=names[0], time=t, values=u, unit=units[0]),),
        outputs=(Channel(name=names[1], time=s, values=y, unit=units[1]),),
        fs=fit_clock(t).fs,
    )
    pair = identify(record).pairs[0]
    fs = record.fs
    slim = replace(pair, time=None, prediction=None, residual=None)
    return slim, pair_bode(pair, input_unit=units[0], output_unit=units[1], fs=fs)
