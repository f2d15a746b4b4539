"""Fits of every structure under one assumption: plain ones, and richer ones if needed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, FALSE_ALARM
from hmpim.identify.fitting.beginning import in_motion
from hmpim.identify.fitting.data import TASTE, Data, hopeless_beside, refit
from hmpim.identify.fitting.enrich import (
    INTEGRATING,
    MODES,
    RICH,
    Proposal,
    integrator_starts,
    members,
    proposals,
    with_fit,
    without_fast,
)
from hmpim.identify.fitting.fit import CONVERGED, Fit, Problem, bounded_for, delayed, fit_structure
from hmpim.identify.fitting.growth import FEW_POLES, one_more_pole, scale_of, with_pole
from hmpim.identify.fitting.held_steps import is_all_behind_hold, steps_through
from hmpim.identify.fitting.modes import grown_modes
from hmpim.identify.fitting.rows import STAMPED_LATE
from hmpim.identify.fitting.spectral import condensed, fitted_roughly
from hmpim.identify.fitting.start import RoughResponse, rough_response, searched, starting_values
from hmpim.identify.fitting.trial import as_likely
from hmpim.identify.noise.misfit import unexplained_response
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import FEW, MATERIAL, MOST, MUCH, NEARLY, PART, TWICE
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName
from hmpim.model.response import slowest_time_constant

__all__ = [
    "almost_integrates",
    "best_of",
    "fit_integrating",
    "fit_plain",
    "fit_rich",
    "is_poor",
    "nested",
    "owed_to_input",
    "pruned",
    "spans_record",
    "sums_to_noise",
]

_LONG_TASTE = 12
"""Steps from each start of a richer structure, whose valleys are longer."""

_PARTNER = 0.3
"""Time constant of an added pole, over the fit's own."""

_AT_ONCE = 4
"""Richer structures tried before a check whether more are needed."""

_SLIPS = 4
"""Half periods by which the delay of a fit in mid-motion is moved either way for new starts."""


def fit_plain(
    problem: Problem,
    rough: RoughResponse,
    structures: tuple[StructureName, ...],
    *,
    before: Sequence[Fit] = (),
    largest: float = np.inf,
) -> list[Fit]:
    """Fit each structure, the richest first, from its own starts and then from the simpler ones.

    The first start of a structure is where its fit ended `before`, on other samples, if any. A fit
    that promises a sum of squares above `largest` is given up.
    Once a residual is white no other start is needed, and simpler structures that promise much
    more than its sum of squares are hopeless: they get one start, and only promising steps.
    """
    fits: list[Fit] = []
    settled = False
    for name in sorted(structures, key=lambda name: -STRUCTURES[name].order):
        structure = STRUCTURES[name]
        if settled and name == "first_order":
            starts = [_without_second_pole(fits[0])]
        else:
            known = [fit.theta for fit in before if fit.structure == structure]
            starts = known or starting_values(rough, structure, thorough=False)
        hopeful = min((f.objective for f in fits), default=np.inf) * TWICE
        hopeless = min(TWICE * hopeful if settled else np.inf, largest)
        fit = fit_structure(problem, structure, starts[0], iterations=TASTE, hopeless=hopeless)
        # Where noise is most of the output, the residual is white whatever the model misses.
        noisy = fit.cost > MOST * problem.spread
        white = fit.objective < hopeful and fit.is_white
        if noisy:
            fit = _tasted(problem, searched(rough, structure), fit, largest)
        if not white and fit.objective < TWICE**2 * hopeful:
            rivals = starts[1:]
            if not settled and structure.order and problem.begins is not None:
                # A climb on the rough response would fit the free response.
                more = starting_values(rough, structure)
                rivals += [t for t in more if not any(np.array_equal(t, s) for s in starts)]
            elif not settled and structure.order:
                every = np.stack([*starts, *starting_values(rough, structure)])
                rivals = list(fitted_roughly(condensed(rough), structure, every).likely)
            fit = _tasted(problem, rivals, fit, largest)
            # Where the output is ahead, the record lacks the beginning as well.
            underway = problem.begins is not None or fit.delay < STAMPED_LATE
            if not settled and structure.order and underway and not fit.is_white:
                fit = _tasted(problem, _slipped(rough, fit.theta), fit, largest)
        settled = settled or white
        fits.append(fit)
    at = {fit.structure.name: i for i, fit in enumerate(fits)}
    if "first_order" in at and "second_order" in at:
        simple, rich = fits[at["first_order"]], fits[at["second_order"]]
        if simple.objective <= rich.objective or not rich.is_white:  # it may have missed its best
            rival = fit_structure(problem, rich.structure, nested(simple), iterations=TASTE)
            fits[at["second_order"]] = min(rich, rival, key=lambda f: f.objective)
    least = min(fit.objective for fit in fits)

    def ended(fit: Fit) -> Fit:
        if fit.objective <= TWICE**2 * least:
            limits = {"precision": CONVERGED / fit.share, "hopeless": largest}
            return fit if fit.converged else refit(problem, fit, **limits)
        if not fit.prediction.size:
            return fit
        return replace(fit, prediction=np.empty(0), residual=np.empty(0))  # at most a start

    return [ended(fit) for fit in fits]


