"""The rows of one problem: what each linear parameter multiplies, and the derivatives.

The output is a sum of rows: for each input, B(s)/A(s) behind a delay, one row for each
coefficient of B; the bias; any other linear terms, such as a drift; and, if the record does not
begin at rest, the free responses of the initial state.
"""

from collections.abc import Iterator
from copy import copy
from dataclasses import dataclass, replace
from math import ceil
from typing import ClassVar

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Mask, Real
from hmpim.identify.fitting.sections import Expansion, Parallel, Poles, poles_of
from hmpim.model.dynamics import Structure
from hmpim.model.poles import PoleResponses
from hmpim.model.sampled import SAMPLES_ALONE, SampledInput

__all__ = ["STAMPED_LATE", "Driven", "Part", "Problem", "spans"]

STAMPED_LATE = -4.0
"""Least delay in samples for an output that follows its input: time stamps may be late."""

_FINAL = 1e-6
"""Precision of the chosen fit, see `hmpim.identify.fitting.fit.fit_structure`."""

_STRETCH = 65_536
"""Samples computed at once: as many as fit into a processor's cache."""

_NOTHING = 50.0
"""Time constants after which a free response is less than rounding."""


def spans(first: int, last: int) -> Iterator[slice]:
    """The samples from `first` to `last` in spans that fit into a processor's cache."""
    for start in range(first, last, _STRETCH):
        yield slice(start, min(start + _STRETCH, last))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Problem:
    """One input, one output, and which samples of the output count."""

    source: SampledInput  # the prepared input
    y: Real  # (n,): output samples
    valid: Mask | None  # (n,): samples that count; None when all do
    longest_delay: float  # greatest delay to try, in samples
    # least delay to try, in samples; below 0 the output is ahead, or its stamps are late
    shortest_delay: float = STAMPED_LATE
    # (n // 2 + 1,): gain at each bin of the transform that makes the noise white; residuals and
    # derivatives are then those of the whitened output. None for white noise.
    whitening: Real | None = None
    # (order + 1,): autoregression of the noise, 1 first, by which residual and derivatives are
    # whitened; None for white noise
    noise: Real | None = None
    # (n,): with `noise`, the samples that count together with all earlier ones the filter uses
    past_known: Mask | None = None
    # (n,): with `noise`, the level of the whitened noise at each sample, over its geometric mean:
    # whitened samples are divided by it. None for a constant level.
    level: Real | None = None
    # (k, n): rows, in addition to the bias, that enter linearly, such as a drift's
    nuisance: Real | None = None
    # sample from which the free response of an unknown state is fitted; earlier ones do not count.
    # None for a record that begins at rest.
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
        """The same with noise assumed white."""
        return replace(self, noise=None, past_known=None, level=None)

    @property
    def counts(self) -> Mask | None:
        """Samples whose residual, whitened if necessary, counts; None when all do."""
        return self.valid if self.past_known is None else self.past_known

    def counting(self, values: Real) -> Real:
        """Return the samples of `values`, (n,), that count."""
        return values if self.counts is None else np.asarray(values[self.counts])

    @property
    def filtered(self) -> bool:
        """Whether samples are whitened, so that a span of them cannot be computed alone."""
        return self.noise is not None or self.whitening is not None

    @property
    def is_coloured(self) -> bool:
        """Whether an autoregression whitens the samples; noise of changing level alone is white."""
        return self.noise is not None and self.noise.size > 1

    def stretches(self, first: int, last: int) -> Iterator[slice]:
        """The samples from `first` to `last` in spans, to be computed one after the other.

        A single span if samples are whitened, or if a filter in z needs the whole record.
        """
        if self.filtered or self.source.degree == SAMPLES_ALONE:
            return iter([slice(first, last)])
        return spans(first, last)

    def masked(self, rows: Real, here: slice = slice(None)) -> Real:
        """Return `rows`, (k, n) or (n,), samples that do not count set to 0, noise whitened.

        Rows of a span of samples, `here`, are allowed only if the problem is not `filtered`.
        """
        if self.noise is not None and self.past_known is not None and rows.size:
            weight = self.past_known if self.level is None else self.past_known / self.level
            return np.asarray(scipy.signal.lfilter(self.noise, np.ones(1), rows) * weight)
        counted = rows if self.valid is None else rows * self.valid[here]
        if self.whitening is None:
            return counted
        return np.asarray(scipy.fft.irfft(scipy.fft.rfft(counted) * self.whitening, rows.shape[-1]))

    def innovations(self, prediction: Real, residual: Real) -> Real:
        """The part of the residual that its past does not predict; all of it for white noise."""
        return residual if self.noise is None else self.masked(self.y - prediction)

    def as_loud(self, innovations: Real) -> Real:
        """Innovations, (n,), with the level that they have in the record."""
        return innovations if self.level is None else innovations * self.level

    def coloured(self, noise: Real, level: Real | None = None) -> "Problem":
        """The same with an autoregression for the noise, started anew after a gap."""
        order, size = noise.size - 1, self.y.size
        lost = np.zeros(size, dtype=np.int64) if self.valid is None else np.cumsum(~self.valid)
        before = np.concatenate([np.zeros(order + 1, dtype=np.int64), lost])[:size]
        known = (lost == before) & (np.arange(size) >= order)
        return replace(self, noise=noise, past_known=known, level=level)

    def fixed(self) -> Real:
        """Bias and nuisance, shape (1 + k, n)."""
        bias = np.ones((1, self.y.size))
        return bias if self.nuisance is None else np.vstack([bias, self.nuisance])

    def with_row(self, row: Real) -> "Problem":
        """The same with one more nuisance row, (n,), which comes last."""
        return replace(self, nuisance=np.vstack([self.fixed()[1:], row]))


