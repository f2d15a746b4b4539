"""Which samples count, and whether the record begins at rest."""

from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Mask, Real, every_of
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.data import Counted, Data
from hmpim.identify.fitting.derivatives import products
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import Trial
from hmpim.identify.noise.whiteness import are_white, effective_share
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
    "first_answers",
    "in_motion",
    "look_again",
    "needs_free",
    "ringing",
    "ringing_of",
    "stand_out_of",
]

REACH = 4
"""Samples by which interpolation reaches back: half of a spline's support."""

_RINGS = 8
"""Samples around a corner over which a spline rings."""

_FIRST = 8
"""First samples, which show whether the input is in motion when the record begins."""

_LEFT = 4
"""Samples per parameter that a test needs at least."""


def in_motion(u: Real) -> bool:
    """Whether an input, (n,), moves from its first sample on, and so may have moved earlier."""
    steps = np.diff(u) ** 2
    return float(steps[:_FIRST].mean()) > PART * float(steps.mean())


def count_in(
    data: Data, mode: Intersample, fits: list[Fit], seen: Counted, known: Mask | None
) -> Counted:
    """Samples that count, once the memory and the delay of the system are known."""
    fit = min(fits, key=lambda f: f.objective)
    # With a negative delay the last samples depend on input after the record.
    ahead = int(np.ceil(-fit.delay)) + 3 if fit.delay < 0 else 0
    begins = begins_of(data.problem(mode, seen), fit, lag=data.rough.lag)
    if begins is None and not ahead and known is None:
        return seen
    n = fit.residual.size
    counted = np.ones(n, dtype=bool) if seen.valid is None else seen.valid.copy()
    counted[: begins or 0] = False
    counted[n - ahead :] = False
    if known is not None:
        counted = _of_measured(fit, counted, known)
    return Counted(valid=counted, begins=begins)


