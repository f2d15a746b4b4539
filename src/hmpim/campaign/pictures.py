"""The pictures of a study: responses and levels of a figure's cases over each other."""

import math
from collections.abc import Sequence

import numpy as np

from hmpim.campaign.compare import HEARD, bandwidth, case_label, samples_reading
from hmpim.campaign.plan import Compare, FigurePlan
from hmpim.campaign.study import Row
from hmpim.identify import Estimate, PairIdentification
from hmpim.plots.curves import BodeCurve, measured_curve, model_curve, stretches
from hmpim.plots.description import Figure as Description
from hmpim.plots.description import Panel
from hmpim.plots.fence import picket_fence
from hmpim.plots.overlay import PHASE, beside_bode, overlaid_bode, overlaid_levels, waveform_panels
from hmpim.report.figures import Picture

__all__ = ["pair_of", "section_pictures"]

_BESIDE: tuple[Compare, ...] = ("rates", "loads", "excitation")
_MODES = ("P", "PV", "PVA")
_MOST_BESIDE = 3  # columns that a page has room for
_MARKED = "Vertical lines mark the −90° bandwidths."
_SAMPLED: tuple[Compare, ...] = (
    "levels",
    "modes",
)  # compared with the hold: not every case is known without
_HOLD = "Phase with hold (deg)"
_MARKED_SAMPLED = (
    "Vertical lines mark the −90° frequencies of the sampled response. Its phase includes the hold "
    "of the command; the tables' bandwidths of position commands do not."
)
_CLEAR = 0.3  # share of the response: what is less sure is left out
_HALF = 0.5  # share of the axis over which a curve is clear: of less, noise is what is seen


def section_pictures(
    rows: Sequence[Row], figure: FigurePlan, found: Sequence[str]
) -> list[Picture]:
    """Draw what a figure of the plan compares, `found` in words for who cannot see it."""
    pictures = []
    words = " ".join(found)
    if figure.compare == "stimulus":
        levels = [
            (
                case_label(row, "stimulus", rows),
                np.array(row.stimulus["frequency"]),
                np.array(row.stimulus["level_db"]),
            )
            for row in rows
        ]
        unit = rows[0].stimulus["unit"] if rows else ""
        drawn = overlaid_levels(levels, unit=unit, level=HEARD, above=_waveforms(rows, unit))
        return [_picture("levels", figure.title, words, drawn)]
    if figure.compare == "axes":
        over = _overlaid(rows, rows, "axes")
        more = _MARKED + _left_out(rows, rows, "axes") + _gaps(rows)
        return [] if over is None else [_picture("axes", figure.title, words, over, more=more)]
    for axis in dict.fromkeys(row.axis for row in rows):
        if figure.compare == "fence":
            fence = _fence([row for row in rows if row.axis == axis])
            pictures.append(_picture(axis, f"{figure.title}: {axis}", words, fence))
            continue
        some = [row for row in rows if row.axis == axis]
        over = _overlaid(some, rows, figure.compare)
        if over is not None:
            title = f"{figure.title}: {axis}"
            more = _MARKED_SAMPLED if figure.compare in _SAMPLED else _MARKED
            more += _left_out(some, rows, figure.compare) + _gaps(some)
            pictures.append(_picture(axis, title, words, over, more=more))
    return pictures


def _left_out(rows: Sequence[Row], every: Sequence[Row], compare: Compare) -> str:
    """Which curves are not drawn, and why."""
    noisy = [case_label(row, compare, every) for row in rows if not _is_clear(row)]
    if not noisy:
        return ""
    return (
        f" Not drawn: {'; '.join(noisy)} (known to within {100 * _CLEAR:.0f} % over less than half "
        "of the band)."
    )


def _gaps(rows: Sequence[Row]) -> str:
    """Why a curve is interrupted, where one is."""
    drawn = [curve for row in rows if _is_clear(row) and (curve := _curve(row)) is not None]
    if all(len(stretches(curve.frequency)) == 1 for curve in drawn):
        return ""
    return " A curve is interrupted where axes that move at once cannot be distinguished."


