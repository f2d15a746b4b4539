"""Several inputs at once: which can be told apart, and the response to each."""

import numpy as np

from hmpim.errors import RecordError
from hmpim.identify.multivariable import ResponseMatrix, response_matrix
from hmpim.identify.result import FrequencyResponse, Verdict
from hmpim.identify.several import Joined
from hmpim.identify.spectrum import excited_band
from hmpim.identify.verdict import Judgement
from hmpim.record import Aligned, Finding, Record, Signal

__all__ = ["column", "matrix_of", "with_condition"]

_NEVER_APART = 0.05
"""Share of the frequencies below which inputs count as one and are refused."""

_TOLD_APART = 0.5
"""Share of the frequencies at which inputs must be told apart for an `ok`."""


def matrix_of(aligned: Aligned, output: Signal, record: Record, joined: Joined) -> ResponseMatrix:
    """Response of one output to all inputs; inputs that cannot be told apart are refused."""
    bands = [record.band or excited_band(s.values, aligned.fs) for s in aligned.inputs]
    names = [s.name for s in aligned.inputs]
    band = (max(low for low, _ in bands), min(high for _, high in bands))
    # One delay for all inputs: moving them against each other would make them look different.
    follows = [fit for fit, related in zip(joined.fits, joined.related, strict=True) if related]
    strongest = min(follows or joined.fits, key=lambda fit: fit.best.fit.cost)
    delay = min(max(strongest.best.fit.delay, 0.0), 0.4 * aligned.samples) / aligned.fs
    matrix = response_matrix(
        np.stack([s.values for s in aligned.inputs]),
        output.values[None, :],
        aligned.fs,
        delays=[[delay]],
        band=band,
        names=[*names, output.name],
    )
    if np.mean(matrix.usable) < _NEVER_APART:
        raise RecordError(
            f"inputs {', '.join(names)} cannot be told apart: the condition number of their "
            f"spectra is {np.median(matrix.condition):.3g} at the median frequency. Drive them one "
            "at a time, or with sweeps that pass each frequency at different times"
        )
    return matrix


def column(matrix: ResponseMatrix, i: int) -> FrequencyResponse:
    """One input's response at the frequencies where the inputs can be told apart."""
    told = matrix.usable
    return FrequencyResponse(
        frequency=matrix.frequency[told],
        response=matrix.response[told, 0, i],
        std=matrix.std[told, 0, i],
        coherence=matrix.partial_coherence[told, 0, i],
    )


def with_condition(
    judgement: Judgement, matrix: ResponseMatrix, aligned: Aligned
) -> tuple[tuple[Finding, ...], Verdict]:
    """Add a warning where the inputs cannot be told apart over a good part of the band."""
    told = float(np.mean(matrix.usable))
    if told > _TOLD_APART:
        return judgement.findings, judgement.verdict
    names = ", ".join(s.name for s in aligned.inputs)
    coupled = Finding(
        code="coupled_inputs",
        message=f"Inputs {names} can be told apart at {100 * told:.0f} % of the frequencies only "
        f"(median condition number {np.median(matrix.condition):.3g}). Drive them with sweeps that "
        "pass each frequency at different times.",
    )
    verdict: Verdict = "doubtful" if judgement.verdict == "ok" else judgement.verdict
    return (*judgement.findings, coupled), verdict
