"""Which samples count, and whether the record begins at rest."""

from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real, every_of
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.data import Data, Seen
from hmpim.identify.fitting.derivatives import products
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import Trial
from hmpim.identify.noise.whiteness import are_white, effective_share, is_white
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import FEW, PART, TWICE
from hmpim.model.sampled import MARGIN, SampledInput
from hmpim.record import Intersample

__all__ = [
    "REACH",
    "begin_at",
    "begin_later",
    "begins_of",
    "count_in",
    "in_motion",
    "look_again",
    "ringing_of",
    "stand_out_of",
]

REACH = 4
"""Samples by which what lies between the samples reaches back: half of a spline's support."""

_RINGS = 8
"""Samples about a corner over which a spline through it rings."""

_FIRST = 8
"""Samples that show whether an input is in motion from the first."""

_LEFT = 4
"""Samples for each parameter that must be left."""


def in_motion(u: Real) -> bool:
    """Whether an input, (n,), moves from its first sample on, and so may have moved before."""
    steps = np.diff(u) ** 2
    return float(steps[:_FIRST].mean()) > PART * float(steps.mean())


def count_in(
    data: Data, mode: Intersample, fits: list[Fit], seen: Seen, known: Mask | None
) -> Seen:
    """Samples that count once it is known how the system remembers, and where it begins."""
    fit = min(fits, key=lambda f: f.objective)
    ahead = _ahead(fits)
    begins = begins_of(data.problem(mode, seen), fit, lag=data.rough.lag)
    if begins is None and not ahead and known is None:
        return seen
    n = fit.residual.size
    counted = np.ones(n, dtype=bool) if seen.valid is None else seen.valid.copy()
    counted[: begins or 0] = False
    counted[n - ahead :] = False
    if known is not None:
        counted = _of_measured(fit, fit.residual, counted, known)
    return Seen(valid=counted, begins=begins)


