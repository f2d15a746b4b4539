"""A plant in a loop, identified through the loop's reference.

Feedback makes the input follow the noise, so a fit of output to input would take noise for a
response. The reference is independent of the noise. So the output is first fitted to the part of
the input that the reference moves (two stages: P. Van den Hof and R. Schrama, Automatica 29,
1993). That part then is an instrument: the parameters are moved to where the residual of output and
*input* is orthogonal to their derivatives for the *instrument* (refined instrumental variables:
T. Söderström and P. Stoica, System Identification, 1989, ch. 8; M. Gilson and P. Van den Hof,
Automatica 41, 2005). An inexact instrument widens the error bars and causes no bias.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Real
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem, within_reach
from hmpim.identify.fitting.least_squares import UNSEEN
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.frf.local import local_response
from hmpim.identify.noise.covariance import covariance
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.worth import MATERIAL
from hmpim.model.sampled import prepare_input
from hmpim.record import Aligned, Finding, Record, uniform

__all__ = [
    "Instrument",
    "aligned_with_reference",
    "fit_through",
    "instrument_of",
    "response_through",
]

_LONGEST = 256
"""Most samples over which the input responds to the reference."""

_SHARE = 8
"""Fewest samples for each weight of that response."""

_STEPS = 40
_NEGLIGIBLE = 1e-4
"""Standard deviations below which every step must be at the end."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Instrument:
    """A reference, and the part of the input that it moves; the arrays have shape (n,)."""

    name: str  # of the reference
    reference: Real
    u: Real  # the input
    moved: Real  # the part of it that the reference moves

    def finding(self) -> Finding:
        """Report how the pair was identified."""
        return Finding(
            code="through_reference",
            message=f"The plant is identified through reference {self.name!r}, so noise "
            "that circulates in the loop biases no figure.",
            severity="info",
            parameters=(),
        )


def aligned_with_reference(record: Record, reference: str) -> tuple[Aligned, Instrument]:
    """Put all channels on one clock, and replace the input by the part that the reference moves."""
    if len(record.inputs) > 1:
        raise ArgumentError(
            f"reference={reference!r} requires a record of one input; this one has "
            f"{len(record.inputs)}: leave the others out"
        )
    if record.intersample == "sampled":
        raise ArgumentError(
            f"reference={reference!r} is for a plant, not for software "
            "(intersample='sampled'); leave one of the two out"
        )
    driver = next((c for c in record.channels if c.name == reference), None)
    if driver is None or driver in record.outputs or driver in record.inputs:
        known = ", ".join(c.name for c in (*record.references, *record.auxiliary)) or "none"
        raise ArgumentError(
            f"reference {reference!r} must be a channel that is neither input nor output; "
            f"there are: {known}"
        )
    aligned = uniform(replace(record, inputs=(*record.inputs, driver), references=(), auxiliary=()))
    source, moves = aligned.inputs
    instrument = instrument_of(reference, moves.values, source.values)
    return replace(aligned, inputs=(replace(source, values=instrument.moved),)), instrument


