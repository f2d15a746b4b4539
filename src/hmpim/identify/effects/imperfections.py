"""Saturation, data hold, rounding and lost samples (Fig. 1): detected, and included in the fit.

The first fit omits clipped samples and those between a hold's updates. Then the likelihood is
maximised, in which a clipped sample is one "beyond the level", and a held one counts at the instant
of its update (`hmpim.identify.effects.censored`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from hmpim.errors import RecordError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import BULK, DEVIATIONS
from hmpim.identify.effects.censored import CensoredFit, fit_censored
from hmpim.identify.effects.hold import Hold, Updates, detect_hold, updates
from hmpim.identify.effects.lost_samples import (
    find_frozen,
    find_repeated,
    find_spikes,
    find_stuck,
    stand_out,
)
from hmpim.identify.effects.quantization import Quantization, detect_quantization
from hmpim.identify.effects.saturation import Saturation, detect_saturation
from hmpim.identify.fitting.data import prepared
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.trial import JointFit, Trial, likeliest_of
from hmpim.identify.worth import FEW, NEARLY, ROUNDING, TWICE
from hmpim.model.dynamics import Structure
from hmpim.record import Intersample

__all__ = ["Imperfections", "find_imperfections", "refine"]

_FEWEST_LEVELS = 8
"""Fewest different values of an output, unless its input takes as few."""

_HEAD = 64
"""First samples, in which most outputs already take more values: a quick test."""

_ROUNDS = 3
"""Searches for spikes after the censored fit: large ones hide smaller ones."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Imperfections:
    """Imperfections detected in the output itself; None where there is none."""

    saturation: Saturation | None = None
    hold: Hold | None = None
    quantization: Quantization | None = None
    spikes: Mask | None = None
    frozen: Mask | None = None
    repeated: Mask | None = None
    unsure: Mask | None = None  # may be copies of samples that are lost
    levels: int | None = None

    def counts_other_samples_than(self, before: "Imperfections") -> bool:
        """Whether a clipped side appeared or vanished, or more samples are lost."""
        if _sides(self.saturation) != _sides(before.saturation):
            return True
        lost, known = self.lost, before.lost
        return lost is not None and bool(np.any(lost if known is None else lost & ~known))

    @property
    def lost(self) -> Mask | None:
        """Samples without information: spikes, copies, and standstills."""
        every = (self.spikes, self.frozen, self.repeated, self.unsure)
        masks = [mask for mask in every if mask is not None]
        return np.logical_or.reduce(masks) if masks else None

    @property
    def rounding(self) -> float:
        """R.m.s. rounding error; 0 if there is no rounding."""
        return 0.0 if self.quantization is None else self.quantization.noise_std

    def floor(self, y: Real) -> float:
        """R.m.s. rounding error of an output, (n,): that of its steps, or of the arithmetic."""
        return max(self.rounding, ROUNDING * float(np.std(y)))

    def arrivals(self, samples: int, fs: float) -> Updates | None:
        """Samples in which a held output is updated."""
        return None if self.hold is None else updates(self.hold, samples, fs)

    def informative(self, samples: int, fs: float) -> Mask | None:
        """Samples that show the output as it was; None if all do."""
        lost = self.lost
        if self.saturation is None and self.hold is None and lost is None:
            return None
        counts = np.ones(samples, dtype=bool)
        arrivals = self.arrivals(samples, fs)
        if arrivals is not None:
            counts[:] = False
            counts[arrivals.index] = True
        if self.saturation is not None:
            counts &= ~self.saturation.clipped
        if lost is not None:
            counts &= ~lost
        return counts

    def counting(self, valid: Mask, fs: float) -> Mask | None:
        """Samples that are valid and show the output as it was; None if all do."""
        shown = self.informative(valid.size, fs)
        if bool(valid.all()):
            return shown
        return valid if shown is None else np.asarray(valid & shown)


def find_imperfections(
    y: Real,
    fs: float,
    *,
    valid: Mask | None = None,
    prediction: Real | None = None,
    inputs: Sequence[Real] = (),
) -> Imperfections:
    """Look for saturation, hold, rounding, spikes and standstills in an output, (n,).

    Samples that are not `valid` were filled in, and lie on no grid. The prediction of a first model
    shows saturation, spikes and standstills. `inputs` show whether the output takes too few values,
    or stands still to its end; without them, neither is tested.
    """
    rounding = detect_quantization(y if valid is None or valid.all() else y[valid])
    step = 0.0 if rounding is None else rounding.step
    hold = detect_hold(y, fs, prediction)
    clipping = spikes = frozen = None
    if prediction is not None:
        levels = detect_saturation(y, prediction, step=step)
        clipping = levels if any(_sides(levels)) and levels.share <= NEARLY else None
    if prediction is None and hold is None:
        frozen = find_stuck(y, inputs)
    elif prediction is not None and hold is None:
        frozen = find_frozen(y, prediction, step=step)
        beyond = None if clipping is None else clipping.clipped
        spikes = find_spikes(y, prediction, clipped=beyond)
    repeated = find_repeated(y) if rounding is None and hold is None else None
    unsure = None
    if repeated is not None and valid is not None:  # a sample after a gap may be a copy
        unsure = np.asarray(valid & ~np.concatenate([[True], valid[:-1]]))
    return Imperfections(
        saturation=clipping,
        hold=hold,
        quantization=rounding,
        spikes=spikes,
        frozen=frozen,
        repeated=repeated,
        unsure=unsure,
        levels=_few_levels(y, inputs),
    )


def _sides(saturation: Saturation | None) -> tuple[bool, bool]:
    """Whether the output is clipped below, and above."""
    if saturation is None:
        return False, False
    return saturation.low is not None, saturation.high is not None


