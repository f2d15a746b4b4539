"""A report's figures and numbers as files of their own: SVG, PNG, CSV."""

import csv
import io
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from hmpim.formats.atomic import replacing, write_text
from hmpim.identify import Identification, PairIdentification
from hmpim.plots.style import printable
from hmpim.report.figures import Picture, pair_pictures, stimulus_picture
from hmpim.report.words import GLOSSARY
from hmpim.stimulus import Stimulus

__all__ = ["parameters_csv", "response_csv", "write_figures"]


def write_figures(
    result: Identification,
    folder: str | PathLike[str],
    *,
    stimulus: Stimulus | None = None,
    pictures: Sequence[Picture] = (),
    dpi: float = 150.0,
) -> list[Path]:
    """Write every figure of a report as SVG and PNG, and its numbers as CSV.

    Parameters
    ----------
    result : Identification
        What was found.
    folder : path-like
        Where to; made if it is missing. Files are named ``PAIR-PICTURE.svg``, where pairs are
        numbered, ``parameters.csv`` and ``response-PAIR.csv``.
    stimulus : Stimulus, optional
        What was sent.
    pictures : sequence of Picture
        What else was seen in the run.
    dpi : float
        Of the PNG files.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    ArgumentError
        If the folder cannot be written to.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     found = write_figures(Identification(record=summary, pairs=()), folder)
    >>> [path.name for path in found]
    ['parameters.csv']
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    drawn = [(picture.key, picture) for picture in pictures]
    if stimulus is not None:
        drawn.append(("stimulus", stimulus_picture(stimulus)))
    texts = {"parameters.csv": parameters_csv(result)}
    for number, pair in enumerate(result.pairs, start=1):
        drawn += [(f"{number}-{p.key}", p) for p in pair_pictures(result, pair)]
        if pair.frequency_response.frequency.size:
            texts[f"response-{number}.csv"] = response_csv(pair)
    written = []
    for name, text in texts.items():
        write_text(place / name, text)
        written.append(place / name)
    for name, picture in drawn:
        for kind in ("svg", "png"):
            path = place / f"{name}.{kind}"
            with replacing(path) as free:
                picture.figure.savefig(free, format=kind, dpi=dpi)
            written.append(path)
    return written


def parameters_csv(result: Identification) -> str:
    """Return every estimate of a result as CSV, one row each.

    Examples
    --------
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> parameters_csv(Identification(record=summary, pairs=())).strip()
    'input,output,parameter,value,std,low95,high95,unit,verdict'
    """
    rows: list[list[object]] = [
        ["input", "output", "parameter", "value", "std", "low95", "high95", "unit", "verdict"]
    ]
    for pair in result.pairs:
        for words in GLOSSARY:
            estimate = getattr(pair.parameters, words.name)
            if estimate is None:
                continue
            low, high = estimate.ci95 or (None, None)
            names = [_cell(pair.input), _cell(pair.output), words.name]
            numbers = [estimate.value, estimate.std, low, high]
            rows.append([*names, *numbers, _cell(estimate.unit), estimate.verdict])
    return _csv(rows)


def response_csv(pair: PairIdentification) -> str:
    """Return a pair's measured frequency response as CSV.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> response = SimpleNamespace(
    ...     frequency=np.array([1.0]), response=np.array([-1j]), std=np.array([0.1]))
    >>> print(response_csv(SimpleNamespace(frequency_response=response)).strip())
    frequency_hz,real,imag,std,magnitude_db,phase_deg
    1.0,-0.0,-1.0,0.1,0.0,-90.0
    """
    found = pair.frequency_response
    names = ("frequency_hz", "real", "imag", "std", "magnitude_db", "phase_deg")
    rows: list[list[object]] = [list(names)]
    for f, z, std in zip(found.frequency, found.response, found.std, strict=True):
        level = 20.0 * np.log10(abs(z)) if abs(z) else -np.inf
        numbers = (f, z.real, z.imag, std, level, np.degrees(np.angle(z)))
        rows.append([float(number) for number in numbers])
    return _csv(rows)


def _cell(text: str) -> str:
    """Return a name that no spreadsheet takes for a formula."""
    shown = printable(text)
    return f"'{shown}" if shown[:1] in ("=", "+", "-", "@") else shown


def _csv(rows: Sequence[Sequence[object]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(
        [["" if cell is None else cell for cell in row] for row in rows]
    )
    return out.getvalue()
