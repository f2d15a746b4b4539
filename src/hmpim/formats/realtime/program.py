"""The C file around a stimulus's formulas: lead, sweep, tail, and a stop at any sample."""

import math
import re
from collections.abc import Sequence
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.formats.atomic import write_text
from hmpim.formats.models.render import rendered
from hmpim.formats.realtime.waveforms import functions_of
from hmpim.formats.stimulus import check_together, identifier
from hmpim.stimulus import Stimulus
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import rate_label

__all__ = ["program_of", "save_stimulus_program"]


def program_of(stimuli: Stimulus | Sequence[Stimulus], *, file: str = "stimulus.c") -> str:
    """Write a stimulus as a C99 program part that computes it sample by sample.

    Parameters
    ----------
    stimuli : Stimulus or sequence of Stimulus
        Several must have one sampling rate, and each an axis of its own.
    file : str
        What the file will be called, for its own comment.

    Returns
    -------
    str
        Functions `NAME_step`, `NAME_stop` and `NAME_at` for each axis; `NAME` is `stimulus`
        where the axis has no name. A stop is a constant deceleration: the acceleration limit,
        or the stimulus's own peak where there is none.

    Raises
    ------
    ArgumentError
        If a waveform has no formula, as samples read from a file.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=500, acceleration=40000, unit="deg")
    >>> text = program_of(design(band=(0.1, 40), duration=10, fs=500, limits=limits))
    >>> "int stimulus_step(hmpim_player *player, hmpim_motion *command);" in text
    True
    """
    several = check_together(stimuli)
    axes: list[dict[str, Any]] = []
    taken: dict[str, Any] = {}
    for stimulus in several:
        name = identifier(stimulus.axis, taken=taken)
        taken[name] = stimulus
        axes.append(_axis(stimulus, name))
    return rendered(
        "stimulus.c.jinja",
        version=version("hmpim"),
        file=file,
        guard=f"HMPIM_{re.sub(r'[^A-Z0-9]', '_', file.upper())}",
        rate=f"{several[0].fs:.9g}",
        axes=axes,
        code="\n".join(part for axis in axes for part in axis["functions"]),
        longest=max(stimulus.samples for stimulus in several),
    )


def save_stimulus_program(
    stimuli: Stimulus | Sequence[Stimulus], path: str | PathLike[str]
) -> None:
    """Write a stimulus to `path` as C99, as `program_of` makes it.

    Parameters
    ----------
    stimuli
        As for `program_of`.
    path : path
        File to write, replaced if there.

    Examples
    --------
    >>> import tempfile
    >>> from hmpim.stimulus import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus_program(sine, Path(folder) / "s.c")
    ...     "-DHMPIM_PRINT s.c" in (Path(folder) / "s.c").read_text()
    True
    """
    write_text(path, program_of(stimuli, file=Path(path).name))


def _axis(stimulus: Stimulus, name: str) -> dict[str, Any]:
    functions, waveform = functions_of(stimulus.waveform, prefix=f"{name}_part")
    brake = _brake(stimulus)
    return {
        "name": name,
        "column": f"{stimulus.axis}." if stimulus.axis else "",
        "lines": [_plain(line) for line in _lines(stimulus, brake)],
        "samples": stimulus.samples,
        "fs": stimulus.fs,
        "resolution": stimulus.resolution,
        "brake": brake,
        "functions": functions,
        "waveform": waveform,
    }


def _brake(stimulus: Stimulus) -> float:
    limits = stimulus.limits
    if limits is not None and math.isfinite(limits.acceleration):
        return limits.acceleration
    peak = stimulus.peaks.acceleration
    return peak if math.isfinite(peak) and peak > 0.0 else 1.0


def _lines(stimulus: Stimulus, brake: float) -> list[str]:
    """Say in plain lines what is played, how large it becomes, and how far a stop may carry it."""
    unit, limits = stimulus.unit, stimulus.limits
    name = stimulus.axis or "stimulus"
    lines = [
        f"{name}: {stimulus.samples} samples at {stimulus.fs:.9g} Hz, {stimulus.duration:.9g} s, "
        f"the waveform from {stimulus.sweep_start:.9g} s on for {stimulus.sweep_duration:.9g} s."
    ]
    for order, quantity in enumerate(QUANTITIES[:3]):
        peak = getattr(stimulus.peaks, quantity)
        limit = math.inf if limits is None else getattr(limits, quantity)
        bound = f", limit {limit:.9g}" if math.isfinite(limit) else ""
        lines.append(f"  peak {quantity} {peak:.6g}{bound} {rate_label(unit, order)}".rstrip())
    reach = np.abs(stimulus.position) + np.square(stimulus.velocity) / (2.0 * brake)
    furthest = float(reach.max())
    said = f"  a stop takes it to {f'{furthest:.6g} {unit}'.rstrip()} from the middle at most"
    if limits is not None and furthest > limits.position * (1.0 + 1e-9):
        said += ", BEYOND ITS POSITION LIMIT"
    return [*lines, said + f" (deceleration {brake:.6g} {rate_label(unit, 2)})".rstrip() + "."]


def _plain(line: str) -> str:
    """ASCII that cannot end a comment; every compiler reads it alike."""
    for sign, plain in (("²", "^2"), ("³", "^3"), ("°", "deg"), ("*/", "* /"), ("\\", "/")):
        line = line.replace(sign, plain)
    return line.encode("ascii", "replace").decode("ascii").replace("??", "? ?")
