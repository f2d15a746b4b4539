"""What a figure's cases say about each other, in sentences with numbers."""

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

from hmpim.campaign.crossing import first_crossing, samples_bandwidth
from hmpim.campaign.plan import Compare
from hmpim.campaign.study import Reading, Row
from hmpim.identify.result.digits import percent as in_percent
from hmpim.plots.style import with_error

__all__ = [
    "HEARD",
    "LINEAR",
    "bandwidth",
    "case_label",
    "findings",
    "linear_from",
    "samples_reading",
]

LINEAR = 0.05
"""Largest departure from the bandwidth at the largest level that still counts as linear."""

HEARD = 30.0
"""Level in dB that the paper calls sufficient (Fig. 18)."""


def bandwidth(row: Row) -> Reading | None:
    """The -90° bandwidth of the fitted model, or read off the response where there is no model."""
    return row.parameters.get("bandwidth_phase90") or row.measured_bandwidth


def samples_reading(row: Row) -> Reading | None:
    """The -90° of the sampled response, read off it: friction fits no linear structure.

    Its error is that of the reading it starts from, the surer of the model's and the response's;
    where the response tells nothing, that is the answer.
    """
    known = [row.parameters.get("bandwidth_phase90"), row.measured_bandwidth]
    start = min((r for r in known if r is not None), key=lambda r: r.std, default=None)
    if start is None:
        return None
    found = samples_bandwidth(row.pair["frequency_response"], near=start.value)
    return start if found is None else replace(start, value=found, ci95=None)


def case_label(row: Row, compare: Compare, among: Sequence[Row]) -> str:
    """What tells a row from the others of a figure."""
    what = {
        "rates": f"{row.rate:g} Hz",
        "stimulus": f"{row.rate:g} Hz",
        "fence": f"{row.rate:g} Hz",
        "loads": row.load,
        "levels": f"{row.peaks[2]:.0f} {row.stimulus['unit']}/s²",
        "modes": f"{row.mode}, {row.rate:g} Hz",
        "excitation": "all at once" if row.together else "alone",
        "axes": _varied(row, [other for other in among if other.axis == row.axis]),
    }[compare]
    if not what:
        return row.axis
    return f"{row.axis}, {what}"


def _varied(row: Row, among: Sequence[Row]) -> str:
    """What is not the same in all rows."""
    said = {
        "test": row.test,
        "load": row.load,
        "mode": row.mode,
        "rate": f"{row.rate:g} Hz",
        "level": f"{row.peaks[2]:.0f} {row.stimulus['unit']}/s²",
    }
    return ", ".join(
        words for name, words in said.items() if len({getattr(other, name) for other in among}) > 1
    )


def findings(
    rows: Sequence[Row], couplings: Sequence[dict[str, Any]], compare: Compare
) -> tuple[str, ...]:
    """Sentences for the rows of a figure, one axis after the other."""
    says: dict[Compare, Callable[[str, list[Row]], str]] = {
        "rates": _rates,
        "loads": _loads,
        "levels": _levels,
        "modes": _modes,
        "excitation": _excitation,
        "stimulus": _stimulus,
        "fence": _fence,
        "axes": _axes,
    }
    found = []
    for axis in dict.fromkeys(row.axis for row in rows):
        sentence = says[compare](axis, [row for row in rows if row.axis == axis])
        if sentence:
            found.append(sentence)
    if compare == "modes" and any(_lifted(row) for row in rows):
        found.append(
            "Friction adds damping, which advances the phase beyond the servo's natural frequency: "
            "with feedforward, friction raises the bandwidth where it is not part of the model."
        )
    if compare in ("excitation", "axes"):
        if couplings:
            found.append(_strongest(couplings))
        found += _loaded([row for row in rows if row.together])
    return tuple(found)


def _percent(value: float, base: float) -> float:
    return 100.0 * (value / base - 1.0)


def _apart(a: float, b: float) -> str:
    percent = abs(_percent(b, a))
    return "less than 0.01 %" if percent < 0.01 else f"{in_percent(0.01 * percent)} %"


def _rates(axis: str, rows: list[Row]) -> str:
    read = [(row, b) for row in rows if (b := bandwidth(row)) is not None]
    if len(read) < 2:
        return ""
    (first, a), (last, b) = read[0], read[-1]
    return (
        f"{axis}: {a.value:.2f} Hz at {first.rate:g} Hz, {b.value:.2f} Hz at {last.rate:g} Hz, "
        f"{_apart(a.value, b.value)} apart." + _paper_rates(first, last)
    )


def _paper_rates(first: Row, last: Row) -> str:
    if first.paper_bandwidth is None or last.paper_bandwidth is None:
        return ""
    return (
        f" The paper's own steps, which see the hold too, give {first.paper_bandwidth:.2f} and "
        f"{last.paper_bandwidth:.2f} Hz."
    )


