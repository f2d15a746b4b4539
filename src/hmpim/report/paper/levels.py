"""Figs 12 to 14: sweeps inside limits, their levels, and what a window does."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.section_iv.spectrum import decibel, spectrum
from hmpim.identify.section_iv.windows import WindowName, window_samples
from hmpim.plots import Axis, Curve, Figure, Panel, Rule, spectrum_curve
from hmpim.plots.description import Dashes, Item
from hmpim.plots.style import Colour, axis_label
from hmpim.report.figures import Picture
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.rows import Row, agreement, shown
from hmpim.stimulus import Limits, Stimulus, design
from hmpim.units import rate_label

__all__ = ["levels_chapter"]

FS = 500.0  # Hz
ALPHA = 1.5
WINDOWS: tuple[tuple[WindowName, str, Colour, Dashes], ...] = (
    ("rectangular", "Rectangular", "muted", "-"),
    ("gaussian", f"Gaussian, α = {ALPHA:g}", "input", "-"),
    ("hann", "Hann", "output", "--"),
    ("hamming", "Hamming", "other", "-."),
    ("blackman", "Blackman", "limit", "--"),
    ("flattop", "Flat top", "model", "-."),
)


def levels_chapter() -> Chapter:
    """Make Figs 12 to 14.

    Examples
    --------
    >>> chapter = levels_chapter()
    >>> chapter.rows[0].quantity, chapter.rows[0].value
    ('Extinction factor n, T = 5 s', 0.0)
    """
    twelve = {T: _sweep(10.0, 1000.0, T) for T in (5.0, 10.0)}
    thirteen = {T: _sweep(40.0, 500.0, T) for T in (5.0, 10.0, 12.0)}
    pictures = {
        12: _level_picture(12, twelve[5.0]),
        13: _level_picture(13, thirteen[12.0]),
        14: _window_picture(),
    }
    return Chapter(pictures=pictures, rows=(*_rows_12(twelve), *_rows_13(thirteen)))


def _sweep(last: float, rate: float, duration: float, *, fs: float = FS) -> Stimulus:
    """The paper's waveform from 0.1 Hz to `last`, as printed, with limits of Figs 12 and 13."""
    limits = Limits(position=10.0, velocity=rate, acceleration=40000.0, unit="deg")
    return design(band=(0.1, last), duration=duration, fs=fs, limits=limits, lead=0)


def _level(stimulus: Stimulus, frequency: float, *, window: WindowName = "gaussian") -> float:
    """Level of the position's DFT at `frequency`, dB re 1 deg."""
    bins = spectrum(stimulus.position, stimulus.fs, window=window, alpha=ALPHA)
    return float(np.interp(frequency, bins.frequency, decibel(bins.value)))


def _ripple(stimulus: Stimulus, window: WindowName) -> float:
    """Root mean square of the level about a parabola from 8 to 9.5 Hz, dB."""
    bins = spectrum(stimulus.position, stimulus.fs, window=window, alpha=ALPHA)
    inside = (bins.frequency >= 8.0) & (bins.frequency <= 9.5)
    f, level = bins.frequency[inside], decibel(bins.value[inside])
    smooth = np.polynomial.Polynomial.fit(f, level, 2)
    return float(np.sqrt(np.mean((level - smooth(f)) ** 2)))


