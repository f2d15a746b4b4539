"""Fits of every structure under one assumption: plain ones, and richer ones where asked for."""

from collections.abc import Iterator, Sequence

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY, FALSE_ALARM
from hmpim.identify.fitting.beginning import in_motion
from hmpim.identify.fitting.data import TASTE, Data, hopeless_beside
from hmpim.identify.fitting.enrich import (
    INTEGRATING,
    MODES,
    RICH,
    Proposal,
    about,
    integrator_starts,
    members,
    proposals,
    without_fast,
)
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.growth import FEW_POLES, one_more_pole, scale_of, with_pole
from hmpim.identify.fitting.held_steps import steps_through
from hmpim.identify.fitting.modes import grown_modes
from hmpim.identify.fitting.rows import STAMPED_LATE
from hmpim.identify.fitting.spectral import condensed, fitted_roughly
from hmpim.identify.fitting.start import RoughResponse, rough_response, searched, starting_values
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
"""Time constant of a pole that is added, over the fit's own."""

_AT_ONCE = 4
"""Richer structures tried before it is asked whether more are needed."""

_SLIPS = 4
"""Half periods by which the delay of a fit in mid-motion is moved either way, to start again."""

_PRECISION = 1e-2
"""Precision of a fit that is weighed against others, see `fit_structure`."""