def _loads(axis: str, rows: list[Row]) -> str:
    read = [(row, b) for row in rows if (b := bandwidth(row)) is not None]
    if len(read) < 2:
        return ""
    (first, a), (last, b) = read[0], read[-1]
    text = (
        f"{axis}: {a.value:.2f} Hz with {first.load}, {b.value:.2f} Hz with {last.load}, "
        f"a ratio of {b.value / a.value:.3f}."
    )
    if first.inertia and last.inertia:
        ratio = first.inertia / last.inertia
        text += (
            f" Torque over inertia falls to {ratio:.3f}; the bandwidth follows it to the power "
            f"{math.log(b.value / a.value) / math.log(ratio):.2f}."
        )
    return text


def linear_from(rows: Sequence[Row]) -> Row | None:
    """Smallest level from which on the bandwidth stays within `LINEAR` of the largest level's."""
    read = sorted(
        ((row, b) for row in rows if (b := samples_reading(row)) is not None),
        key=lambda item: item[0].peaks[2],
    )
    smallest = None
    for row, b in reversed(read):
        if abs(b.value / read[-1][1].value - 1.0) > LINEAR:
            break
        smallest = row
    return smallest


def _levels(axis: str, rows: list[Row]) -> str:
    read = sorted(
        ((row, b) for row in rows if (b := samples_reading(row)) is not None),
        key=lambda item: item[0].peaks[2],
    )
    start = linear_from(rows)
    if len(read) < 2 or start is None:
        return ""
    (low, a), (high, b) = read[0], read[-1]
    unit = f"{low.stimulus['unit']}/s²"
    text = (
        f"{axis}: {a.value:.2f} Hz at {low.peaks[2]:.0f} {unit}, {b.value:.2f} Hz at "
        f"{high.peaks[2]:.0f} {unit}. Linear to {100 * LINEAR:.0f} % from "
        f"{start.peaks[2]:.0f} {unit} on, read off the sampled responses."
    )
    if a.value < (1.0 - LINEAR) * b.value:
        text += " Dry friction lowers the bandwidth of small motions."
    exact = high.pair["known"].get("exact_samples_bandwidth")
    if exact is not None:
        text += f" Without friction it is {exact:.2f} Hz at every level."
    return text


def _modes(axis: str, rows: list[Row]) -> str:
    """The sampled response for every mode: behind the hold there is no figure for all three."""
    said = []
    for rate in sorted({row.rate for row in rows}):
        seen, exact = [], []
        for row in (row for row in rows if row.rate == rate):
            known = row.pair["known"].get("exact_samples_bandwidth")
            seen.append(f"{row.mode} {_samples_in_words(row)}")
            exact += [] if known is None else [f"{known:.1f}"]
        if len(seen) > 1:
            free = f" (without friction {', '.join(exact)} Hz)" if len(exact) == len(seen) else ""
            said.append(f"at {rate:g} Hz {', '.join(seen)}{free}")
    if not said:
        return ""
    return f"{axis}, −90° of the sampled response: " + "; ".join(said) + "."


def _samples_in_words(row: Row) -> str:
    """The -90° of the sampled response, said to be read off it where no model reaches it."""
    reading = samples_reading(row)
    if reading is not None:
        return f"{reading.value:.1f} Hz"
    response = row.pair["frequency_response"]
    near = first_crossing(response)
    found = None if near is None else samples_bandwidth(response, near=near)
    if found is None:
        return "unknown (the response is too noisy there)"
    return f"{found:.1f} Hz (read off the response; the model does not reach −90°)"


def _lifted(row: Row) -> bool:
    """Whether the bandwidth with a friction that is not modelled is above that without."""
    reading, known = samples_reading(row), row.pair["known"].get("exact_samples_bandwidth")
    if reading is None or known is None or row.pair.get("nonlinear_part") is not None:
        return False
    return bool(reading.value > 1.01 * known)


def _axes(axis: str, rows: list[Row]) -> str:
    return f"{axis}: " + "; ".join(_at_90(row, _varied(row, rows)) for row in rows) + "."


def _at_90(row: Row, varied: str) -> str:
    found = bandwidth(row)
    where = f" ({varied})" if varied else ""
    if found is None:
        return f"no bandwidth{where}"
    text = f"−90° at {with_error(found.estimate)} Hz{where}"
    if row.exact_bandwidth is not None:
        off = _percent(found.value, row.exact_bandwidth)
        text += f", {abs(off):.1f} % {'above' if off > 0.0 else 'below'} the exact value without "
        text += f"friction, {row.exact_bandwidth:.2f} Hz"
    return text


def _excitation(axis: str, rows: list[Row]) -> str:
    joint = [row for row in rows if row.together]
    alone = [row for row in rows if not row.together and joint and row.rate == joint[0].rate]
    if not joint or not alone:
        return ""
    a, b = bandwidth(alone[0]), bandwidth(joint[0])
    if a is None or b is None:
        return f"{axis}: no bandwidth from one of the two."
    paper = joint[0].paper_bandwidth
    stepwise = "" if paper is None else f" (the paper's own steps: {paper:.2f} Hz)"
    return (
        f"{axis}: {a.value:.2f} Hz alone, {b.value:.2f} Hz with all axes at once, "
        f"{_apart(a.value, b.value)} apart{stepwise}."
    )


