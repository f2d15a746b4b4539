"""The joint fit: the data choose the structure and the assumption between the samples.

Each structure is fitted from starts that come from the data. The Bayesian information criterion
(G. Schwarz, Annals of Statistics 6, 1978) chooses, with fewer effective samples if the residual is
not white. The assumption between the samples is chosen by likelihood alone, since none costs a
parameter. If the input is smooth at this rate and the system filters it, held, linear and
band-limited inputs differ by little more than half a sample of delay, which no likelihood detects.
The input is then assumed band-limited, or held if it mostly stands still and jumps, unless the
record clearly contradicts it.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import ONE_SIDED
from hmpim.identify.fitting.beginning import in_motion, look_again
from hmpim.identify.fitting.between import refit_between
from hmpim.identify.fitting.candidates import is_poor
from hmpim.identify.fitting.course import (
    Course,
    completed,
    continue_between,
    enrich,
    find_beginning,
    free_from_wander,
    interpolate_finely,
    interpolated_for,
    is_unanswered,
    start,
    turn_ahead,
)
from hmpim.identify.fitting.data import Fits, polished, refit_all
from hmpim.identify.fitting.enrich import INTEGRATING, MODES, PLAIN, RICH
from hmpim.identify.fitting.feedforward_rows import may_be_fed_forward
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.growth import HiddenPole, grow, one_more_pole
from hmpim.identify.fitting.software import software_fit
from hmpim.identify.fitting.trial import JointFit, Trial, as_likely, likeliest_of, trial_of
from hmpim.identify.fitting.unrelated import LEAST_ANSWER
from hmpim.identify.fitting.whitening import weighed_by_noise
from hmpim.identify.fitting.zeros import SECOND_ZERO, mirrored, second_zeros
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import Structure, StructureName
from hmpim.record import BETWEEN, Intersample

__all__ = ["chosen_of", "fit_likeliest", "joint_fit"]

_LOOKS = 2
"""How often the samples that count are reconsidered, once there is a structure."""


def joint_fit(
    u: Real,
    y: Real,
    *,
    valid: Mask | None = None,
    known: Mask | None = None,
    intersample: Intersample | None = None,
    structures: tuple[StructureName, ...] = (*PLAIN, *RICH, *MODES, *INTEGRATING),
    nuisance: Real | None = None,
    growing: bool = True,
    shared: bool = False,
    small: int = 0,
) -> JointFit:
    """Fit every structure and keep the one that the record supports.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Uniform samples of input and output.
    valid : ndarray of bool, shape (n,), optional
        Output samples that count; all if None.
    known : ndarray of bool, shape (n,), optional
        Input samples that were measured, not filled in. The output does not count until it has
        forgotten filled-in samples. All if None.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'}, optional
        The input between samples, or 'sampled' for software, whose structures are filters; chosen
        by likelihood if None, 'feedforward' only with one input.
    structures : tuple of str
        Structures to try.
    nuisance : ndarray, shape (k, n), optional
        Rows, in addition to the bias, that enter linearly, such as a drift's.
    growing : bool
        Whether to test for further poles at the end.
    shared : bool
        Whether other inputs, whose fits are unfinished, move the output too: many poles need not
        leave white noise then.
    small : int
        How many of the last rows of `nuisance` explain little, so that spectra ignore them.

    Returns
    -------
    JointFit
    """
    if intersample == "sampled":
        return software_fit(u, y, valid, structures, nuisance)
    course = start(u, y, valid, known, intersample, structures, nuisance, shared, small)
    course = turn_ahead(course)
    course = free_from_wander(course)
    course = interpolate_finely(course)
    course = find_beginning(course)
    return chosen_of(course, structures, growing=growing)


def fit_likeliest(
    inputs: Mapping[int, Real],
    y: Real,
    *,
    valid: Mask | None,
    known: Mask | None,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    nuisance: Real | None = None,
) -> tuple[int, JointFit]:
    """Fit an output to each of several inputs; return the key and fit of the one explaining most.

    Inputs that cannot win are not fitted completely, and further poles are not tested. Inputs,
    (n,), and the rest are as for `joint_fit`.
    """
    found: dict[int, JointFit] = {}
    if intersample == "sampled":
        for j, u in inputs.items():
            found[j] = software_fit(u, y, valid, structures, nuisance)
        return _likeliest(found)
    courses = {
        j: turn_ahead(start(u, y, valid, known, intersample, structures, nuisance))
        for j, u in inputs.items()
    }
    least = np.inf
    for j in sorted(courses, key=lambda j: courses[j].best.cost):
        course = courses[j]
        moving = in_motion(course.data.u) and is_poor(course.best, course.problem.spread)
        if moving or course.best.cost < least:  # otherwise a complete fit seldom leaves less
            course = completed(free_from_wander(course))
            found[j] = chosen_of(course, structures, growing=False)
            least = min(least, found[j].best.fit.cost)
    return _likeliest(found)


def _likeliest(found: Mapping[int, JointFit]) -> tuple[int, JointFit]:
    """The fit that leaves least, with its key."""
    return min(found.items(), key=lambda item: item[1].best.fit.cost)


def chosen_of(
    course: Course,
    structures: tuple[StructureName, ...],
    *,
    growing: bool = True,
    fitted: Fits | None = None,
) -> JointFit:
    """Finish the search once the plain structures are fitted to the samples that count.

    The course has the plain fits under the natural assumption, and `fitted`, if known, those under
    each assumption; the rest is as for `joint_fit`.
    """
    fitted = fitted or continue_between(course)
    if is_unanswered(course, fitted):
        return give_up(course, fitted)
    course, fitted = enrich(course, fitted)
    course, trials, best, share = weigh_and_look_again(course, fitted)
    joint = settle(course, trials, best, share)
    return try_neighbours(joint, course, structures) if growing else joint


def settle(
    course: Course, trials: list[Trial], best: Trial, share: float, *, silent: bool = False
) -> JointFit:
    """The chosen trial among all, and the data with their noise model."""
    weighed = course.data.problem(best.intersample, course.counted)
    return JointFit(
        problem=weighed.plain,
        weighed=weighed,
        best=best,
        trials=tuple(trials),
        forgotten=course.counted.first or 0,
        effective_share=share,
        related=not silent
        and not course.data.is_unexplainable(weighed.plain, best.fit, least=LEAST_ANSWER),
        silent=silent,
    )


def weigh_and_look_again(course: Course, fitted: Fits) -> tuple[Course, list[Trial], Trial, float]:
    """Choose among all fits, and again where the best of them shows that other samples count.

    Zeros in front of the hold would explain ends of the record that do not count. So they are only
    tried once these are left out.
    """
    looked, trials, best, share = _looked_again(course, fitted)
    found = _fed_forward(looked, trials, _counting(looked, share))
    if found:
        best, trials = _chosen(looked, [*trials, *found], _counting(looked, share))
    return looked, trials, best, share


def _looked_again(course: Course, fitted: Fits) -> tuple[Course, list[Trial], Trial, float]:
    """Choose among all fits until the samples that count stay the same, or after two looks."""
    course, trials, best, share = _weigh(course, fitted)
    for _ in range(_LOOKS if course.data.keeps_samples else 0):
        data, seen = course.data, course.counted
        problem = data.problem(best.intersample, seen)
        rests = best.fit is course.settled
        again = look_again(problem, best, seen, lag=data.rough.lag, rests=rests, known=course.known)
        bandlimited = best.intersample == "bandlimited"
        finer = interpolated_for(course, best.fit) if bandlimited else None
        if (again, finer) == (None, None):
            break
        again = again or seen
        course = replace(course, counted=again, data=(finer or course).data.plain)
        chosen, most = (best.intersample, best.fit.structure), TWICE**2 * best.fit.cost
        others = [(mode, fit) for mode, fit in fitted if (mode, fit.structure) != chosen]
        others = [(m, f) for m, f in others if f.cost < most or f.structure.name in PLAIN]
        fitted = refit_all(course.data, [(best.intersample, best.fit), *others], again)
        course, trials, best, share = _weigh(course, fitted)
    return course, trials, best, share


def try_neighbours(
    joint: JointFit, course: Course, structures: tuple[StructureName, ...]
) -> JointFit:
    """Add poles and zeros that the likelihood supports, and record what it leaves open.

    Half a sample of delay, or a zero, may have replaced a missing pole: so poles are also added to
    other trials. Delay may also have put a zero into the wrong half plane, or replaced a servo's
    second one. The likeliest result leads.
    """
    rivals, ends = list[Trial](), list[tuple[Trial, HiddenPole]]()
    images = _mirrored(joint, course)
    found = [*joint.trials, *images]
    for trial in (joint.best, *images, *_others_to_grow(joint, course.natural)):
        grown, further, test = _grown_from(joint, trial, course, structures)
        found += grown
        rivals += further
        if grown or trial is joint.best or trial in images:
            ends.append(((trial, *grown)[-1], test))
    leading, hidden = min(ends, key=lambda end: end[0].criterion)
    if SECOND_ZERO in structures:
        mode = leading.intersample
        problem = course.data.problem(mode, course.counted)
        seconds = _trials_of(
            joint, mode, second_zeros(problem, leading.fit, hidden, count=joint.counted)
        )
        found += seconds
        white = (trial for trial in seconds if trial.fit.is_white)
        likeliest = min([leading, *white], key=lambda trial: trial.criterion)
        if likeliest is not leading:
            leading, hidden = likeliest, course.data.hidden_pole(problem, likeliest.fit)
    asked = [rival for rival in rivals if _is_better(rival, leading, joint)]
    joint = replace(joint, trials=tuple(found), rivals=tuple(asked), hidden=hidden)
    return joint if leading is joint.best else _with_leading(leading, joint, course)


def _trials_of(joint: JointFit, mode: Intersample, fits: Iterable[Fit]) -> list[Trial]:
    """Fits to all that a joint fit counts, with Schwarz's criterion."""
    return [trial_of(mode, fit, joint.counted) for fit in fits]


