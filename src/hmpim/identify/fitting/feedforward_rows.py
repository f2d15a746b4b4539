"""The rows of a held command whose velocity and acceleration are commanded, and held, too."""

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.rows import Part, Problem
from hmpim.identify.fitting.sections import Expansion, poles_of
from hmpim.model.dynamics import Structure
from hmpim.model.poles import PoleResponses
from hmpim.model.sampled import SampledInput

__all__ = ["FeedforwardPart", "is_fed_forward", "may_be_fed_forward"]


def may_be_fed_forward(structure: Structure) -> bool:
    """Whether zeros of a structure may stem from commands of velocity and acceleration.

    Sections in parallel have zeros of other origin, and with as many zeros as poles the output
    would jump.
    """
    return structure.order > structure.zeros > structure.dc_zeros == 0 and not structure.parallel


def is_fed_forward(source: SampledInput, structure: Structure) -> bool:
    """Whether the zeros of a structure act on commands before these are held."""
    return source.derivatives is not None and may_be_fed_forward(structure)


class FeedforwardPart(Part):
    """Responses of 1/A(s) to position, velocity and acceleration, one for each coefficient of B.

    The interface is that of `Part`. A servo with feedforward computes B of the command before it
    is held; the aliases of what follows then differ from those of B(s)/A(s) behind a held command.
    """

    def __init__(self, problem: Problem, structure: Structure, theta: Real) -> None:
        self.structure, self.theta = structure, theta
        self._source, self._delay = problem.source, float(theta[0])
        self._poles = poles_of(structure, theta[1:])
        commands, upper = self._source.commands[: structure.zeros + 1], self._poles.upper
        self._each = [PoleResponses(command, self._delay, upper) for command in commands]
        self.rows = self._answered(self._poles.expand(np.ones((1, 1))))[:, 0]
        self.level = self._source.first
        self._begin(problem.begins)

    def _driven_slopes(self, numerator: Real, here: slice) -> Real:
        every = self._answered(self._poles.slopes(np.ones(1)), here)
        return np.asarray(np.tensordot(numerator, every, 1))

    def _answered(self, expansion: Expansion, here: slice = slice(None)) -> Real:
        """Sums of the responses of single poles to each command, (m, rows, n)."""
        return np.stack([self._added(expansion, here, answers=one) for one in self._each])