def _few_levels(y: Real, inputs: Sequence[Real]) -> int | None:
    """Number of values of the output, if it is small compared with the inputs'."""
    if not inputs or np.unique(y[:_HEAD]).size >= _FEWEST_LEVELS:
        return None
    levels = np.unique(y).size
    few = levels < _FEWEST_LEVELS and max(np.unique(u).size for u in inputs) > 2 * levels
    return levels if few else None


def refine(
    joint: JointFit, found: Imperfections, u: Real, fs: float, disturbance: Real | None = None
) -> tuple[JointFit, CensoredFit] | None:
    """Fit the chosen structure by maximum likelihood; None if nothing was clipped or held.

    `disturbance`, (n,), is the motion of the output apart from its input `u`, (n,), and has been
    subtracted.
    """
    if found.saturation is None and found.hold is None:
        return None
    problem = joint.problem
    whole = _gaps_only(problem, found, fs)
    if problem.begins is not None:  # until the initial state has decayed
        memory = int(np.ceil(joint.best.fit.memory))
        whole[: problem.begins + min(memory, problem.y.size // 4)] = False
    arrivals = found.arrivals(problem.y.size, fs)

    def assuming(mode: Intersample) -> Problem:
        if mode == joint.best.intersample:
            return problem
        return replace(problem, source=prepared(u, mode, rest=problem.begins is None))

    def censored_fit(mode: Intersample, start: Fit, counts: Mask) -> CensoredFit:
        read = replace(assuming(mode), valid=counts, nuisance=None, begins=None)
        return fit_censored(read, start, found.saturation, arrivals=arrivals, drift=disturbance)

    tried: list[tuple[Trial, CensoredFit]] = []
    for trial in _worth_refining(joint, found):
        try:
            censored = censored_fit(trial.intersample, trial.fit, whole)
        except RecordError:  # fewer samples inside the range than parameters
            continue
        price = trial.fit.structure.parameters * float(np.log(censored.index.size))
        tried.append((replace(trial, criterion=price - 2.0 * censored.log_likelihood), censored))
    if not tried:  # keep the first fit
        return None
    chosen = likeliest_of([trial for trial, _ in tried], "bandlimited")
    censored = next(one for trial, one in tried if trial is chosen)
    for _ in range(_ROUNDS):  # a clipped spike was taken for a sample of the plateau
        spikes = _spikes(censored, found.saturation)
        if spikes is None:
            break
        whole = np.asarray(whole & ~spikes)
        censored = censored_fit(chosen.intersample, censored.fit, whole)
    counted = np.zeros(problem.y.size, dtype=bool)
    counted[censored.index] = True
    fit = replace(censored.fit, residual=censored.fit.residual * counted)
    best = replace(chosen, fit=fit)
    final = replace(assuming(chosen.intersample), valid=counted)
    refined = replace(
        joint,
        problem=final,
        weighed=final,
        best=best,
        trials=_weighed_again(joint, tried, best),
        rivals=(),
        hidden=None,
    )
    return refined, censored


def _weighed_again(
    joint: JointFit, tried: list[tuple[Trial, CensoredFit]], best: Trial
) -> tuple[Trial, ...]:
    """All trials by the censored likelihood; the others shift with the one of their assumption."""
    again = {_kind(trial): replace(trial, fit=refined.fit) for trial, refined in tried}
    again[_kind(best)] = best
    moved = {
        trial.intersample: again[_kind(trial)].criterion - trial.criterion
        for trial in joint.trials
        if _kind(trial) in again
    }
    usual = moved.get(joint.best.intersample, 0.0)
    return tuple(
        again.get(_kind(trial))
        or replace(trial, criterion=trial.criterion + moved.get(trial.intersample, usual))
        for trial in joint.trials
    )


def _kind(trial: Trial) -> tuple[Intersample, Structure]:
    """Assumption on the input between samples, and structure of the dynamics."""
    return trial.intersample, trial.fit.structure


def _spikes(censored: CensoredFit, saturation: Saturation | None) -> Mask | None:
    """Single samples that the noise of a censored fit does not explain, (n,); None without any."""
    residual = censored.fit.residual
    inside = np.zeros(residual.size, dtype=bool)
    inside[censored.index] = True
    counted = residual[inside]
    if saturation is not None:
        inside &= ~saturation.clipped
    if not stand_out(counted) or not inside.any():
        return None
    bulk = float(np.median(np.abs(residual[inside]))) / BULK
    far = np.abs(residual) > TWICE * DEVIATIONS * bulk
    return far if 0 < np.count_nonzero(far) < FEW * counted.size else None


def _worth_refining(joint: JointFit, found: Imperfections) -> list[Trial]:
    """The chosen trial, and those that clipping may have made look worse.

    Samples inside the range are a biased selection: noise that would have led out of it is missing.
    The first fit may explain that by another assumption between the samples.
    """
    best = joint.best
    if found.saturation is None:
        return [best]
    between = [
        trial
        for trial in joint.trials
        if trial.intersample != best.intersample
        and trial.fit.structure == best.fit.structure
        and trial.fit.objective < TWICE * best.fit.objective
    ]
    return [best, *between]


def _gaps_only(problem: Problem, found: Imperfections, fs: float) -> Mask:
    """Samples that count, with clipped and held ones included again."""
    whole = np.ones(problem.y.size, dtype=bool) if problem.valid is None else problem.valid
    shown, lost = found.informative(problem.y.size, fs), found.lost
    if shown is not None:
        whole = np.asarray(whole | ~shown)
    return whole if lost is None else np.asarray(whole & ~lost)