def _of_measured(fit: Fit, residual: Real, counted: Mask, known: Mask) -> Mask:
    """Samples that count and answer `known` input alone, where they tell more than all.

    The others count as long as they hold no more than noise, or so little more that fewer samples
    with less noise would tell less: what was filled in is part of the noise.
    """
    reach = min(int(np.ceil(max(fit.delay, 0.0) + fit.memory)) + 2, residual.size // 4)
    while True:
        clear = counted & _unaffected(known, reach)
        few = np.count_nonzero(clear) < FEW * np.count_nonzero(counted)
        if few or _precision(residual[clear]) <= _precision(residual[counted]):
            return counted
        if not _stands_out(residual, counted & ~clear, clear):
            return counted
        counted, reach = clear, 2 * reach


def _precision(residual: Real) -> float:
    """Samples over their mean square: an estimate's variance is inverse to it."""
    return residual.size**2 / max(float(np.sum(residual**2)), np.finfo(float).tiny)


def begins_of(problem: Problem, fit: Fit, *, lag: int) -> int | None:
    """Sample from which on an unknown state must be fitted; None for a record at rest.

    A score test (C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948) of the free responses beside all other
    parameters, and a chi-squared test of what comes before them, when the output still answers
    input before the record. A fit from rest may have any delay where it was not at rest; that of
    the cross-correlation, `lag`, is the later one, and costs a few samples.
    """
    latest = max(fit.delay, float(lag) if lag <= problem.y.size * PART else 0.0, 0.0)
    begins = int(np.ceil(latest)) + REACH
    if begins > longest_lag(problem.y.size) or fit.objective <= 0.0:
        return None
    late = np.arange(problem.y.size) >= begins
    told = _counts(problem)
    valid = told & late
    innovations = problem.innovations(fit.prediction, fit.residual)
    count = int(np.count_nonzero(valid))
    if count < _LEFT * fit.structure.parameters:
        return None
    share = effective_share(innovations[valid])
    if _stands_out(innovations, told & ~late, valid):
        return begins
    if not fit.structure.order:
        return None
    part = part_of(replace(problem, begins=begins), fit.structure, fit.theta)
    known = part if problem.begins is None else None
    counted = innovations if problem.counts is None else innovations * told
    _, after = products(problem, fit, counted, *part.free, part=known, edges=(begins,))
    moment, power = after[:-1, -1], float(after[-1, -1])
    if power <= 0.0:
        return None
    gained = float(moment @ solved(after[:-1, :-1], moment))
    left = max(power - gained, np.finfo(float).tiny)
    limit = float(scipy.special.chdtri(len(part.free), FALSE_ALARM))
    statistic = share * count * float(np.log(power) - np.log(left))
    if statistic > limit:
        return begins
    if share == 1.0 or fit.objective != fit.cost:  # whitened, it is not the best without a colour
        return None
    # What colours the residual may be the free response itself: the noise is what it leaves.
    begun = replace(problem, valid=valid, begins=begins)
    free = fit_structure(begun, fit.structure, fit.theta)
    if free.objective <= 0.0:
        return begins
    statistic = free.share * count * float(np.log(power) - np.log(free.objective))
    return begins if statistic > limit else None


def look_again(
    problem: Problem, trial: Trial, seen: Seen, *, lag: int, rests: bool, known: Mask | None
) -> Seen | None:
    """Samples that count after all, now that the structure is known; None if they are the same.

    What a band-limited input does at the ends of a record is not known: a command that starts from
    rest has a corner there, and a spline rings about it for a few samples, a finer one for longer,
    and for as long as it stands out of the noise.
    Where the residual is far above the noise at samples that answer those, they do not count. If
    what is before is still no noise, the record does not begin at rest.

    Parameters
    ----------
    problem : Problem
        What the trial was fitted to.
    trial : Trial
        The best one.
    seen : Seen
        The samples that counted.
    lag : int
        As for `begins_of`.
    rests : bool
        Whether it is known from this fit that the record begins at rest.
    known : ndarray of bool, shape (n,), or None
        Samples at which the input was measured; None when all are.
    """
    count = problem.y.size
    told = _counts(problem)
    innovations = problem.innovations(trial.fit.prediction, trial.fit.residual)
    innovations = problem.as_loud(innovations)  # divided by it, the ends would not stand out
    if trial.intersample == "bandlimited":
        reach = ringing_of(problem.source)
        ringing = _ringing(count, trial.fit.delay, reach)
        if problem.is_coloured and is_white(trial.fit.residual[told & ~ringing]):
            innovations = trial.fit.residual  # it is the ends that have the colour
        if _stands_out(innovations, told & ringing, told & ~ringing):
            ringing = _until_quiet(innovations, told, ringing, trial.fit.delay, reach)
            return replace(seen, valid=~ringing if seen.valid is None else seen.valid & ~ringing)
    if known is not None:
        clear = _of_measured(trial.fit, trial.fit.residual, told, known)
        if clear is not told:
            return replace(seen, valid=clear)
    if seen.begins is not None:
        return begin_later(seen, trial.fit)
    if rests:
        return None
    begins = begins_of(problem, trial.fit, lag=lag)
    if begins is None and problem.is_coloured:
        # Noise of the colour of a mode explains its free response, and more of it than there is.
        begins = begins_of(problem.plain, trial.fit, lag=lag)
    return None if begins is None else _from(seen, begins, count)


def _until_quiet(innovations: Real, told: Mask, first: Mask, delay: float, reach: int) -> Mask:
    """Samples over which the ends ring, as far as they stand out of the noise.

    What has not died away over a twentieth of the record is none of the ends' doing: it is left
    in, but for the first of them.
    """
    ringing, count = first, innovations.size
    while reach < FEW * count:
        reach *= 2
        wider = _ringing(count, delay, reach)
        if not _stands_out(innovations, told & wider & ~ringing, told & ~wider):
            return ringing
        ringing = wider
    return first


def ringing_of(source: SampledInput) -> int:
    """Samples about a corner over which a spline rings: a finer one for longer.

    Of a record too short to do without them only the first are asked for.
    """
    finer = source.oversampling > 1 and FEW * source.samples > MARGIN
    return MARGIN if finer else _RINGS


def _ringing(count: int, delay: float, reach: int) -> Mask:
    """Samples that answer those within reach of either end of the record."""
    late = np.arange(count) - delay
    return np.asarray((np.abs(late) <= reach) | (late >= count - 1 - reach))


def begin_later(seen: Seen, fit: Fit) -> Seen | None:
    """Samples that count where a fit has a longer delay than those before; None if none goes.

    What comes before the delay answers input before the record, which no free response describes.
    """
    begins, size = int(np.ceil(fit.delay)) + REACH, fit.residual.size
    if seen.begins is None or begins <= seen.begins:
        return None
    return begin_at(seen, begins, size)


def begin_at(seen: Seen, begins: int, size: int) -> Seen | None:
    """Samples that counted, from one on; None where no delay is as long."""
    return None if begins > longest_lag(size) else _from(seen, begins, size)


def _from(seen: Seen, begins: int, size: int) -> Seen:
    """The samples that counted, from one on."""
    late = np.arange(size) >= begins
    return Seen(valid=late if seen.valid is None else seen.valid & late, begins=begins)


def _counts(problem: Problem) -> Mask:
    """Which samples count."""
    return np.ones(problem.y.size, dtype=bool) if problem.counts is None else problem.counts


def _stands_out(innovations: Real, some: Mask, others: Mask) -> bool:
    """Whether some samples hold more than the noise that the others show."""
    told = some | others
    return bool(stand_out_of(innovations[told][None], some[told][None])[0])


def stand_out_of(innovations: Real, some: Mask) -> Mask:
    """Which residuals hold more in some samples than the noise that their others show.

    Parameters
    ----------
    innovations : ndarray, shape (k, n)
        Residuals, whitened.
    some : ndarray of bool, shape (k, n)
        The samples that are asked for; the others tell the noise.
    """
    squares = innovations**2
    counts = np.count_nonzero(some, axis=1)
    told = (counts > 0) & (counts < some.shape[1])
    level, every = np.zeros(some.shape[0]), every_of(some.shape[1])
    bulk, out_of_it = squares[:, ::every], some[:, ::every]
    left_out = np.count_nonzero(out_of_it, axis=1)
    for count in np.unique(left_out[told]):  # rows with equally many others share one array
        alike = told & (left_out == count)
        others = bulk[alike][~out_of_it[alike]].reshape(-1, bulk.shape[1] - count)
        level[alike] = np.median(others, axis=1) / 0.455  # of a squared Gaussian
    limit = level * scipy.special.chdtri(np.maximum(counts, 1), FALSE_ALARM)
    held = np.vecdot(squares, some)
    out = np.asarray(told & (held > limit))
    # Twice as much where the others are not white: they hold more than noise.
    white = are_white(np.where(some[out], 0.0, innovations[out]))
    out[out] = white | (held > TWICE * limit)[out]
    return out


def _ahead(fits: list[Fit]) -> int:
    """Samples at the end that depend on input after the record, if the delay is negative."""
    delay = min(fits, key=lambda f: f.objective).delay
    return int(np.ceil(-delay)) + 3 if delay < 0 else 0


def _unaffected(known: Mask, memory: int) -> Mask:
    """Samples whose output depends on measured input alone."""
    unknown = np.concatenate([[0], np.cumsum(~known)])
    index = np.arange(known.size)
    return np.asarray(unknown[index + 1] == unknown[np.maximum(index - memory, 0)])
