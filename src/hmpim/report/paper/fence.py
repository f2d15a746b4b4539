"""Fig. 23: the picket fence, on a light resonance driven by held commands."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.experiment import run
from hmpim.identify.section_iv.response import phase
from hmpim.identify.section_iv.spectrum import (
    TransferFunction,
    decibel,
    spectrum,
    transfer_function,
)
from hmpim.plots.description import Axis, Curve, Figure, Item, Panel
from hmpim.report.figures import Picture
from hmpim.report.paper.bound import resonance_db
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.rows import Row, agreement
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, Stimulus, design

__all__ = ["fence_chapter"]

RATES = (500.0, 1000.0)  # Hz
DURATION = 5.0  # s; a bin is 0.2 Hz
SEEN = (20.0, 30.0)  # Hz
NEAR = (24.2, 26.0)  # Hz, where the bins can be told apart
BELOW = 22.0  # Hz, where the phase is compared
# its resonance lies half-way between two bins, the worst place
NATURAL, DAMPING, DELAY = 25.1, 0.01, 0.004
SYSTEM = Sensor(
    delay=DELAY, natural_frequency=NATURAL, damping_ratio=DAMPING, command="zoh", name="resonance"
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Case:
    """One command rate: its transfer function on the record's own bins, and between them."""

    rate: float
    stimulus: Stimulus
    bins: TransferFunction
    padded: TransferFunction


def fence_chapter() -> Chapter:
    """Make Fig. 23.

    Examples
    --------
    >>> sorted(fence_chapter().pictures)
    [23]
    """
    cases = [_case(rate) for rate in RATES]
    fences = [_peak(case.padded)[1] - _peak(case.bins)[1] for case in cases]
    words = " and ".join(
        f"{loss:.2f} dB at {case.rate:g} Hz" for loss, case in zip(fences, cases, strict=True)
    )
    picture = Picture(
        key="fig23",
        title="HMPIM analyses picket fence example",
        caption=f"A resonance at {NATURAL:g} Hz with damping ratio {DAMPING:g}, "
        f"{1e3 * DELAY:g} ms delay, commands held at 500 and at 1000 Hz, 5 s, Gaussian window. "
        f"The record's own bins are {1 / DURATION:g} Hz apart at either rate and miss the peak by "
        f"{words}; zeros after the windowed signal show what lies between. The window widens the "
        "resonance, and so lowers it, below its true height (dashed). The phase is late by half a "
        "command interval, less so at 1000 Hz.",
        description=f"Magnitude and phase at {NATURAL:g} Hz; the bins miss the peak by {words}.",
        figure=_figure(cases),
    )
    return Chapter(pictures={23: picture}, rows=tuple(_rows(cases)))


def _case(rate: float) -> _Case:
    limits = Limits(position=10.0, velocity=500.0, acceleration=40000.0, unit="deg")
    stimulus = design(band=(0.1, 40.0), duration=DURATION, fs=rate, limits=limits, lead=0)
    record = run(SYSTEM, stimulus)
    u, y = record.inputs[0].values, record.outputs[0].values
    return _Case(
        rate=rate,
        stimulus=stimulus,
        bins=transfer_function(u, y, rate, pad=0),
        padded=transfer_function(u, y, rate, pad=15 * u.size),
    )


def _around(response: TransferFunction) -> NDArray[np.bool_]:
    return np.asarray((response.frequency >= SEEN[0]) & (response.frequency <= SEEN[1]))


def _peak(response: TransferFunction) -> tuple[float, float]:
    """Frequency in Hz and level in dB of the greatest magnitude around the resonance."""
    seen = _around(response)
    level = decibel(response.response[seen])
    top = int(np.argmax(level))
    return float(response.frequency[seen][top]), float(level[top])


def _phase_at(response: TransferFunction, frequency: float) -> float:
    inside = (response.frequency > 0.5) & (response.frequency <= SEEN[1])
    turning = phase(response.response[inside])
    return float(np.interp(frequency, response.frequency[inside], turning))


