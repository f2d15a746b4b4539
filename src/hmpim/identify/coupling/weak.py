"""Weak couplings, fitted with the noise whitened.

The residual of an axis is seldom white: friction, drift and the tails of resonances are at low
frequencies, and a plain sum of squares would fit couplings to them. Here the residual's own
spectrum weights the sum of squares (generalised least squares: Söderström and Stoica, System
Identification, 1989, ch. 4). Only plain structures and a second-order high pass are tried: a
product of inertia turns one axis's acceleration into another's disturbance, which a servo rejects
at DC. The one with the smallest criterion of H. Akaike (IEEE Trans. Autom. Control 19, 1974) is
chosen: it keeps a barely significant pole, and so the wider error bars.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real, averaged
from hmpim.identify.chance import CLEARLY, searched
from hmpim.identify.fitting.candidates import in_best_sample, nested
from hmpim.identify.fitting.course import bridged
from hmpim.identify.fitting.data import TASTE
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.start import RoughResponse, rough_response, starting_values
from hmpim.identify.fitting.trial import JointFit, Trial
from hmpim.identify.noise.whiteness import effective_share, is_white
from hmpim.identify.section_iv.correlation import likeness
from hmpim.model.dynamics import STRUCTURES, StructureName
from hmpim.record import Intersample

__all__ = ["coupling_fit", "unsettled", "whitening_of"]

_COUPLED: tuple[StructureName, ...] = (*PLAIN, "second_order_high_pass")
"""Structures that a weak coupling may have."""

_SMOOTHED = 0.1
"""Half-width of the average over the residual's periodogram, as a share of the frequency."""

_NARROWEST = 10
"""Least half-width of that average, in bins."""

_FLOOR = 1e-8
"""Smallest power of the noise, relative to the mean power of the residual."""

_PARTS = 4
"""Parts of a window on either side of its middle."""

_ALIKE = 1e-6
"""Power, over the strongest in the window, below which an input, or what distinguishes two alike,
is left out."""

_STEPS = 25


def whitening_of(residual: Real, inputs: Sequence[Real] = (), *, late: float = 0.0) -> Real | None:
    """Gain at each bin that whitens a residual, (n // 2 + 1,); None if it is white already.

    The inverse root of its periodogram, averaged over a tenth of the frequency on either side. The
    residual, (n,), is 0 where a sample does not count. Whitened, the noise in it has unit variance;
    what follows any of the `inputs`, (n,), at a delay of about `late` samples, is not noise.
    """
    if is_white(residual):
        return None
    answer = scipy.fft.rfft(residual - residual.mean())
    power = np.abs(answer) ** 2 / residual.size
    power[0] = power[1]
    bins = np.arange(power.size)
    reach = np.maximum((_SMOOTHED * bins).astype(np.int64), _NARROWEST)
    smooth = _noise(answer, inputs, late, reach) if inputs else averaged(power, reach)
    return np.asarray(1.0 / np.sqrt(np.maximum(smooth, _FLOOR * power.mean())))


