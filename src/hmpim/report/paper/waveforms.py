"""Figs 3 and 5, and equations (1) to (7): stimuli in time and frequency."""

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.section_iv.spectrum import decibel, spectrum
from hmpim.plots import Axis, Curve, Figure, Panel, spectrum_curve, time_histories
from hmpim.report.figures import Picture
from hmpim.report.paper.bound import cramer_rao
from hmpim.report.paper.chapter import Chapter
from hmpim.report.paper.rows import Row, shown
from hmpim.report.paper.sample import SYSTEM
from hmpim.stimulus import (
    Chirp,
    Limits,
    Ramp,
    Sine,
    Step,
    Stimulus,
    SumOfSines,
    Sweep,
    Waveform,
    design,
)

__all__ = ["waveforms_chapter"]

BAND = (0.1, 20.0)  # Hz
DURATION = 10.0  # s
FS = 200.0  # Hz
LINES = (0.5, 1.0, 2.0, 5.0, 10.0)  # Hz, of the sum of sines
PERSISTENT = -20.0  # dB re the greatest: above it a frequency counts as excited


def waveforms_chapter() -> Chapter:
    """Make Figs 3 and 5, and check equations (1) to (7).

    Examples
    --------
    >>> sorted(waveforms_chapter().pictures)
    [3, 5]
    """
    limits = Limits(position=10.0, velocity=100.0, acceleration=10000.0, unit="deg")
    constrained = design(band=BAND, duration=DURATION, fs=500.0, limits=limits, lead=0)
    peaks = constrained.peaks
    reached = (
        f"n = {constrained.extinction:g}, peaks {peaks.position:.4g} deg, "
        f"{peaks.velocity:.4g} deg/s, {shown(peaks.acceleration)} deg/s²"
    )
    waves = _classical()
    shares = {name: _persistence(wave) for name, wave in waves.items()}
    others = max(share for name, share in shares.items() if name != "Chirp")
    words = ", ".join(f"{name.lower()} {100 * share:.3g} %" for name, share in shares.items())
    pictures = {
        3: Picture(
            key="fig03",
            title="Example of input stimulus with constraints",
            caption="A sweep from 0.1 to 20 Hz, its gain and its extinction solved so that all "
            f"three limits (dashed) are kept: {reached}.",
            description=f"Position, velocity and acceleration over 10 s inside limits: {reached}.",
            figure=time_histories(constrained),
        ),
        5: Picture(
            key="fig05",
            title="Frequency domain characteristics of waveforms",
            caption="Five test waveforms and their discrete Fourier transforms. Share of "
            f"0.1 to 20 Hz that lies within 20 dB of the greatest: {words}.",
            description=f"Time histories and spectra; share of the band excited: {words}.",
            figure=_figure_5(waves),
        ),
    }
    rows = (
        _row_plain_chirp(),
        _row_third_term(),
        Row(
            figure=5,
            where="Fig. 5",
            quantity="Share of 0.1–20 Hz within 20 dB of the greatest: chirp",
            paper="persistent",
            value=100.0 * shares["Chirp"],
            unit="%",
            why="Agrees: the chirp is the only one of the five; the next best has "
            f"{100 * others:.2g} %.",
        ),
        _row_tests(waves),
    )
    return Chapter(pictures=pictures, rows=rows)


def _classical() -> dict[str, Waveform]:
    size = 1.0 / len(LINES)
    return {
        "Step": Step(duration=DURATION, start=1.0),
        "Ramp": Ramp(rate=1.0 / (DURATION - 1.0), duration=DURATION, start=1.0),
        "Sine": Sine(frequency=2.0, duration=DURATION),
        "Sum of sines": SumOfSines(
            amplitudes=(size,) * len(LINES), frequencies=LINES, duration=DURATION
        ),
        "Chirp": Chirp(band=BAND, duration=DURATION),
    }


def _persistence(waveform: Waveform) -> float:
    """Share of the band's bins that lie within 20 dB of the greatest."""
    x = Stimulus(waveform=waveform, fs=FS).position
    bins = spectrum(x, FS, window="rectangular", pad=0)
    inside = (bins.frequency >= BAND[0] - 1e-9) & (bins.frequency <= BAND[1] + 1e-9)
    level = decibel(bins.value[inside])
    return float(np.mean(level >= level.max() + PERSISTENT))