def _tasted(problem: Problem, starts: Sequence[Real], best: Fit, largest: float) -> Fit:
    """The best of a fit and of a few steps from each other promising start.

    Starts beyond the bounds may be the same one within them.
    """
    within = [bounded_for(problem, best.structure, theta) for theta in starts]
    for theta in {theta.tobytes(): theta for theta in within}.values():
        hopeless = min(TWICE * best.objective, largest)
        rival = fit_structure(problem, best.structure, theta, iterations=TASTE, hopeless=hopeless)
        best = min(best, rival, key=lambda fit: fit.objective)
    return best


def _slipped(rough: RoughResponse, theta: Real) -> list[Real]:
    """Starts whose delay is a few half periods of the input's mean frequency earlier or later.

    Beyond a resonance the phase hardly turns: each delay that is a period off has a local minimum
    of its own, and the free response hides which of them is the lowest.
    """
    mean = float(np.sqrt(rough.weight @ rough.omega**2 / rough.weight.sum()))
    steps = np.pi / mean * np.array([k for k in range(-_SLIPS, _SLIPS + 1) if k])
    return [delayed(theta, step) for step in steps]


def fit_rich(
    data: Data,
    problem: Problem,
    fits: list[Fit],
    structures: tuple[StructureName, ...],
    *,
    all_of_them: bool,
    shared: bool,
) -> list[Fit]:
    """Fits of the richer structures, the most promising first, until the residual is explained.

    Simpler versions of these, without parameters that the record does not need, are added. Fits
    with many poles must leave white noise; if inputs with unfinished fits move the output too
    (`shared`), at most half the residual power of fits with few poles is enough.
    """
    found = _climbed(data, problem, fits, structures, all_of_them=all_of_them, shared=shared)
    found += pruned(problem, [*fits, *found], structures)
    if found and not min(found, key=lambda fit: fit.objective).is_white:
        # More and more poles, or ones as slow as the record, fit nonlinear effects: friction,
        # rounding.
        few = [f for f in found if f.structure.order <= FEW_POLES]
        enough = min((f.objective for f in [*fits, *few]), default=np.inf) / TWICE
        many = [f for f in found if shared and f not in few and f.objective < enough]
        found = [f for f in [*few, *many] if not spans_record(f)]
        if min(fits, key=lambda fit: fit.objective).is_white:
            # In closed loop, noise returns through the input and looks like dynamics.
            found = [f for f in found if f.is_white]
    return found


def _climbed(
    data: Data,
    problem: Problem,
    fits: list[Fit],
    structures: tuple[StructureName, ...],
    *,
    all_of_them: bool,
    shared: bool,
) -> list[Fit]:
    """Fits of richer structures from the rough response, until the residual is explained.

    Unless the output is shared with other inputs, starts also come from the best fit's residual.
    """
    found = fit_integrating(data, problem, fits, structures)
    if sums_to_noise([*fits, *found]):
        return found
    best = min([*fits, *found], key=lambda fit: fit.objective)
    rich = members(structures, RICH)
    # A rough response that mistakes a free response for an answer proposes nothing useful.
    misled = data.keeps_samples and in_motion(data.u) and is_poor(best, problem.spread)
    proposed = proposals(data.rough, rich, best, all_of_them=all_of_them or misled)

    def climbed(p: Proposal) -> Fit:
        rivals = [*fits, *found]
        starts = [*p.starts, *_grown(p.structure, rivals)]
        far_off = misled and is_poor(min(rivals, key=lambda f: f.objective), problem.spread)
        return best_of(problem, p.structure, starts, rivals, far_off=far_off)

    def explains(fit: Fit) -> bool:
        return owed_to_input(problem, fit, data) <= MATERIAL and fit.is_white

    near = [p for p in proposed if p.promising and p.error < PART**2]
    far = [p for p in proposed if p not in near]
    some, rest = ([g[i : i + _AT_ONCE] for i in range(0, len(g), _AT_ONCE)] for g in (near, far))
    for batch in [*some, [], *rest]:
        for p in batch:
            found.append(climbed(p))
        if not batch:  # modes in parallel after the proposals near the rough response
            late = min(proposed, key=lambda p: p.error).starts[0][0] if proposed else best.delay
            modes = members(structures, ("two_modes", *MODES))
            hopeless = PART * best.objective
            grown = grown_modes(problem, data, float(late), best.memory, modes, hopeless=hopeless)
            # Modes that explain only part of the residual fit a nonlinear effect.
            found += [f for f in grown if f.cost < PART * best.cost]
        best = min([best, *found], key=lambda fit: fit.objective)
        if explains(best):
            return found
    if shared or best.structure.integrators:
        return found
    for p in proposals(with_fit(data.rough_left(best), best), rich, best)[:_AT_ONCE]:
        fit = climbed(p)
        same = [f for f in found if f.structure == p.structure]
        if any(f.objective <= fit.objective for f in same):
            continue
        found = [*(f for f in found if f not in same), fit]
        if explains(fit):
            break
    return found