def _noise(answer: Complex, inputs: Sequence[Real], late: float, reach: NDArray[np.int64]) -> Real:
    """Power at each bin of what a local regression on the inputs leaves of a transform, (m,).

    One complex gain for each input and window (local methods of degree 0: Pintelon and Schoukens,
    System Identification, 2nd ed., Wiley 2012, ch. 7). The inputs are first delayed by `late`, so
    that the phase changes little within a window. Where a window has too few bins for that, all
    of the residual counts as noise.
    """
    edges = [1]
    while edges[-1] < reach.size:
        edges.append(min(edges[-1] + max(int(reach[edges[-1]]) // _PARTS, 1), reach.size))
    samples = inputs[0].size
    turn = np.exp(-2j * np.pi * late / samples * np.arange(reach.size))
    spectra = [scipy.fft.rfft(u - u.mean()) * turn for u in inputs]
    moved = [one / max(float(np.linalg.norm(one)), 1e-300) for one in spectra]
    window = np.ones(2 * _PARTS + 1)  # parts, as differences of running sums would cancel

    def around(first: Complex, second: Complex) -> Complex:
        parts = np.add.reduceat(first.conj() * second, edges[:-1])
        return np.asarray(np.convolve(parts, window, "same"), dtype=np.complex128)

    gram = np.array([[around(u, v) for v in moved] for u in moved]).transpose(2, 0, 1)
    cross = np.array([around(u, answer) for u in moved]).T
    gains = np.einsum("kij,kj->ki", np.linalg.pinv(gram, rcond=_ALIKE, hermitian=True), cross)
    count, whole = np.convolve(np.diff(edges), window, "same"), around(answer, answer).real
    rest = whole - np.einsum("ki,ki->k", cross.conj(), gains).real
    many = count > 2 * len(moved)
    power = np.where(many, rest, whole) / (count - many * len(moved)) / samples
    centres = 0.5 * (np.array(edges[:-1]) + np.array(edges[1:]) - 1.0)
    return np.asarray(np.interp(np.arange(reach.size), centres, power))


def coupling_fit(
    problem: Problem, u: Real, *, intersample: Intersample, structures: tuple[StructureName, ...]
) -> JointFit:
    """Fit the structures of a coupling to the output without the contributions of stronger inputs.

    The criteria use the problem's whitening; the problem that is returned is without it. The input
    has shape (n,), with its behaviour between samples as for the strongest input.
    """
    y = bridged(problem.y, problem.valid)
    # Both are whitened: their ratio stays, and noise at low frequencies hides no delay.
    plain = replace(problem, valid=None)
    longest, moves, answer = int(problem.longest_delay), plain.masked(u), plain.masked(y)
    rough = rough_response(moves, answer, longest_delay=longest)
    fits: list[Fit] = []
    tried = tuple(name for name in structures if name in _COUPLED) or _COUPLED
    for name in sorted(tried, key=lambda name: STRUCTURES[name].order):
        structure, seen = STRUCTURES[name], rough
        if structure.dc_zeros:  # a plain second order, driven by the input's acceleration
            faster = np.gradient(np.gradient(moves))
            if fits and not _correlates(faster, answer, longest):
                continue
            seen = rough_response(faster, answer, longest_delay=longest)
        elif structure.order > 1 and fits and not _hopeful(problem, fits):
            continue
        starts = starting_values(seen, structure, count=2, thorough=True)
        if structure.order == 2:
            simpler = [fit for fit in fits if fit.structure.name == "first_order"]
            starts += [nested(fit) for fit in simpler if not structure.dc_zeros]
            lag = fits[0].delay if fits and not structure.dc_zeros else float(seen.lag)
            starts += _resonances(seen, lag)
        found = [fit_structure(problem, structure, s, iterations=TASTE) for s in starts]
        best = min(found, key=lambda fit: fit.objective)
        if not best.converged:
            best = fit_structure(problem, structure, best.theta, iterations=_STEPS)
        fits.append(in_best_sample(problem, best))
    trials = tuple(
        Trial(intersample=intersample, fit=fit, criterion=_akaike(problem, fit)) for fit in fits
    )
    best_trial = min(trials, key=lambda trial: trial.criterion)
    unweighted = replace(problem, whitening=None)
    return JointFit(
        problem=unweighted,
        weighed=unweighted,
        best=best_trial,
        trials=trials,
        forgotten=0,
        effective_share=effective_share(best_trial.fit.residual),
        related=True,
    )


def _correlates(u: Real, y: Real, longest: int) -> bool:
    """Whether a whitened output correlates with an input at any lag up to `longest`."""
    power = float(np.var(u) * np.var(y)) * u.size**2
    share = likeness(u, y, longest).there ** 2 / power if power else 0.0
    gain = -0.5 * u.size * np.log1p(-min(share, 1.0 - 1e-12))
    return bool(gain > searched(longest + 1))


def _hopeful(problem: Problem, fits: list[Fit]) -> bool:
    """Whether a simpler structure explains anything, so that a richer one may explain more."""
    nothing = problem.masked(problem.y - fits[0].linear[-1])
    gain = np.log(float(nothing @ nothing) / max(min(fit.objective for fit in fits), 1e-300))
    return bool(0.5 * problem.counted * gain > CLEARLY)


def _resonances(rough: RoughResponse, lag: float) -> list[Real]:
    """Starting values with a resonance, which a noisy rough response does not show.

    Their phase at low frequencies is that of a delay by `lag`.
    """
    highest = float(np.sqrt(rough.weight @ rough.omega**4 / (rough.weight @ rough.omega**2)))
    starts = []
    for share in (0.3, 0.7, 1.5):
        slope = 2 * 0.4 / (share * highest)
        starts.append(np.array([max(lag - slope, 0.0), np.log(slope), 1 / (4 * 0.4**2)]))
    return starts


def unsettled(fit: JointFit) -> tuple[float, float]:
    """Variance of delay (samples²) and scale factor due to the choice of structure.

    By Akaike's weights of the structures (K. P. Burnham and D. R. Anderson, Model Selection and
    Multimodel Inference, 2nd ed., 2002, section 4.3), those of up to one pole taken together.
    """
    if fit.best.fit.structure.dc_zeros:  # no other has a scale factor of its kind
        return 0.0, 0.0
    alike = [t for t in fit.trials if not t.fit.structure.dc_zeros]
    richer = [t for t in alike if t.fit.structure.order > 1]
    plainer = [t for t in alike if t.fit.structure.order < 2]
    if not richer or not plainer:
        return 0.0, 0.0
    rich = min(richer, key=lambda t: t.criterion)
    simple = min(plainer, key=lambda t: t.criterion)
    apart = rich.criterion - CLEARLY - simple.criterion
    weight = 1.0 / (1.0 + np.exp(0.5 * np.clip(apart, -99, 99)))
    share = float(weight * (1.0 - weight))
    delay = rich.fit.delay - simple.fit.delay
    gain = float(rich.fit.linear[0] - simple.fit.linear[0])
    return share * delay**2, share * gain**2


def _akaike(problem: Problem, fit: Fit) -> float:
    tiny = np.finfo(float).tiny
    count = problem.counted
    price = 2 * fit.structure.parameters + (CLEARLY if fit.structure.order > 1 else 0.0)
    return float(count * np.log(max(fit.objective, tiny) / count) + price)
