"""Isaac Lab: a delayed PD actuator and the term that draws its gains. Not run here."""

from math import ceil, floor
from pathlib import Path

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.formats.atomic import write_text
from hmpim.formats.models.ranges import ranges_of
from hmpim.formats.models.render import literal, rendered
from hmpim.formats.models.source import Source
from hmpim.model import Model, draw_models

__all__ = ["write_isaac"]

_DRAWS = 2000


def write_isaac(source: Source, path: Path, *, timestep: float | None) -> tuple[Path, ...]:
    """Write the Python file.

    Raises
    ------
    ArgumentError
        If the physics step is not given, or the dynamics are neither a first-order lag nor of
        second order.
    """
    if timestep is None or not (np.isfinite(timestep) and timestep > 0):
        raise ArgumentError(
            "the physics step is not known, and Isaac Lab counts a delay in steps; give "
            "timestep=0.005 or --timestep 0.005"
        )
    model = source.causal()
    if (
        len(model.numerator) > 1
        or len(model.denominator) not in (2, 3)
        or not model.denominator[-1]
    ):
        raise ArgumentError(
            f"{source.pair.structure} is neither a first-order lag nor of second order, which is "
            "what a PD actuator makes; export to python and step that in parallel"
        )
    ranges = ranges_of(source)
    low, high = ranges.get("delay", (model.delay, model.delay))
    steps = (max(floor(low / timestep), 0), ceil(high / timestep))
    stiffness, damping = _gains(model)
    drawn = [_gains(one) for one in draw_models(model, _DRAWS, rng=0)] if model.spread else []
    text = rendered(
        "isaac.py.jinja",
        title=f"{source.pair.output} from {source.pair.input}, for Isaac Lab.",
        lines=source.program_lines(),
        timestep=float(timestep),
        delay=model.delay,
        delay_error=max(model.delay - steps[0] * timestep, steps[1] * timestep - model.delay),
        steps=steps,
        scale_factor=model.scale_factor,
        ranges=literal(ranges),
        stiffness=stiffness,
        damping=damping,
        time_constant=1.0 / damping,
        stiffness_range=_share([k for k, _ in drawn if k is not None], stiffness),
        damping_range=_share([d for _, d in drawn], damping),
    )
    write_text(path, text)
    return (path,)


def _gains(model: Model) -> tuple[float | None, float]:
    """Stiffness and damping for each unit of inertia."""
    if len(model.denominator) == 2:
        return None, model.denominator[1] / model.denominator[0]
    second, first, constant = model.denominator
    return constant / second, first / second


def _share(drawn: list[float], nominal: float | None) -> tuple[float, float]:
    """95 % of the draws, over the nominal value."""
    if not drawn or not nominal:
        return 1.0, 1.0
    low, high = np.quantile(np.array(drawn) / nominal, [0.025, 0.975])
    return float(low), float(high)