def fit_integrating(
    data: Data, problem: Problem, fits: list[Fit], structures: tuple[StructureName, ...]
) -> list[Fit]:
    """Fits of the structures that integrate, the plainest first, until one leaves white noise.

    The search also stops at one that explains next to nothing, as of an output that does not
    wander.
    """
    found: list[Fit] = []
    for structure in members(structures, INTEGRATING):
        useless = bool(found) and found[-1].objective > NEARLY * problem.spread
        if useless or sums_to_noise([*fits, *found]):
            break
        if not found:
            running_sum = np.cumsum(data.u - data.u[0])
            rough = rough_response(running_sum, data.y, longest_delay=longest_lag(data.y.size))
        rivals = [*fits, *found]
        starts = [*_grown(structure, rivals), *integrator_starts(rough, structure)]
        found.append(best_of(problem, structure, starts, rivals))
    return found


def sums_to_noise(fits: list[Fit]) -> bool:
    """Whether the best fit with an integrator leaves white noise, and little more than others do.

    If the output is white, a fit that explains nothing leaves white noise too.
    """
    integrating = [fit for fit in fits if fit.structure.integrators]
    best = min(integrating, key=lambda fit: fit.objective, default=None)
    least = min(fit.objective for fit in fits)
    return best is not None and best.objective < TWICE * least and best.is_white


def pruned(problem: Problem, fits: list[Fit], structures: tuple[StructureName, ...]) -> list[Fit]:
    """Plainer rich structures from the slowest poles of the leading fits, the richest first.

    A pole or zero that the record does not need may lie anywhere. Without it the others start
    close to their best values, where the rough response may have proposed nothing useful.
    """
    found: list[Fit] = []
    rich = members(structures, (*RICH, *INTEGRATING))
    for structure in sorted(rich, key=lambda s: -s.parameters):
        every = [*fits, *found]
        least = min(fit.objective for fit in every)

        def behind(fit: Fit, least: float = least) -> float:
            return problem.counted * float(np.log(fit.objective / least))

        near = [fit for fit in every if fit.objective < TWICE * least]
        above = [fit for fit in near if _holds(fit, structure)]
        if not above or any(f.structure == structure and behind(f) < 2 * CLEARLY for f in near):
            continue
        simplest = min(above, key=lambda f: (f.structure.parameters, f.objective))
        start = without_fast(simplest, structure)
        starts = [] if start is None else [start]
        if structure.dc_zeros > 1:  # the slowest poles of a rich fit need not be its own
            starts += _grown(structure, every)
        hopeless = TWICE * least
        for start in starts:
            taste = fit_structure(problem, structure, start, iterations=TASTE, hopeless=hopeless)
            if taste.objective < hopeless:
                fit = best_of(problem, structure, [taste.theta], near)
                if behind(fit) < 2 * CLEARLY:
                    found.append(fit)
                    break
    return found


def _holds(fit: Fit, plain: Structure) -> bool:
    """Whether a fit has all poles and zeros of a plainer structure, and more of either.

    A pole as slow as the record is long counts as an integrator.
    """
    rich = fit.structure
    few = plain.zeros <= rich.zeros and plain.dc_zeros >= rich.dc_zeros
    few = few and plain.order + plain.integrators <= rich.order + rich.integrators
    alike = plain.integrators == rich.integrators
    alike = alike or (plain.integrators > rich.integrators and almost_integrates(fit))
    return few and alike and plain.parameters < rich.parameters


def _grown(structure: Structure, fits: list[Fit]) -> list[Real]:
    """Starts from fits with one pole fewer, or of a high pass from first-order fits with a zero."""
    if structure.dc_zeros > 1:
        return [start for fit in fits if (start := _as_high_pass(fit)) is not None]
    return [
        with_pole(fit.structure, fit.theta, _PARTNER * scale_of(fit))
        for fit in fits
        if one_more_pole(fit.structure) == structure
    ]


