"""A stimulus as files: CSV of its samples for a rig to play, JSON of what it is."""

import json
import math
import re
from collections.abc import Collection, Sequence
from os import PathLike
from typing import Any

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.formats.atomic import write_text
from hmpim.stimulus import Limits, Stimulus
from hmpim.stimulus.command import rounded
from hmpim.stimulus.limits import QUANTITIES
from hmpim.stimulus.motion import FloatArray

__all__ = [
    "check_together",
    "identifier",
    "save_stimulus_csv",
    "save_stimulus_json",
    "stimulus_columns",
    "stimulus_to_dict",
]


def stimulus_to_dict(stimulus: Stimulus) -> dict[str, Any]:
    """Return what a stimulus is as plain JSON values; its samples are not among them.

    `duration`, `lead`, `lead_out` and `tail` are in seconds: `lead` before the sweep,
    `lead_out` after it, `duration` of all together. A limit that is not set is null, and a peak
    that is infinite.

    Parameters
    ----------
    stimulus : Stimulus
        Any.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> data = stimulus_to_dict(design(band=(0.1, 10), duration=10, fs=500, limits=limits, lead=0))
    >>> data["extinction"], data["samples"], round(data["peaks"]["velocity"])
    (0.0, 5000, 628)
    """
    before = stimulus.sweep_start
    return {
        "axis": stimulus.axis,
        "gain": stimulus.gain,
        "extinction": stimulus.extinction,
        "peaks": {name: _finite(getattr(stimulus.peaks, name)) for name in QUANTITIES},
        "band": None if stimulus.band is None else list(stimulus.band),
        "duration": stimulus.duration,
        "fs": stimulus.fs,
        "lead": before,
        "lead_out": round(stimulus.waveform.duration - before - stimulus.sweep_duration, 12),
        "tail": stimulus.tail,
        "resolution": stimulus.resolution,
        "sweep_start": before,
        "sweep_duration": stimulus.sweep_duration,
        "limits": None if stimulus.limits is None else _limits(stimulus.limits),
        "unit": stimulus.unit,
        "samples": stimulus.samples,
    }


def _limits(limits: Limits) -> dict[str, float | str | None]:
    bounds = {name: _finite(getattr(limits, name)) for name in QUANTITIES}
    return {**bounds, "unit": limits.unit}


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def save_stimulus_json(stimulus: Stimulus, path: str | PathLike[str]) -> None:
    """Write what a stimulus is to `path` as JSON.

    Parameters
    ----------
    stimulus : Stimulus
        Any.
    path : path
        File to write, replaced if there.

    Examples
    --------
    >>> import json, tempfile
    >>> from pathlib import Path
    >>> from hmpim.stimulus import Sine, Stimulus
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "s.json"
    ...     save_stimulus_json(Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0), file)
    ...     json.loads(file.read_text())["samples"]
    20
    """
    text = json.dumps(stimulus_to_dict(stimulus), indent=1, allow_nan=False)
    write_text(path, text + "\n")


def save_stimulus_csv(stimuli: Stimulus | Sequence[Stimulus], path: str | PathLike[str]) -> None:
    """Write the samples of one or several stimuli to `path` as CSV.

    Columns are ``time,position,velocity,acceleration``, or for several axes
    ``time,roll.position,…``; comment lines start with ``#``. Every number reads back to
    the very same float. Axes that end earlier stand still to the end of the longest.

    Parameters
    ----------
    stimuli : Stimulus or sequence of Stimulus
        Several must have one sampling rate, and each an axis of its own.
    path : path
        File to write, replaced if there.

    Raises
    ------
    ArgumentError
        If there is none, rates differ, or axes are not told apart.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hmpim.stimulus import Sine, Stimulus
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = Path(folder) / "s.csv"
    ...     save_stimulus_csv(Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=4.0), file)
    ...     file.read_text().splitlines()[1]
    'time,position,velocity,acceleration'
    """
    several = check_together(stimuli)
    columns: list[FloatArray] = []
    names: list[str] = []
    lines = []
    for stimulus in several:
        prefix = f"{stimulus.axis}." if len(several) > 1 else ""
        for name, values in stimulus_columns(stimulus, several).items():
            if name == "time" and names:
                continue
            names.append(prefix + name if name != "time" else name)
            columns.append(values)
        lines.append(f"{_comment(stimulus)}, samples = {columns[0].size}")
    lines.append(",".join(names))
    rows = np.column_stack(columns).tolist()
    lines += [",".join(map(repr, row)) for row in rows]
    write_text(path, "\n".join(lines) + "\n")


