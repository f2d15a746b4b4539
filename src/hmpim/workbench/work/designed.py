"""A design as its page shows it: figures, tables, the command that does the same."""

import shlex
from dataclasses import dataclass, replace
from pathlib import Path

from hmpim.formats.stimulus_files import save_stimulus
from hmpim.plots import Figure, time_histories
from hmpim.plots.stimulus import stimulus_spectrum
from hmpim.stimulus import Stimulus, section_v
from hmpim.stimulus.lead import RestToRest
from hmpim.stimulus.section_v import FIG_4
from hmpim.workbench.desks import AxisRow, Wish
from hmpim.workbench.names import free_place
from hmpim.workbench.work.design import error_rows, limits_of, peak_rows, stimuli_of

__all__ = ["Designed", "designed", "error_cells", "five_axes", "save_design", "spectrum"]

_UNITS = {"delay": (1e3, "ms"), "natural_frequency": (1.0, "Hz")}  # as they are read aloud


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Designed:
    """What follows from a wish at once: words, cells of a table, one axis's motion, the command.

    `solved` holds what was solved of the sliders: extinction, and lead in s. `shown` is the
    stimulus that is drawn.
    """

    words: str
    solved: dict[str, float]
    inside: bool
    peaks: tuple[tuple[str, ...], ...]
    shown: Stimulus
    motion: Figure
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
        If it cannot be met; the message says what is enough.
    """
    stimuli = stimuli_of(wish)
    peaks = peak_rows(wish, stimuli)
    inside = all(row.peak <= row.limit for row in peaks)
    drawn = min(axis, len(stimuli) - 1)
    row = wish.rows[drawn]
    own = limits_of(replace(row, amplitude=row.position), wish.unit)  # whatever amplitude is used
    return Designed(
        words=_words(stimuli, inside),
        solved=_solved(wish, stimuli[0]),
        inside=inside,
        peaks=tuple(
            (r.axis or "–", r.quantity, f"{r.peak:.5g}", f"{r.limit:g}", r.unit) for r in peaks
        ),
        shown=stimuli[drawn],
        motion=time_histories(stimuli[drawn], limits=own),
        command=_command(wish),
    )


def spectrum(wish: Wish, axis: int = 0) -> Figure:
    """Describe the spectrum of an axis, with and without the window."""
    stimuli = stimuli_of(wish)
    return stimulus_spectrum(stimuli[min(axis, len(stimuli) - 1)], alpha=wish.alpha)


def error_cells(wish: Wish) -> tuple[tuple[str, ...], ...]:
    """Return the predicted error bars (95 %) of every axis as cells of a table."""

    def shown(name: str, value: float) -> str:
        times, unit = _UNITS.get(name, (1.0, ""))
        return f"{times * value:.3g} {unit}".strip()

    return tuple(
        (s.axis or "–", name.replace("_", " "), shown(name, value))
        for s in stimuli_of(wish)
        for name, value in error_rows(wish, s)
    )


def _words(stimuli: tuple[Stimulus, ...], inside: bool) -> str:
    first = stimuli[0]
    words = f"{first.duration:.4g} s, {first.samples} samples at {first.fs:g} Hz"
    if len(stimuli) == 1 and first.gain is not None and first.extinction is not None:
        words += f", gain {first.gain:.4g} {first.unit}, n = {first.extinction:.3g}"
    return f"{words}: {'inside all limits' if inside else 'beyond a limit'}."


def _solved(wish: Wish, stimulus: Stimulus) -> dict[str, float]:
    """What was left open of the sliders, and came out."""
    found = {}
    if wish.extinction is None and stimulus.extinction is not None:
        found["extinction"] = float(stimulus.extinction)
    waveform = stimulus.waveform
    if wish.lead is None and isinstance(waveform, RestToRest):
        found["lead"] = waveform.lead_in.end - waveform.lead_in.start
    return found


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
