"""MuJoCo: an actuator on a body of its own, its delay, lag and gain, and ranges to draw from.

MuJoCo quantises a delay to what its buffer holds without a word: the buffer here is as long as
the delay, read linearly. The gains are set so that the stepped system has the poles of the model
at the stated time step; what is left is computed from the recursion that MuJoCo steps, and said.
"""

from dataclasses import dataclass
from math import ceil
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.formats.atomic import write_text
from hmpim.formats.models.ranges import ranges_of
from hmpim.formats.models.render import rendered
from hmpim.formats.models.source import Source
from hmpim.model import Model, frequency_response

__all__ = ["Stepped", "stepped_response", "write_mujoco"]

_WHOLE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Stepped:
    """What MuJoCo steps.

    Parameters
    ----------
    timestep : float
        Step in s.
    delay : float
        Delay in s that its buffer is given; 0 for none.
    activation : {'none', 'integrator', 'filterexact'}
        Dynamics of the activation.
    time_constant : float
        Of the filter in s.
    gain, bias : float
        Force for each unit of control, and without.
    stiffness, damping : float or None
        Of the body of mass 1, matched to the step; None where force itself is the output.
    """

    timestep: float
    delay: float
    activation: str
    time_constant: float
    gain: float
    bias: float
    stiffness: float | None
    damping: float | None


def write_mujoco(source: Source, path: Path, *, timestep: float | None) -> tuple[Path, ...]:
    """Write the MJCF.

    Raises
    ------
    ArgumentError
        If the time step is not given, or the model has zeros or more than three poles.
    """
    stepped = _stepped(source, timestep)
    error, band = _error(source, stepped)
    late = stepped.delay
    model = source.model
    text = rendered(
        "model.xml.jinja",
        name=source.name,
        # Two dashes end a comment in XML.
        lines=[line.replace("--", "- -") for line in source.program_lines()],
        stepped=stepped,
        samples=ceil(late / stepped.timestep - _WHOLE) if late else 0,
        sensor_samples=max(ceil(model.delay / stepped.timestep - _WHOLE), 1),
        error=error,
        band=band,
        model=source.causal(),
        ranges=ranges_of(source),
        friction=_friction(model, stepped),
    )
    write_text(path, text)
    return (path,)


def _friction(model: Model, stepped: Stepped) -> tuple[float, float] | None:
    """Friction of the body, and the rate at which its constraint stops it: within a step."""
    part = model.nonlinear
    if part is None or stepped.stiffness is None:
        return None
    return part.size * stepped.stiffness, 1.0 / stepped.timestep


def _stepped(source: Source, timestep: float | None) -> Stepped:
    if timestep is None:
        raise ArgumentError(
            "the time step of the simulation is not known, and MuJoCo counts a delay in steps; "
            "give timestep=0.001 or --timestep 0.001, as in its <option>"
        )
    if not (np.isfinite(timestep) and timestep > 0):
        raise ArgumentError(f"timestep = {timestep!r} s is not a time step; give a positive number")
    model, h = source.causal(), float(timestep)
    if len(model.numerator) > 1 or len(model.denominator) > 4:
        raise ArgumentError(
            f"{source.pair.structure} has zeros or more than three poles, which MuJoCo's actuators "
            "lack; export to c or python and step that in parallel"
        )
    poles = np.roots(model.denominator)
    poles = poles[np.argsort(np.abs(poles.imag) > 0)]  # real ones first
    integrates = model.denominator[-1] == 0.0
    moving = poles[np.abs(poles) > 0]
    activation, constant, early = "none", 1.0, False
    pair: NDArray[np.complex128] | None = None
    if moving.size + integrates in (0, 1):
        if integrates or moving.size:
            activation, early = ("integrator" if integrates else "filterexact"), True
            constant = 1.0 if integrates else float(-1.0 / moving[0].real)
    else:
        if moving.size == 3 or (integrates and moving.size == 2):
            real = moving[np.abs(moving.imag) == 0]
            chosen = real[np.argmin(np.abs(real.real))] if real.size else None
            if chosen is None:  # an integrator behind an oscillating pair
                activation, early = "integrator", True
                pair = moving
            else:
                activation, early, constant = "filterexact", True, float(-1.0 / chosen.real)
                moving = np.delete(moving, int(np.flatnonzero(moving == chosen)[0]))
        if pair is None:
            pair = np.concatenate([[0.0], moving]) if integrates else moving
    delay = model.delay
    if early:  # the activation of the end of the step counts: half a step early
        delay = delay + h / 2 if delay >= h / 2 else 0.0
    gain, bias, stiffness, damping = model.scale_factor, model.bias, None, None
    if pair is not None:
        stiffness, damping, gain = _matched(pair, h, model.scale_factor)
        bias = model.bias * stiffness
    return Stepped(
        timestep=h,
        delay=delay,
        activation=activation,
        time_constant=constant,
        gain=gain,
        bias=bias,
        stiffness=stiffness,
        damping=damping,
    )


def _matched(
    pair: NDArray[np.complex128], h: float, scale_factor: float
) -> tuple[float, float, float]:
    """Stiffness, damping and gain of a mass of 1 whose step has the poles exp(p h).

    MuJoCo's implicitfast integrator steps v' = v + h (g u - k q - d v) / (1 + h d), q' = q + h v'.
    """
    z = np.exp(pair * h)
    product, total = float((z[0] * z[1]).real), float((z[0] + z[1]).real)
    damping = (1.0 - product) / h / product
    stiffness = (1.0 + product - total) / h**2 * (1.0 + h * damping)
    if abs(pair[0]) == 0.0:  # an integrator: the speed is what has a gain
        stiffness = 0.0
        return stiffness, damping, scale_factor * damping
    return stiffness, damping, scale_factor * stiffness


def stepped_response(stepped: Stepped, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Response of what MuJoCo steps, at `frequency` in Hz, shape (m,)."""
    h = stepped.timestep
    z = np.exp(2j * np.pi * frequency * h)
    response = np.full(z.size, complex(stepped.gain))
    if stepped.delay > 0:
        late = max(stepped.delay / h, 1.0)  # reading comes before writing
        whole = int(late + _WHOLE)
        part = max(late - whole, 0.0)
        response *= z**-whole * ((1.0 - part) + part / z)
    if stepped.activation == "filterexact":
        kept = np.exp(-h / stepped.time_constant)
        response *= (1.0 - kept) / (1.0 - kept / z)
    elif stepped.activation == "integrator":
        response *= h / (1.0 - 1.0 / z)
    if stepped.stiffness is not None and stepped.damping is not None:
        scale = 1.0 + h * stepped.damping
        spring, damper = stepped.stiffness / scale, stepped.damping / scale
        below = z**2 - (2.0 - h * damper - h**2 * spring) * z + (1.0 - h * damper)
        response *= h**2 / scale * z / below
    return response


def _error(source: Source, stepped: Stepped) -> tuple[float, float]:
    band = min(source.model.band or 0.2 * source.fs, 0.5 / stepped.timestep)
    frequency = np.linspace(band / 400, band, 400)
    truth = frequency_response(source.causal(), frequency)
    return float(np.max(np.abs(stepped_response(stepped, frequency) / truth - 1.0))), band