def _loaded(rows: Sequence[Row]) -> list[str]:
    """Torque of each axis that was predicted before anything moved."""
    known = [f"{row.axis} {100.0 * row.torque:.0f} %" for row in rows if row.torque is not None]
    if not known:
        return []
    return [
        "Predicted peak torque with all axes moving together, checked before any motion, as shares "
        f"of the limit: {', '.join(known)}."
    ]


def _strongest(couplings: Sequence[dict[str, Any]]) -> str:
    seen = [c for c in couplings if c["std"] is not None and c["gain"] > 3.0 * c["std"]]
    low, high = couplings[0]["band"]
    where = f"from {low:g} to {high:g} Hz"
    if not seen:
        return f"No coupling {where} exceeds three standard deviations."
    top = max(seen, key=lambda c: c["gain"])
    exact = top.get("exact")
    beside = "" if exact is None else f" (exact without friction: {100 * exact:.2f} %)"
    return (
        f"{len(seen)} of {len(couplings)} couplings {where} exceed three standard "
        f"deviations; the strongest is {top['from']} to {top['to']}, "
        f"{100 * top['gain']:.2f} ± {100 * top['std']:.2f} % of the command{beside}."
    )


def _level_at(row: Row, frequency: float) -> float:
    import numpy as np

    return float(np.interp(frequency, row.stimulus["frequency"], row.stimulus["level_db"]))


def _stimulus(axis: str, rows: list[Row]) -> str:
    at = 0.5 * rows[0].stimulus["band"][1]
    levels = [(row.rate, _level_at(row, at)) for row in rows]
    text = ", ".join(f"{level:.1f} dB at {rate:g} Hz" for rate, level in levels)
    reach = [f"{_heard_to(row):.3g}" for row in rows]
    n = rows[0].stimulus["extinction"]
    more = f", {levels[-1][1] - levels[0][1]:.1f} dB more" if len(levels) > 1 else ""
    shape = "" if n is None else f"extinction n = {n:.3f}; "
    return (
        f"{axis}: {shape}level at {at:g} Hz of {text}{more} (Gaussian window, α = 1.5); above "
        f"{HEARD:g} dB up to {' and '.join(reach)} Hz."
    )


def _heard_to(row: Row) -> float:
    """Frequency up to which the level stays above `HEARD`, from where it first is."""
    heard = 0.0
    for f, level in zip(row.stimulus["frequency"], row.stimulus["level_db"], strict=True):
        if level >= HEARD:
            heard = f
        elif heard:
            break
    return heard


def _fence(axis: str, rows: list[Row]) -> str:
    parts, jumps = [], []
    for row in rows:
        high = row.stimulus["band"][1]
        std = _scatter(row, 0.5 * high, 0.9 * high)
        if std is not None:
            parts.append(f"{in_percent(0.01 * std)} % at {row.rate:g} Hz")
        jumps.append(
            f"{in_percent(0.01 * _bin_scatter(row, 0.5 * high, 0.9 * high))} % at {row.rate:g} Hz"
        )
    bin_width = 1.0 / (rows[0].stimulus["samples"] / rows[0].rate)
    if not parts:
        return ""
    return (
        f"{axis}: bins of the record are {bin_width:.3f} Hz apart at either rate. Over the upper "
        f"half of the band the ratio of the spectra scatters from bin to bin by "
        f"{' and '.join(jumps)} (r.m.s.); the local estimate of the response, which also holds "
        f"between the bins, has a standard deviation of {' and '.join(parts)} (median). The faster "
        "commands bring twice the samples of the same motion, and no peak is lost between bins."
    )


def _bin_scatter(row: Row, low: float, high: float) -> float:
    """R.m.s. of half the second difference from bin to bin, in percent of the response."""
    bins = row.pair["bins"]
    z = [
        complex(re, im)
        for f, re, im in zip(bins["frequency"], bins["real"], bins["imag"], strict=True)
        if low <= f <= high
    ]
    bends = [
        abs(a - 2.0 * b + c) ** 2 / 6.0 / max(abs(b) ** 2, 1e-300)
        for a, b, c in zip(z, z[1:], z[2:], strict=False)
    ]
    return 100.0 * math.sqrt(sum(bends) / len(bends)) if bends else math.nan


def _scatter(row: Row, low: float, high: float) -> float | None:
    response = row.pair["frequency_response"]
    shares = sorted(
        std / math.hypot(re, im)
        for f, re, im, std in zip(
            response["frequency"],
            response["real"],
            response["imag"],
            response["std"],
            strict=True,
        )
        if low <= f <= high and std is not None
    )
    return 100.0 * shares[len(shares) // 2] if shares else None
