"""What a model leaves over, told from statistics alone: its autocorrelation, and both ends."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.noise.autoregression import LONGEST
from hmpim.identify.statistics.reach import AHEAD

__all__ = ["Residual"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Residual:
    """What a model leaves over: autocorrelation over all samples, and the ends themselves.

    Parameters
    ----------
    whole : ndarray, shape (LONGEST + 1,)
        Sums of products with what came so many samples before, over all that is not 0.
    ends : ndarray, shape (runs, 2, length)
        Head and tail of each run; sample c of the head is sample c - AHEAD of the run, and of the
        tail one of those that do not count from `span` on.
    span : int
        See above.
    counted : int
        Samples of all runs, those at the end that do not count taken off.
    """

    whole: Real
    ends: Real
    span: int
    counted: int

    def head(self, run: int, count: int) -> Real:
        """The first samples of a run, as if it had begun at rest."""
        return np.asarray(self.ends[run, 0, AHEAD : AHEAD + count])

    def gram(self, first: int) -> tuple[Real, int]:
        """Sums of products of a sample and its past, and of how many samples.

        Parameters
        ----------
        first : int
            Sample of each run from which on its outputs count.

        Returns
        -------
        gram : ndarray, shape (LONGEST + 1, LONGEST + 1)
            The sample itself first.
        count : int
        """
        index = np.arange(LONGEST + 1)
        out = self.whole[np.abs(index[:, None] - index)] * 1.0
        begin = first + LONGEST
        for head, tail in self.ends:
            before = _shifted(head[: begin + AHEAD])
            after = _shifted(tail)[:, self.span :]
            out -= before @ before.T + after @ after.T
        return out, self.counted - begin * self.ends.shape[0]


def _shifted(x: Real) -> Real:
    """A signal and what came 1 … LONGEST samples before, 0 before it begins."""
    padded = np.concatenate([np.zeros(LONGEST), x])
    return np.stack([padded[LONGEST - k : padded.size - k] for k in range(LONGEST + 1)])
