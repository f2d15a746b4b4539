"""A design as its page shows it: figures, tables, the command that does the same."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hmpim.formats.stimulus_files import save_stimulus
from hmpim.plots import Figure, time_histories
from hmpim.plots.stimulus import stimulus_spectrogram, stimulus_spectrum
from hmpim.stimulus import Stimulus, section_v
from hmpim.stimulus.lead import RestToRest
from hmpim.stimulus.section_v import FIG_4
from hmpim.workbench.desks import AxisRow, Wish
from hmpim.workbench.names import free_place
from hmpim.workbench.work.design import error_rows, limits_of, peak_rows, stimuli_of

__all__ = ["Designed", "designed", "five_axes", "save_design", "spectrogram"]

_UNITS = {"delay": "s", "natural_frequency": "Hz"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Designed:
    """What follows from a wish: words, cells of tables, figures of one axis, the command.

    `solved` holds what was solved of the sliders: extinction, and lead in s.
    """

    words: str
    solved: dict[str, float]
    inside: bool
    peaks: tuple[tuple[str, ...], ...]
    errors: tuple[tuple[str, ...], ...]
    figures: dict[str, Figure]
    command: str


def designed(wish: Wish, axis: int = 0) -> Designed:
    """Design what is wished, and describe it.

    Parameters
    ----------
    wish : Wish
        As it is on the page.
    axis : int
        Which one is drawn.

    Raises
    ------
    HmpimError
        If it cannot be met; the message says what would do.
    """
    stimuli = stimuli_of(wish)
    peaks = peak_rows(wish, stimuli)
    inside = all(row.peak <= row.limit for row in peaks)
    return Designed(
        words=_words(stimuli, inside),
        solved=_solved(wish, stimuli[0]),
        inside=inside,
        peaks=tuple(
            (r.axis or "–", r.quantity, f"{r.peak:.5g}", f"{r.limit:g}", r.unit) for r in peaks
        ),
        errors=tuple(
            (s.axis or "–", name.replace("_", " "), f"{value:.3g} {_UNITS.get(name, '')}".strip())
            for s in stimuli
            for name, value in error_rows(wish, s)
        ),
        figures=_figures(_shown(wish, axis), wish),
        command=_command(wish),
    )


def spectrogram(wish: Wish, axis: int = 0) -> Figure:
    """Describe how the spectrum of an axis goes with time; it takes longer than all the rest."""
    figure = stimulus_spectrogram(_shown(wish, axis))
    assert isinstance(figure, Figure)
    return figure


def _shown(wish: Wish, axis: int) -> Stimulus:
    """The stimulus of an axis with the axis's own limits, whatever amplitude is used."""
    stimuli = stimuli_of(wish)
    shown = min(axis, len(stimuli) - 1)
    own = limits_of(replace(wish.rows[shown], amplitude=wish.rows[shown].position), wish.unit)
    return replace(stimuli[shown], limits=own)


def _solved(wish: Wish, stimulus: Stimulus) -> dict[str, float]:
    """What was left open of the sliders, and came out."""
    found = {}
    if wish.extinction is None and stimulus.extinction is not None:
        found["extinction"] = float(stimulus.extinction)
    waveform = stimulus.waveform
    if wish.lead is None and isinstance(waveform, RestToRest):
        found["lead"] = waveform.lead_in.end - waveform.lead_in.start
    return found


def _words(stimuli: tuple[Stimulus, ...], inside: bool) -> str:
    first = stimuli[0]
    words = f"{first.duration:.4g} s, {first.samples} samples at {first.fs:g} Hz"
    if len(stimuli) == 1 and first.gain is not None and first.extinction is not None:
        words += f", gain {first.gain:.4g} {first.unit}, n = {first.extinction:.3g}"
    return f"{words}: {'inside all limits' if inside else 'beyond a limit'}."


def _figures(stimulus: Stimulus, wish: Wish) -> dict[str, Figure]:
    made: dict[str, Callable[[], Any]] = {
        "motion": lambda: time_histories(stimulus),
        "spectrum": lambda: stimulus_spectrum(stimulus, alpha=wish.alpha),
    }
    figures = {name: make() for name, make in made.items()}
    return {name: figure for name, figure in figures.items() if isinstance(figure, Figure)}


def _command(wish: Wish) -> str:
    if len(wish.rows) > 1:
        plans = ",\n         ".join(
            f"AxisPlan(axis={r.name!r}, band=({r.low:g}, {r.high:g}), "
            f"limits=hmpim.Limits(position={min(r.amplitude, r.position):g}, "
            f"velocity={r.velocity:g}, acceleration={r.acceleration:g}, unit={wish.unit!r}))"
            for r in wish.rows
        )
        return (
            f"plans = [{plans}]\nstimuli = hmpim.design_axes(plans, duration={wish.duration:g}, "
            f"fs={wish.fs:g})"
        )
    (r,) = wish.rows
    if wish.gentlest:
        return _gentlest_command(wish)
    words = ["hmpim", "design", "--band", f"{r.low:g}", f"{r.high:g}"]
    words += ["--duration", f"{wish.duration:g}", "--fs", f"{wish.fs:g}"]
    words += ["--amplitude", f"{min(r.amplitude, r.position):g}", "--max-rate", f"{r.velocity:g}"]
    words += ["--max-acceleration", f"{r.acceleration:g}", "--unit", wish.unit]
    if wish.extinction is not None:
        words += ["--extinction", f"{wish.extinction:g}"]
    if wish.lead is not None:
        words += ["--lead", f"{wish.lead:g}"]
    return shlex.join([*words, "-o", "design.csv"])


def _gentlest_command(wish: Wish) -> str:
    (r,), model = wish.rows, wish.model
    options = {
        "natural-frequency": model.natural_frequency,
        "damping": model.damping_ratio,
        "delay": model.delay,
        "noise": model.noise_std,
        "frequency-error": 0.01 * model.wanted,
        "amplitude": min(r.amplitude, r.position),
        "max-rate": r.velocity,
        "max-acceleration": r.acceleration,
        "duration": wish.duration,
        "fs": wish.fs,
    }
    words = [word for name, value in options.items() for word in (f"--{name}", f"{value:g}")]
    return shlex.join(["hmpim", "gentlest", *words, "--unit", wish.unit, "-o", "design.csv"])


def save_design(wish: Wish, folder: str) -> str:
    """Write the samples of a design; return where they are."""
    stimuli = stimuli_of(wish)
    place = free_place(Path(folder), "design.csv")
    save_stimulus(stimuli if len(stimuli) > 1 else stimuli[0], place)
    return str(place)


def five_axes() -> tuple[AxisRow, ...]:
    """Return the five axes of Fig. 4 with bands and limits of section V."""
    return tuple(
        AxisRow(
            name=axis,
            low=0.1,
            high=stimulus.band[1] if stimulus.band is not None else 20.0,
            position=limits.position,
            velocity=limits.velocity,
            acceleration=limits.acceleration,
            amplitude=5.0,
        )
        for (axis, limits), stimulus in zip(FIG_4.items(), section_v().values(), strict=True)
    )
