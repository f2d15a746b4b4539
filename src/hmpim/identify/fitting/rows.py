"""The rows of one problem: what each linear parameter multiplies, and the derivatives.

The output is a sum of rows: for each input, B(s)/A(s) behind a delay, one row for each
coefficient of B; the bias; whatever else is linear, such as a drift; and, where a record does not
begin at rest, the free response of the state it begins with.
"""

from copy import copy
from dataclasses import dataclass, replace
from math import ceil
from typing import ClassVar

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.sections import Expansion, Parallel, Poles, poles_of
from hmpim.model.dynamics import Structure
from hmpim.model.poles import PoleResponses, input_responses
from hmpim.model.sampled import SampledInput

__all__ = ["STAMPED_LATE", "Driven", "Part", "Problem"]

STAMPED_LATE = -4.0
"""Least delay in samples that is tried where an output follows its input: stamps may be late."""


_FINAL = 1e-6
"""Precision of the chosen fit, see `hmpim.identify.fitting.fit.fit_structure`."""

_NOTHING = 50.0
"""Time constants after which a free response is less than rounding."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One input, one output, and which samples of the output count.

    Parameters
    ----------
    source : SampledInput
        The prepared input.
    y : ndarray, shape (n,)
        Output samples.
    valid : ndarray of bool, shape (n,), or None
        Samples that count; None when all do.
    longest_delay : float
        Greatest delay to try, in samples.
    shortest_delay : float
        Least delay to try, in samples; below 0 the output is ahead, or its stamps are late.
    whitening : ndarray, shape (n // 2 + 1,), or None
        Gain at each bin of the transform after which the noise is white; residuals and
        derivatives then are those of the whitened output. None for noise that is white.
    noise : ndarray, shape (order + 1,), or None
        Autoregression of the noise, 1 first: what it leaves of residual and derivatives is white.
    told : ndarray of bool, shape (n,), or None
        With `noise`, the samples whose whole past, as far as it reaches, counts.
    nuisance : ndarray, shape (k, n), or None
        Rows beside the bias that enter linearly, such as a drift's.
    begins : int or None
        Sample from which on the free response of an unknown state is fitted; those before do not
        count. None for a record that begins at rest.
    """

    source: SampledInput
    y: Real
    valid: Mask | None
    longest_delay: float
    shortest_delay: float = STAMPED_LATE
    whitening: Real | None = None
    noise: Real | None = None
    told: Mask | None = None
    nuisance: Real | None = None
    begins: int | None = None
    final: ClassVar[float] = _FINAL

    @property
    def counted(self) -> int:
        """How many samples count."""
        return self.y.size if self.counts is None else int(np.count_nonzero(self.counts))

    @property
    def spread(self) -> float:
        """Sum of squares of the output about its mean."""
        return float(np.sum((self.masked(self.y - self.y.mean())) ** 2))

    @property
    def plain(self) -> "Problem":
        """The same, its noise taken for white."""
        return replace(self, noise=None, told=None)

    @property
    def counts(self) -> Mask | None:
        """Samples whose residual, whitened where noise is, counts; None when all do."""
        return self.valid if self.told is None else self.told

    def counting(self, values: Real) -> Real:
        """Return the samples of `values`, (n,), that count."""
        return values if self.counts is None else np.asarray(values[self.counts])

    def masked(self, rows: Real) -> Real:
        """Return `rows`, (k, n) or (n,), samples that do not count set to 0, noise whitened."""
        if self.noise is not None and self.told is not None and rows.size:
            return np.asarray(scipy.signal.lfilter(self.noise, np.ones(1), rows) * self.told)
        counted = rows if self.valid is None else rows * self.valid
        if self.whitening is None:
            return counted
        return np.asarray(scipy.fft.irfft(scipy.fft.rfft(counted) * self.whitening, rows.shape[-1]))

    def innovations(self, prediction: Real, residual: Real) -> Real:
        """What of the output no past residual foresees; the residual itself of white noise."""
        return residual if self.noise is None else self.masked(self.y - prediction)

    def coloured(self, noise: Real) -> "Problem":
        """The same with an autoregression for the noise; after a gap it starts anew."""
        order, size = noise.size - 1, self.y.size
        lost = np.zeros(size, dtype=np.int64) if self.valid is None else np.cumsum(~self.valid)
        before = np.concatenate([np.zeros(order + 1, dtype=np.int64), lost])[:size]
        told = (lost == before) & (np.arange(size) >= order)
        return replace(self, noise=noise, told=told)

    def fixed(self) -> Real:
        """Bias and nuisance, shape (1 + k, n)."""
        bias = np.ones((1, self.y.size))
        return bias if self.nuisance is None else np.vstack([bias, self.nuisance])


