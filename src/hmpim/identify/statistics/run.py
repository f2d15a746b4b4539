"""One run, compressed: products of its samples at a window of lags, and its two ends.

Everything is a sum over all samples, 0 taken for what lies outside the run; what of it a fit does
not want, the samples at either end tell. So a run is read once, block by block.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.equality import ByValue
from hmpim.identify.arrays import Complex, Real
from hmpim.identify.noise.autoregression import LONGEST
from hmpim.identify.statistics.reach import AHEAD, Reach

__all__ = ["SUMMED", "Run", "begun", "closed", "continued", "last_sums", "shortened"]

SUMMED = -2
"""Place of the input's running sum among the outputs of a run."""

_PIECE = 16_384
"""Samples that are read at once, at least."""

_FEW = 64
"""New samples up to which their products are sooner made one by one than by transforms."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run(ByValue):
    """Products of one run's input u and outputs v.

    Outputs are the bias' rows, the running sum of the input, and the measured output. Input and
    measured output are deviations from their first samples; the sum is not, since an integrator
    turns a constant input into a ramp.

    Parameters
    ----------
    samples : int
        How many have been read.
    level : ndarray, shape (2,)
        First samples of input and output.
    uu : ndarray, shape (span + 1,)
        Σ u(t) u(t-k).
    vu : ndarray, shape (rows + 2, forth + back + 1)
        Σ v(t) u(t-k), k from -forth on.
    vv : ndarray, shape (rows + 2, rows + 2, LONGEST + 1)
        Σ v_i(t) v_j(t-k).
    head_u, tail_u : ndarray, shape (span,)
        First and last samples of the input; 0 where there are none.
    head_y : ndarray, shape (back,)
        First samples of the output.
    tail_y : ndarray, shape (forth,)
        Its last ones.
    """

    samples: int
    level: Real
    uu: Real
    vu: Real
    vv: Real
    head_u: Real
    tail_u: Real
    head_y: Real
    tail_y: Real

    def total(self, reach: Reach) -> float:
        """Sum of the input, as a deviation: the bias' rows add to 1 at each sample."""
        return float(self.vu[: reach.rows, reach.forth].sum())


def begun(reach: Reach, u: float, y: float) -> Run:
    """An empty run that will begin with these samples."""
    count = reach.rows + 2
    return Run(
        samples=0,
        level=np.array([u, y]),
        uu=np.zeros(reach.span + 1),
        vu=np.zeros((count, reach.forth + reach.back + 1)),
        vv=np.zeros((count, count, LONGEST + 1)),
        head_u=np.zeros(reach.span),
        tail_u=np.zeros(reach.span),
        head_y=np.zeros(reach.back),
        tail_y=np.zeros(reach.forth),
    )


def continued(run: Run, reach: Reach, u: Real, y: Real) -> Run:
    """A run and the samples that follow it, u and y of shape (n,)."""
    piece = max(_PIECE, 4 * reach.span)
    for first in range(0, u.size, piece):
        some = slice(first, first + piece)
        rows = reach.fixed(run.samples, u[some].size)
        moved = u[some] - run.level[0]
        at = np.arange(run.samples + 1, run.samples + 1 + moved.size)
        sums = run.total(reach) + np.cumsum(moved) + run.level[0] * at
        run = _added(run, reach, moved, np.vstack([rows, sums, y[some] - run.level[1]]))
    return run


def last_sums(run: Run, reach: Reach, count: int) -> Real:
    """Running sum of the input at the last samples of a run, 0 before it began, shape (count,)."""
    at = np.arange(run.samples + 1 - count, run.samples + 1)
    later = np.append(np.cumsum(run.tail_u[:-count:-1])[::-1], 0.0)
    return np.asarray((run.total(reach) - later + run.level[0] * at) * (at > 0))


def closed(run: Run, reach: Reach) -> Run:
    """A run with its input continued by `AHEAD` samples, odd about the last; its outputs are 0.

    What a band-limited input does at its end depends on samples to come; `prepare_input` continues
    a record alike.
    """
    known = min(AHEAD, run.samples - 1)
    last = run.tail_u[-1]
    after = 2.0 * last - run.tail_u[-2 : -2 - known : -1]
    after = np.concatenate([after, np.full(AHEAD - known, after[-1] if known else last)])
    return _added(run, reach, after, np.zeros((reach.rows + 2, AHEAD)))


