"""python-control and scipy.signal: a script each, the delay exact and apart from the dynamics."""

from pathlib import Path

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.formats.atomic import write_text
from hmpim.formats.models.refined import (
    pade_error,
    pade_order,
    refined_values,
)
from hmpim.formats.models.render import literal, rendered
from hmpim.formats.models.source import Source

__all__ = ["write_control", "write_scipy"]


def write_control(source: Source, path: Path, *, pade: int | None = None) -> tuple[Path, ...]:
    """Write the script for python-control; `pade` is the order of its approximation.

    Raises
    ------
    ArgumentError
        If the order is not from 1 to 20: beyond, its coefficients lose all digits.
    """
    if pade is not None and not 1 <= pade <= 20:
        raise ArgumentError(f"pade = {pade!r} is not an order from 1 to 20; give one of these")
    return _write(source, path, control=True, pade=pade)


def write_scipy(source: Source, path: Path) -> tuple[Path, ...]:
    """Write the script for scipy.signal."""
    return _write(source, path, control=False, pade=None)


def _write(source: Source, path: Path, *, control: bool, pade: int | None) -> tuple[Path, ...]:
    model, pair = source.causal(), source.pair
    order = pade_order(source) if pade is None else pade
    band = model.band or 0.2 * source.fs
    spread = model.spread
    text = rendered(
        "linear.py.jinja",
        control=control,
        name=source.name,
        title=f"{pair.output} from {pair.input}, for {'python-control' if control else 'scipy'}.",
        lines=source.program_lines(),
        pade=order,
        pade_error=pade_error(order, 2 * np.pi * band * model.delay),
        band=band,
        input=pair.input,
        output=pair.output,
        parameters=literal({k: e.to_dict() for k, e in source.estimates()}),
        covariance=literal(None if spread is None else [list(r) for r in spread.covariance]),
        **refined_values(source),
    )
    write_text(path, text)
    return (path,)