def _true(frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """The resonance and its delay, nothing held."""
    s = 1j * frequency / NATURAL
    return np.asarray(
        np.exp(-2j * np.pi * frequency * DELAY) / (1.0 + 2.0 * DAMPING * s + s * s),
        dtype=np.complex128,
    )


def _rows(cases: list[_Case]) -> list[Row]:
    slow, fast = cases
    rows = [
        Row(
            figure=23,
            where="Fig. 23",
            quantity=f"Spacing of the bins, {case.rate:g} Hz",
            paper="finer at 1000 Hz",
            value=float(case.bins.frequency[1]),
            unit="Hz",
            why="Does not agree: the bins are 1/T apart at any rate, T being the duration. Zeros "
            "after the signal, or a longer T, make them finer.",
        )
        for case in cases
    ]
    for case in cases:
        on_bins, between = _peak(case.bins), _peak(case.padded)
        rows.append(
            Row(
                figure=23,
                where="Fig. 23",
                quantity=f"Peak missed by the bins, {case.rate:g} Hz",
                paper="less with padding",
                value=between[1] - on_bins[1],
                unit="dB",
                why=f"Agrees: the bins say {on_bins[0]:.2f} Hz, padded {between[0]:.2f} Hz, the "
                f"truth is {NATURAL:g} Hz.",
            )
        )
    rows += [
        Row(
            figure=23,
            where="Fig. 23",
            quantity=f"Phase at {BELOW:g} Hz, commands at {case.rate:g} Hz",
            paper="better at 1000 Hz",
            value=_phase_at(case.padded, BELOW),
            truth=float(np.degrees(np.angle(_true(np.array([BELOW]))[0]))),
            unit="deg",
            why="Agrees: a held command is late by half a sample, "
            f"{180.0 * BELOW / case.rate:.1f}° here.",
        )
        for case in cases
    ]
    level = [
        float(np.interp(NATURAL, x.frequency, decibel(x.value)))
        for x in (spectrum(case.stimulus.position, case.rate) for case in (slow, fast))
    ]
    rows.append(
        Row(
            figure=23,
            where="Fig. 23",
            quantity=f"Level of the stimulus at {NATURAL:g} Hz gained at 1000 Hz",
            paper="6 dB (Fig. 18)",
            value=level[1] - level[0],
            unit="dB",
            why=agreement(level[1] - level[0], 6.0, within=0.1),
        )
    )
    return rows


def _figure(cases: list[_Case]) -> Figure:
    panels = []
    for column, case in enumerate(cases):
        magnitude: list[Item] = []
        lag: list[Item] = []
        for response, marked in ((case.padded, False), (case.bins, True)):
            seen = _around(response)
            f, g = response.frequency[seen], response.response[seen]
            curve = Curve(x=f, y=decibel(g), label="padded")
            if marked:
                curve = replace(
                    curve,
                    label="bins",
                    colour="output",
                    dashes=":",
                    width=0.9,
                    marker="o",
                    size=3.5,
                )
            magnitude.append(replace(curve, label=""))
            lag.append(replace(curve, y=phase(g)))
        f = np.linspace(*SEEN, 1001)
        truth = _true(f)
        true = Curve(x=f, y=decibel(truth), colour="model", dashes="--", label="truth")
        magnitude.append(replace(true, label=""))
        lag.append(replace(true, y=phase(truth)))
        top = resonance_db(DAMPING)
        panels += [
            Panel(
                x=Axis(label="Frequency (Hz)", low=NEAR[0], high=NEAR[1]),
                y=Axis(label="" if column else "Magnitude (dB)", low=top - 12.0, high=top + 1.0),
                items=tuple(magnitude),
                title=f"{case.rate:g} Hz",
                column=column,
            ),
            Panel(
                x=Axis(label="Frequency (Hz)", low=SEEN[0], high=SEEN[1]),
                y=Axis(label="" if column else "Phase (deg)", degrees=True, low=-260.0, high=0.0),
                items=tuple(lag),
                row=1,
                column=column,
                legend=not column,
            ),
        ]
    return Figure(
        panels=tuple(panels),
        alt="Magnitude and phase about a resonance, at the bins and between them.",
        heights=(2.4, 2.4),
        columns=len(cases),
        share_x=False,
    )
