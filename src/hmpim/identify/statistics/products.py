"""Products of filtered inputs over the samples that count, from statistics alone.

With F the impulse responses, whitened or not, and R the Toeplitz matrix of the input's
autocorrelation, F R Fᵀ are the products of the full convolutions. The samples that do not count lie
at the two ends of each run, where the input itself is kept: they are computed and subtracted. The
bias is solved for each run, or for all, and subtracted too.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.noise.autoregression import LONGEST
from hmpim.identify.statistics.reach import AHEAD
from hmpim.identify.statistics.run import SUMMED, Run, closed, last_sums
from hmpim.identify.statistics.statistics import Statistics

__all__ = ["Moments", "Products", "Remainder", "Responses", "spectrum_of"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Responses:
    """Impulse responses that end at 0 or, for an integrator, at another final value."""

    rows: Real  # (q, taps): from `AHEAD` samples before the input; later, less the final value
    steady: Real  # (q,): response of `rows` to a constant input of 1
    kept: Real  # (q,): the final values, which multiply the running sum of the input

    @classmethod
    def integrating(cls, rows: Real) -> "Responses":
        """Responses of an integrator, with the last sample as the final value."""
        kept, rows = rows[:, -1].copy(), rows.copy()
        rows[:, AHEAD:] -= kept[:, None]
        return cls(rows=rows, steady=rows.sum(axis=1), kept=kept)

    @classmethod
    def ending(cls, rows: Real, steady: Real) -> "Responses":
        """Responses that end at 0."""
        return cls(rows=rows, steady=steady, kept=np.zeros(steady.size))

    def and_also(self, others: "Responses") -> "Responses":
        """These, then others."""
        return Responses(
            rows=np.vstack([self.rows, others.rows]),
            steady=np.concatenate([self.steady, others.steady]),
            kept=np.concatenate([self.kept, others.kept]),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moments:
    """Products of rows and output, with the bias solved and subtracted.

    With `weights` the coefficients of the rows, the coefficients of each run's bias are
    ``fixed - fixed_rows @ weights``, and the mean bias is ``bias - bias_rows @ weights``.
    """

    gram: Real  # (q, q): of the rows
    cross: Real  # (q,): of rows and output
    energy: float  # of the output
    fixed: Real  # (runs, rows of the bias)
    fixed_rows: Real  # (runs, rows of the bias, q)
    bias: float
    bias_rows: Real  # (q,)
    bias_variance: float  # of `bias`, for noise of variance 1


class Remainder(NamedTuple):
    """The residual of a model, not whitened."""

    gram: Real  # (LONGEST + 1)²: sums of products of a sample that counts and those before it
    counted: int  # samples that count
    heads: Real  # (runs, m): first samples of each run, as if it had begun at rest
    tails: Real  # (runs, LONGEST): its last samples


class Products:
    """Products over the samples that count, under one noise model.

    The first `skipped` outputs of each run, at most `lags`, do not count, since they depend on
    earlier input; 0 where each run begins at rest. Nor do the last `AHEAD`, unless `to_the_end`: a
    band-limited input is continued there, odd about its last sample; an input that ends in motion
    rings there. `noise`, (order + 1,), is the autoregression of the noise, 1 first.
    """

    def __init__(
        self,
        statistics: Statistics,
        *,
        skipped: int,
        noise: Real | None = None,
        to_the_end: bool = True,
    ) -> None:
        self.statistics, self.skipped, self.to_the_end = statistics, skipped, to_the_end
        self.noise = np.ones(1) if noise is None else noise
        self._plain: Products | None = None
        reach = statistics.reach
        self.order = self.noise.size - 1
        self.first = self.order + skipped
        """First sample of a run whose whitened output counts."""
        self._levels = np.array([run.level for run in statistics.runs])
        self._length = int(scipy.fft.next_fast_len(2 * reach.span + 1, real=True))
        runs = statistics.runs
        self._runs = runs = tuple(closed(run, reach) for run in runs) if to_the_end else runs
        self._average = self._averages()
        self._power = spectrum_of(sum((r.uu for r in runs), np.zeros(reach.span + 1)), self._length)
        self._white = scipy.fft.rfft(self.noise, self._length)
        self._cross = np.stack([self._lagged(run) for run in runs])
        ends = [
            end
            for run, read in zip(runs, statistics.runs, strict=True)
            for end in self._ends_of(run, read)
        ]
        self._inputs = scipy.fft.rfft(np.stack([end[0] for end in ends]), self._length)
        self._around = np.stack([end[1] for end in ends])
        self._apart = (
            slice(0, self.first + AHEAD),
            slice(reach.span, reach.span + reach.taps + self.order),
        )
        """Samples of a full convolution with the head that do not count; with the tail."""
        parts = [self._around[i::2, :, apart] for i, apart in enumerate(self._apart)]
        self._out = np.concatenate(parts, axis=2)
        self._inner = np.stack([self._outputs(run) for run in runs])
        self._inner -= self._out @ self._out.transpose(0, 2, 1)
        self._others = np.delete(np.arange(reach.rows + 2), SUMMED)
        self._unsummed = self._inner[:, self._others][:, :, self._others]
        """Products of whitened outputs without the running sum, (runs, rows + 1, rows + 1)."""

    @property
    def plain(self) -> "Products":
        """The same with white noise."""
        return self if self._plain is None else self._plain

    def whitened(self, noise: Real) -> "Products":
        """The same samples under another noise model."""
        if noise.size == 1:
            return self.plain
        other = self.alike(noise=noise)
        other._plain = self.plain
        return other

    def alike(
        self,
        statistics: Statistics | None = None,
        *,
        skipped: int | None = None,
        noise: Real | None = None,
    ) -> "Products":
        """The same with other statistics, another number of skipped outputs, or another noise."""
        return Products(
            self.statistics if statistics is None else statistics,
            skipped=self.skipped if skipped is None else skipped,
            noise=self.noise if noise is None else noise,
            to_the_end=self.to_the_end,
        )

    @property
    def counted(self) -> int:
        """How many samples count."""
        return sum(run.samples - AHEAD - self.first for run in self._runs)

    @cached_property
    def energy(self) -> float:
        """Sum of squares of the outputs that count, without the bias."""
        nothing = np.zeros((len(self._runs), 0, self._others.size))
        return self._without_bias(np.zeros((0, 0)), nothing, np.zeros(0)).energy

    def _lagged(self, run: Run) -> Real:
        """Products of whitened outputs and the whitened input at each tap, (rows + 2, taps)."""
        reach, order = self.statistics.reach, self.order
        once = np.zeros((run.vu.shape[0], reach.taps + order))
        out = np.zeros((run.vu.shape[0], reach.taps))
        # Σ aᵢ Σ v(t-i) u(t-j), j from -AHEAD to lags + order
        for i, a in enumerate(self.noise):
            start = reach.forth - AHEAD - i
            once += a * run.vu[:, start : start + once.shape[1]]
        for i, a in enumerate(self.noise):
            out += a * once[:, i : i + reach.taps]
        return out

    def _outputs(self, run: Run) -> Real:
        """Products of whitened outputs over the whole run, (rows + 2)²."""
        weight = np.correlate(self.noise, self.noise, "full")[self.order :]
        later = run.vv[:, :, 1 : weight.size] @ weight[1:]
        return np.asarray(weight[0] * run.vv[:, :, 0] + later + later.T)

    def _ends_of(self, run: Run, read: Run) -> list[tuple[Real, Real]]:
        """Input at either end of a run, and whitened outputs there, 0 beyond the run as `read`."""
        reach, beyond = self.statistics.reach, run.samples - read.samples
        n, span, count = run.samples, reach.span, reach.rows + 2
        # Sample c of a convolution with the head is sample c - AHEAD of the run; with the tail it
        # is sample n - span - AHEAD + c.
        head, tail = (np.zeros((count, self._length)) for _ in range(2))
        size = min(reach.back, n)
        begins = np.cumsum(run.head_u[:size] + run.level[0])
        early = np.vstack([reach.fixed(0, size), begins, run.head_y[:size]])
        early[:, read.samples :] = 0.0
        head[:, AHEAD : AHEAD + size] = early
        known = reach.forth - beyond
        sums = np.append(last_sums(read, reach, known), np.zeros(beyond))
        late = np.vstack([reach.fixed(n - reach.forth, reach.forth), sums, run.tail_y])
        late[:, known:] = 0.0
        tail[:, span + AHEAD - reach.forth : span + AHEAD] = late
        out = []
        for u, v in ((run.head_u, head), (run.tail_u, tail)):
            white = np.zeros_like(v)
            for i, a in enumerate(self.noise):
                white[:, i:] += a * v[:, : v.shape[1] - i]
            padded = np.zeros(self._length)
            padded[:span] = u
            out.append((padded, white))
        return out

    def transform(self, rows: Real) -> Complex:
        """Transforms of impulse responses, (q, taps), whitened, as `moments` takes them."""
        return np.asarray(scipy.fft.rfft(rows, self._length) * self._white)

    def moments(self, responses: Responses, *, known: Complex | None = None) -> Moments:
        """Products of the input, filtered by impulse responses, and the output.

        `known` are the transforms of the first rows, from `transform`.
        """
        rows, kept = responses.rows, responses.kept
        if known is None:
            spectra = self.transform(rows)
        else:
            spectra = np.vstack([known, self.transform(rows[known.shape[0] :])])
        apart = self._not_counted(spectra)
        flat = apart.reshape(rows.shape[0], -1)
        gram = _products(spectra, self._power, self._length) - flat @ flat.T
        lost = apart.transpose(1, 0, 2) @ self._out.transpose(0, 2, 1)
        mixed = rows @ self._cross.transpose(0, 2, 1) - lost
        if kept.any():
            first = np.outer(kept, mixed[:, :, SUMMED].sum(axis=0))
            square = float(self._inner[:, SUMMED, SUMMED].sum())
            gram = gram + first + first.T + square * np.outer(kept, kept)
            mixed = mixed + kept[None, :, None] * self._inner[:, None, SUMMED]
        return self._without_bias(gram, mixed[:, :, self._others], responses.steady)

    def across(
        self, responses: Responses, other: "Products", others: Responses, lags: Real
    ) -> Real:
        """Products of this input, filtered, and another input of the same runs, filtered.

        Each run has its own bias, and all responses end at 0. The outputs and the noise of both are
        the same; `lags`, (2 span + 1,), are Σ x(t) z(t-k), k from -span on, x this input and z the
        other.
        """
        span = self.statistics.reach.span
        ours, theirs = self.transform(responses.rows), other.transform(others.rows)
        around = np.zeros(self._length)
        around[: span + 1], around[self._length - span :] = lags[span:], lags[:span]
        whole = _products(ours, scipy.fft.rfft(around), self._length, theirs)
        apart = self._not_counted(ours)
        beyond = other._not_counted(theirs)
        flat = apart.reshape(len(ours), -1) @ beyond.reshape(len(theirs), -1).T
        first, second = self.moments(responses).fixed_rows, other.moments(others).fixed_rows
        inner = self._unsummed[:, :-1, :-1]
        return np.asarray(whole - flat - np.sum(first.transpose(0, 2, 1) @ inner @ second, axis=0))

    def _not_counted(self, spectra: Complex) -> Real:
        """Samples at the ends of each run that do not count, (q, runs, samples)."""
        parts = [
            scipy.fft.irfft(spectra[:, None] * self._inputs[i::2], self._length)[..., apart]
            for i, apart in enumerate(self._apart)
        ]
        return np.concatenate(parts, axis=2)

    def left_over(self, response: Real, kept: float, bias: Real) -> Remainder:
        """Return the residual of a model; for products without a noise model only.

        The model has an impulse response, (taps,), less its final value, that value `kept`, and
        coefficients of each run's bias, (runs, rows).
        """
        runs, reach, index = self._runs, self.statistics.reach, np.arange(LONGEST + 1)
        weights = np.hstack([-bias, np.tile([-kept, 1.0], (len(runs), 1))])
        spectrum = scipy.fft.rfft(response, self._length)
        made = spectrum * spectrum.conj() * self._power
        whole = np.array(scipy.fft.irfft(made, self._length)[: LONGEST + 1])
        for run, c in zip(runs, weights, strict=True):
            follows = c @ run.vu
            for k in index:
                start = reach.forth - AHEAD
                ahead = follows[start + k : start + k + reach.taps]
                behind = follows[start - k : start - k + reach.taps]
                whole[k] += c @ run.vv[:, :, k] @ c - response @ (ahead + behind)
        doubled = np.repeat(weights, 2, axis=0)
        ends = np.einsum("ec,ect->et", doubled, self._around) - scipy.fft.irfft(
            spectrum * self._inputs, self._length
        )
        gram = whole[np.abs(index[:, None] - index)]
        first = self.skipped + LONGEST
        for head, tail in zip(ends[0::2], ends[1::2], strict=True):
            before, after = _shifted(head[: first + AHEAD]), _shifted(tail)[:, reach.span :]
            gram -= before @ before.T + after @ after.T
        count = sum(run.samples - AHEAD - first for run in runs)
        last = reach.span + AHEAD * (not self.to_the_end)
        return Remainder(gram, count, ends[0::2, AHEAD:], ends[1::2, last - LONGEST : last])

    def _without_bias(self, gram: Real, mixed: Real, steady: Real) -> Moments:
        """Solve the biases and subtract them."""
        statistics = self.statistics
        inner, outer = self._unsummed[:, :-1, :-1], self._unsummed[:, :-1, -1]
        energy = float(self._unsummed[:, -1, -1].sum())
        with_bias, cross = mixed[:, :, :-1], mixed[:, :, -1].sum(axis=0)
        if statistics.bias == "common":
            u, y = self._levels.T
            weight, with_y, with_rows = inner[:, 0, 0], outer[:, 0], with_bias[:, :, 0]
            first = np.outer(steady, u @ with_rows)
            gram = gram + first + first.T + u**2 @ weight * np.outer(steady, steady)
            cross = cross + steady * (u @ with_y) + y @ with_rows + steady * (u * y @ weight)
            energy += float(2 * y @ with_y + y**2 @ weight)
            with_bias = (with_rows + np.outer(u * weight, steady)).sum(axis=0)[None, :, None]
            outer = (with_y + y * weight).sum()[None, None]
            inner = weight.sum()[None, None, None]
        if inner.shape[1] == 1:
            solved = np.divide(1.0, inner, out=np.zeros_like(inner), where=inner > 0.0)
        else:
            solved = np.linalg.pinv(inner, hermitian=True)
        with_bias = with_bias.transpose(0, 2, 1)  # (runs, rows of the bias, q)
        fixed_rows = solved @ with_bias
        fixed = (solved @ outer[:, :, None])[:, :, 0]
        average, levels = self._average[:, None], self._levels
        bias, bias_rows = (average @ fixed[:, :, None])[:, 0, 0], (average @ fixed_rows)[:, 0]
        count, left = bias.size, energy - float((fixed * outer).sum())
        gram = gram - (fixed_rows.transpose(0, 2, 1) @ with_bias).sum(axis=0)
        cross = cross - (fixed[:, None] @ with_bias)[:, 0].sum(axis=0)
        if statistics.bias == "common":
            fixed = fixed[0] - levels[:, 1:]
            fixed_rows = (fixed_rows[0] - levels[:, :1] * steady)[:, None]
        else:
            bias, bias_rows = bias + levels[:, 1], bias_rows + levels[:, :1] * steady
        return Moments(
            gram=gram,
            cross=cross,
            energy=max(left, np.finfo(float).eps * abs(energy)),  # sums may cancel
            fixed=fixed,
            fixed_rows=fixed_rows,
            bias=float(bias.sum()) / count,
            bias_rows=bias_rows.sum(axis=0) / count,
            bias_variance=float((average @ solved @ average.transpose(0, 2, 1)).sum()) / count**2,
        )

    def _averages(self) -> Real:
        """Mean over its run of each row of the bias, shape (biases, rows)."""
        statistics = self.statistics
        if statistics.reach.rows == 1:
            return np.ones((1 if statistics.bias == "common" else len(statistics.runs), 1))
        count = statistics.reach.rows
        runs = statistics.runs
        return np.stack([run.vv[:count, :count, 0].sum(axis=1) / run.samples for run in runs])


def spectrum_of(autocorrelation: Real, length: int) -> Real:
    """Eigenvalues of the circulant matrix of some length that contains a Toeplitz matrix."""
    around = np.zeros(length)
    around[: autocorrelation.size] = autocorrelation
    around[length - autocorrelation.size + 1 :] += autocorrelation[:0:-1]
    return np.asarray(scipy.fft.rfft(around).real)


def _products(
    spectra: Complex, power: Real | Complex, length: int, others: Complex | None = None
) -> Real:
    """F R Fᵀ, or F R Gᵀ with others, by Parseval's theorem."""
    twice = np.full(power.size, 2.0)
    twice[0] = 1.0
    if length % 2 == 0:
        twice[-1] = 1.0
    weighed = spectra * (power * twice / length)
    right = spectra if others is None else others
    # Real parts of a product are those of real and imaginary parts, side by side.
    return np.asarray(weighed.view(np.float64) @ right.view(np.float64).T)


def _shifted(x: Real) -> Real:
    """A signal delayed by 0 … LONGEST samples, 0 before it begins."""
    padded = np.concatenate([np.zeros(LONGEST), x])
    return np.stack([padded[LONGEST - k : padded.size - k] for k in range(LONGEST + 1)])