def shortened(run: Run, reach: Reach) -> Run:
    """The same run, of which no more is kept than a shorter reach asks for."""
    return replace(
        run,
        uu=run.uu[: reach.span + 1],
        vu=run.vu[:, : reach.forth + reach.back + 1],
        head_u=run.head_u[: reach.span],
        tail_u=run.tail_u[-reach.span :],
        head_y=run.head_y[: reach.back],
    )


def _added(run: Run, reach: Reach, u: Real, v: Real) -> Run:
    before_u, before_v = run.tail_u, _before(run, reach)
    whole_u = np.concatenate([before_u, u])
    whole_v = np.hstack([before_v, v])
    products = _one_by_one if u.size <= _FEW else _transformed
    uu, after, ahead, vv = products(reach, (u, v), (whole_u, whole_v))
    room_u, room_y = reach.span - run.samples, reach.back - run.samples
    return replace(
        run,
        samples=run.samples + u.size,
        uu=run.uu + uu,
        vu=run.vu + np.hstack([ahead[:, ::-1], after]),
        vv=run.vv + vv,
        head_u=_filled(run.head_u, run.samples, u[: max(room_u, 0)]),
        tail_u=whole_u[-reach.span :],
        head_y=_filled(run.head_y, run.samples, v[-1, : max(room_y, 0)]),
        tail_y=whole_v[-1, -reach.forth :],
    )


def _transformed(
    reach: Reach, new: tuple[Real, Real], whole: tuple[Real, Real]
) -> tuple[Real, Real, Real, Real]:
    """Products of new inputs and outputs and those `span` and `forth` samples before, by FFT.

    Returns
    -------
    uu : ndarray, shape (span + 1,)
        Σ u(t) u(t-k).
    after, ahead : ndarray, shape (rows + 2, back + 1) and (rows + 2, forth)
        Σ v(t) u(t-k), k from 0 on; Σ u(t) v(t-k), k from 1 on.
    vv : ndarray, shape (rows + 2, rows + 2, LONGEST + 1)
        Σ v_i(t) v_j(t-k).
    """
    length = scipy.fft.next_fast_len(new[0].size + reach.span, real=True)
    new_u, new_v = (_late(x, reach.span, length) for x in new)
    all_u = scipy.fft.rfft(whole[0], length)
    all_v = _late(whole[1], reach.span - reach.forth, length)
    uu = scipy.fft.irfft(new_u * all_u.conj(), length)[: reach.span + 1]
    after = scipy.fft.irfft(new_v * all_u.conj(), length)[:, : reach.back + 1]
    ahead = scipy.fft.irfft(new_u * all_v.conj(), length)[:, 1 : reach.forth + 1]
    vv = scipy.fft.irfft(new_v[:, None] * all_v.conj()[None], length)[:, :, : LONGEST + 1]
    return uu, after, ahead, vv


def _one_by_one(
    reach: Reach, new: tuple[Real, Real], whole: tuple[Real, Real]
) -> tuple[Real, Real, Real, Real]:
    """The same of a few new samples, without transforms."""
    (u, v), (whole_u, whole_v) = new, whole
    near = whole_v[:, reach.forth - LONGEST :]
    uu, *after = (np.correlate(whole_u, x, "valid")[::-1] for x in (u, *v))
    ahead = [np.correlate(x, u, "valid")[-2::-1] for x in whole_v]
    vv = [[np.correlate(x, row, "valid")[::-1] for x in near] for row in v]
    return uu, np.array(after)[:, : reach.back + 1], np.array(ahead), np.array(vv)


def _before(run: Run, reach: Reach) -> Real:
    """The outputs just before what follows, shape (rows + 2, forth)."""
    fixed = reach.fixed(run.samples - reach.forth, reach.forth)
    return np.vstack([fixed, last_sums(run, reach, reach.forth), run.tail_y])


def _late(x: Real, by: int, length: int) -> Complex:
    """Transform of what begins `by` samples late."""
    shifted = np.zeros((*x.shape[:-1], length))
    shifted[..., by : by + x.shape[-1]] = x
    return np.asarray(scipy.fft.rfft(shifted, length))


def _filled(head: Real, count: int, more: Real) -> Real:
    """First samples, the following put in place."""
    if not more.size:
        return head
    out = head.copy()
    out[count : count + more.size] = more
    return out
