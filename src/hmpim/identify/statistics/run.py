"""One run, compressed: products of its samples at a window of lags, and its two ends.

Everything is a sum over all samples, with 0 outside the run. Terms that a fit excludes are computed
from the samples at either end. So a run is read once, block by block.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.equality import ByValue
from hmpim.identify.arrays import Complex, Real
from hmpim.identify.noise.autoregression import LONGEST
from hmpim.identify.statistics.reach import AHEAD, Reach

__all__ = [
    "STOOD",
    "SUMMED",
    "Run",
    "begun",
    "closed",
    "continued",
    "cubes_by",
    "last_sums",
    "of_cubes",
    "shortened",
    "without_cubes",
]

SUMMED = -2
"""Place of the input's running sum among the outputs of a run."""

STOOD = 64
"""Longest standstill of an output that is counted separately, in samples."""

_PIECE = 16_384
"""Samples that are read at once, at least."""

_FEW = 64
"""New samples up to which their products are faster one by one than by transforms."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Run(ByValue):
    """Products of one run's input u and outputs v.

    Outputs are the rows of the bias, the running sum of the input, and the measured output. Input
    and measured output are deviations from their first samples; the sum is not, since an integrator
    turns a constant input into a ramp.
    """

    samples: int  # read so far
    level: Real  # (2,): first samples of input and output
    uu: Real  # (span + 1,): Σ u(t) u(t-k)
    vu: Real  # (rows + 2, forth + back + 1): Σ v(t) u(t-k), k from -forth on
    vv: Real  # (rows + 2, rows + 2, LONGEST + 1): Σ v_i(t) v_j(t-k)
    head_u: Real  # (span,): first samples of the input; 0 where there are none
    tail_u: Real  # (span,): its last ones
    head_y: Real  # (back,): first samples of the output
    tail_y: Real  # (forth,): its last ones
    # (1,): divisor of the input before it is cubed, a power of two, so that a change of it is
    # exact; this and all that follows is empty where no cubes are kept
    scale: Real
    ww: Real  # (span + 1,): Σ w(t) w(t-k), w the cube
    wu: Real  # (2 span + 1,): Σ w(t) u(t-k), k from -span on
    vw: Real  # (rows + 1, forth + back + 1): Σ v(t) w(t-k), without the running sum
    # (STOOD + 1,): samples since the output last changed, then how often it kept a value for 1, 2,
    # … samples; the last entry also counts longer standstills
    stood: Real

    @property
    def cubed(self) -> bool:
        """Whether products of the cube are kept."""
        return self.ww.size > 0

    def total(self, reach: Reach) -> float:
        """Sum of the input, as a deviation: the rows of the bias add to 1 at each sample."""
        return float(self.vu[: reach.rows, reach.forth].sum())


def begun(reach: Reach, u: float, y: float) -> Run:
    """Return an empty run that will begin with these samples."""
    count, kept = reach.rows + 2, int(reach.beyond)
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
        scale=np.zeros(kept),
        ww=np.zeros(kept * (reach.span + 1)),
        wu=np.zeros(kept * (2 * reach.span + 1)),
        vw=np.zeros((count - 1, kept * (reach.forth + reach.back + 1))),
        stood=np.zeros(kept * (STOOD + 1)),
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
        follows = y[some] - run.level[1]
        if run.cubed:
            run = replace(_scaled(run, moved), stood=_stood(run, follows))
        run = _added(run, reach, moved, np.vstack([rows, sums, follows]))
    return run


def _cubes(run: Run, u: Real) -> Real:
    """Cubes of inputs, by the scale of a run."""
    return np.asarray((u / run.scale[0]) ** 3 if run.scale[0] else np.zeros_like(u))


def without_cubes(run: Run) -> Run:
    """A run without cubes and standstills."""
    none = np.empty(0)
    return replace(run, scale=none, ww=none, wu=none, vw=run.vw[:, :0], stood=none)


def of_cubes(run: Run, reach: Reach, scale: float) -> Run:
    """The run that has the cube, by another scale, as its input; without its running sum."""
    ratio = (run.scale[0] / scale) ** 3
    vv = run.vv.copy()
    vv[SUMMED] = vv[:, SUMMED] = 0.0
    return replace(
        without_cubes(run),
        level=run.level * np.array([0.0, 1.0]),
        uu=run.ww * ratio**2,
        vu=np.insert(run.vw * ratio, reach.rows, 0.0, axis=0),
        vv=vv,
        head_u=_cubes(run, run.head_u) * ratio,
        tail_u=_cubes(run, run.tail_u) * ratio,
    )


def cubes_by(run: Run, reach: Reach, scale: float, *, to_the_end: bool) -> Real:
    """Products `wu` by another scale; to the end, with input and cube continued by `closed`."""
    known = np.asarray(run.wu * (run.scale[0] / scale) ** 3)
    if not to_the_end:
        return known
    pair = (run, of_cubes(run, reach, scale))
    after = [closed(each, reach).tail_u[-AHEAD:] for each in pair]
    whole = [np.concatenate([x.tail_u, y]) for x, y in zip(pair, after, strict=True)]
    behind = np.correlate(whole[0], after[1], "valid")[::-1]
    before = np.correlate(whole[1], after[0], "valid")[:-1]
    return np.asarray(known + np.concatenate([before, behind]))


def _scaled(run: Run, u: Real) -> Run:
    """A run with a scale that no input exceeds."""
    peak = float(np.abs(u).max())
    if peak <= run.scale[0]:
        return run
    scale = 2.0 ** np.ceil(np.log2(peak))
    ratio = (run.scale[0] / scale) ** 3
    return replace(
        run, scale=np.array([scale]), ww=run.ww * ratio**2, wu=run.wu * ratio, vw=run.vw * ratio
    )


def _stood(run: Run, y: Real) -> Real:
    """Counts of the output's standstills, with more outputs counted."""
    begins = run.samples == 0
    changes = np.flatnonzero(np.diff(y, prepend=y[0] if begins else run.tail_y[-1]))
    if not changes.size:
        return np.append(run.stood[0] + y.size, run.stood[1:])
    lengths = np.diff(changes, prepend=-run.stood[0]).astype(np.intp)
    out = run.stood + np.bincount(np.minimum(lengths, STOOD), minlength=STOOD + 1)
    out[0] = y.size - changes[-1]
    return np.asarray(out)


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
    return _added(without_cubes(run), reach, after, np.zeros((reach.rows + 2, AHEAD)))