def _is_better(rival: Trial, leading: Trial, joint: JointFit) -> bool:
    """Whether a richer fit is better than the leading one by more than chance."""
    richer = rival.fit.structure.parameters > leading.fit.structure.parameters
    return richer and joint.gain(rival, leading) >= ONE_SIDED**2


def _mirrored(joint: JointFit, course: Course) -> list[Trial]:
    """The best trial with a zero in the other half plane, if that is about as likely."""
    best = joint.best
    problem = course.data.problem(best.intersample, course.counted)
    hopeless = as_likely(best.fit, best.fit.structure.parameters, joint.counted)
    return _trials_of(joint, best.intersample, mirrored(problem, best.fit, hopeless=hopeless))


def _others_to_grow(joint: JointFit, natural: Intersample) -> list[Trial]:
    """The likeliest natural trials without zeros and with them, except the best itself.

    If the best has zeros, instead of it the one with a pole fewer: a fit with zeros from its own
    start may have ended elsewhere.
    """
    own, most = joint.best.fit.structure, TWICE * joint.best.fit.objective
    hopeful = [t for t in joint.trials if t.intersample == natural and t.fit.objective < most]
    hopeful = [t for t in hopeful if t.fit.structure.integrators == own.integrators]
    found = []
    for with_zeros in (False, True):
        alike = [t for t in hopeful if bool(t.fit.structure.zeros) == with_zeros]
        if joint.best in alike:
            alike = [t for t in alike if with_zeros and one_more_pole(t.fit.structure) == own]
        if alike:
            found.append(min(alike, key=lambda trial: trial.criterion))
    return found


