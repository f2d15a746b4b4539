"""The nonlinear part of a model under another input: whether it can be applied, and how far."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.result import PairIdentification
from hmpim.identify.worth import FEW
from hmpim.model import Model, simulate
from hmpim.model.model import simulate_with_reach
from hmpim.model.nonlinear import KIND_WORDS, NonlinearPart
from hmpim.model.operators import gap_crossed
from hmpim.record import Aligned, Finding

__all__ = ["all_applied", "applied", "known_state", "left_out"]


def left_out(pair: PairIdentification) -> str | None:
    """Name a nonlinearity that the record shows and the model lacks; None if there is none."""
    if pair.nonlinear_part is not None:
        return None
    codes = {warning.code for warning in pair.warnings} & {"nonlinear", *KIND_WORDS}
    p = pair.parameters
    if p.saturation_low is not None or p.saturation_high is not None:
        codes.discard("saturation")
    if not codes:
        return None
    found = () if pair.nonlinearity is None else pair.nonlinearity.kinds
    kinds = dict.fromkeys(found or [kind for kind in KIND_WORDS if kind in codes])
    words = [KIND_WORDS[kind] for kind in kinds if kind in KIND_WORDS]
    return " or ".join(words) or "a nonlinearity of no known kind"


def applied(
    pair: PairIdentification, model: Model, u: Real, fs: float
) -> tuple[Model, Real, tuple[Finding, ...]]:
    """The model as it can be driven by an input, (n,) at `fs` in Hz, and what to know about it.

    Its nonlinear part is taken off where it cannot be applied. The second value is the output that
    it simulates, (n,), without saturation, hold and rounding.
    """
    lacking = left_out(pair)
    found: tuple[Finding, ...] = ()
    if lacking is not None:
        found = (_linear_only(pair, f"{lacking} was found, but is not part of the model"),)
    elif (part := model.nonlinear) is not None:
        try:
            moved, reach = simulate_with_reach(model, u, fs=fs)
        except ArgumentError as reason:
            model = replace(model, nonlinear=None)
            found = (_linear_only(pair, str(reason)),)
        else:
            return model, moved, _beyond(pair, model, part, reach)
    return model, simulate(model, u, fs=fs, intersample=model.intersample), found


def _beyond(
    pair: PairIdentification, model: Model, part: NonlinearPart, farthest: float
) -> tuple[Finding, ...]:
    """Report an input that goes beyond the amplitude at which the nonlinearity was identified."""
    if farthest <= (1.0 + FEW) * part.reach:
        return ()
    what, unit = "moves the output by", model.output_unit
    if part.at == "command":
        speed = part.kind == "rate_limit"
        unit = "per s" if speed else ""
        what = "moves at" if speed else "goes"
    return (
        Finding(
            code="beyond_reach",
            message=f"{pair.input!r} {what} up to {f'{farthest:.4g} {unit}'.rstrip()}, and "
            f"{part.words} was identified from a record of up to {part.reach:.4g}: beyond, the "
            "prediction is an extrapolation. Identify a record of this amplitude too.",
            severity="info",
            parameters=(),
        ),
    )


def all_applied(
    pairs: Sequence[PairIdentification], models: Sequence[Model], aligned: Aligned
) -> tuple[list[Model], list[Real], Mask, tuple[Finding, ...]]:
    """The models of an output as a record can drive them, their outputs, samples and findings.

    The outputs and the samples are (n,). The samples are those at which all inputs and the states
    of the nonlinear parts are known.
    """
    driven: list[Model] = []
    outputs: list[Real] = []
    known, said = np.ones(aligned.samples, dtype=bool), list[Finding]()
    for pair, model in zip(pairs, models, strict=True):
        source = aligned.signal(pair.input)
        able, moved, findings = applied(pair, model, source.values, aligned.fs)
        driven.append(able)
        outputs.append(moved)
        said += findings
        known &= source.valid & known_state(able, source.values, aligned.fs)
    return driven, outputs, known, tuple(said)


def known_state(model: Model, u: Real, fs: float) -> Mask:
    """Samples, (n,), at which the state of the nonlinear part does not depend on the past.

    Backlash may begin anywhere in its gap, and is known once that has been crossed.
    """
    part = model.nonlinear
    if part is None or part.kind != "backlash":
        return np.ones(u.size, dtype=bool)
    linear = replace(model, nonlinear=None)
    return gap_crossed(simulate(linear, u, fs=fs, intersample=model.intersample), part.size)


def _linear_only(pair: PairIdentification, reason: str) -> Finding:
    return Finding(
        code="linear_only",
        message=f"The prediction of {pair.output!r} from {pair.input!r} is that of the linear part "
        f"alone: {reason}.",
        severity="info",
        parameters=(),
    )
