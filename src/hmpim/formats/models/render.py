"""Templates filled in: numbers with all their digits, comments in the target's own form."""

import json
from collections.abc import Iterable
from math import floor
from pprint import pformat
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hmpim.model import Chain
from hmpim.model.fine import FINE
from hmpim.model.nonlinear import force_step
from hmpim.model.stepped import SteppedPart, command_step, kept

__all__ = ["c_number", "chain_context", "literal", "rendered"]

_OPERATORS = ("backlash", "dead_zone", "rate_limit", "friction")
"""Kinds that are no power of the deflection."""


def c_number(value: float) -> str:
    """Write a number with all its digits, recognisable as a floating one.

    Examples
    --------
    >>> c_number(1.0), c_number(0.1), c_number(-2e-300)
    ('1.0', '0.1', '-2e-300')
    """
    return repr(float(value))


def literal(value: Any) -> str:
    """Write plain values as Python would have them typed, whatever kind their numbers are.

    Examples
    --------
    >>> literal({"delay": [np.float64(0.1), None]})
    "{'delay': [0.1, None]}"
    """
    return pformat(json.loads(json.dumps(value)), width=96, sort_dicts=False)


def _in_docstring(text: str) -> str:
    """Text as it may stand between Python's triple quotes."""
    return text.replace("\\", "/").replace('"""', "'''")


def _row(values: ArrayLike) -> str:
    return ", ".join(c_number(v) for v in np.ravel(values))


def _comment(lines: Iterable[str], sign: str) -> str:
    return "\n".join(f"{sign} {line}".rstrip() for line in lines)


def rendered(template: str, **context: Any) -> str:
    """Fill in a template of this package.

    Parameters
    ----------
    template : str
        File name in the folder `templates`.
    context : dict
        What it asks for; a name that is missing is an error.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("hmpim.formats.models"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters["number"] = c_number
    environment.filters["row"] = _row
    environment.filters["comment"] = _comment
    environment.filters["docstring"] = _in_docstring
    return environment.get_template(template).render(**context)


def chain_context(chain: Chain) -> dict[str, Any]:
    """Lay out a chain's numbers for the templates of programs."""
    step, readout = chain.step, chain.readout
    pieces = [
        {"start": p.start, "stop": p.stop, "coefficients": p.coefficients} for p in chain.pieces
    ]
    rows = chain.pieces[0].coefficients.shape[0] if chain.pieces else 0
    terms = chain.pieces[0].coefficients.shape[1] if chain.pieces else 0
    hold = readout.hold_period is not None
    return {
        "fs": step.fs,
        "order": step.order,
        "prefilter": step.prefilter,
        "line": step.delay + 3,
        "delay": step.delay,
        "transition": step.transition,
        "drive": step.drive,
        "output": step.output,
        "feed": step.feed,
        "level": chain.level,
        "integrates": chain.integrates,
        "bias": readout.bias,
        "low": readout.saturation_low,
        "high": readout.saturation_high,
        "quantum": readout.quantization_step,
        "hold": hold,
        "period": (readout.hold_period or 0.0) * step.fs,
        "phase": readout.hold_phase * step.fs,
        "over_outputs": chain.over_outputs,
        "pieces": pieces,
        "rows": rows,
        "terms": terms,
        "intersample": step.intersample,
        "error": chain.error,
        "band": step.band,
        "gain": step.gain,
        "bent": None if chain.nonlinear is None else _bent_context(chain.nonlinear),
    }


def _bent_context(stepped: SteppedPart) -> dict[str, Any]:
    """Lay out a nonlinear part for the templates of programs."""
    part = stepped.part
    context: dict[str, Any] = {
        "kind": part.kind,
        "form": part.kind if part.kind in _OPERATORS else part.at,
        "size": part.size,
        "step": part.size / stepped.fs,
        "fine": FINE,
    }
    if part.kind not in _OPERATORS:
        context |= {"weight": part.weight, "power": part.power, "reach": part.reach}
    if context["form"] == "force":
        transition, first, last = force_step(stepped.denominator)
        context |= {"transition": transition, "first": first, "last": last}
    if part.kind == "friction":
        late = stepped.system.delay * stepped.fs * FINE
        whole = floor(late)
        unit = stepped.rubbing
        context |= {
            "motion": command_step(unit),
            "lag": unit.lag,
            "kept": kept(unit),
            "inertia": unit.inertia,
            "gain": float(stepped.system.numerator[0]),
            "whole": whole,
            "part": late - whole,
            "held": part.between == "zoh",
            "commands": max((whole + FINE + 1) // FINE + 2, 3),
        }
    return context
