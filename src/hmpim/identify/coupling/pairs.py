"""The pairs of one output during the search: each input's fit, and all moved at once."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np

from hmpim.identify.arrays import Mask, Real, count_alike
from hmpim.identify.chance import SEARCHED
from hmpim.identify.coupling.joint_errors import common, gained_by
from hmpim.identify.fitting.beginning import REACH, begin_at, needs_free
from hmpim.identify.fitting.data import Counted, prepared
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.fit import fit_together as fit_all
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.whiteness import effective_share, is_white
from hmpim.identify.worth import PART, TWICE
from hmpim.model.dynamics import Structure
from hmpim.model.response import slowest_time_constant
from hmpim.model.sampled import PRECISION, WINDOW, interpolation_error

__all__ = ["Pairs", "constant_of", "contribution", "with_nuisance"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pairs:
    """The pairs of one output during the search; all but `y`, `valid` and `alike` change.

    `alike` is as for `fit_together`.
    """

    y: Real  # (n,)
    valid: Mask | None  # samples that count before any fit
    fits: dict[int, JointFit]
    strong: list[int]  # inputs that are no weak couplings, the strongest first
    alike: Sequence[tuple[frozenset[int], Mask]]
    masks: dict[int, Mask | None] = field(default_factory=dict)  # samples that each fit counts
    _searched: dict[int, tuple[Real, Mask | None]] = field(default_factory=dict)

    @property
    def kept(self) -> list[int]:
        """The inputs that the output is known to follow."""
        return [j for j, fit in self.fits.items() if fit.related]

    def without(self, some: Iterable[int]) -> Real:
        """The output without the contributions of some inputs."""
        parts = (contribution(self.fits[j]) for j in some if self.fits[j].related)
        return np.asarray(self.y - sum(parts, np.zeros(self.y.size)))

    def without_others(self, i: int) -> Real:
        """The output without the contributions of all inputs but one."""
        return self.without(j for j in self.fits if j != i)

    def free_of_others(self, i: int) -> Real:
        """Free responses of all strong inputs but one, (k, n), if they begin early."""
        rows = [np.zeros((0, self.y.size))]
        for j in self.strong:
            fit, begins = self.fits[j], self.fits[j].problem.begins
            if j != i and fit.related and begins is not None and self.is_early(begins):
                rows.append(part_of(fit.problem, fit.best.fit.structure, fit.best.fit.theta).free)
        return np.vstack(rows)

    def is_early(self, begins: int) -> bool:
        """Whether a free response that begins there leaves most samples to the other inputs."""
        return begins <= PART * self.y.size

    @property
    def cost(self) -> float:
        """Mean square of the residual."""
        rest, counts = self.residual(), self.counted(self.kept)
        return float(np.mean(np.square(rest if counts is None else rest[counts])))

    @property
    def spread(self) -> float:
        """Standard deviation of the output."""
        return float(np.std(self.y if self.valid is None else self.y[self.valid]))

    @property
    def structures(self) -> list[Structure]:
        """Of the strong inputs."""
        return [self.fits[i].best.fit.structure for i in self.strong]

    @property
    def dominant(self) -> set[int]:
        """Inputs whose motion is so large that an error of their model looks like a coupling."""
        least = PART * self.spread
        return {j for j in self.strong if float(np.std(contribution(self.fits[j]))) > least}

    def apart(self, problem: Problem, i: int) -> Problem:
        """A coupling's problem without the bins at which its input resembles another coupling's.

        There, the first to be fitted would explain a share of the other's response as well.
        """
        minor = [(group - self.dominant, bins) for group, bins in self.alike]
        shared = [bins for group, bins in minor if i in group and len(group) > 1]
        return _apart([problem], shared)[0]

    def put(self, i: int, fit: JointFit) -> None:
        """Store one input's fit and the samples it counts; an unrelated input masks none."""
        self.fits[i] = fit
        self.masks[i] = fit.problem.valid if fit.related else None

    def resume(self, led: Mapping[int, JointFit], nuisance: Real | None) -> None:
        """Start from fits to strong inputs, with `nuisance`, (k, n), as their rows.

        If they had other rows, which samples count is decided anew: it may have been decided
        wrongly. Only those before a free response do not count.
        """
        others = {i for i, fit in led.items() if not _has_nuisance(fit, nuisance)}
        for i, fit in led.items():
            self.put(i, with_nuisance(fit, nuisance) if i in others else fit)
            self.strong.append(i)
        if len(led) > 1 or others:
            self.refine(self.kept, None)
            self.masks.update({i: self._since(fit.problem.begins) for i, fit in led.items()})

    def _since(self, begins: int | None) -> Mask | None:
        """Samples from which a free response is known; before them, it grows without bound."""
        return None if begins is None else np.arange(self.y.size) >= begins

    def copied(self) -> Self:
        """An independent copy that remembers no full search."""
        fits, strong, masks = dict(self.fits), list(self.strong), dict(self.masks)
        return replace(self, fits=fits, strong=strong, masks=masks, _searched={})

    def is_new(self, i: int, rest: Real, counted: Mask | None) -> bool:
        """Whether an input's data differ from those of its last full search; if so, note them.

        A change with less power than one sample's noise moves no estimate by its error bar.
        """
        before = self._searched.get(i)
        if before is not None and count_alike(before[1], counted):
            change = rest - before[0]
            change = change if counted is None else change[counted]
            change = change - change.mean()  # the bias makes up for a constant
            if float(change @ change) <= self.cost:
                return False
        self._searched[i] = rest, counted
        return True

    def counted(self, some: Iterable[int]) -> Mask | None:
        """Samples at which the contributions of some inputs are known."""
        return common([self.valid, *(self.masks[j] for j in some)])

    def residual(self) -> Real:
        """The output without any contribution or constant; 0 where not known."""
        kept = self.kept
        best = self.fits[next((i for i in self.strong if i in kept), self.strong[0])]
        rest = self.without(self.fits) - constant_of(best)
        counts = self.counted(kept)
        return rest if counts is None else np.asarray(rest * counts)

    def refine(
        self, some: list[int], whitening: Real | None, y: Real | None = None
    ) -> tuple[list[Problem], list[Fit]]:
        """Move some fits at once to match the output, or another `y`, but for a bias."""
        if not some:
            return [], []
        y, valid = self.y if y is None else y, self.counted(some)
        before = [self.fits[j] for j in some]
        problems = [replace(fit.problem, y=y, valid=valid, whitening=whitening) for fit in before]
        begun = [fit.best.fit for fit in before]
        found = fit_all(problems, [f.structure for f in begun], [f.theta for f in begun])
        for k, j in enumerate(some):
            rows = before[k].problem.fixed()[1:]
            others = (one for one in found if one is not found[k])
            moved = (one.prediction - one.linear[-1] - one.nuisance @ rows for one in others)
            own = replace(before[k].problem, y=y - sum(moved, np.zeros(y.size)), valid=valid)
            share = effective_share(found[k].residual)
            moved_fit = before[k].with_fit(found[k])
            self.fits[j] = replace(moved_fit, problem=own, weighed=own, effective_share=share)
        return problems, found

    def free_states(self, inputs: Sequence[Real]) -> None:
        """Free the initial states of all strong inputs if the residual requires it.

        `inputs` are (n,). Each fit was made before the other inputs were known, and their motion
        hid its free response.
        """
        some = [i for i in self.strong if self.fits[i].related]
        strong = [self.fits[i] for i in some]
        resting = [fit for fit in strong if fit.problem.begins is None]
        modes = sum(fit.best.fit.structure.order for fit in resting)
        sampled = any(fit.best.fit.structure.sampled for fit in strong)
        if len(strong) < 2 or not modes or sampled or is_white(self.residual()):
            return
        begins = int(np.ceil(max(0.0, *(fit.best.fit.delay for fit in strong)))) + REACH
        given = Counted(valid=self.counted(self.kept), begins=None)
        later = begin_at(given, begins, self.y.size)
        if later is None or not self.is_early(later.first or 0):
            return
        fits, masks, before = dict(self.fits), dict(self.masks), self.residual()
        for i in some:
            self.put(i, _begun(self.fits[i], inputs[i], later))
        self.refine(self.kept, None)
        if not _explains(modes, before, self.residual(), self.counted(self.kept)):
            self.fits.update(fits)
            self.masks.update(masks)

    def together(self, whitening: Real | None, *, drop: bool = True) -> bool:
        """Move all couplings at once; drop the weakest if it adds nothing; return if dropped."""
        dominant = self.dominant
        moved = [j for j in self.kept if j not in dominant]
        weak = [j for j in moved if j not in self.strong]
        if not weak:
            return False
        problems, found = self.refine(moved, whitening, self.without(dominant))
        if not drop:
            return False
        gains = {}
        for j in weak:
            k = moved.index(j)
            shared = [bins for group, bins in self.alike if j in group and group & dominant]
            # If its corner is below a few periods of the record, a coupling only follows drifts.
            slowest = slowest_time_constant(found[k].denominator)
            slow = 2 * np.pi * slowest * TWICE > self.y.size
            gains[j] = 0.0 if slow else gained_by(_apart(problems, shared), found, k)
        least = min(weak, key=gains.__getitem__)
        if gains[least] > SEARCHED:
            return False
        self.fits[least] = replace(self.fits[least], related=False)
        return True


