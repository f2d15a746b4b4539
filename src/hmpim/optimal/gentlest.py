"""The gentlest stimulus that gives a wanted accuracy (section III's trade, solved)."""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, LimitsError
from hmpim.optimal.bound import least_share
from hmpim.optimal.candidate import FULL, Candidate, gentleness, gentler, has_lines
from hmpim.optimal.fisher import Errors, predict_errors
from hmpim.optimal.multisine import best_multisine
from hmpim.optimal.sweeps import best_sweep
from hmpim.optimal.wish import Accuracy, Family, Gentle, ModelRange, RoughModel, Step, Wish
from hmpim.stimulus import Limits, Stimulus
from hmpim.stimulus.limits import three_digits

__all__ = ["FAMILIES", "Gentlest", "TradePoint", "gentlest", "trade"]

Progress = Callable[[float, str], None]
"""Told the share done, from 0 to 1, and in a few words what comes next."""

FAMILIES: tuple[Family, ...] = get_args(Family)

_LENGTH = 10.0  # s; the paper's longer one
_LONGEST = 60.0  # s, where the duration is to be short and no longest one is stated
_TRIALS = 100  # of one search, roughly: for the progress that is told
_MORE = 8  # starts, before it is said that limits do not allow an accuracy
_FEW = 15  # trials of what says how far beyond all limits a wish is
_SURELY = 1.001  # share of the limits from which no stimulus can, arithmetic aside
_HOPELESS = 1.25  # share that a multisine takes from which more starts, or a sweep, are no help:
# in 14 wishes drawn at random eight starts gained 3 % at most, and sweeps took 6 % more or worse
_FREEDOM = 12  # lines that most multisines of that study had, or more
_ROUNDS = 8  # of the search for the shortest record
_CLOSE = 0.01  # of the duration, to which the shortest is found
_FREE = 0.98  # of a limit: what is below it is not shaped by it
_ROOM = 1.05  # on what would do: another search may end in another, slightly worse minimum


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Gentlest:
    """The gentlest stimulus found, its predicted errors, and the cost of the other families.

    Parameters
    ----------
    stimulus : Stimulus
        Checked against the limits.
    family : {'sweep', 'exponential', 'multisine'}
        Its kind.
    value : float
        What was to be small: unit/s² for accelerations, the unit for travel, s.
    errors : Errors
        Predicted standard deviations for the rough model.
    worst : Errors
        The greatest ones over the range of models, parameter by parameter.
    wish : Wish
        What was wanted.
    candidates : tuple of Candidate
        The best of each family, gentlest first, those beyond the limits last.
    """

    stimulus: Stimulus
    family: Family
    value: float
    errors: Errors
    worst: Errors
    wish: Wish
    candidates: tuple[Candidate, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class TradePoint:
    """What one accuracy costs.

    Parameters
    ----------
    factor : float
        The errors allowed, relative to those wanted.
    value : float or None
        What is to be small; None if the limits do not allow that accuracy.
    """

    factor: float
    value: float | None


@checked
def gentlest(
    *,
    accuracy: Accuracy,
    model: RoughModel,
    noise_std: float,
    limits: Limits,
    fs: float,
    gentle: Gentle = "peak_acceleration",
    duration: float | None = None,
    model_range: ModelRange | None = None,
    families: Sequence[Family] = FAMILIES,
    progress: Progress | None = None,
) -> Gentlest:
    """Find the gentlest stimulus that gives a wanted accuracy inside limits.

    Parameters
    ----------
    accuracy : Accuracy
        Errors that are wanted, at 95 %.
    model : RoughModel
        What is roughly known of the unit.
    noise_std : float
        Standard deviation of white measurement noise, in the output's unit.
    limits : Limits
        Limits of the axis, which are always kept.
    fs : float
        Sampling rate, Hz.
    gentle : {'peak_acceleration', 'rms_acceleration', 'travel', 'duration'}
        What is to be small.
    duration : float, optional
        Length of the record in s: leads, motion, and the tail at rest in which the delayed
        response is read; 10 by default. Where the duration is to be small, the longest one,
        60 by default.
    model_range : ModelRange, optional
        Where the unit's parameters may lie; the accuracy is then met everywhere in it.
    families : sequence of {'sweep', 'exponential', 'multisine'}
        Which to try.
    progress : callable, optional
        Called with the share done, from 0 to 1, and what comes next.

    Returns
    -------
    Gentlest

    Raises
    ------
    LimitsError
        If no stimulus of these families meets the accuracy inside the limits; the message
        says what is needed.
    ArgumentError
        If something else is out of range.

    Notes
    -----
    The predicted errors are the Cramér-Rao bound, which `hmpim.identify` reaches.

    Examples
    --------
    The paper's Fig. 17, at the accuracy that the paper claims; its own sweep peaks at
    8060 deg/s²:

    >>> found = gentlest(
    ...     accuracy=Accuracy(), noise_std=0.1, limits=Limits(position=10, unit="deg"), fs=200,
    ...     model=RoughModel(delay=0.15, natural_frequency=10, damping_ratio=0.4),
    ...     families=("multisine",))
    >>> bool(found.stimulus.peaks.acceleration < 700), found.stimulus.samples
    (True, 2000)
    >>> round(found.errors.ci95("natural_frequency") / 10, 4)
    0.017
    """
    wish = Wish(
        accuracy=accuracy,
        model=model,
        model_range=ModelRange() if model_range is None else model_range,
        noise_std=noise_std,
        limits=limits,
        fs=fs,
        gentle=gentle,
        duration=(_LONGEST if gentle == "duration" else _LENGTH) if duration is None else duration,
    )
    if wish.duration < wish.shortest:
        raise LimitsError(
            f"duration = {wish.duration:g} s is too short: delay and settling take "
            f"{wish.shortest / 2.2:.3g} s, and no record of less than twice that is trusted; "
            f"allow {three_digits(wish.shortest, up=True)} s or more"
        )
    chosen = tuple(families)
    for family in chosen:
        if family not in FAMILIES:
            raise ArgumentError(f"family {family!r} is not known; choose one of {list(FAMILIES)}")
    if not chosen:
        raise ArgumentError(f"no family is given; choose one of {list(FAMILIES)}")
    _refuse_beyond(wish, chosen, _steps(progress, "bound", 0, len(chosen)))
    found: list[Candidate] = []
    for k, family in enumerate(sorted(chosen, key=lambda name: name != "multisine")):
        best = _best(family, wish, step=_steps(progress, family, k, len(chosen)))
        if best is not None:
            found.append(best)
            if family == "multisine" and _is_hopeless(best):
                break
    found.sort(key=lambda c: (c.use > FULL, c.value if c.use <= FULL else c.use))
    if not found or found[0].use > FULL:
        raise LimitsError(_what_would_do(wish, found[0] if found else None))
    _tell(progress, 1.0, "done")
    first = found[0]
    stimulus = replace(first.stimulus, limits=limits)
    everywhere = [_errors(stimulus, m, wish) for m in wish.models(finer=3)]
    return Gentlest(
        stimulus=stimulus,
        family=first.family,
        value=first.value,
        errors=_errors(stimulus, model, wish),
        worst=Errors(
            delay=max(e.delay for e in everywhere),
            natural_frequency=max(e.natural_frequency for e in everywhere),
            damping_ratio=max(e.damping_ratio for e in everywhere),
            scale_factor=max(e.scale_factor for e in everywhere),
            bias=max(e.bias for e in everywhere),
        ),
        wish=wish,
        candidates=tuple(found),
    )


def _is_hopeless(multisine: Candidate) -> bool:
    """Whether it is so far beyond the limits that neither more starts nor a sweep help."""
    return multisine.use > _HOPELESS and multisine.shape.size // 2 >= _FREEDOM


def _refuse_beyond(wish: Wish, families: Sequence[Family], step: Step) -> None:
    """Refuse at once what no stimulus of any shape can give inside the limits."""
    share = least_share(wish)
    if share <= _SURELY:
        return
    least = replace(wish, gentle="duration")
    if "multisine" in families:
        rough = best_multisine(least, wish.duration, starts=1, steps=_FEW, step=step)
    else:
        rough = best_sweep(least, wish.duration, family=families[0], trials=_FEW, step=step)
    if rough is None or rough.use > FULL:
        raise LimitsError(_what_would_do(wish, rough, share))


def trade(
    found: Gentlest,
    *,
    factors: Sequence[float] = (0.25, 0.35, 0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0),
    progress: Progress | None = None,
) -> tuple[TradePoint, ...]:
    """What other accuracies cost, by the family that was found the gentlest.

    Parameters
    ----------
    found : Gentlest
        A result.
    factors : sequence of float
        Errors allowed, relative to those wanted.
    progress : callable, optional
        As in `gentlest`.

    Returns
    -------
    tuple of TradePoint
        In the order of `factors`.
    """
    points = []
    shape = found.candidates[0]
    for k, factor in enumerate(factors):
        step = _steps(progress, f"errors times {factor:g}", k, len(factors))
        wish = replace(found.wish, accuracy=found.wish.accuracy.times(factor))
        best = _rescaled(shape, factor, found.wish, wish)
        if best is None and least_share(wish) <= _SURELY:
            best = _best(found.family, wish, near=shape, step=step)
        inside = best is not None and best.use <= FULL
        points.append(TradePoint(factor=factor, value=best.value if best and inside else None))
    _tell(progress, 1.0, "done")
    return tuple(points)


def _rescaled(best: Candidate, factor: float, before: Wish, wish: Wish) -> Candidate | None:
    """The stimulus for `factor` times the errors, where it has the shape of the best one.

    Errors are inverse to its size; so where no limit shapes either, only the size differs.
    """
    free = wish.gentle != "duration" and max(best.use, best.use / factor) < _FREE
    if factor != 1.0 and not (free and _in_proportion(factor, before, wish)):
        return None
    return replace(best, use=best.use / factor, value=best.value / factor)


def _in_proportion(factor: float, before: Wish, wish: Wish) -> bool:
    """Whether all errors allowed grow by `factor`, none held by what a verdict needs."""
    return all(
        np.allclose(wish.wanted(model), factor * before.wanted(model), rtol=1e-9)
        for model in wish.models()
    )


def _tell(progress: Progress | None, share: float, what: str) -> None:
    if progress is not None:
        progress(share, what)


def _steps(progress: Progress | None, what: str, part: int, parts: int) -> Step:
    """Give what is to be called at each trial; it tells the share done, and never all of it."""
    trials = itertools.count(1)

    def step() -> None:
        trial = next(trials)
        _tell(progress, (part + trial / (trial + _TRIALS)) / parts, f"{what}, trial {trial}")

    _tell(progress, part / parts, what)
    return step


def _errors(stimulus: Stimulus, model: RoughModel, wish: Wish) -> Errors:
    return predict_errors(stimulus, model=model, noise_std=wish.noise_std)


def _best(
    family: Family, wish: Wish, *, step: Step, near: Candidate | None = None
) -> Candidate | None:
    """Best of a family, in the wish's duration or, where that is to be small, in the shortest.

    One that is beyond the limits takes the least share of them that was found.
    """
    if wish.gentle == "duration":
        return _shortest(family, wish, step)
    best = None if near is None else _at(family, wish, wish.duration, near, step)
    if best is None or best.use > FULL:
        best = _at(family, wish, wish.duration, None, step)
    if best is not None and best.use <= FULL:
        return best
    if wish.unlimited:
        return best
    # limits come first: the least share of them, and on from there if that is inside
    least = replace(wish, gentle="duration")
    inside = _at(family, least, wish.duration, None, step)
    decided = inside is not None and (inside.use <= FULL or _is_hopeless(inside))
    if family == "multisine" and not decided:
        inside = gentler(inside, best_multisine(least, wish.duration, starts=_MORE, step=step))
    if inside is None:
        return best
    inside = replace(inside, value=gentleness(inside.stimulus, wish.gentle))
    if inside.use > FULL:
        return inside  # for limits in proportion, in proportion: what would do relies on it
    return gentler(inside, _at(family, wish, wish.duration, inside, step))


def _at(
    family: Family, wish: Wish, total: float, near: Candidate | None, step: Step
) -> Candidate | None:
    start = None if near is None else near.shape
    if family == "multisine":
        return best_multisine(wish, total, start=start, step=step)
    trials = 40 if near is None else 15
    return best_sweep(wish, total, family=family, start=start, trials=trials, step=step)


def _shortest(family: Family, wish: Wish, step: Step) -> Candidate | None:
    """Close in on the duration at which the accuracy takes the limits in full.

    Errors fall with the root of the time; from there it is a secant between a duration that
    is too short and one that is not.
    """
    enough: Candidate | None = None
    enough_at, short_at = wish.duration, 0.0
    short_use = math.inf
    total = max(2.0 * wish.tail + 10.0 / wish.model.natural_frequency, wish.shortest)
    total = min(wish.duration, total)
    near: Candidate | None = None
    for _ in range(_ROUNDS):
        total = math.ceil(total * wish.fs - 1e-6) / wish.fs
        best = _at(family, wish, total, near, step)
        if near is not None and family == "multisine" and (best is None or best.use > FULL):
            best = gentler(best, _at(family, wish, total, None, step))  # a second look costs little
        near = best or near
        lasting = near if near is not None and _lasts(near, total, wish) else None
        told = lasting is not None and has_lines(lasting.stimulus.position)
        tried = lasting if told else None
        if tried is not None and tried.use <= FULL:
            enough, enough_at = tried, total
        else:
            short_at = max(short_at, total)
            short_use = math.inf if tried is None else tried.use
        if short_at >= wish.duration - 0.5 / wish.fs:
            return gentler(enough, lasting)
        if enough is not None and enough_at - max(short_at, wish.shortest) <= max(
            _CLOSE * enough_at, 1.0 / wish.fs
        ):
            break
        total = _next_duration(total, tried, enough, (short_at, short_use, enough_at), wish)
    return enough if enough is not None else near


def _lasts(candidate: Candidate, total: float, wish: Wish) -> bool:
    return abs(candidate.stimulus.duration - total) < 1.5 / wish.fs


def _next_duration(
    total: float,
    tried: Candidate | None,
    enough: Candidate | None,
    around: tuple[float, float, float],
    wish: Wish,
) -> float:
    short_at, short_use, enough_at = around
    if enough is None:  # too short so far
        factor = 2.0 if tried is None else min(max(tried.use**2, 1.05), 4.0)
        return min(total * factor, wish.duration)
    if short_at == 0.0:
        return max(total * max(enough.use**2, 0.3), 2.0 / wish.fs, wish.shortest)
    share = 0.5
    if math.isfinite(short_use):
        low, high = math.log(short_use), math.log(enough.use)
        share = min(max(low / (low - high), 0.15), 0.85) if low > high else 0.5
    return short_at + share * (enough_at - short_at)


def _what_would_do(wish: Wish, best: Candidate | None, share: float = 0.0) -> str:
    """Say how far off the wish is, in errors, in limits, and in time."""
    if best is None or not math.isfinite(best.use):
        needed = three_digits(wish.tail + 10.0 / wish.model.natural_frequency, up=True)
        return (
            f"duration = {wish.duration:g} s is too short for any motion: leads, and a tail of "
            f"{wish.tail:.3g} s for the delayed response, take it all; allow {needed} s or more"
        )
    wide = _ROOM * best.use
    factor = three_digits(wide, up=True)
    longer = three_digits(wish.duration * wide**2, up=True)
    any_shape = ""
    if share > _SURELY:
        any_shape = f", and none of any shape does with {three_digits(share, up=False)} times"
    return (
        f"the accuracy cannot be met inside the limits in {wish.duration:g} s: the best "
        f"stimulus found needs {factor} times the limits{any_shape}; allow errors {factor} times "
        f"as large, limits {factor} times as wide, or about {longer} s"
    )