def _grown_from(
    joint: JointFit, trial: Trial, course: Course, structures: tuple[StructureName, ...]
) -> tuple[tuple[Trial, ...], tuple[Trial, ...], HiddenPole]:
    """Add poles to a trial: trials that beat one another, rivals, and the test of the last one."""
    mode = trial.intersample
    problem = course.data.problem(mode, course.counted)

    def otherwise(given: Fit) -> float:
        most = given.structure.parameters
        others = (t.fit for t in joint.trials if t.intersample != mode)
        plain = [fit.objective for fit in others if fit.structure.parameters <= most]
        return min(plain, default=np.inf)

    growth = grow(
        problem,
        trial.fit,
        hidden=course.data.hidden_pole,
        count=joint.counted,
        names=structures,
        otherwise=otherwise,
    )
    grown, rivals = (tuple(_trials_of(joint, mode, f)) for f in (growth.grown, growth.rivals))
    return grown, rivals, growth.hidden


def _with_leading(leading: Trial, joint: JointFit, course: Course) -> JointFit:
    """The joint fit with a grown trial as the best, polished and under each assumption."""
    mode = leading.intersample
    problem = course.data.problem(mode, course.counted)
    fit = polished(problem, leading.fit)
    trials = [trial for trial in joint.trials if trial is not leading]
    for other in () if course.alone else BETWEEN:
        if other != mode:
            moved = refit_between(course.data.problem(other, course.counted), fit, mode, other)
            trials.append(trial_of(other, moved, joint.counted))
    best = trial_of(mode, fit, joint.counted)
    fresh = settle(course, [*trials, best], best, joint.effective_share)
    return replace(fresh, rivals=joint.rivals, hidden=joint.hidden)


