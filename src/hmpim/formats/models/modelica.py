"""Modelica: equations of the states and the operator `delay`, no library needed."""

from pathlib import Path

import numpy as np

from hmpim.formats.atomic import write_text
from hmpim.formats.models.render import rendered
from hmpim.formats.models.source import Source

__all__ = ["write_modelica"]


def write_modelica(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the model; its file must keep its name."""
    model = source.causal()
    system = model.system
    below, above = system.denominator, system.numerator
    spread = model.spread
    text = rendered(
        "model.mo.jinja",
        name=source.name,
        lines=[line.replace('"', "'") for line in source.lines()],
        input=source.pair.input,
        output=source.pair.output,
        unit=model.output_unit,
        delay=model.delay,
        order=below.size - 1,
        below=below,
        above=above,
        model=model,
        estimates=[
            (name, estimate) for name, estimate in source.estimates() if np.isfinite(estimate.value)
        ],
        covariance=[] if spread is None else spread.covariance,
    )
    write_text(path, text)
    return (path,)