def _overlaid(rows: Sequence[Row], every: Sequence[Row], compare: Compare) -> Description | None:
    """Responses side by side where they are few, else over each other; bandwidths marked."""
    drawn = [row for row in rows if _is_clear(row)]
    seen = [(row, curve) for row in drawn if (curve := _curve(row)) is not None]
    if not seen:
        return None
    if compare == "modes":
        seen.sort(key=lambda item: (_MODES.index(item[0].mode), item[0].rate))
        return beside_bode(
            [(f"{row.axis}, {row.mode}", curve) for row, curve in seen],
            bandwidths=[_bandwidth(row, compare) for row, _ in seen],
            within=[f"{row.rate:g} Hz" for row, _ in seen],
            phase_label=_HOLD,
        )
    if compare in _BESIDE and len(seen) <= _MOST_BESIDE:
        return beside_bode(
            [(case_label(row, compare, every), curve) for row, curve in seen],
            bandwidths=[_bandwidth(row, compare) for row, _ in seen],
        )
    return overlaid_bode(
        [(case_label(row, compare, every), curve) for row, curve in seen],
        bandwidths=[_bandwidth(row, compare) for row, _ in seen],
        pairs=compare != "axes",
        phase_label=_HOLD if compare in _SAMPLED else PHASE,
    )


def _waveforms(rows: Sequence[Row], unit: str) -> tuple[Panel, ...]:
    """Each axis's motion once: at another rate it is the same. None of studies without it."""
    first = {row.axis: row for row in reversed(rows)}
    seen = {axis: row.stimulus.get("history") for axis, row in sorted(first.items())}
    return waveform_panels(
        [
            (axis, np.array(history["time"]), np.array(history["position"]))
            for axis, history in seen.items()
            if history
        ],
        unit=unit,
    )


def _fence(rows: Sequence[Row]) -> Description:
    """Close-up of the upper half of the band, bin by bin."""
    low, high = rows[0].stimulus["band"]
    records = []
    for row in rows:
        bins = row.pair["bins"]
        ratio = np.array(bins["real"]) + 1j * np.array(bins["imag"])
        records.append(
            (case_label(row, "fence", rows), np.array(bins["frequency"]), ratio, _curve(row))
        )
    return picket_fence(records, band=(max(low, 0.55 * high), 0.75 * high))


def _picture(key: str, title: str, words: str, drawn: Description, *, more: str = "") -> Picture:
    caption = f"{title}. {more}".rstrip()
    return Picture(key=key, title=title, caption=caption, description=words, figure=drawn)


def pair_of(row: Row, *, clear: bool = False) -> PairIdentification:
    """Return what was identified in a row, as a pair that can be drawn.

    Parameters
    ----------
    row : Row
        As read back from JSON, where an unknown error is None.
    clear : bool
        True keeps the longest run of frequencies at which the response is clear.
    """
    parameters = {
        name: estimate if estimate and estimate["std"] is not None else None
        for name, estimate in row.pair["parameters"].items()
    }
    scale = row.pair["parameters"]["scale_factor"]
    if scale is not None and parameters["scale_factor"] is None:  # a curve needs its value alone
        parameters["scale_factor"] = {**scale, "std": 0.0, "ci95": [scale["value"]] * 2}
    response = dict(row.pair["frequency_response"])
    response["std"] = [math.inf if std is None else std for std in response["std"]]
    response["coherence"] = None
    runs: list[list[int]] = [[]]  # of neighbouring frequencies that are clear
    for k, std in enumerate(response["std"]):
        size = math.hypot(response["real"][k], response["imag"][k])
        if std < _CLEAR * size or (not clear and math.isfinite(std)):
            runs[-1].append(k)
        else:
            runs.append([])
    kept = max(runs, key=len)
    for name in ("frequency", "real", "imag", "std"):
        response[name] = [response[name][k] for k in kept]
    return PairIdentification.from_dict(
        {
            **row.pair,
            "parameters": parameters,
            "frequency_response": response,
            "bandwidths_from_response": {},
            "candidates": [],
        }
    )


def _is_clear(row: Row) -> bool:
    """Whether a response is known over at least half of the axis that it is drawn on."""
    response = row.pair["frequency_response"]
    f = np.array(response["frequency"], dtype=np.float64)
    if not np.any(f > 0):
        return False
    parts = zip(response["real"], response["imag"], response["std"], strict=True)
    clear = [std is not None and std < _CLEAR * math.hypot(re, im) for re, im, std in parts]
    width = np.gradient(np.log(f)) if f.size > 1 else np.ones(1)  # each one's share of the axis
    return bool(width[clear].sum() >= _HALF * width.sum())


def _curve(row: Row) -> BodeCurve | None:
    """Measured response of a row; its phase unwrapped beside the model's."""
    pair = pair_of(row, clear=True)
    seen = pair.frequency_response.frequency
    seen = seen[seen > 0]
    if not seen.size:
        return None
    return measured_curve(pair.frequency_response, near=model_curve(pair, seen, fs=row.rate))


def _bandwidth(row: Row, compare: Compare) -> Estimate | None:
    """-90° of a row, as the section's sentences give it."""
    found = samples_reading(row) if compare in _SAMPLED else bandwidth(row)
    if found is None or not found.std < found.value:  # it may lie anywhere
        return None
    return found.estimate
