"""Which export carries the nonlinear part of a model, how near it is, and what is said if none."""

from dataclasses import replace

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.formats.models.refined import REFINE
from hmpim.formats.models.source import LINEAR_PART, Source
from hmpim.identify import left_out
from hmpim.identify.result.sizes import size_in_words
from hmpim.model import Model, simulate
from hmpim.model.nonlinear import NonlinearPart, excursion

__all__ = ["LinearPartOnly", "with_nonlinear_part"]

_PROGRAMS = ("c", "python", "fmu")
"""Targets that step every kind from the samples."""

_SCRIPTS = ("control", "scipy", "matlab")
"""Targets that follow every kind on a finer grid."""

_VALUES = ("json", "mat")
"""Targets that hold the figures."""

_MOST_POLES = 6
"""Poles up to which a script steps a force: beyond, the coefficients lose their digits."""

_SAMPLES = 2000
"""Samples of the sweep on which a program is compared with the model, at least."""

_MOST_SAMPLES = 100_000
"""And at most: a second or two of stepping."""

_CYCLES = 20.0
"""Periods of its highest frequency that it lasts, after twice the delay, at any rate."""


class LinearPartOnly(UserWarning):
    """An export lacks a nonlinearity that was found."""


def with_nonlinear_part(source: Source, to: str) -> tuple[Source, str | None]:
    """The source as a target carries it, with a note for its heading; and what the target lacks."""
    lacking = left_out(source.pair)
    if lacking is not None:
        said = f"The file omits {lacking}, which was found but is not part of the model."
        return replace(source, note=said), said
    part = source.model.nonlinear
    if part is None:
        return source, None
    size = size_in_words(part, (source.model.input_unit, source.model.output_unit))
    if not _carries(to, part, source.model):
        said = f"{LINEAR_PART}it omits {part.words} ({size})."
        linear = replace(source.model, nonlinear=None)
        return replace(source, model=linear, note=said), said
    return replace(
        source, note=f"The file includes {part.words} ({size}){_how(source, part, to)}"
    ), None


def _carries(to: str, part: NonlinearPart, model: Model) -> bool:
    """Whether a target has a form for the part of this model."""
    if to in _VALUES:
        return True
    if model.hold_period is not None and part.at != "command":
        return False
    order, zeros = len(model.denominator) - 1, len(model.numerator) - 1
    if part.kind == "friction":
        able = (*_PROGRAMS, *_SCRIPTS) if part.lag else (*_PROGRAMS, *_SCRIPTS, "mujoco")
        acts = order == (3 if part.lag else 2) and zeros == 0 and model.denominator[-1] != 0.0
        return acts and to in able
    if part.at == "force":
        if model.denominator[-1] == 0.0:
            return False
        return to in _PROGRAMS or (to in _SCRIPTS and 1 <= order <= _MOST_POLES)
    if part.kind == "dead_zone" or (part.at == "output" and part.kind != "backlash"):
        return to in (*_PROGRAMS, *_SCRIPTS, "modelica")
    return to in (*_PROGRAMS, *_SCRIPTS)


def _how(source: Source, part: NonlinearPart, to: str) -> str:
    """How a target follows the part, and how near that is."""
    if to in _SCRIPTS:
        return f", followed in steps of 1/{REFINE} of a sample."
    if to == "mujoco":
        return ", as frictionloss: a body that stops creeps for a step of the simulation."
    if to not in _PROGRAMS:
        return "."
    amplitude = "half the amplitude" if part.at == "force" else "the amplitude"
    return (
        f", stepped from the samples: within {_stepped_error(source):.1e} of its effect (r.m.s.) "
        f"on a sweep over the band at {amplitude} of the record."
    )


def _stepped_error(source: Source) -> float:
    """Error of a program over the effect of the part, on a sweep, both r.m.s."""
    model = source.model if source.moved_before else source.causal()
    part, fs, mode = model.nonlinear, source.fs, source.intersample
    assert part is not None
    model = replace(
        model,
        saturation_low=None,
        saturation_high=None,
        quantization_step=None,
        hold_period=None,
    )
    highest = min(model.band or 0.2 * fs, 0.45 * fs)
    wanted = fs * (2.0 * max(model.delay, 0.0) + _CYCLES / highest)
    t = np.arange(int(min(max(wanted, _SAMPLES), _MOST_SAMPLES))) / fs
    if t[-1] <= 1.1 * model.delay:
        raise ArgumentError(
            f"fs = {fs:g} Hz is too fast for a program with a delay of {model.delay:.4g} s, which "
            f"is {model.delay * fs:.3g} samples; give a lower rate with fs=... or --fs"
        )
    u = np.sin(np.pi * highest * t**2 / t[-1])
    # The reach of a force is that of the whole output, which may resonate where x does not.
    share, seen = 1.0, part
    if part.at == "force":
        share, seen = 0.5, replace(part, at="output")
    linear = replace(model, nonlinear=None)
    u *= share * part.reach / excursion(seen, linear.system, u, fs, mode)
    bent, straight = (
        (one.simulate(u, t, intersample=mode), simulate(one, u, fs=fs, intersample=mode))
        for one in (model, linear)
    )
    effect = bent[1] - straight[1]
    wrong = bent[0] - straight[0] - effect
    size = float(np.sqrt(np.mean(effect**2)))
    return float(np.sqrt(np.mean(wrong**2))) / size if size else 0.0