def _row_tests(waves: dict[str, Waveform]) -> Row:
    """What one record of each waveform can tell of Fig. 17's system: section III's argument."""
    bounds = {
        name: cramer_rao(SYSTEM, Stimulus(waveform=wave, fs=FS)).natural_frequency
        for name, wave in waves.items()
    }
    step, chirp = bounds["Step"], bounds["Chirp"]
    return Row(
        figure=5,
        where="Fig. 5",
        quantity="Smallest possible error of Fig. 17's natural frequency from one record",
        paper="chirp only",
        text=", ".join(f"{name.lower()} {shown(bound)} Hz" for name, bound in bounds.items()),
        truth=SYSTEM.natural_frequency,
        unit="Hz",
        why="Cramér-Rao bounds at an amplitude of 1 deg. A ramp does not determine it, and a sine "
        f"hardly does. A step does, but with {step / chirp:.0f} times the chirp's error.",
    )


def _figure_5(waves: dict[str, Waveform]) -> Figure:
    panels = []
    for row, (name, wave) in enumerate(waves.items()):
        stimulus = Stimulus(waveform=wave, fs=FS)
        bins = spectrum(stimulus.position, FS, window="rectangular")
        last = row == len(waves) - 1
        panels += [
            Panel(
                x=Axis(label="Time (s)" if last else "", numbered=last),
                y=Axis(label="Position (–)"),
                items=(Curve(x=stimulus.time, y=stimulus.position, width=1.0),),
                title=name,
                row=row,
            ),
            Panel(
                x=Axis(
                    label="Frequency (Hz)" if last else "",
                    scale="log",
                    low=BAND[0] / 2,
                    high=FS / 2,
                    numbered=last,
                ),
                y=Axis(label="Level (dB)", low=-30.0, high=75.0),
                items=(spectrum_curve(bins.frequency, decibel(bins.value)),),
                row=row,
                column=1,
            ),
        ]
    return Figure(
        panels=tuple(panels),
        alt="Five waveforms over time and their spectra: " + ", ".join(waves) + ".",
        heights=(1.35,) * len(waves),
        columns=2,
    )


def _row_plain_chirp() -> Row:
    """Equation (5) with n = 0 and G = 1 against equation (1), written out."""
    sweep = Sweep(band=BAND, duration=DURATION, gain=1.0, extinction=0.0)
    t = np.linspace(0.0, DURATION, 2001)
    a, b = sweep.sweep_rate, sweep.start_omega
    printed = np.sin(0.5 * a * t**2 + b * t) / (b + 0.5 * a)
    off = float(np.max(np.abs(sweep.motion(t).position - printed)) / np.max(np.abs(printed)))
    return Row(
        figure=3,
        where="Eqs (1), (5)",
        quantity="Waveform (5) with n = 0 and G = 1",
        paper="no extinction",
        text="equals (1)" if off < 1e-9 else f"off from (1) by {off:.1e}",
        why="Agrees: (1) to (3) divide by the constant b + a/2, and (4) with n = 0 gives the same.",
    )


def _row_third_term() -> Row:
    """Equation (7) against the numerical derivative of (6), with either sign of its third term."""
    sweep = Sweep(band=BAND, duration=DURATION, gain=65.0, extinction=0.8)
    t = np.linspace(0.2, 2.0, 1801)
    h = 1e-4

    def velocity(at: NDArray[np.float64]) -> NDArray[np.float64]:
        return sweep.motion(at).velocity

    slope = (velocity(t + h) - velocity(t - h)) / (2.0 * h)
    ours = sweep.motion(t).acceleration
    a, b, n = sweep.sweep_rate, sweep.start_omega, sweep.extinction
    sigma = b + 0.5 * a * t**n
    sine = np.sin(0.5 * a * t**2 + b * t)
    third = sweep.gain * a**2 * n**2 * t ** (2 * n - 2) * sine / (2.0 * sigma**3)
    top = float(np.max(np.abs(slope)))
    plus = float(np.max(np.abs(ours - slope))) / top
    minus = float(np.max(np.abs(ours - 2.0 * third - slope))) / top
    sign = "+" if plus < minus else "−"
    return Row(
        figure=3,
        where="Eq. (7)",
        quantity="Sign of the third term, a²n²t^(2n−2) sin σ₁ / (2σ₂³)",
        paper="−",
        text=sign,
        why="A misprint. Differentiating (6) gives +: its numerical derivative (n = 0.8, 0.2 to "
        f"2 s) agrees with + to {100 * plus:.1g} % of the peak, with − to {100 * minus:.2g} %.",
    )
