"""Modelica: equations of the states and the operator `delay`, no library needed."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.atomic import write_text
from hmpim.formats.models.refined import modal_matrices
from hmpim.formats.models.render import c_number, rendered
from hmpim.formats.models.source import Source
from hmpim.model import Model

__all__ = ["write_modelica"]

Real = NDArray[np.float64]


def write_modelica(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the model; its file must keep its name."""
    model = source.causal()
    system = model.system
    modal = modal_matrices(source)
    if modal is None:
        derivatives, shown = _chain(system.denominator, system.numerator)
    else:
        derivatives, shown = _modes(*modal)
    spread = model.spread
    text = rendered(
        "model.mo.jinja",
        name=source.name,
        lines=[line.replace('"', "'") for line in source.program_lines()],
        input=source.pair.input,
        output=source.pair.output,
        unit=model.output_unit,
        delay=model.delay,
        derivatives=derivatives,
        shown=shown,
        entered=_entered(model),
        bent=_bent(model),
        model=model,
        estimates=[
            (name, estimate) for name, estimate in source.estimates() if np.isfinite(estimate.value)
        ],
        covariance=[] if spread is None else spread.covariance,
    )
    write_text(path, text)
    return (path,)


def _entered(model: Model) -> str:
    """The input of the dynamics: late, and beyond a dead zone."""
    late = "delay(u, tau)" if model.delay > 0 else "u"
    part = model.nonlinear
    if part is None or part.kind != "dead_zone":
        return late
    half = c_number(part.size)
    return f"{late} - max(-{half}, min({half}, {late}))"


def _bent(model: Model) -> str:
    """The output by a scale that changes with the deflection; empty if it does not."""
    part = model.nonlinear
    if part is None or part.at != "output":
        return ""
    weight, reach = c_number(part.weight * part.reach), c_number(part.reach)
    return f"linear + ({weight}) * (linear / {reach})^{part.power}"


def _chain(below: Real, above: Real) -> tuple[list[str], str]:
    """Right sides of the states' equations, each the next one's derivative, and the output."""
    states = [f"x{i + 1}" for i in range(below.size - 1)]
    if not states:
        return [], _sum(above, ["v"])
    last = f"({_sum([1.0, *-below[:-1]], ['v', *states])}) / {c_number(below[-1])}"
    # As many zeros as poles: what is fed through is the last derivative's share.
    names = [*states, f"der({states[-1]})"]
    return [*states[1:], last], _sum(above, names[: above.size])


def _modes(generator: Real, entry: Real, output: Real, through: float) -> tuple[list[str], str]:
    """The same, each mode apart from the others."""
    names = [*(f"x{i + 1}" for i in range(entry.size)), "v"]
    rows = np.column_stack([generator, entry])
    return [_sum(row, names) for row in rows], _sum([*output, through], names)


def _sum(weights: Iterable[float], names: list[str]) -> str:
    """A sum of names, each times its weight; a weight below 0 needs brackets in Modelica."""
    terms = []
    for weight, name in zip(weights, names, strict=True):
        number = f"({c_number(weight)})" if weight < 0 else c_number(weight)
        if weight:
            terms.append(name if weight == 1.0 else f"{number} * {name}")
    return " + ".join(terms) or "0.0"