def shortened(run: Run, reach: Reach) -> Run:
    """The same run, reduced to a shorter reach, without cubes."""
    return replace(
        without_cubes(run),
        uu=run.uu[: reach.span + 1],
        vu=run.vu[:, : reach.forth + reach.back + 1],
        head_u=run.head_u[: reach.span],
        tail_u=run.tail_u[-reach.span :],
        head_y=run.head_y[: reach.back],
    )


def _added(run: Run, reach: Reach, u: Real, v: Real) -> Run:
    """A run and more samples of its input and outputs."""
    whole_u = np.concatenate([run.tail_u, u])
    fixed = reach.fixed(run.samples - reach.forth, reach.forth)
    before = np.vstack([fixed, last_sums(run, reach, reach.forth), run.tail_y])
    whole_v = np.hstack([before, v])
    inputs, whole = u[None], whole_u[None]
    if run.cubed:
        whole = np.vstack([whole, _cubes(run, whole_u)])
        inputs = whole[:, reach.span :]
    products = _one_by_one if u.size <= _FEW else _transformed
    xx, after, ahead, vv = products(reach, (inputs, v), (whole, whole_v))
    vx = np.concatenate([ahead[..., ::-1], after], axis=2)
    room_u, room_y = reach.span - run.samples, reach.back - run.samples
    if run.cubed:
        run = replace(
            run,
            ww=run.ww + xx[1, 1],
            wu=run.wu + np.concatenate([xx[0, 1, :0:-1], xx[1, 0]]),
            vw=run.vw + np.delete(vx[1], SUMMED, axis=0),
        )
    return replace(
        run,
        samples=run.samples + u.size,
        uu=run.uu + xx[0, 0],
        vu=run.vu + vx[0],
        vv=run.vv + vv,
        head_u=_filled(run.head_u, run.samples, u[: max(room_u, 0)]),
        tail_u=whole_u[-reach.span :],
        head_y=_filled(run.head_y, run.samples, v[-1, : max(room_y, 0)]),
        tail_y=whole_v[-1, -reach.forth :],
    )


def _transformed(
    reach: Reach, new: tuple[Real, Real], whole: tuple[Real, Real]
) -> tuple[Real, Real, Real, Real]:
    """Products of new inputs and outputs with the `span` and `forth` samples before, by FFT.

    Inputs are the input and, where it is kept, its cube. Returned are xx, Σ x_i(t) x_j(t-k), shape
    (inputs, inputs, span + 1); after, Σ v(t) x(t-k), k from 0 on, (inputs, rows + 2, back + 1);
    ahead, Σ x(t) v(t-k), k from 1 on, (inputs, rows + 2, forth); and vv, Σ v_i(t) v_j(t-k),
    (rows + 2, rows + 2, LONGEST + 1).
    """
    length = scipy.fft.next_fast_len(new[0].shape[1] + reach.span, real=True)
    new_x, new_v = (_late(x, reach.span, length) for x in new)
    all_x = scipy.fft.rfft(whole[0], length).conj()
    all_v = _late(whole[1], reach.span - reach.forth, length).conj()
    xx = scipy.fft.irfft(new_x[:, None] * all_x, length)[..., : reach.span + 1]
    after = scipy.fft.irfft(new_v * all_x[:, None], length)[..., : reach.back + 1]
    ahead = scipy.fft.irfft(new_x[:, None] * all_v, length)[..., 1 : reach.forth + 1]
    vv = scipy.fft.irfft(new_v[:, None] * all_v, length)[..., : LONGEST + 1]
    return xx, after, ahead, vv


def _one_by_one(
    reach: Reach, new: tuple[Real, Real], whole: tuple[Real, Real]
) -> tuple[Real, Real, Real, Real]:
    """The same for a few new samples, without transforms."""
    (x, v), (whole_x, whole_v) = new, whole
    after = _correlated(v, whole_x).transpose(1, 0, 2)[..., : reach.back + 1]
    ahead = _correlated(x, whole_v)[..., 1:]
    vv = _correlated(v, whole_v[:, reach.forth - LONGEST :])
    return _correlated(x, whole_x), after, ahead, vv


def _correlated(new: Real, whole: Real) -> Real:
    """Σ a(t) b(t-k) for each new a and each b, k from 0 on."""
    return np.array([[np.correlate(b, a, "valid")[::-1] for b in whole] for a in new])


def _late(x: Real, by: int, length: int) -> Complex:
    """Transform of signals that begin `by` samples late."""
    shifted = np.zeros((*x.shape[:-1], length))
    shifted[..., by : by + x.shape[-1]] = x
    return np.asarray(scipy.fft.rfft(shifted, length))


def _filled(head: Real, count: int, more: Real) -> Real:
    """First samples of a run, with the following ones inserted."""
    if not more.size:
        return head
    out = head.copy()
    out[count : count + more.size] = more
    return out