def give_up(course: Course, fitted: Fits) -> JointFit:
    """The plain fits, for an output that no model explains."""
    share = min((fit for _, fit in fitted), key=lambda f: f.objective).share
    trials = [trial_of(mode, fit, course.problem.counted * share) for mode, fit in fitted]
    return settle(course, trials, likeliest_of(trials, course.natural), share, silent=True)


def _weigh(course: Course, fitted: Fits) -> tuple[Course, list[Trial], Trial, float]:
    """Compare all fits under one noise model, and polish the best.

    Return the course with that model, all trials, the best trial, and the effective share.
    """
    data, seen = course.data, course.counted
    mode, leading = min(fitted, key=lambda item: item[1].objective)
    share = leading.share
    weighed = weighed_by_noise(data.problem(mode, seen), leading, data)
    if weighed.noise is not None or data.noise is not None:
        course = replace(course, data=weighed)
        fitted = refit_all(weighed, fitted, seen, hopeful=TWICE * leading.objective)
    count = _counting(course, share)
    trials = [trial_of(mode, fit, count) for mode, fit in fitted]
    best, trials = _chosen(course, trials, count)
    return course, trials, best, share


def _counting(course: Course, share: float) -> float:
    """Independent samples: all that count if the noise is whitened."""
    return course.problem.counted * (share if course.data.noise is None else 1.0)


def _chosen(course: Course, trials: list[Trial], count: float) -> tuple[Trial, list[Trial]]:
    """The likeliest trial, polished, and all trials with it."""
    chosen = likeliest_of(trials, course.natural)
    fit, problem = chosen.fit, course.data.problem(chosen.intersample, course.counted)
    best = trial_of(
        chosen.intersample, fit if fit is course.settled else polished(problem, fit), count
    )
    return best, [best if trial is chosen else trial for trial in trials]


def _fed_forward(course: Course, trials: list[Trial], count: float) -> list[Trial]:
    """Fit each servo structure with its zeros in front of the hold.

    If the best structure has no zeros, only those with no more parameters: richer ones would merely
    fit the ends of the record.
    """
    best = min(trials, key=lambda trial: trial.criterion).fit
    leading = best.structure
    if not _tries_feedforward(course) or leading.dc_zeros:
        return []
    most = np.inf if leading.zeros else leading.parameters
    known: set[Structure] = set()
    found: list[Trial] = []
    for trial in sorted(trials, key=lambda trial: trial.fit.objective):
        structure, mode = trial.fit.structure, trial.intersample
        if structure in known or not may_be_fed_forward(structure) or structure.parameters > most:
            continue
        known.add(structure)
        problem = course.data.problem("feedforward", course.counted)
        hopeless = as_likely(best, structure.parameters, count)
        fit = refit_between(
            problem, trial.fit, mode, "feedforward", iterations=40, hopeless=hopeless
        )
        found.append(trial_of("feedforward", fit, count))
    return found


def _tries_feedforward(course: Course) -> bool:
    """Whether zeros may turn out to act before the hold; with several inputs only if stated."""
    return not (course.alone or course.shared) and course.data.keeps_samples