class Driven:
    """Responses that the numerator's coefficients multiply, and the level beside them.

    Attributes
    ----------
    rows : ndarray, shape (m, n)
        One response for each coefficient, `level` not added.
    level : float
        What the scale factor multiplies at every sample: beside a bias, all but the same row.
    """

    rows: Real
    level: float

    def driven(self, numerator: Real) -> Real:
        """What the input does, (n,), with `numerator`, (m,), before its `rows`."""
        return np.asarray(numerator @ self.rows + numerator[0] * self.level)


class Part(Driven):
    """What one input does to the output at given parameters.

    Parameters
    ----------
    problem : Problem
        Its source, and where it begins.
    structure : Structure
        The dynamics.
    theta : ndarray, shape (1 + order,)
        Delay in samples, then the parameters of the sections.
    """

    def __init__(self, problem: Problem, structure: Structure, theta: Real) -> None:
        self.structure, self.theta = structure, theta
        self._since_start: Real | None
        self._source = problem.source
        self._delay = float(theta[0])
        self._poles: Poles | Parallel = poles_of(structure, theta[1:])
        upper = self._poles.upper
        self._answers = PoleResponses(self._source, self._delay, upper) if upper.size else None
        self._fed: Real | None = None
        self._numerators = _powers(structure)
        self.rows = self._added(self._poles.expand(self._numerators))
        first = self._source.first
        self.level = 0.0 if structure.dc_zeros or structure.integrators else first
        if first and structure.integrators:
            self.rows[0] += first * self._since()
        self._begin(problem.begins)

    def begun(self, begins: int | None) -> "Part":
        """The same where the free responses begin elsewhere."""
        if begins == self._begins:
            return self
        other = copy(self)
        other._begin(begins)
        return other

    def _begin(self, begins: int | None) -> None:
        answers, structure, count = self._answers, self.structure, self._source.samples
        self._begins, self._since_start = begins, None
        self.free = np.empty((0, count))
        """Free responses, shape (order, n)."""
        if begins is None or not structure.order or answers is None:
            return
        slowest = max(-float(self._poles.upper.real.max()), 1.0 / _NOTHING)
        lasts = slice(begins, begins + ceil(min(_NOTHING / slowest, count)))
        self._late = np.maximum(np.arange(count) - float(begins), 0.0)
        waves = np.exp(self._poles.upper[:, None] * self._late[lasts])
        self._since_start = np.zeros((len(answers.waves), count))
        self._since_start[:, lasts] = answers.parts(waves)
        impulses = np.eye(structure.order + structure.integrators)[structure.integrators :]
        self.free = answers.summed(self._poles.expand(impulses).simple, self._since_start)

    def slopes(self, numerator: Real, initial: Real) -> Real:
        """Derivatives of what the input does by theta, shape (1 + order, n).

        Parameters
        ----------
        numerator : ndarray, shape (m,)
            What multiplies `rows`.
        initial : ndarray, shape (order,) or (0,)
            What multiplies `free`.
        """
        structure = self.structure
        full: Real = numerator @ self._numerators
        slopes, answers = self._poles.slopes(full), self._answers
        out = self._added(slopes)
        if structure.integrators and self._source.first:
            out[0] -= full[0] * self._source.first * (self._since() > 0.0)
        if answers is None or not structure.order:
            return out
        out += answers.summed(slopes.double, answers.slopes)
        if initial.size and self._since_start is not None:
            state = np.concatenate([np.zeros(structure.integrators), initial])
            free = self._poles.slopes(state)
            out[1:] += answers.summed(free.simple[1:], self._since_start)
            out[1:] += answers.summed(free.double[1:], self._late * self._since_start)
        return out

    def _added(self, expansion: Expansion) -> Real:
        """Sum of single poles, the input itself and its rate."""
        if self._answers is None:
            out = np.zeros((expansion.direct.size, self._source.samples))
        else:
            out = self._answers.summed(expansion.simple, self._answers.waves)
        rate = expansion.rate
        rated = rate is not None and bool(rate.any())
        if rated or expansion.direct.any():
            if self._fed is None or self._fed.shape[0] < 1 + rated:
                self._fed = input_responses(self._source, self._delay, slopes=rated)
            out += np.outer(expansion.direct, self._fed[0])
            if rate is not None and rated:
                out += np.outer(rate, self._fed[1])
        return out

    def _since(self) -> Real:
        return np.asarray(np.maximum(np.arange(self._source.samples) - self._delay, 0.0))


def _powers(structure: Structure) -> Real:
    """Numerators 1, s, s², … that a structure has, by rising powers, shape (m, zeros + 1).

    Of sections in parallel, as `Parallel` has them: the first alone, and each other less the first.
    """
    if structure.parallel and structure.zeros == structure.order - 1:
        return np.eye(structure.order)
    if structure.parallel:
        gains = np.zeros((len(structure.sections), structure.order))
        gains[:, ::2] = np.eye(len(structure.sections))
        gains[1:, 0] = -1.0
        return gains
    return np.asarray(np.eye(structure.zeros + 1)[structure.dc_zeros :])
