"""One result against one truth: every figure, the response, and what the draw counts as."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from families.take import Draw, Figure, Response

__all__ = ["CELLS", "Cell", "Score", "Scored", "score", "score_figure"]

Cell = Literal["right_ok", "right_not_ok", "wrong_ok", "wrong_not_ok", "no_answer"]
CELLS: tuple[Cell, ...] = ("right_ok", "right_not_ok", "wrong_ok", "wrong_not_ok", "no_answer")

DEVIATIONS, HALF_WIDTHS = 5.0, 2.5
OFF = 0.05
"""Share by which a response must be off to be wrong."""
FEW = 0.05
"""Share of a measured response's points that may lie beyond their error bars."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scored:
    """One figure: its cell, and whether its interval holds the truth (None: there is none).

    `error` is in tolerances, `width` that of the 95 % interval in what would still count.
    """

    cell: Cell
    ok: bool
    tellable: bool
    holds: bool | None
    error: float | None = None
    width: float | None = None
    hull: bool = False


@dataclass(slots=True, kw_only=True)
class Score:
    """One draw."""

    cell: Cell
    verdict: str
    figures: dict[str, Scored] = field(default_factory=dict)
    response: float | None = None
    measured_off: bool | None = None
    seconds: float = 0.0
    failure: str = ""


def score_figure(estimate: Any, truth: Figure, verdict: str) -> Scored:
    """Right, wrong or no answer.

    Wrong is beyond 5 deviations (2.5 half-widths of the interval where it is not symmetric, or
    there is no deviation) and beyond the tolerance. A value without an interval is no answer,
    unless it is called ok: then the tolerance alone decides. An interval wider than `widest`
    is no answer either.
    """
    if estimate is None or estimate.value is None:
        return Scored(cell="no_answer", ok=False, tellable=truth.tellable, holds=None)
    ok = getattr(estimate, "verdict", verdict) == "ok"
    error = float(estimate.value) - truth.value
    low, high = _interval(estimate)
    holds = width = None
    if low is not None and high is not None:
        slack = 1e-12 * max(abs(truth.value), abs(float(estimate.value)))
        holds = low - slack <= truth.value <= high + slack
        width = (high - low) / truth.widest if truth.widest else np.inf
        if low == high and abs(error) <= truth.tolerance and truth.bound == 0:
            holds = None  # 0 dB without a hump is a statement, no interval
    allowed = _allowed(estimate, error, low, high)
    missed = allowed is None or abs(error) > allowed
    if not np.isfinite(error) or (abs(error) > truth.tolerance and missed):
        cell: Cell = "wrong_ok" if ok else "wrong_not_ok"
        if allowed is None and not ok:
            cell = "no_answer"  # a value that is withheld but for its size
    elif width is None or width > 1:
        cell = "no_answer"
    else:
        cell = "right_ok" if ok else "right_not_ok"
    return Scored(
        cell=cell,
        ok=ok,
        tellable=truth.tellable,
        holds=holds,
        error=error / truth.tolerance if truth.tolerance else None,
        width=width,
        hull=truth.hull,
    )


def _interval(estimate: Any) -> tuple[float | None, float | None]:
    """The 95 % interval; an open end is infinite, a withheld interval (None, None)."""
    if estimate.ci95 is None:
        return None, None
    low, high = estimate.ci95
    return (
        -np.inf if low is None or np.isnan(low) else float(low),
        np.inf if high is None or np.isnan(high) else float(high),
    )


def _allowed(estimate: Any, error: float, low: float | None, high: float | None) -> float | None:
    """Largest error that the stated spread still allows; None where none is stated."""
    value = float(estimate.value)
    if low is not None and high is not None:
        half = value - low if error > 0 else high - value
        spread = HALF_WIDTHS * half
        if estimate.std is not None and np.isfinite(low) and np.isfinite(high):
            symmetric = abs((value - low) - (high - value)) <= 0.02 * (high - low)
            return DEVIATIONS * float(estimate.std) if symmetric else spread
        return spread
    return None if estimate.std is None else DEVIATIONS * float(estimate.std)


def score(draw: Draw, pair: Any, response: np.ndarray | None) -> Score:
    """Hold a pair of the result against its draw.

    Parameters
    ----------
    draw : Draw
        The truth.
    pair : PairIdentification
        The result.
    response : complex ndarray or None
        The result's model at `draw.response.frequency`; None where there is none.
    """
    verdict = str(pair.verdict)
    told = verdict != "not_identifiable"
    figures = {}
    for name, truth in draw.figures.items():
        estimate = getattr(pair.parameters, name, None)
        if not told and name in ("bias", "noise_std"):
            estimate = None  # of an output that follows nothing
        figures[name] = score_figure(estimate, truth, verdict)
    off = None
    truth_at = draw.response
    if truth_at is not None and response is not None and truth_at.frequency.size:
        accepted = (truth_at.value, *truth_at.others)
        off = float(min(np.max(np.abs(response / value - 1)) for value in accepted))
    measured = None
    if truth_at is not None:
        measured = _measured_off(pair.frequency_response, truth_at)
    cell = _cell_of(figures, verdict, off, related=draw.related)
    return Score(cell=cell, verdict=verdict, figures=figures, response=off, measured_off=measured)


def _cell_of(figures: dict[str, Scored], verdict: str, off: float | None, *, related: bool) -> Cell:
    """The worst that is said decides; a draw is right if nothing is wrong and something right."""
    if not related:
        return {"not_identifiable": "right_ok", "ok": "wrong_ok"}.get(verdict, "wrong_not_ok")  # type: ignore[return-value]
    cells = [f.cell for f in figures.values()]
    bent = off is not None and not off <= OFF
    if "wrong_ok" in cells or (bent and verdict == "ok"):
        return "wrong_ok"
    if "wrong_not_ok" in cells or (bent and verdict != "not_identifiable"):
        return "wrong_not_ok"
    told = [f.cell for f in figures.values() if f.tellable] or cells
    if verdict == "not_identifiable" or not any(c.startswith("right") for c in told):
        return "no_answer"
    good = all(c == "right_ok" for c in told if c.startswith("right"))
    return "right_ok" if good else "right_not_ok"


def _measured_off(measured: Any, truth: Response) -> bool | None:
    """Whether more than a twentieth of the measured points lie beyond 5 % and 5 deviations.

    Of a held or linear input the ratio of the samples' spectra counts as true as well.
    """
    if measured is None:
        return None
    f = np.asarray(measured.frequency, float)
    inside = (f >= truth.band[0]) & (f <= truth.band[1])
    if not inside.any():
        return None
    f = f[inside]
    if f.size > 200:
        pick = np.linspace(0, f.size - 1, 200).astype(int)
        f, index = f[pick], np.flatnonzero(inside)[pick]
    else:
        index = np.flatnonzero(inside)
    seen, std = np.asarray(measured.response)[index], np.asarray(measured.std)[index]

    def share(true: np.ndarray) -> float:
        error = np.abs(seen - true)
        return float(np.mean((error > OFF * np.abs(true)) & (error > DEVIATIONS * std)))

    least = share(truth.at(f))
    if least > FEW and truth.sampled is not None:
        least = min(least, share(truth.sampled(f)))
    return least > FEW