def _amplitude(stimulus: Stimulus, time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Envelope G/σ₂ of the sweep, equation (5), in its unit."""
    gain, n, band = stimulus.gain, stimulus.extinction, stimulus.band
    if gain is None or n is None or band is None:
        return np.zeros_like(time)
    a = 2.0 * math.pi * (band[1] - band[0]) / stimulus.sweep_duration
    return np.asarray(gain / (2.0 * math.pi * band[0] + 0.5 * a * time**n))


def _rows_12(sweeps: dict[float, Stimulus]) -> list[Row]:
    short = sweeps[5.0]
    level = {T: _level(stimulus, 10.0) for T, stimulus in sweeps.items()}
    plain = _level(short, 10.0, window="rectangular")
    bare, tapered = _ripple(short, "rectangular"), _ripple(short, "gaussian")
    double = _level(_sweep(10.0, 1000.0, 5.0, fs=2 * FS), 10.0) - level[5.0]
    rows = [
        Row(
            figure=12,
            where="Fig. 12",
            quantity=f"Extinction factor n, T = {T:g} s",
            paper="0",
            value=stimulus.extinction,
            why=agreement(stimulus.extinction, 0.0, within=5e-4),
        )
        for T, stimulus in sweeps.items()
    ]
    rows += [
        Row(
            figure=12,
            where="Fig. 12",
            quantity=f"Peak {quantity}, T = {T:g} s",
            paper=f"≤ {limit:g} {rate_label('deg', order)}",
            value=getattr(stimulus.peaks, quantity),
            unit=rate_label("deg", order),
            why="The paper prints the limit; "
            f"{100 * getattr(stimulus.peaks, quantity) / limit:.0f} % of it is used.",
        )
        for T, stimulus in sweeps.items()
        for order, (quantity, limit) in enumerate(
            (("position", 10.0), ("velocity", 1000.0), ("acceleration", 40000.0))
        )
    ]
    rows += [
        Row(
            figure=12,
            where="Fig. 12",
            quantity=f"Level at 10 Hz with the window, T = {T:g} s",
            paper="50 dB",
            value=value,
            unit="dB",
            why=agreement(value, 50.0, within=1.0, otherwise="T is not printed; 5 s is nearer."),
        )
        for T, value in level.items()
    ]
    rows += [
        Row(
            figure=12,
            where="Fig. 12",
            quantity="Level at 10 Hz without window, T = 5 s",
            value=plain,
            unit="dB",
            why=f"Not printed. The window costs {plain - level[5.0]:.1f} dB at the sweep's end.",
        ),
        Row(
            figure=12,
            where="Fig. 12",
            quantity="Leakage: ripple from 8 to 9.5 Hz with the window, T = 5 s",
            paper="reduced",
            value=tapered,
            unit="dB rms",
            why=f"{'Agrees: it is' if tapered < bare else 'Does not agree: it is'} {bare:.2g} dB "
            "without window.",
        ),
        _row_double(12, double, "the transform is a sum over samples, and there are twice as many"),
    ]
    return rows


def _rows_13(sweeps: dict[float, Stimulus]) -> list[Row]:
    long = sweeps[12.0]
    time = np.linspace(0.0, long.sweep_duration, 24001)[1:]
    amplitude = _amplitude(long, time)
    reached = float(np.interp(-1.0, -amplitude, time))
    frequency = 0.1 + 39.9 * reached / long.sweep_duration
    level = {T: _level(stimulus, 40.0) for T, stimulus in sweeps.items()}
    double = _level(_sweep(40.0, 500.0, 12.0, fs=2 * FS), 40.0) - level[12.0]
    rows = [
        Row(
            figure=13,
            where="Fig. 13",
            quantity=f"Smallest extinction factor n, T = {T:g} s",
            paper="0.81",
            value=stimulus.extinction,
            why=agreement(
                stimulus.extinction,
                0.81,
                within=0.005,
                otherwise="T is not printed; n agrees best at 12 s, the level at 5 s.",
            ),
        )
        for T, stimulus in sweeps.items()
    ]
    rows += [
        Row(
            figure=13,
            where="Fig. 13",
            quantity="Peak velocity, T = 12 s",
            paper="≤ 500 deg/s",
            value=long.peaks.velocity,
            unit="deg/s",
            why="The paper prints the limit; the acceleration binds before it, with "
            f"{shown(long.peaks.acceleration)} of 40000 deg/s².",
        ),
        Row(
            figure=13,
            where="Fig. 13",
            quantity="Amplitude at 40 Hz, T = 12 s",
            paper="~1 deg",
            value=float(amplitude[-1]),
            unit="deg",
            why="Cannot be: the acceleration limit allows 40 000/(2π·40)² = "
            f"{40000.0 / (2.0 * math.pi * 40.0) ** 2:.2f} deg there. The amplitude G/σ₂ passes "
            f"1 deg at {frequency:.3g} Hz, so that ~1 deg holds for the higher frequencies as a "
            "whole.",
        ),
    ]
    rows += [
        Row(
            figure=13,
            where="Fig. 13",
            quantity=f"Level at 40 Hz with the window, T = {T:g} s",
            paper="20 dB",
            value=value,
            unit="dB",
            why=agreement(
                value,
                20.0,
                within=1.0,
                otherwise="The paper's level is read off a plot; no T gives both its n and its "
                "level.",
            ),
        )
        for T, value in level.items()
    ]
    return [*rows, _row_double(13, double, "as for Fig. 12")]


def _row_double(figure: int, gained: float, because: str) -> Row:
    return Row(
        figure=figure,
        where=f"Fig. {figure}",
        quantity="Level gained by twice the sampling rate",
        paper="6 dB (Fig. 18)",
        value=gained,
        unit="dB",
        why=agreement(gained, 6.0, within=0.1, because=because),
    )


def _level_picture(number: int, stimulus: Stimulus) -> Picture:
    band = stimulus.band or (0.0, 0.0)
    peaks = stimulus.peaks
    made = (
        f"{band[0]:g} to {band[1]:g} Hz in {stimulus.duration:g} s at {stimulus.fs:g} Hz, "
        f"n = {stimulus.extinction:g}, peaks {peaks.position:.4g} deg, {peaks.velocity:.4g} deg/s, "
        f"{shown(peaks.acceleration)} deg/s²"
    )
    levels = (
        f"{_level(stimulus, band[1], window='rectangular'):.1f} dB at {band[1]:g} Hz without "
        f"window, {_level(stimulus, band[1]):.1f} dB with the Gaussian window, α = {ALPHA:g}"
    )
    return Picture(
        key=f"fig{number}",
        title="DFT of HMPIM and windowing effects",
        caption=f"Above: the sweep inside its limits (dashed), {made}. Below: its DFT in dB re "
        f"1 deg, {levels}. The zeros that fill the picket fence follow the windowed signal.",
        description=f"Time histories of a sweep, {made}, and its spectra: {levels}.",
        figure=_level_figure(stimulus),
    )


def _level_figure(stimulus: Stimulus) -> Figure:
    panels = []
    limits = stimulus.limits
    for order, quantity in enumerate(("position", "velocity", "acceleration")):
        values = getattr(stimulus, quantity)
        items: list[Item] = [Curve(x=stimulus.time, y=values, width=1.0)]
        if limits is not None:
            bound = getattr(limits, quantity)
            label = "" if order else "limit"
            items += [Rule(at=at, axis="y", label=label) for at in (-bound, bound)]
        panels.append(
            Panel(
                x=Axis(label="Time (s)" if order == 2 else "", numbered=order == 2),
                y=Axis(label=axis_label(quantity.capitalize(), rate_label(stimulus.unit, order))),
                items=tuple(items),
                row=order,
                columns=2,
            )
        )
    band = stimulus.band or (0.1, stimulus.fs / 2)
    kinds: tuple[tuple[str, WindowName], ...] = (
        ("No window", "rectangular"),
        (f"Gaussian window, α = {ALPHA:g}", "gaussian"),
    )
    for column, (title, window) in enumerate(kinds):
        bins = spectrum(stimulus.position, stimulus.fs, window=window, alpha=ALPHA)
        level = _level(stimulus, band[1], window=window)
        words = f"{level:.1f} dB at {band[1]:g} Hz"
        panels.append(
            Panel(
                x=Axis(label="Frequency (Hz)", scale="log", low=band[0] / 2, high=band[1] * 2.5),
                y=Axis(label="Level (dB re 1 deg)", low=-10.0, high=85.0),
                items=(
                    spectrum_curve(bins.frequency, decibel(bins.value)),
                    Rule(at=band[1], words=words, words_at=0.22),
                ),
                title=title,
                row=3,
                column=column,
            )
        )
    return Figure(
        panels=tuple(panels),
        alt="A sweep inside its limits, and its spectra without and with a window.",
        heights=(1.65, 1.65, 1.65, 2.3),
        columns=2,
        share_x=False,
    )


def _window_picture() -> Picture:
    n = 1001
    ends = float(window_samples("gaussian", n, alpha=ALPHA)[0])
    place = np.linspace(-0.5, 0.5, n)
    in_time, in_frequency = [], []
    for name, label, colour, dashes in WINDOWS:
        samples = window_samples(name, n, alpha=ALPHA)
        window = Curve(x=place, y=samples, colour=colour, label=label, dashes=dashes)
        # one unit of this axis is one bin of the record's own transform
        bins = spectrum(samples, float(n), window="rectangular", pad=31 * n)
        seen = bins.frequency <= 8.0
        level = decibel(bins.value[seen] / samples.sum())
        in_time.append(window)
        in_frequency.append(replace(window, x=bins.frequency[seen], y=level, label="", width=1.0))
    figure = Figure(
        panels=(
            Panel(
                x=Axis(label="Time (share of the record)"),
                y=Axis(label="Window (–)"),
                items=tuple(in_time),
            ),
            Panel(
                x=Axis(label="Frequency (bins of the record, 1/T)"),
                y=Axis(label="Level re DC (dB)", low=-110.0, high=5.0),
                items=tuple(in_frequency),
                row=1,
            ),
        ),
        alt="Windows over time, and the levels of their transforms.",
        heights=(2.5, 2.5),
        share_x=False,
    )
    return Picture(
        key="fig14",
        title="Time and frequency domain windowing examples",
        caption="Windows over a record of length T, and their transforms. The Gaussian of "
        f"equation (15) with α = {ALPHA:g} ends at {ends:.3f}.",
        description="Six windows over time, and the levels of their transforms up to 8/T.",
        figure=figure,
    )