def _as_high_pass(fit: Fit) -> Real | None:
    """Start of a second-order high pass from a first-order fit with a zero; None if it has none.

    At high frequencies both are about 1 - r/s, which gives r. The rough response hardly shows a
    corner near the end of the band, where it leaks.
    """
    if fit.structure.order != 1 or fit.structure.zeros != 1:
        return None
    below, above = fit.denominator, fit.numerator
    rate = 1.0 / below[1] - (above[0] / above[1] if above[1] else np.inf)
    return np.array([fit.delay, np.log(2.0 / rate), 0.5]) if rate > 0.0 else None


def best_of(
    problem: Problem,
    structure: Structure,
    starts: list[Real],
    rivals: list[Fit],
    *,
    far_off: bool = False,
) -> Fit:
    """The best of several starts, fitted to convergence if it may lead.

    Unless the rivals are `far_off`, a start is given up if its steps promise a fit that cannot
    compete with them by its residual or by Schwarz's criterion. In a coloured residual only some
    samples are independent; the precision refers to these.
    """
    leading = min(rivals, key=lambda fit: fit.objective)
    precision = CONVERGED / leading.share
    hopeless = np.inf if far_off else hopeless_beside(structure, rivals)
    count = problem.counted * leading.share
    own = structure.parameters
    paid = min(as_likely(fit, own, count, behind=0.0) for fit in rivals)
    if not far_off:  # fits that are about as likely are needed: the intervals cover them
        hopeless = min(hopeless, *(as_likely(fit, own, count) for fit in rivals))
    tried: list[Fit] = []
    for theta in starts:
        fit = fit_structure(
            problem,
            structure,
            theta,
            iterations=_LONG_TASTE,
            precision=precision,
            hopeless=hopeless,
        )
        tried.append(fit)
        if fit.converged and fit.is_white:
            break
    best = min(tried, key=lambda fit: fit.objective)
    best = in_best_sample(problem, best)
    if best.converged or best.objective > TWICE * leading.objective:
        return best
    return refit(problem, best, precision=precision, hopeless=min(hopeless, paid))


def in_best_sample(problem: Problem, best: Fit) -> Fit:
    """Move the delay one sample earlier or later while that improves the fit.

    Only where the delay is confined to one sample.
    """
    if not steps_through(best.structure, held=is_all_behind_hold(problem.source, best.structure)):
        return best
    for step in (-1.0, 1.0):
        while True:
            start = delayed(best.theta, step)
            hopeless = TWICE * best.objective
            other = fit_structure(problem, best.structure, start, hopeless=hopeless)
            if not other.objective < best.objective:
                break
            best = other
    return best


def owed_to_input(problem: Problem, fit: Fit, data: Data) -> float:
    """Share of the output (r.m.s.) by which the residual follows the input; 0 if by chance.

    Infinite where part of the response is missed, or much of the output is unexplained.
    """
    misfit, spread = data.misfit(fit), problem.spread
    owed = 0.0
    if misfit.probability < FALSE_ALARM:
        owed = float(np.sqrt(misfit.within * fit.cost / spread)) if spread else 0.0
        if owed <= MATERIAL and data.keeps_samples and _misses_part(problem, fit, data):
            owed = np.inf
    return np.inf if owed <= MATERIAL and is_poor(fit, spread) else owed


def is_poor(fit: Fit, spread: float) -> bool:
    """Whether much of the output is unexplained, and the residual is not white."""
    return fit.cost > PART * spread and not fit.is_white


def spans_record(fit: Fit) -> bool:
    """Whether a pole other than an integrator is about as slow as the record is long."""
    return almost_integrates(fit) and not fit.structure.integrators


def almost_integrates(fit: Fit) -> bool:
    """Whether the slowest pole is as slow as the record is long."""
    return slowest_time_constant(fit.denominator) > MUCH * fit.residual.size


def _misses_part(problem: Problem, fit: Fit, data: Data) -> bool:
    """Whether the response is missed where the output hardly moves, as at the end of a sweep."""
    span = slice(None)
    if problem.valid is not None:
        counted = np.flatnonzero(problem.valid)
        span = slice(int(counted[0]), int(counted[-1]) + 1)
        if counted.size < counted[-1] + 1 - counted[0]:
            return False  # a spectrum needs samples without gaps
    missed = unexplained_response(
        data.u[span], data.y[span], fit.residual[span], delay=fit.delay, band=data.band
    )
    return missed > FEW


def _without_second_pole(second_order: Fit) -> Real:
    """First-order start from a second-order fit: a fast second pole counts as delay."""
    delay, log_lag, shape = second_order.theta
    return np.array([delay + min(shape, 0.25) * np.exp(log_lag), log_lag])


def nested(first_order: Fit) -> Real:
    """Second-order start from a first-order fit: a quarter of its time constant becomes a pole."""
    return np.concatenate([first_order.theta, [0.1875]])  # (1 + 3/4 Ts)(1 + 1/4 Ts)
