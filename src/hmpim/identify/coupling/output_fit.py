"""One output, several inputs at once: each pair's fit with the others taken out.

The inputs that move the output most are fitted as if alone, each to what the others leave over;
what is weak beside them (`hmpim.identify.coupling.weak`) follows, with the noise whitened.
Then all pairs are moved at once. The error bars come from all pairs' derivatives together, so that
inputs that resemble each other widen them.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import SEARCHED
from hmpim.identify.coupling.lag import Lag, lag_of
from hmpim.identify.coupling.together import gained_by, joint_covariance
from hmpim.identify.coupling.weak import coupling_fit, whitening_of
from hmpim.identify.effects.drift import Drifting
from hmpim.identify.effects.gain import GainChange
from hmpim.identify.effects.hum import Humming
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.fitting.fit import fit_together as fit_all
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.whiteness import effective_share, is_white
from hmpim.identify.worth import NEARLY, PART, TWICE
from hmpim.model.dynamics import StructureName
from hmpim.model.response import slowest_time_constant
from hmpim.model.sampled import prepare_input
from hmpim.record import Intersample

__all__ = ["OutputFit", "fit_together"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputFit:
    """Fits of one output to each input.

    Parameters
    ----------
    fits : tuple of JointFit
        One for each input; its output is what the other inputs leave over.
    related : tuple of bool
        Whether the output follows that input at all.
    covariances : tuple of ndarray, shape (p_i, p_i)
        Of each fit's parameters, all fits considered together.
    strong : tuple of bool
        Whether the input's contribution is large beside the output, not a coupling.
    lags : tuple of Lag or None
        Delay and lag of couplings of no more than first order.
    drifting : Drifting or None
        The bias's drift, of an output to one input; the fit's output is without it.
    humming : Humming or None
        Its hum, likewise.
    steady : ndarray, shape (n,), or None
        Where it drifts, what a fit with a constant bias predicts.
    gaining : GainChange or None
        What is known of a gain that changes, of an output to one input.
    """

    fits: tuple[JointFit, ...]
    related: tuple[bool, ...]
    covariances: tuple[Real, ...]
    strong: tuple[bool, ...]
    lags: tuple[Lag | None, ...]
    drifting: Drifting | None = None
    humming: Humming | None = None
    steady: Real | None = None
    gaining: GainChange | None = None

    @classmethod
    def alone(cls, fit: JointFit, drifting: Drifting | None = None) -> "OutputFit":
        """Of an output to its one input."""
        return cls(
            fits=(fit,),
            related=(fit.related,),
            covariances=(),
            strong=(True,),
            lags=(None,),
            drifting=drifting,
        )

    @property
    def prediction(self) -> Real:
        """What all inputs together predict of the output, bias and drift included, shape (n,)."""
        first = self.fits[0].best.fit
        total: Real = np.full(first.prediction.size, first.linear[-1])
        for fit, told in zip(self.fits, self.related, strict=True):
            if told:
                total = total + _part(fit)
        return total if self.disturbance is None else total + self.disturbance

    @property
    def disturbance(self) -> Real | None:
        """What moves the output beside the model, shape (n,): drift, hum, a change of the gain."""
        trends = [one.trend for one in (self.drifting, self.humming) if one is not None]
        if self.gaining is not None and self.gaining.taken:
            trends.append(self.gaining.trend)
        return np.sum(trends, axis=0) if trends else None


def fit_together(
    inputs: list[Real],
    y: Real,
    *,
    valid: Mask | None,
    known: Mask | None,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    alike: Sequence[tuple[frozenset[int], Mask]] = (),
    nuisance: Real | None = None,
) -> OutputFit:
    """Fit one output to several inputs.

    Parameters
    ----------
    inputs : list of ndarray, shape (n,)
        Uniform samples of each input.
    y : ndarray, shape (n,)
        Uniform samples of the output.
    valid, known, intersample, structures
        As for `hmpim.identify.fitting.joint.joint_fit`; `known` is for all inputs together.
    alike : sequence of (frozenset of int, ndarray of bool, shape (n // 2 + 1,))
        Inputs that are not told apart, and the bins at which they are not. There a coupling is
        not told from what the stronger one's model lacks.
    nuisance : ndarray, shape (k, n), optional
        Rows beside the bias that enter linearly, such as a drift's.
    """

    def fitted(
        u: Real, rest: Real, names: tuple[StructureName, ...], *, growing: bool = True
    ) -> JointFit:
        return joint_fit(
            u,
            rest,
            valid=valid,
            known=known,
            intersample=intersample,
            structures=names,
            nuisance=nuisance,
            growing=growing,
        )

    if len(inputs) == 1:
        return OutputFit.alone(fitted(inputs[0], y, structures))
    plain = tuple(name for name in structures if name in PLAIN) or structures

    def plainly(u: Real, rest: Real) -> JointFit:
        return fitted(u, rest, plain, growing=False)

    fits = _strongest(inputs, y, valid, plainly)
    strong = tuple(fits)
    related = {i: fit.related for i, fit in fits.items()}
    if len(strong) > 1:  # each was fitted with the later ones unknown
        for i in strong:
            fits[i] = plainly(inputs[i], y - _others(fits, related, i))
            related[i] = fits[i].related
    _fit_couplings(inputs, y, fits, related, strong, plain, alike)
    before = [fits[i].best.fit.structure for i in strong]
    for i in strong:  # the couplings known
        fits[i] = fitted(inputs[i], y - _others(fits, related, i), structures)
        related[i] = fits[i].related
    if [fits[i].best.fit.structure for i in strong] != before:
        _fit_couplings(inputs, y, fits, related, strong, plain, alike)
    return _moved_at_once(y, fits, related, strong, alike)


def _moved_at_once(
    y: Real,
    fits: dict[int, JointFit],
    related: dict[int, bool],
    strong: tuple[int, ...],
    alike: Sequence[tuple[frozenset[int], Mask]],
) -> OutputFit:
    """All pairs moved together until none is left out, with the errors of all."""
    _refine(y, fits, [j for j in fits if related[j]], None)
    # What was not white may have been no noise but what one of them had not given back yet.
    whitening = whitening_of(_left(y, fits, related, strong))
    _refine(y, fits, [j for j in fits if related[j]], whitening)
    while _together(y, fits, related, strong, whitening, alike):
        _refine(y, fits, [j for j in fits if related[j]], whitening)
    kept = [j for j in fits if related[j]]
    pairs = [fits[j] for j in kept]
    told = dict(zip(kept, _covariances(pairs, whitening), strict=True))
    weak = [j for j in kept if j not in strong]
    everyone = range(len(fits))
    return OutputFit(
        fits=tuple(fits[j] for j in everyone),
        related=tuple(related[j] for j in everyone),
        covariances=tuple(told.get(j, np.zeros((0, 0))) for j in everyone),
        strong=tuple(j in strong for j in everyone),
        lags=tuple(_lag(pairs, kept.index(j), whitening) if j in weak else None for j in everyone),
    )


def _strongest(
    inputs: list[Real], y: Real, valid: Mask | None, fitted: Callable[[Real, Real], JointFit]
) -> dict[int, JointFit]:
    """Fit the inputs that move the output most, one after the other; at least one."""
    rest = y if valid is None else np.interp(np.arange(y.size), np.flatnonzero(valid), y[valid])
    spread = max(float(np.std(rest)), 1e-300)
    fits: dict[int, JointFit] = {}
    waiting = list(range(len(inputs)))
    while waiting:
        share = {j: _follows_at_all(inputs[j], rest) / spread for j in waiting}
        most = max(share.values())
        if fits and most < PART:
            break
        # A delayed copy of an input correlates as well; which one it is the fit tells.
        left = y - sum((_part(f) for f in fits.values()), np.zeros(y.size))
        tried = {j: fitted(inputs[j], left) for j in waiting if share[j] > NEARLY * most}
        i = min(tried, key=lambda j: tried[j].best.fit.cost)
        fit = tried[i]
        waiting.remove(i)
        part = _part(fit)
        if not fits or (float(np.std(part)) > PART * spread and fit.related):
            fits[i] = fit
            rest = rest - part
    return fits


def _follows_at_all(u: Real, y: Real) -> float:
    """Amplitude (r.m.s.) of the output that correlates with the input at the best lag."""
    first, second = u - u.mean(), y - y.mean()
    length = scipy.fft.next_fast_len(2 * u.size, real=True)
    crossed = scipy.fft.irfft(
        np.conj(scipy.fft.rfft(first, length)) * scipy.fft.rfft(second, length), length
    )[: u.size // 2]
    size = float(np.linalg.norm(first))
    return float(np.max(np.abs(crossed))) / max(size, 1e-300) / float(np.sqrt(u.size))


def _fit_couplings(
    inputs: list[Real],
    y: Real,
    fits: dict[int, JointFit],
    related: dict[int, bool],
    strong: tuple[int, ...],
    structures: tuple[StructureName, ...],
    alike: Sequence[tuple[frozenset[int], Mask]],
) -> None:
    """Fit, in place, all that is weak, the strongest first."""
    best = fits[strong[0]]
    mode = best.best.intersample
    weak = [j for j in range(len(inputs)) if j not in strong]
    if not weak:
        return
    latest = max(PART * y.size, 4.0 * best.best.fit.delay) + 2.0
    rest = _left(y, fits, related, strong)
    whitening = whitening_of(rest)
    sources = {j: prepare_input(inputs[j], mode) for j in weak}
    roughly = tuple(name for name in structures if name == "first_order") or structures
    known = all(j in fits for j in weak)
    for names in (structures,) if known else (roughly, structures):  # each whitened anew
        for j in sorted(weak, key=lambda j: -_follows_at_all(inputs[j], rest)):
            problem = Problem(
                source=sources[j],
                y=y - _others(fits, related, j),
                valid=best.problem.valid,
                longest_delay=latest,
                whitening=whitening,
            )
            fits[j] = coupling_fit(problem, inputs[j], intersample=mode, structures=names)
            related[j] = True
        # Not before all are right is one of them tested: alike, they take each other's share.
        while _together(y, fits, related, strong, whitening, alike, drop=names is structures):
            pass
        rest = _left(y, fits, related, strong)
        whitening = whitening_of(rest)


def _together(
    y: Real,
    fits: dict[int, JointFit],
    related: dict[int, bool],
    strong: tuple[int, ...],
    whitening: Real | None,
    alike: Sequence[tuple[frozenset[int], Mask]],
    *,
    drop: bool = True,
) -> bool:
    """Move all couplings at once, in place; leave out the least if it adds nothing and may go.

    Returns
    -------
    bool
        Whether one was left out.
    """
    weak = [j for j in fits if related[j] and j not in strong]
    if not weak:
        return False
    rest = y - _others({j: fits[j] for j in strong}, related, None)
    problems, found = _refine(rest, fits, weak, whitening)
    if not drop:
        return False
    gains = []
    for k, j in enumerate(weak):
        shared = [bins for group, bins in alike if j in group and group & set(strong)]
        gains.append(
            0.0 if _too_slow(found[k], y.size) else gained_by(_apart(problems, shared), found, k)
        )
    least = int(np.argmin(gains))
    if gains[least] > SEARCHED:
        return False
    related[weak[least]] = False
    return True


def _refine(
    y: Real, fits: dict[int, JointFit], some: list[int], whitening: Real | None
) -> tuple[list[Problem], list[Fit]]:
    """Move some of the fits at once, in place, to what `y` is but for a bias."""
    counted = np.logical_and.reduce(
        [np.ones(y.size, bool) if (v := fits[j].problem.valid) is None else v for j in some]
    )
    valid = None if bool(counted.all()) else counted
    problems = [replace(fits[j].problem, y=y, valid=valid, whitening=whitening) for j in some]
    begun = [fits[j].best.fit for j in some]
    found = fit_all(problems, [fit.structure for fit in begun], [fit.theta for fit in begun])
    parts = {j: fit.prediction - fit.linear[-1] for j, fit in zip(some, found, strict=True)}
    total = sum(parts.values(), np.zeros(y.size))
    for j, fit in zip(some, found, strict=True):
        trial = replace(fits[j].best, fit=fit)
        fits[j] = replace(
            fits[j],
            problem=replace(fits[j].problem, y=y - (total - parts[j])),
            weighed=replace(fits[j].problem, y=y - (total - parts[j])),
            best=trial,
            trials=tuple(trial if t is fits[j].best else t for t in fits[j].trials),
            effective_share=effective_share(fit.residual),
        )
    return problems, found


def _left(
    y: Real, fits: dict[int, JointFit], related: dict[int, bool], strong: tuple[int, ...]
) -> Real:
    """What all of them leave over."""
    best = fits[strong[0]]
    rest = y - _others(fits, related, None) - best.best.fit.linear[-1]
    counts = best.problem.valid
    return rest if counts is None else np.asarray(rest * counts)


def _too_slow(fit: Fit, samples: int) -> bool:
    """Whether a coupling is one of drifts only: its corner below a few periods of the record."""
    slowest = slowest_time_constant(fit.denominator)
    return bool(2 * np.pi * slowest * TWICE > samples)


def _apart(problems: list[Problem], shared: list[Mask]) -> list[Problem]:
    """The problems without the bins at which an input is not told from a stronger one."""
    if not shared:
        return problems
    known = problems[0].whitening
    gain = np.ones(problems[0].y.size // 2 + 1) if known is None else known
    for bins in shared:
        gain = gain * ~bins
    return [replace(problem, whitening=gain) for problem in problems]


def _others(fits: dict[int, JointFit], related: dict[int, bool], i: int | None) -> Real:
    """What the inputs other than one move the output by."""
    total: Real = np.zeros(next(iter(fits.values())).problem.y.size)
    for j, fit in fits.items():
        if j != i and related[j]:
            total = total + _part(fit)
    return total


def _part(fit: JointFit) -> Real:
    """What the input contributes to the output, the bias aside."""
    best = fit.best.fit
    return np.asarray(best.prediction - best.linear[-1])


def _lag(pairs: list[JointFit], k: int, whitening: Real | None) -> Lag | None:
    """Delay and lag of one of the pairs, if it is of no more than first order."""
    fit = pairs[k].best.fit
    if fit.structure.name not in ("static", "first_order"):
        return None
    problem, blocks = _derivatives([*pairs[:k], *pairs[k + 1 :]], whitening)
    others = np.vstack([*blocks, problem.masked(np.ones(fit.residual.size))])
    own = replace(pairs[k].problem, valid=problem.valid, whitening=whitening)
    return lag_of(own, fit, others)


def _derivatives(fits: list[JointFit], whitening: Real | None) -> tuple[Problem, list[Real]]:
    """Derivatives of each pair but by the bias, on the samples that count for all."""
    last = fits[-1].problem
    counted = np.ones(last.y.size, dtype=bool)
    for fit in fits:
        counted &= True if fit.problem.valid is None else fit.problem.valid
    problem = replace(last, valid=None if bool(counted.all()) else counted, whitening=whitening)
    return problem, [
        jacobian(replace(problem, source=fit.problem.source), fit.best.fit)[:-1] for fit in fits
    ]


def _covariances(fits: list[JointFit], whitening: Real | None) -> list[Real]:
    """Covariance of each pair's parameters and the bias, from all derivatives together."""
    if not fits:
        return []
    last = fits[-1]
    problem, blocks = _derivatives(fits, whitening)
    counted = np.ones(last.problem.y.size, dtype=bool) if problem.valid is None else problem.valid
    rows = np.vstack([*blocks, problem.masked(np.ones(counted.size))])
    residual = problem.masked(last.problem.y - last.best.fit.prediction)
    freedom = max(int(np.count_nonzero(counted)) - rows.shape[0], 1)
    white = whitening is not None or is_white(residual[counted])
    full = joint_covariance(rows, residual, freedom=freedom, white=white)
    end, start, out = rows.shape[0] - 1, 0, []
    for block in blocks:
        span = [*range(start, start + block.shape[0]), end]
        out.append(full[np.ix_(span, span)])
        start += block.shape[0]
    return out
