"""Several inputs on a page: which are told apart, and every coupling in one table."""

import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from hmpim import plots
from hmpim.identify import Identification, InputSet, PairIdentification
from hmpim.report.figures import Picture
from hmpim.report.numbers import format_estimate

__all__ = ["InputsView", "gain_rows", "inputs_view"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InputsView:
    """What a page shows of several inputs, as text, and the picture.

    Parameters
    ----------
    rows : tuple of dict
        For each input its `name`, `band`, and `apart`: what it is not told from, and where.
    outputs : tuple of str
        Heads of the table of gains.
    gains : tuple of dict
        For each input its `name` and `cells`, one for each output.
    picture : Picture
        Condition and multiple coherence over frequency.
    """

    rows: tuple[dict[str, str], ...]
    outputs: tuple[str, ...]
    gains: tuple[dict[str, Any], ...]
    picture: Picture


def inputs_view(result: Identification) -> InputsView | None:
    """Return what a page shows of several inputs; None if there is one.

    Examples
    --------
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> inputs_view(Identification(record=summary, pairs=())) is None
    True
    """
    inputs = result.inputs
    if inputs is None:
        return None
    outputs = tuple(dict.fromkeys(pair.output for pair in result.pairs))
    told = 100 * float(np.mean(inputs.usable))
    return InputsView(
        rows=tuple(
            {
                "name": name,
                "band": f"{band[0]:.3g} to {band[1]:.3g} Hz",
                "apart": _apart(inputs, name),
            }
            for name, band in zip(inputs.names, inputs.bands, strict=True)
        ),
        outputs=outputs,
        gains=gain_rows(result),
        picture=Picture(
            key="inputs",
            title="Separation of the inputs, and coherence",
            caption="Above: condition number of the inputs' spectra; up to 10, the inputs count as "
            "separable. Below: share of each output that all inputs together explain (multiple "
            "coherence).",
            description=f"The inputs are separable at {told:.0f} % of the frequencies.",
            figure=plots.inputs_plot(inputs),
        ),
    )


def gain_rows(result: Identification) -> tuple[dict[str, Any], ...]:
    """Return, for each input, its `name` and `cells`: the scale factor to each output.

    Examples
    --------
    >>> from hmpim.identify import RecordSummary
    >>> summary = RecordSummary(fs=200.0, samples=2000, sha256="")
    >>> gain_rows(Identification(record=summary, pairs=()))
    ()
    """
    outputs = dict.fromkeys(pair.output for pair in result.pairs)
    return tuple(
        {"name": name, "cells": [_gain(result[output, name]) for output in outputs]}
        for name in dict.fromkeys(pair.input for pair in result.pairs)
    )


def _apart(inputs: InputSet, name: str) -> str:
    """Which inputs one cannot be separated from, and where."""
    found = [
        f"{', '.join(other for other in group.names if other != name)} at {_spans(group.where)}"
        for group in inputs.alike
        if name in group.names
    ]
    return "; ".join(found) or "separable from all others"


def _spans(where: str) -> str:
    """Bands in words, one of a single frequency as that.

    Examples
    --------
    >>> _spans("0.2 to 0.4, 14.8 to 14.8 Hz")
    '0.2 to 0.4, 14.8 Hz'
    """
    return re.sub(r"\b([\d.e+-]+) to \1(?=[, ])", r"\1", where)


def _gain(pair: PairIdentification) -> str:
    """Scale factor, or how large the coupling is at most."""
    gain = pair.parameters.scale_factor
    if gain is not None:
        return format_estimate(gain)
    response = pair.frequency_response
    if pair.verdict == "doubtful" and response.frequency.size:
        level = 20 * np.log10(max(float(np.max(np.abs(response.response))), 1e-300))
        return f"no static gain; {level:.0f} dB at most".replace("-", "−")
    return "–"
