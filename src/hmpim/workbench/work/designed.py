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
from hmpim.stimulus.section_v import FIG_4
from hmpim.workbench.desks import AxisRow, Wish
from hmpim.workbench.names import free_place
from hmpim.workbench.work.design import error_rows, limits_of, peak_rows, stimuli_of

__all__ = ["Designed", "designed", "five_axes", "save_design"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Designed:
    """What follows from a wish: words, cells of tables, figures of the first axis, the command."""

    words: str
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
    shown = min(axis, len(stimuli) - 1)
    # the limits that are drawn are the axis's own, whatever amplitude is used
    own = limits_of(replace(wish.rows[shown], amplitude=wish.rows[shown].position), wish.unit)
    stimulus = replace(stimuli[shown], limits=own)
    return Designed(
        words=_words(stimuli, inside),
        inside=inside,
        peaks=tuple(
            (r.axis or "–", r.quantity, f"{r.peak:.5g}", f"{r.limit:g}", r.unit) for r in peaks
        ),
        errors=tuple(
            (s.axis or "–", name.replace("_", " "), f"{value:.3g}")
            for s in stimuli
            for name, value in error_rows(wish, s)
        ),
        figures=_figures(stimulus, wish),
        command=_command(wish),
    )


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
        "spectrogram": lambda: stimulus_spectrogram(stimulus),
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
    words = ["hmpim", "design", "--band", f"{r.low:g}", f"{r.high:g}"]
    words += ["--duration", f"{wish.duration:g}", "--fs", f"{wish.fs:g}"]
    words += ["--amplitude", f"{min(r.amplitude, r.position):g}", "--max-rate", f"{r.velocity:g}"]
    words += ["--max-acceleration", f"{r.acceleration:g}", "--unit", wish.unit]
    if wish.extinction is not None:
        words += ["--extinction", f"{wish.extinction:g}"]
    if wish.lead is not None:
        words += ["--lead", f"{wish.lead:g}"]
    return shlex.join([*words, "-o", "design.csv"])


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
