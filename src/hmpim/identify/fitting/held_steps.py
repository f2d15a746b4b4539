"""A held input that steps straight through to the output: samples fix the delay to one sample.

If the numerator has the denominator's degree, the output jumps with a held input. Samples then do
not distinguish a fraction of a sample of delay from a change of the numerator, and the likelihood
jumps from one whole sample to the next. So the delay stays in the middle of its sample, the
neighbouring samples are tried one by one, and figures are read at both ends of the best one. Where
a structure has fewer numerator coefficients than poles, as a second-order high pass has, samples do
determine the fraction, and the delay moves within its sample.
"""

from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.feedforward_rows import is_fed_forward
from hmpim.identify.fitting.rows import Problem
from hmpim.model.dynamics import Structure, coefficients_of, denominator_of
from hmpim.model.sampled import SampledInput, companion

__all__ = [
    "at_ends",
    "in_whole_samples",
    "is_all_behind_hold",
    "is_known_to_a_sample",
    "kept_in_sample",
    "steps_through",
]

_EDGE = 0.01
"""Least distance of the delay from the ends of its sample, in samples."""

_INSIDE = 1e-6
"""Least distance from the ends for a delay that moves within its sample: the likelihood jumps
there."""

_FORGOTTEN = 1e-10
"""Share of a state that remains after part of a sample, below which it is unobservable."""


def is_all_behind_hold(source: SampledInput, structure: Structure) -> bool:
    """Whether all of B(s)/A(s) is behind the hold of a held input."""
    return source.degree == 0 and not is_fed_forward(source, structure)


def steps_through(structure: Structure, *, held: bool) -> bool:
    """Whether the output jumps when a held input does."""
    if not held or structure.sampled or structure.parallel or structure.integrators:
        return False
    return structure.order > 0 and structure.zeros == structure.order


def in_whole_samples(structure: Structure, *, held: bool) -> bool:
    """Whether samples fix a delay to one sample and no closer.

    So they do where the output steps with a held input, unless the numerator is too short to
    imitate a fraction of a sample.
    """
    short = structure.zeros - structure.dc_zeros + 1 < structure.order
    stepped = steps_through(structure, held=True) and not short
    return held and (structure.name == "static" or stepped)


def is_known_to_a_sample(source: SampledInput, structure: Structure) -> bool:
    """Whether samples of this input fix the delay of a structure to one sample and no closer."""
    return in_whole_samples(structure, held=is_all_behind_hold(source, structure))


def kept_in_sample(problem: Problem, structure: Structure, theta: Real) -> Problem:
    """The problem with the delay kept in its sample, in the middle if no fraction is known."""
    held = is_all_behind_hold(problem.source, structure)
    stated = problem.shortest_delay == problem.longest_delay
    if stated or not steps_through(structure, held=held):
        return problem
    within = np.clip(theta[0], problem.shortest_delay, problem.longest_delay)
    room = 0.5 if in_whole_samples(structure, held=held) else _INSIDE
    low = float(np.floor(within))
    return replace(problem, shortest_delay=low + room, longest_delay=low + 1.0 - room)


def at_ends(structure: Structure, theta: Real, linear: Real) -> list[tuple[Real, Real]]:
    """Parameters that give the same samples, the delay at the beginning and the end of its sample.

    With y = C x + D u behind a delay of d + f samples, d whole, the input last stepped 1 - f before
    a sample. The samples determine C e^{A (1 - f)} and D + C Γ(1 - f), with Γ the integral of
    e^{At} B, and from these follow C and D at any other f. `in_whole_samples` is true of the
    structure, which has poles; theta, (1 + order,), and linear, (m + 1,), are as of a `Fit`.
    """
    below = denominator_of(structure, coefficients_of(structure, theta[1:]))
    order, first = structure.order, structure.dc_zeros
    above = np.zeros(order + 1)
    above[first:] = linear[:-1]
    through = above[-1] / below[-1]
    reads = above[:-1] - through * below[:-1]
    whole = float(np.floor(theta[0]))
    rest = 1.0 - (theta[0] - whole)
    moved, fed = _steps(below, rest)
    observed, at_once = reads @ moved, through + reads @ fed
    found = []
    for share in (_EDGE, 1.0 - _EDGE):
        moved, fed = _steps(below, 1.0 - share)
        # A state that is forgotten within the sample is unobservable.
        reads = np.linalg.lstsq(moved.T, observed, rcond=_FORGOTTEN)[0]
        through = at_once - float(reads @ fed)
        above = np.append(reads, 0.0) + through * below
        delayed = np.concatenate([[whole + share], theta[1:]])
        found.append((delayed, np.append(above[first:], linear[-1])))
    return found


def _steps(below: Real, time: float) -> tuple[Real, Real]:
    """e^{At} and Γ(t) of a companion form, `below` by rising powers of s per sample."""
    step = scipy.linalg.expm(companion(below, 1) * time)
    return step[:-1, :-1], step[:-1, -1]