class Driven:
    """Responses to the input, `rows`, (m, n), one for each coefficient of the numerator.

    `level` is a constant that the scale factor multiplies in addition. As part of a row it would
    make that nearly collinear with the bias.
    """

    rows: Real
    level: float

    def driven(self, numerator: Real) -> Real:
        """Response to the input, (n,), for the numerator's coefficients, (m,)."""
        return np.asarray(numerator @ self.rows + numerator[0] * self.level)


class Part(Driven):
    """Response of the output to one input at given parameters.

    The problem gives the input, and the sample at which free responses begin; `theta`, (1 + order,)
    holds the delay in samples, then the parameters of the sections.
    """

    def __init__(self, problem: Problem, structure: Structure, theta: Real) -> None:
        self.structure, self.theta = structure, theta
        self._source = problem.source
        self._delay = float(theta[0])
        self._poles: Poles | Parallel = poles_of(structure, theta[1:])
        self._answers = PoleResponses(self._source, self._delay, self._poles.upper)
        self._numerators = _powers(structure)
        self.rows = self._added(self._poles.expand(self._numerators))
        first = self._source.first
        self.level = 0.0 if structure.dc_zeros or structure.integrators else first
        if first and structure.integrators:
            self.rows[0] += first * self._since()
        self._begin(problem.begins)

    def begun(self, begins: int | None) -> "Part":
        """The same with free responses that begin at another sample."""
        if begins == self._begins:
            return self
        other = copy(self)
        other._begin(begins)
        return other

    def _begin(self, begins: int | None) -> None:
        upper, structure, count = self._poles.upper, self.structure, self._source.samples
        self._begins, self._lasts = begins, slice(0, 0)
        self.free = np.empty((0, count))
        """Free responses, shape (order, n)."""
        if begins is None or not structure.order:
            return
        slowest = max(-float(upper.real.max()), 1.0 / _NOTHING)
        self._lasts = slice(begins, min(begins + ceil(min(_NOTHING / slowest, count)), count))
        self._late = np.arange(float(self._lasts.stop - begins))
        self._since_start = self._parts(np.exp(upper[:, None] * self._late))
        impulses = np.eye(structure.order + structure.integrators)[structure.integrators :]
        self.free = np.zeros((structure.order, count))
        weights = self._freely(self._poles.expand(impulses).simple)
        self.free[:, self._lasts] = weights @ self._since_start

    def slopes(self, numerator: Real, initial: Real, here: slice = slice(None)) -> Real:
        """Derivatives of the response by theta at the samples `here`, shape (1 + order, n).

        `numerator`, (m,), holds the weights of `rows`, `initial` those of `free`, (order,) or (0,).
        """
        structure = self.structure
        out = self._driven_slopes(numerator, here)
        if structure.integrators and self._source.first:
            out[0] -= numerator[0] * self._source.first * (self._since()[here] > 0.0)
        start, stop, _ = here.indices(self._source.samples)
        first, last = max(start, self._lasts.start), min(stop, self._lasts.stop)
        if initial.size and first < last:
            state = np.concatenate([np.zeros(structure.integrators), initial])
            span = slice(first - self._lasts.start, last - self._lasts.start)
            free, waves = self._poles.slopes(state), self._since_start[:, span]
            moved = out[1:, first - start : last - start]
            moved += self._freely(free.simple[1:]) @ waves
            moved += self._freely(free.double[1:]) @ (self._late[span] * waves)
        return out

    def _driven_slopes(self, numerator: Real, here: slice) -> Real:
        """Derivatives of the response to the input by theta."""
        full: Real = numerator @ self._numerators
        return self._added(self._poles.slopes(full), here)

    def _added(
        self,
        expansion: Expansion,
        here: slice = slice(None),
        *,
        answers: PoleResponses | None = None,
    ) -> Real:
        """Sum of the responses of single poles, the input itself and its rate."""
        direct, rate = expansion.direct, expansion.rate
        return (answers or self._answers).summed(
            expansion.simple,
            double=expansion.double if expansion.double.size else None,
            direct=direct if direct.any() else None,
            rate=None if rate is None or not rate.any() else rate,
            here=here,
        )

    def _parts(self, each: Complex) -> Real:
        """Values of each pole, (k, m): real parts, then imaginary ones of complex poles."""
        return np.concatenate([each.real, each.imag[self._poles.upper.imag != 0.0]])

    def _freely(self, weights: Complex) -> Real:
        """Weights of `_since_start` for real parts of sums over poles, shape (rows, waves)."""
        return self._parts(weights.conj().T).T

    def _since(self) -> Real:
        """Time since the delayed start of the record, in samples, (n,)."""
        return np.asarray(np.maximum(np.arange(self._source.samples) - self._delay, 0.0))


def _powers(structure: Structure) -> Real:
    """Numerators 1, s, s², … of a structure, by rising powers, shape (m, zeros + 1).

    For sections in parallel, as in `Parallel`: the first alone, and each other less the first.
    """
    if structure.parallel:
        gains = np.zeros((len(structure.sections), structure.order))
        gains[:, ::2] = np.eye(len(structure.sections))
        gains[1:, 0] = -1.0
        return gains
    return np.asarray(np.eye(structure.zeros + 1)[structure.dc_zeros :])