def _begun(fit: JointFit, u: Real, seen: Counted) -> JointFit:
    """The same fit, not yet refined, with the initial state of its input, (n,), unknown."""
    finer, precision = fit.problem.source.oversampling, PRECISION
    if fit.best.intersample == "bandlimited":
        missed = interpolation_error(u, finer)
        precision = missed if finer > 1 else max(missed, WINDOW)
    source = prepared(u, fit.best.intersample, rest=False, precision=precision)
    problem = replace(fit.problem, source=source, valid=seen.valid, begins=seen.first)
    return replace(fit, problem=problem, weighed=problem, forgotten=seen.first or 0)


def _explains(modes: int, before: Real, after: Real, counts: Mask | None) -> bool:
    """Whether free responses of so many modes lower a residual, (n,), by more than chance."""
    power, left = (rest if counts is None else rest[counts] for rest in (before, after))
    count = effective_share(left) * left.size
    return bool(needs_free(float(power @ power), float(left @ left), count, modes))


def _has_nuisance(fit: JointFit, nuisance: Real | None) -> bool:
    """Whether these rows, (k, n), are those of a fit."""
    own = fit.problem.nuisance
    if own is None or nuisance is None:
        return own is nuisance
    return np.array_equal(own, nuisance)


def with_nuisance(fit: JointFit, nuisance: Real | None) -> JointFit:
    """A fit with other rows, (k, n), that explain nothing yet."""
    problem = replace(fit.problem, nuisance=nuisance)
    weights = np.zeros(0 if nuisance is None else len(nuisance))
    best = replace(fit.best, fit=replace(fit.best.fit, nuisance=weights))
    return replace(fit, problem=problem, best=best, trials=(best,))


def contribution(fit: JointFit) -> Real:
    """Motion of the output by the input, without the bias and other rows."""
    return np.asarray(fit.best.fit.prediction - constant_of(fit))


def constant_of(fit: JointFit) -> Real:
    """Bias and other rows of a fit, shape (n,)."""
    best = fit.best.fit
    return np.asarray(best.linear[-1] + best.nuisance @ fit.problem.fixed()[1:])


def _apart(problems: list[Problem], shared: list[Mask]) -> list[Problem]:
    """The problems without the bins at which the input resembles a stronger one."""
    if not shared:
        return problems
    known = problems[0].whitening
    gain = np.ones(problems[0].y.size // 2 + 1) if known is None else known
    for bins in shared:
        gain = gain * ~bins
    return [replace(problem, whitening=gain) for problem in problems]
