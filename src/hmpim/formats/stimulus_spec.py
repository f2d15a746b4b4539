"""The specification of stimuli as TOML: what makes the samples, not the samples.

A file written here states each waveform in full, `[[stimulus]]`, so that it gives the same
samples bit for bit, whatever becomes of the solver. One written by hand may state a wish
instead, `[[design]]`, with the arguments of `design` (`seed` standing for rng):

    [[design]]
    kind = "hmpim"
    band = [0.1, 10.0]
    duration = 10.0
    fs = 500.0
    limits = {position = 10.0, velocity = 1000.0, acceleration = 40000.0, unit = "deg"}
"""

import tomllib
from collections.abc import Sequence
from dataclasses import fields, is_dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from hmpim.errors import ArgumentError, FormatError
from hmpim.formats.atomic import write_text
from hmpim.formats.stimulus import check_together
from hmpim.stimulus import (
    Chirp,
    ExponentialSweep,
    Limits,
    Multisine,
    Prbs,
    Quintic,
    Ramp,
    Repeated,
    RestToRest,
    Reversed,
    SampledMotion,
    Shuttle,
    Sine,
    Step,
    Steps,
    Stimulus,
    SumOfSines,
    Superposed,
    Sweep,
    design,
)

__all__ = ["read_stimulus_toml", "save_stimulus_toml", "stimuli_from_toml", "stimulus_to_toml"]

_FORMAT = "hmpim/stimulus/1"
_TYPES: dict[str, Any] = {
    kind.__name__: kind
    for kind in (
        *(Chirp, ExponentialSweep, Multisine, Prbs, Quintic, Ramp, Repeated, RestToRest),
        *(Reversed, SampledMotion, Shuttle, Sine, Step, Steps, SumOfSines, Superposed, Sweep),
    )
}
_STATED = ("axis", "unit", "fs", "tail", "resolution")
_WISHES = {
    *("band", "duration", "fs", "limits", "kind", "sweep", "extinction", "lead", "tail", "base"),
    *("axis", "resolution", "seed", "wanted_snr", "noise"),
}


def stimulus_to_toml(stimuli: Stimulus | Sequence[Stimulus]) -> str:
    """Return the specification of one or several stimuli as TOML.

    Parameters
    ----------
    stimuli : Stimulus or sequence of Stimulus
        Several must have one sampling rate, and each an axis of its own.

    Raises
    ------
    ArgumentError
        If a waveform is of no kind that this package makes.

    Examples
    --------
    >>> from hmpim.stimulus import Sine, Stimulus
    >>> print(stimulus_to_toml(Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0)))
    format = "hmpim/stimulus/1"
    <BLANKLINE>
    [[stimulus]]
    axis = ""
    unit = ""
    fs = 10.0
    tail = 0.0
    resolution = 0.0
    <BLANKLINE>
    [stimulus.waveform]
    type = "Sine"
    amplitude = 1.0
    frequency = 1.0
    duration = 2.0
    <BLANKLINE>
    """
    lines = [f'format = "{_FORMAT}"']
    for stimulus in check_together(stimuli):
        lines += ["", "[[stimulus]]"]
        lines += [f"{name} = {_value(getattr(stimulus, name))}" for name in _STATED]
        if stimulus.limits is not None:
            lines += _table("stimulus.limits", stimulus.limits)
        lines += _table("stimulus.waveform", stimulus.waveform)
    return "\n".join(lines) + "\n"


def _table(name: str, value: Any) -> list[str]:
    lines = ["", f"[{name}]"]
    within: list[str] = []
    if not isinstance(value, Limits):
        kind = type(value).__name__
        if _TYPES.get(kind) is not type(value):
            raise ArgumentError(f"a {kind} is not a waveform of this package and cannot be saved")
        lines.append(f'type = "{kind}"')
    for field in fields(value):
        part = getattr(value, field.name)
        if part is None:
            continue
        if is_dataclass(part):
            within += _table(f"{name}.{field.name}", part)
        else:
            lines.append(f"{field.name} = {_value(part)}")
    return lines + within


def _value(value: Any) -> str:
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, int):
        return str(value)
    if isinstance(value, Sequence | np.ndarray):
        return f"[{', '.join(_value(part) for part in value)}]"
    return repr(float(value))  # reads back to the very same float


def _quoted(text: str) -> str:
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in escaped) + '"'