def _comment(stimulus: Stimulus) -> str:
    words = [f"fs = {stimulus.fs!r} Hz", f"unit = {stimulus.unit or 'none'}"]
    if stimulus.band is not None:
        words.append(f"band = {stimulus.band[0]!r} {stimulus.band[1]!r} Hz")
    if stimulus.gain is not None and stimulus.extinction is not None:
        words += [f"gain = {stimulus.gain!r}", f"n = {stimulus.extinction!r}"]
    words.append(f"sweep = {stimulus.sweep_start!r} s + {stimulus.sweep_duration!r} s")
    axis = f"{stimulus.axis}: " if stimulus.axis else ""
    return f"# hmpim stimulus; {axis}{', '.join(words)}"


def stimulus_columns(
    stimulus: Stimulus, together: Sequence[Stimulus] = ()
) -> dict[str, FloatArray]:
    """Samples as a player gets them: time, position, velocity, acceleration.

    Positions are rounded to the stimulus's resolution. Beside longer stimuli the axis stands
    still to the end of the longest.

    Parameters
    ----------
    stimulus : Stimulus
        Whose samples.
    together : sequence of Stimulus
        Those that go into one file.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp, Stimulus
    >>> ramp = Stimulus(waveform=Ramp(duration=0.5), fs=8.0, resolution=0.25)
    >>> stimulus_columns(ramp)["position"].tolist()
    [0.0, 0.0, 0.25, 0.5]
    """
    longest = max((stimulus, *together), key=lambda s: s.samples)
    motion = stimulus.motion(longest.time)
    return {
        "time": longest.time,
        "position": rounded(motion.position, stimulus.resolution),
        "velocity": motion.velocity,
        "acceleration": motion.acceleration,
    }


def check_together(stimuli: Stimulus | Sequence[Stimulus]) -> tuple[Stimulus, ...]:
    """Return the stimuli of one file, refusing those that do not go together.

    Raises
    ------
    ArgumentError
        If there is none, rates differ, or axes are not told apart.

    Examples
    --------
    >>> check_together([])
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: there is no stimulus to write; give at least one
    """
    stimuli = (stimuli,) if isinstance(stimuli, Stimulus) else tuple(stimuli)
    if not stimuli:
        raise ArgumentError("there is no stimulus to write; give at least one")
    rates = sorted({s.fs for s in stimuli})
    if len(rates) > 1:
        raise ArgumentError(
            f"stimuli sampled at {rates[0]:g} Hz and {rates[-1]:g} Hz do not fit one file; "
            "design them at one rate"
        )
    axes = [s.axis for s in stimuli]
    if len(stimuli) > 1 and (len(set(axes)) < len(axes) or not all(axes)):
        raise ArgumentError(
            f"axes {axes!r} must be different names; give each stimulus its own axis"
        )
    for axis in axes:
        if any(c in axis for c in ',"#\n\r'):
            raise ArgumentError(
                f'axis {axis!r} cannot head a column; leave out , " # and new lines'
            )
    return stimuli


def identifier(axis: str, *, taken: Collection[str] = ()) -> str:
    """Name of an axis that C and MATLAB allow, of at most 31 letters, not used before.

    Examples
    --------
    >>> identifier("2nd axis"), identifier(""), identifier("yaw_1", taken=["Yaw_1"])
    ('axis_2nd_axis', 'stimulus', 'yaw_1_2')
    """
    name = re.sub(r"[^A-Za-z0-9_]", "_", axis)[:31] or "stimulus"
    if not name[0].isalpha():
        name = f"axis_{name}"[:31]
    base, number = name, 2
    while name.upper() in {other.upper() for other in taken}:
        name, number = f"{base[:28]}_{number}", number + 1
    return name
