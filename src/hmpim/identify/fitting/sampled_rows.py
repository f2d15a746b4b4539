"""The rows of software under test: responses of a filter in z, and their derivatives."""

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.feedforward_rows import FeedforwardPart, is_fed_forward
from hmpim.identify.fitting.rows import Driven, Part, Problem
from hmpim.identify.kept import recent
from hmpim.model.dynamics import Structure, coefficients_of
from hmpim.model.filters import nyquist_taps, poles_in_z
from hmpim.model.sampled import MARGIN, SAMPLES_ALONE

__all__ = ["SampledPart", "part_of"]

_STEP = 1e-6


class SampledPart(Driven):
    """Response of software to its input at given parameters; the same interface as `Part`.

    The structure is one of `hmpim.model.dynamics.FILTERS`, its delay a whole number of samples.
    """

    def __init__(self, problem: Problem, structure: Structure, theta: Real) -> None:
        self.structure, self.theta = structure, theta
        source, n = problem.source, problem.y.size
        late = min(max(round(float(theta[0])), 0), n)
        deviation = source.coefficients[MARGIN : MARGIN + n]
        moved = np.concatenate([np.zeros(late), deviation])[:n]
        self._below = _below(structure, theta[1:])
        taps = self._below.sum() * nyquist_taps(structure)
        rows = [scipy.signal.lfilter(taps, self._below, moved)]
        for _ in range(structure.zeros):
            rows.append(np.diff(rows[-1], prepend=0.0))
        self.rows = np.stack(rows)
        self.level = source.first
        self.free = np.empty((0, n))
        """Free responses, shape (order, n)."""
        if problem.begins is not None and structure.order:
            impulses = np.eye(structure.order, n, problem.begins)
            self.free = np.asarray(scipy.signal.lfilter(np.ones(1), self._below, impulses))

    def slopes(self, numerator: Real, initial: Real, here: slice = slice(None)) -> Real:
        """Derivatives by theta, shape (1 + order, n); 0 by the delay, a whole number of samples."""
        order = self.structure.order
        out = np.zeros((1 + order, self.rows.shape[1]))
        if not order:
            return out[:, here]
        forced = numerator @ self.rows
        free = initial @ self.free if initial.size else np.zeros(forced.size)
        turned = -scipy.signal.lfilter(np.ones(1), self._below, forced + free)
        later = [np.concatenate([np.zeros(k), turned[:-k]]) for k in range(1, order + 1)]
        by_coefficient = forced / self._below.sum() + np.stack(later)
        for j, step in enumerate(_STEP * np.eye(order)):
            up = _below(self.structure, self.theta[1:] + step)
            down = _below(self.structure, self.theta[1:] - step)
            out[1 + j] = (up - down)[1:] / (2 * _STEP) @ by_coefficient
        return out[:, here]


def _below(structure: Structure, theta: Real) -> Real:
    """A by rising powers of 1/z, 1 first."""
    below = np.ones(1, dtype=np.complex128)
    for pole in poles_in_z(structure, coefficients_of(structure, theta)):
        below = np.convolve(below, [1.0, -pole])
    return np.asarray(below.real)


def part_of(problem: Problem, structure: Structure, theta: Real) -> Part | SampledPart:
    """Rows of a system in continuous time, or of software.

    The rows of the last fits are kept, since several steps need them again.
    """
    source = problem.source
    if source.degree == SAMPLES_ALONE:
        return SampledPart(problem, structure, theta)
    kind = FeedforwardPart if is_fed_forward(source, structure) else Part
    made = recent(part_of, source.coefficients.nbytes)
    if made is None:
        return kind(problem, structure, theta)
    key = (source, structure, theta.tobytes())
    if key not in made:
        made[key] = kind(problem, structure, theta)
    part: Part = made[key]
    return part.begun(problem.begins)