def save_stimulus_toml(stimuli: Stimulus | Sequence[Stimulus], path: str | PathLike[str]) -> None:
    """Write the specification of one or several stimuli as TOML.

    Parameters
    ----------
    stimuli
        As for `stimulus_to_toml`.
    path : path
        File to write, replaced if there.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hmpim.stimulus import Limits, design
    >>> one = design(band=(0.1, 40), duration=4, fs=500, limits=Limits(position=1, velocity=40))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_stimulus_toml(one, Path(folder) / "s.toml")
    ...     [same] = read_stimulus_toml(Path(folder) / "s.toml")
    >>> same.acceleration.tobytes() == one.acceleration.tobytes()
    True
    """
    text = stimulus_to_toml(stimuli)
    write_text(path, text)


def read_stimulus_toml(path: str | PathLike[str]) -> list[Stimulus]:
    """Make the stimuli that a TOML file specifies.

    Parameters
    ----------
    path : path
        As written by `save_stimulus_toml`, or with `[[design]]` tables.

    Raises
    ------
    FormatError
        If the file cannot be read, is no TOML, or specifies no stimulus.
    ArgumentError, LimitsError, UnitError
        If what it specifies cannot be made.

    Examples
    --------
    >>> import tempfile
    >>> wish = '''
    ... [[design]]
    ... band = [0.1, 10]
    ... duration = 10
    ... fs = 500
    ... limits = {position = 10, velocity = 1000, acceleration = 40000, unit = "deg"}
    ... '''
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     written = (Path(folder) / "wish.toml").write_text(wish)
    ...     [stimulus] = read_stimulus_toml(Path(folder) / "wish.toml")
    >>> stimulus.extinction
    0.0
    """
    try:
        text = Path(path).read_bytes().decode()
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{str(path)!r} cannot be read as TOML: {error}") from error
    return stimuli_from_toml(text, name=repr(str(path)))


def stimuli_from_toml(text: str, *, name: str) -> list[Stimulus]:
    """Make the stimuli that a text specifies.

    Parameters
    ----------
    text : str
        As `stimulus_to_toml` returns it, or with `[[design]]` tables.
    name : str
        What the text is called in messages.

    Raises
    ------
    FormatError
        If it is no TOML, or specifies no stimulus.
    ArgumentError, LimitsError, UnitError
        If what it specifies cannot be made.

    Examples
    --------
    >>> from hmpim.stimulus import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=10.0)
    >>> stimuli_from_toml(stimulus_to_toml(sine), name="sine") == [sine]
    True
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"{name} cannot be read as TOML: {error}") from error
    said = data.get("format", _FORMAT)
    if said != _FORMAT:
        raise FormatError(f"{name} has format {said!r}; this version reads {_FORMAT!r}")
    stated, wished = data.get("stimulus", []), data.get("design", [])
    tables = [*([stated] if isinstance(stated, dict) else stated)]
    wishes = [*([wished] if isinstance(wished, dict) else wished)]
    if not tables and not wishes:
        raise FormatError(f"{name} holds neither [[stimulus]] nor [[design]]")
    made = [_made(table, name) for table in tables]
    return made + [_designed(table, name) for table in wishes]


def _made(table: Any, name: str) -> Stimulus:
    try:
        stated = {key: table[key] for key in _STATED if key in table}
        limits = Limits(**table["limits"]) if "limits" in table else None
        waveform = _waveform(table["waveform"])
        return Stimulus(waveform=waveform, limits=limits, **stated)
    except (KeyError, TypeError, AttributeError) as error:
        raise FormatError(f"a [[stimulus]] of {name} is not complete: {error}") from error


def _waveform(table: dict[str, Any]) -> Any:
    kind = table["type"]
    if kind not in _TYPES:
        raise FormatError(f"type = {kind!r} is not a waveform; known are {', '.join(_TYPES)}")
    arguments: dict[str, Any] = {}
    for name, value in table.items():
        if isinstance(value, dict):
            arguments[name] = _waveform(value)
        elif name != "type":
            arguments[name] = tuple(value) if isinstance(value, list) else value
    return _TYPES[kind](**arguments)


def _designed(table: Any, name: str) -> Stimulus:
    if not isinstance(table, dict) or not set(table) <= _WISHES:
        unknown = sorted(set(table) - _WISHES) if isinstance(table, dict) else table
        raise FormatError(
            f"a [[design]] of {name} has {unknown!r}; known are {', '.join(sorted(_WISHES))}"
        )
    arguments = dict(table)
    try:
        arguments["limits"] = Limits(**arguments.get("limits", {}))
        arguments["rng"] = arguments.pop("seed", None)
        return design(**arguments)
    except TypeError as error:
        raise FormatError(f"a [[design]] of {name} is not complete: {error}") from error