def _of_measured(fit: Fit, counted: Mask, known: Mask) -> Mask:
    """Samples that count and depend on `known` input alone, where these estimate better than all.

    Samples that depend on filled-in input also count while their residual is not above the noise,
    or so little above it that dropping them would cost more precision than it gains.
    """
    residual = fit.residual
    reach = min(int(np.ceil(max(fit.delay, 0.0) + fit.memory)) + 2, residual.size // 4)
    unknown, index = np.concatenate([[0], np.cumsum(~known)]), np.arange(known.size)
    while True:
        clear = counted & (unknown[index + 1] == unknown[np.maximum(index - reach, 0)])
        few = np.count_nonzero(clear) <= FEW * np.count_nonzero(counted)
        if few or _variance(residual[clear]) >= _variance(residual[counted]):
            return counted
        if not _stands_out(residual, counted & ~clear, clear):
            return counted
        counted, reach = clear, 2 * reach


def _variance(residual: Real) -> float:
    """Mean square over the number of samples: the variance of an estimate is proportional to it."""
    return float(np.sum(residual**2)) / residual.size**2


def begins_of(problem: Problem, fit: Fit, *, lag: int) -> int | None:
    """Sample from which an unknown state must be fitted; None if the record begins at rest.

    A score test (C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948) decides whether free responses are
    needed in addition to all other parameters, and a chi-squared test whether the samples before
    them answer input before the record. A fit that wrongly assumes rest may have any delay, so
    the later of its delay and `lag`, the lag of the cross-correlation, is taken.
    """
    begins = int(first_answers(np.array(fit.delay), np.array(lag), problem.y.size))
    if begins > longest_lag(problem.y.size) or fit.objective <= 0.0:
        return None
    late = np.arange(problem.y.size) >= begins
    every = _counts(problem)
    valid = every & late
    innovations = problem.innovations(fit.prediction, fit.residual)
    count = int(np.count_nonzero(valid))
    share = effective_share(innovations[valid])
    if _stands_out(innovations, every & ~late, valid):
        return begins
    if not fit.structure.order:
        return None
    part = part_of(replace(problem, begins=begins), fit.structure, fit.theta)
    counted = innovations if problem.counts is None else innovations * every
    _, after = products(problem, fit, counted, *part.free, part=part, edges=(begins,))
    moment, power = after[:-1, -1], float(after[-1, -1])
    gained = float(moment @ solved(after[:-1, :-1], moment))
    needed = needs_free(power, power - gained, share * count, len(part.free))
    return begins if needed else None


def first_answers(delays: Real, lags: NDArray[np.intp], samples: int) -> NDArray[np.intp]:
    """First samples, (...,), that answer only input of the record, as in `begins_of`."""
    late = np.where(lags <= PART * samples, lags, 0)
    return np.ceil(np.maximum(np.maximum(delays, late), 0.0)).astype(np.intp) + REACH


def needs_free(
    power: Real | float, left: Real | float, count: NDArray[np.intp] | float, modes: int
) -> Mask:
    """Which residuals' power, (...,), free responses of so many modes lower by more than chance.

    With them `left` remains; `count` samples are independent.
    """
    tiny = np.finfo(float).tiny
    fell = np.log(np.maximum(power, tiny)) - np.log(np.maximum(left, tiny))
    return np.asarray(count * fell > scipy.special.chdtri(modes, FALSE_ALARM))


def look_again(
    problem: Problem, trial: Trial, seen: Counted, *, lag: int, rests: bool, known: Mask | None
) -> Counted | None:
    """Samples that count, now that the structure is known; None if they do not change.

    A band-limited input is unknown at the ends of the record: a command that starts from rest has
    a corner there, and a spline through it rings until the ringing is lost in the noise, a finer
    spline for longer. Samples that answer the ringing do not count where the residual is far
    above the noise. If the samples before them still hold more than noise, the record does not
    begin at rest.

    `problem` is what the best `trial` was fitted to, over the samples `seen`, and `lag` is as for
    `begins_of`. `rests` says whether this fit already showed that the record begins at rest, and
    `known` which input samples were measured, all if None.
    """
    count = problem.y.size
    every = _counts(problem)
    innovations = problem.innovations(trial.fit.prediction, trial.fit.residual)
    innovations = problem.as_loud(
        innovations
    )  # after division by the level, no end would stand out
    if trial.intersample == "bandlimited":
        reach = ringing_of(problem.source)
        ends = ringing(count, trial.fit.delay, reach)
        if _stands_out(innovations, every & ends, every & ~ends):
            return replace(seen, valid=~ends if seen.valid is None else seen.valid & ~ends)
    if known is not None:
        clear = _of_measured(trial.fit, every, known)
        if clear is not every:
            return replace(seen, valid=clear)
    if seen.begins is not None:
        return begin_later(seen, trial.fit)
    if rests:
        return None
    begins = begins_of(problem, trial.fit, lag=lag)
    if begins is None and problem.is_coloured:
        # Noise with the colour of a mode would explain more than the mode's own free response.
        begins = begins_of(problem.plain, trial.fit, lag=lag)
    return None if begins is None else begin_at(seen, begins, count)


def ringing_of(source: SampledInput) -> int:
    """Samples around a corner over which a spline rings: a finer one rings for longer.

    A short record cannot spare that many, so only the first few are counted.
    """
    finer = source.oversampling > 1 and FEW * source.samples > MARGIN
    return MARGIN if finer else _RINGS


def ringing(count: int, delay: Real | float, reach: int) -> Mask:
    """Samples that answer input within `reach` of either end of the record, (n,).

    For delays of shape (k, 1) those of each are returned, (k, n).
    """
    late = np.arange(count) - delay
    return np.asarray((np.abs(late) <= reach) | (late >= count - 1 - reach))


def begin_later(seen: Counted, fit: Fit) -> Counted | None:
    """Samples that count if a fit has a longer delay than earlier ones; None if none drops out.

    Samples before the delay answer input before the record, which no free response describes. None
    as well if too few would be left for the fit.
    """
    begins, size = int(np.ceil(fit.delay)) + REACH, fit.residual.size
    if seen.begins is None or begins <= seen.begins:
        return None
    later = begin_at(seen, begins, size)
    if later is None or later.valid is None:
        return later
    enough = np.count_nonzero(later.valid) >= _LEFT * fit.structure.parameters
    return later if enough else None


def begin_at(seen: Counted, begins: int, size: int) -> Counted | None:
    """Samples that counted, from `begins` on; None if that is longer than any delay."""
    if begins > longest_lag(size):
        return None
    late = np.arange(size) >= begins
    return Counted(valid=late if seen.valid is None else seen.valid & late, begins=begins)


def _counts(problem: Problem) -> Mask:
    """Which samples count."""
    return np.ones(problem.y.size, dtype=bool) if problem.counts is None else problem.counts


def _stands_out(innovations: Real, some: Mask, others: Mask) -> bool:
    """Whether some samples have more power than the noise in the others explains."""
    every = some | others
    return bool(stand_out_of(innovations[every][None], some[every][None])[0])


def stand_out_of(innovations: Real, some: Mask) -> Mask:
    """Which residuals have more power in some samples than the noise in the others explains.

    The residuals, (k, n), are whitened; `some`, (k, n), are the samples to test.
    """
    squares = innovations**2
    counts = np.count_nonzero(some, axis=1)
    testable = (counts > 0) & (counts < some.shape[1])
    level, every = np.zeros(some.shape[0]), every_of(some.shape[1])
    bulk, tested = squares[:, ::every], some[:, ::every]
    omitted = np.count_nonzero(tested, axis=1)
    for count in np.unique(omitted[testable]):  # rows with equally many others share one array
        alike = testable & (omitted == count)
        others = bulk[alike][~tested[alike]].reshape(-1, bulk.shape[1] - count)
        level[alike] = np.median(others, axis=1) / 0.455  # of a squared Gaussian
    limit = level * scipy.special.chdtri(np.maximum(counts, 1), FALSE_ALARM)
    power = np.vecdot(squares, some)
    out = np.asarray(testable & (power > limit))
    # Twice the limit where the others are not white, and so hold more than noise.
    white = are_white(np.where(some[out], 0.0, innovations[out]))
    out[out] = white | (power > TWICE * limit)[out]
    return out