def fit_plain(
    problem: Problem,
    rough: RoughResponse,
    structures: tuple[StructureName, ...],
    *,
    before: Sequence[Fit] = (),
) -> list[Fit]:
    """Fit each structure, the richest first, from its own starts and then from the simpler ones.

    The first start of a structure is where it ended `before`, on other samples, if it was fitted.
    A residual that is white needs no other start, and tells which simpler structures are
    hopeless: those get one start, and no step that does not lead near.
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
        hopeless = TWICE * hopeful if settled else np.inf
        fit = fit_structure(problem, structure, starts[0], iterations=TASTE, hopeless=hopeless)
        # A residual of noise for the most part is white whatever the model misses.
        noisy = fit.cost > MOST * problem.spread
        white = fit.objective < hopeful and fit.is_white
        if noisy:
            fit = _tasted(problem, searched(rough, structure), fit)
        if not white and fit.objective < TWICE**2 * hopeful:
            rivals = starts[1:]
            if not settled and structure.order and problem.begins is not None:
                # A climb on the rough response would follow the free response.
                more = starting_values(rough, structure)
                rivals += [t for t in more if not any(np.array_equal(t, s) for s in starts)]
            elif not settled and structure.order:
                every = np.stack([*starts, *starting_values(rough, structure)])
                rivals = list(fitted_roughly(condensed(rough), structure, every).likely)
            fit = _tasted(problem, rivals, fit)
            # Of an output that is ahead, the record does not hold the beginning either.
            underway = problem.begins is not None or fit.delay < STAMPED_LATE
            if not settled and structure.order and underway and not fit.is_white:
                fit = _tasted(problem, _slipped(rough, fit.theta), fit)
        settled = settled or white
        fits.append(fit)
    for i, fit in enumerate(fits):
        for other in fits:
            if _nests(other, fit):
                rival = fit_structure(problem, fit.structure, nested(other), iterations=TASTE)
                fits[i] = min(fits[i], rival, key=lambda f: f.objective)
    least = min(fit.objective for fit in fits)

    def ended(fit: Fit) -> Fit:
        if fit.objective > TWICE**2 * least:  # a start at most
            return fit.bare
        if fit.converged:
            return fit
        precision = _PRECISION / fit.share
        return fit_structure(problem, fit.structure, fit.theta, precision=precision)

    return [ended(fit) for fit in fits]


def _tasted(problem: Problem, starts: Sequence[Real], best: Fit) -> Fit:
    """The best of a fit and of a few steps from each other start that leads near it."""
    for theta in starts:
        hopeless = TWICE * best.objective
        rival = fit_structure(problem, best.structure, theta, iterations=TASTE, hopeless=hopeless)
        best = min(best, rival, key=lambda fit: fit.objective)
    return best


def _slipped(rough: RoughResponse, theta: Real) -> list[Real]:
    """Starts whose delay is some half periods of the input's mean frequency earlier or later.

    Beyond a resonance the phase hardly turns: a delay that is a period off leaves a valley of its
    own, and the free response hides which of them is the deepest.
    """
    mean = float(np.sqrt(rough.weight @ rough.omega**2 / rough.weight.sum()))
    steps = np.pi / mean * np.array([k for k in range(-_SLIPS, _SLIPS + 1) if k])
    return [np.append(theta[0] + step, theta[1:]) for step in steps]


def fit_rich(
    data: Data,
    problem: Problem,
    fits: list[Fit],
    structures: tuple[StructureName, ...],
    *,
    all_of_them: bool,
    shared: bool,
) -> list[Fit]:
    """Fits of the richer structures, the most promising first, until nothing is left to explain.

    And those that are a richer one without what the record does not need of it. Where the output is
    `shared` with inputs whose fits are unfinished, many poles need not leave white noise, but at
    most half the power that few leave.
    """
    found = _climbed(data, problem, fits, structures, all_of_them=all_of_them, shared=shared)
    found += pruned(problem, [*fits, *found], structures)
    if found and not min(found, key=lambda fit: fit.objective).is_white:
        # Poles without end, or as slow as the record, follow what no linear model describes:
        # friction, rounding.
        few = [f for f in found if f.structure.order <= FEW_POLES]
        enough = min((f.objective for f in [*fits, *few]), default=np.inf) / TWICE
        many = [f for f in found if shared and f not in few and f.objective < enough]
        found = [f for f in [*few, *many] if not spans_record(f)]
        if min(fits, key=lambda fit: fit.objective).is_white:
            # In a loop, noise returns through the input and looks like dynamics.
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
    """Fits of richer structures from the rough response, until nothing is left to explain.

    And, where that is not shared with other inputs, from what the best of them leaves over.
    """
    found = fit_integrating(data, problem, fits, structures)
    if sums_to_noise([*fits, *found]):
        return found
    best = min([*fits, *found], key=lambda fit: fit.objective)
    rich = members(structures, RICH)
    # A rough response that takes a free response for an answer proposes nothing that is of use.
    misled = data.keeps_samples and in_motion(data.u) and is_poor(best, problem.spread)
    proposed = proposals(data.rough, rich, best, all_of_them=all_of_them or misled)

    def climbed(p: Proposal) -> Fit:
        rivals = [*fits, *found]
        starts = [*p.starts, *_grown(p.structure, rivals)]
        far_off = misled and is_poor(min(rivals, key=lambda f: f.objective), problem.spread)
        return best_of(problem, p.structure, starts, rivals, far_off=far_off)

    def explains(fit: Fit) -> bool:
        return owed_to_input(problem, fit, data) <= MATERIAL and fit.is_white

    for some in _batches(proposed):
        for p in some:
            found.append(climbed(p))
        if not some:
            late = min(proposed, key=lambda p: p.error).starts[0][0] if proposed else best.delay
            modes = members(structures, ("two_modes", *MODES))
            hopeless = PART * best.objective
            grown = grown_modes(problem, data, float(late), best.memory, modes, hopeless=hopeless)
            # Two modes that explain part of what follows the input stand for what is not linear.
            found += [f for f in grown if f.cost < PART * best.cost]
        best = min([best, *found], key=lambda fit: fit.objective)
        if explains(best):
            return found
    if shared or best.structure.integrators:
        return found
    for p in proposals(about(data.rough_left(best), best), rich, best)[:_AT_ONCE]:
        fit = climbed(p)
        same = [one for one in found if one.structure == p.structure]
        if any(one.objective <= fit.objective for one in same):
            continue
        found = [*(one for one in found if one not in same), fit]
        if explains(fit):
            break
    return found


def fit_integrating(
    data: Data, problem: Problem, fits: list[Fit], structures: tuple[StructureName, ...]
) -> list[Fit]:
    """Fits of the structures that integrate, the plainest first, until one leaves white noise.

    Or explains next to nothing, of an output that does not wander. Those among `fits` are not
    fitted again.
    """
    found: list[Fit] = []
    for structure in members(structures, INTEGRATING):
        if sums_to_noise([*fits, *found]):
            break
        if found and found[-1].objective > NEARLY * problem.spread:
            break
        if any(fit.structure == structure for fit in fits):
            continue
        if not found:
            added = np.cumsum(data.u - data.u[0])
            rough = rough_response(added, data.y, longest_delay=longest_lag(data.y.size))
        rivals = [*fits, *found]
        starts = [*_grown(structure, rivals), *integrator_starts(rough, structure)]
        found.append(best_of(problem, structure, starts, rivals))
    return found


def sums_to_noise(fits: list[Fit]) -> bool:
    """Whether the best fit with an integrator leaves white noise, and no more than others do.

    Of a white output, one that explains nothing leaves white noise too.
    """
    integrating = [fit for fit in fits if fit.structure.integrators]
    if not integrating:
        return False
    best = min(integrating, key=lambda fit: fit.objective)
    return best.objective < TWICE * min(fit.objective for fit in fits) and best.is_white


def _batches(proposed: list[Proposal]) -> Iterator[list[Proposal]]:
    """Proposals a few at a time: those near the rough response, none for modes, then the rest.

    An empty batch stands for modes in parallel.
    """
    near = [p for p in proposed if p.promising and p.error < PART**2]
    far = [p for p in proposed if p not in near]
    for start in range(0, len(near), _AT_ONCE):
        yield near[start : start + _AT_ONCE]
    yield []
    for start in range(0, len(far), _AT_ONCE):
        yield far[start : start + _AT_ONCE]


def pruned(problem: Problem, fits: list[Fit], structures: tuple[StructureName, ...]) -> list[Fit]:
    """Plainer rich structures from the slowest poles of those near the lead, the richest first.

    A pole or a zero that the record does not need lies anywhere; without it the rest begins close
    to its best, where a rough response may have proposed nothing of use.
    """
    found: list[Fit] = []
    rich = members(structures, (*RICH, *INTEGRATING))
    for structure in sorted(rich, key=lambda one: -one.parameters):
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
        if start is None:
            continue
        hopeless = TWICE * least
        taste = fit_structure(problem, structure, start, iterations=TASTE, hopeless=hopeless)
        if taste.objective < hopeless:
            fit = best_of(problem, structure, [taste.theta], near)
            if -2 * CLEARLY < behind(fit) < 2 * CLEARLY:  # else it is in another valley
                found.append(fit)
    return found


def _holds(fit: Fit, plain: Structure) -> bool:
    """Whether a fit has at least a structure's poles and zeros, and more of either.

    A pole as slow as the record is long holds an integrator.
    """
    rich = fit.structure
    few = plain.zeros <= rich.zeros and plain.dc_zeros >= rich.dc_zeros
    few = few and plain.order + plain.integrators <= rich.order + rich.integrators
    alike = plain.integrators == rich.integrators
    if plain.integrators > rich.integrators:
        alike = almost_integrates(fit)
    return few and alike and plain.parameters < rich.parameters


def _grown(structure: Structure, fits: list[Fit]) -> list[Real]:
    """Starts from fits that have one pole less."""
    return [
        with_pole(fit.structure, fit.theta, _PARTNER * scale_of(fit))
        for fit in fits
        if one_more_pole(fit.structure) == structure
    ]


def best_of(
    problem: Problem,
    structure: Structure,
    starts: list[Real],
    rivals: list[Fit],
    *,
    far_off: bool = False,
) -> Fit:
    """The best of several starts, followed to its end if it may lead.

    Unless they are `far_off`, one whose steps promise no chance against its rivals is left. Of what
    is left over in colour few samples are independent: a step that gains less than one of those
    could tell is not worth making.
    """
    leading = min(rivals, key=lambda fit: fit.objective)
    precision = _PRECISION / leading.share
    hopeless = np.inf if far_off else hopeless_beside(structure, rivals)
    tried: list[Fit] = []
    for theta in starts:
        tried.append(
            fit_structure(
                problem,
                structure,
                theta,
                iterations=_LONG_TASTE,
                precision=precision,
                hopeless=hopeless,
            )
        )
        if tried[-1].converged and tried[-1].is_white:
            break
    best = min(tried, key=lambda fit: fit.objective)
    if steps_through(structure, held=problem.source.degree == 0):
        best = _best_sample(problem, best)
    if best.converged or best.objective > TWICE * leading.objective:
        return best
    count = problem.counted * leading.share
    price = float(np.log(count)) / count
    for fit in rivals:  # by Schwarz's criterion
        paid = np.exp(price * (fit.structure.parameters - structure.parameters))
        hopeless = min(hopeless, float(paid) * fit.objective)
    return fit_structure(problem, structure, best.theta, precision=precision, hopeless=hopeless)


def _best_sample(problem: Problem, best: Fit) -> Fit:
    """The best of a fit and those one sample earlier or later, until none is better."""
    for step in (-1.0, 1.0):
        while True:
            start = np.append(best.theta[0] + step, best.theta[1:])
            hopeless = TWICE * best.objective
            other = fit_structure(problem, best.structure, start, hopeless=hopeless)
            if not other.objective < best.objective:
                break
            best = other
    return best


def owed_to_input(problem: Problem, fit: Fit, data: Data) -> float:
    """Share of the output (r.m.s.) by which the residual follows the input; 0 if by chance.

    Infinite where a part of the response is missed, or much of the output is left over.
    """
    left, spread = data.misfit(fit), problem.spread
    owed = 0.0
    if left.probability < FALSE_ALARM:
        owed = float(np.sqrt(left.share * fit.cost / spread)) if spread else 0.0
        if owed <= MATERIAL and data.keeps_samples and _misses_part(problem, fit, data):
            owed = np.inf
    return np.inf if owed <= MATERIAL and is_poor(fit, spread) else owed


def is_poor(fit: Fit, spread: float) -> bool:
    """Whether much of the output is left over, and it is no white noise."""
    return fit.cost > PART * spread and not fit.is_white


def spans_record(fit: Fit) -> bool:
    """Whether a pole that is no integrator is about as slow as the record is long."""
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
            return False  # spectra do not bear gaps
    missed = unexplained_response(
        data.u[span], data.y[span], fit.residual[span], delay=fit.delay, band=data.band
    )
    return missed > FEW


def _nests(simple: Fit, rich: Fit) -> bool:
    """Whether the simpler structure is a start for a richer one that may have missed its best."""
    return (
        simple.structure.name == "first_order"
        and rich.structure.name == "second_order"
        and (simple.objective <= rich.objective or not rich.is_white)
    )


def _without_second_pole(second_order: Fit) -> Real:
    """First order from second: a fast second pole counts as delay."""
    delay, log_lag, shape = second_order.theta
    return np.array([delay + min(shape, 0.25) * np.exp(log_lag), log_lag])


def nested(first_order: Fit) -> Real:
    """First order as second: a quarter of its time constant moved into a second pole."""
    return np.concatenate([first_order.theta, [0.1875]])  # (1 + 3/4 Ts)(1 + 1/4 Ts)