def instrument_of(name: str, reference: Real, u: Real) -> Instrument:
    """Fit the part of an input that a reference moves, (n,): weights over its past, by Akaike."""
    if np.ptp(reference) == 0.0:
        raise RecordError(
            f"reference {name!r} is constant at {reference[0]:g}; it moves nothing, so leave it out"
        )
    since = reference - reference[0]
    level = u - u.mean()
    best, least = np.zeros(u.size), np.inf
    lags = 8
    while lags <= min(_LONGEST, max(8, u.size // _SHARE)):
        rows = np.column_stack([scipy.linalg.toeplitz(since, np.zeros(lags)), np.ones(u.size)])
        found = rows @ np.linalg.lstsq(rows, level, rcond=None)[0]
        cost = float(np.sum((level - found) ** 2))
        criterion = u.size * np.log(max(cost, np.finfo(float).tiny)) + 2 * lags
        if criterion < least:
            best, least = found, criterion
        lags *= 2
    if float(best.var()) < MATERIAL * float(level.var()):
        raise RecordError(
            f"reference {name!r} accounts for almost none of the input; check which channel it is"
        )
    return Instrument(name=name, reference=reference, u=u, moved=np.asarray(best + u.mean()))


def fit_through(joint: JointFit, instrument: Instrument) -> tuple[JointFit, Real]:
    """Move a fit to the instrument to where the input's own residual is orthogonal to it.

    The fit is of the output to the part of the input that the reference moves. Its structure and
    noise model are kept. The second value is the covariance of its parameters, (p, p).
    """
    indirect, begun = joint.weighed, joint.best.fit
    problem = replace(indirect, source=prepare_input(instrument.u, joint.best.intersample))
    fit = _moved(problem, begun, np.zeros(begun.theta.size + begun.linear.size))
    for _ in range(_STEPS):
        rows, tools = jacobian(problem, fit), jacobian(indirect, fit)
        residual = problem.innovations(fit.prediction, fit.residual)
        # Scaled to unit size, as the parameters differ by many decades.
        size = np.sqrt(np.maximum(np.sum(tools**2, axis=1), np.finfo(float).tiny))
        mixed = (tools / size[:, None]) @ (rows / size[:, None]).T
        step = np.linalg.lstsq(mixed, (tools @ residual) / size, rcond=1e-12)[0] / size
        fit = _moved(problem, fit, step)
        spread = np.sqrt(float(residual @ residual) / max(problem.counted, 1)) / size
        if np.all(np.abs(step) < _NEGLIGIBLE * spread):
            break
    else:
        fit = replace(fit, converged=False)
    rows, tools = jacobian(problem, fit), jacobian(indirect, fit)
    residual = problem.innovations(fit.prediction, fit.residual)
    freedom = max(problem.counted - rows.shape[0], 1)
    white = is_white(problem.counting(residual))
    # (tools rowsᵀ)⁻¹ tools R toolsᵀ (…)⁻ᵀ: the bound for the instrument, turned to the input.
    size = np.sqrt(np.maximum(np.sum(tools**2, axis=1), np.finfo(float).tiny))
    tools, rows = tools / size[:, None], rows / size[:, None]
    left, values, right = np.linalg.svd(tools @ rows.T)
    # A direction that is not determined is left wide open.
    turn = right.T / np.maximum(values, UNSEEN * values[0]) @ left.T @ (tools @ tools.T)
    cov = turn @ covariance(tools, residual, freedom=freedom, white=white) @ turn.T
    cov = cov / np.outer(size, size)
    return joint.with_fit(fit), np.asarray(cov)


def _moved(problem: Problem, fit: Fit, step: Real) -> Fit:
    """The fit at other parameters; all other linear ones are solved for."""
    unknown = fit.theta.size
    theta = within_reach(
        fit.structure,
        fit.theta + step[:unknown],
        delays=(problem.shortest_delay, problem.longest_delay),
        samples=problem.y.size,
    )
    linear = fit.linear + step[unknown:]
    part = part_of(problem, fit.structure, theta)
    own = part.driven(linear[:-1]) + linear[-1]
    others = part.free if problem.nuisance is None else np.vstack([part.free, problem.nuisance])
    if others.shape[0]:
        counted, target = problem.masked(others), problem.masked(problem.y - own)
        own = own + np.linalg.lstsq(counted.T, target, rcond=None)[0] @ others
    error = problem.y - own
    residual = error if problem.valid is None else error * problem.valid
    innovations = problem.masked(error)
    return replace(
        fit,
        theta=theta,
        linear=linear,
        prediction=own,
        residual=residual,
        cost=float(residual @ residual),
        objective=float(innovations @ innovations),
        converged=True,
    )


def response_through(
    instrument: Instrument, y: Real, fs: float, *, band: tuple[float, float]
) -> FrequencyResponse:
    """Return the plant's measured response: that from reference to output, over that to input.

    The error is at most the two errors together. `y` has shape (n,); rate and band are in Hz.
    """
    into, out = (local_response(instrument.reference, x, fs, band=band) for x in (instrument.u, y))
    ratio = out.response / into.response
    std = np.hypot(out.std, np.abs(ratio) * into.std) / np.abs(into.response)
    return FrequencyResponse(frequency=out.frequency, response=ratio, std=std)
