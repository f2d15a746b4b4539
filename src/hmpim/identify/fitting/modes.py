"""Modes in parallel, added one after the other at the peaks of the residual.

The response is a sum of modes, Σ gₖ/Aₖ(s), behind a delay. With poles and delay fixed, the gains
are linear. A wrong delay turns the phase of each mode, and may turn its sign. So the poles are
found first, with a free phase for each mode: g + hs instead of g (B. Gustavsen and A. Semlyen,
IEEE Trans. Power Delivery 14, 1999, fit residues and move poles as well). For those poles one sum
over the rough response gives the delays at which gains alone explain it, and from there all
parameters move together. A further mode starts at the natural frequency where it explains most of
the residual.
"""

from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.data import Data
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.spectral import condensed, fitted_roughly, residual_of
from hmpim.identify.fitting.start import RoughResponse, local_minima
from hmpim.identify.worth import FEW, PART, TWICE
from hmpim.model.dynamics import Structure

__all__ = ["grown_modes"]

_DAMPING = (0.02, 0.06, 0.2)
"""Damping ratios tried for a new mode."""

_FREQUENCIES = 200
"""Natural frequencies tried for a new mode, over the band."""

_DELAYS = 3
"""Delays to start from, the likeliest first."""

_FINE = 0.3
"""Phase of one step of the delay at the highest frequency, in rad."""

_STEPS = 20
"""Most steps on the rough response for each added mode."""

_TASTE = 12
"""Steps from each start before the best is fitted to convergence."""


def grown_modes(
    problem: Problem,
    data: Data,
    delay: float,
    memory: float,
    structures: list[Structure],
    *,
    hopeless: float,
) -> list[Fit]:
    """Fits of sections in parallel, as many as are needed to leave white noise.

    Modes are added on the rough response, first at `delay`, that of other fits, and if these leave
    more than noise again at their own delay: at a wrong delay some modes only make up for it. The
    delay may be earlier by up to `memory`, both in samples. Samples are fitted from the fewest
    modes on that come near the best.

    `structures` are those that may be chosen, each a number of sections of order 2. No fit with a
    sum of squares of `hopeless` or more is of use.
    """
    rough = condensed(data.rough)
    found: dict[Structure, Fit] = {}
    for known in (False, True) if structures else ():
        before, grown = np.inf, _grown(rough, delay, memory, structures, known=known)
        begun = [fit_structure(problem, s, start, iterations=0) for s, start in grown.items()]
        # If more modes leave much less even before they are fitted, fewer have no chance.
        least = min([hopeless, *(TWICE * fit.objective for fit in begun)])
        for fit in begun:
            structure = fit.structure
            fit = fit_structure(problem, structure, fit.theta, iterations=_TASTE, hopeless=least)
            found[structure] = min(fit, found.get(structure, fit), key=lambda f: f.objective)
            if fit.is_white or fit.objective > (1.0 - PART) * before:
                break
            before = fit.objective
        best = min(found.values(), key=lambda f: f.objective, default=None)
        if best is None or best.objective > TWICE * hopeless:
            break
        if best.is_white:
            return [*found.values(), *_with_fewer(problem, rough, best, structures)]
        delay = best.delay
    return list(found.values())


def _with_fewer(
    problem: Problem, rough: RoughResponse, fit: Fit, structures: list[Structure]
) -> list[Fit]:
    """Remove the least important section, one after the other, while white noise remains.

    Modes added one by one may need an extra one to make up for local minima.
    """
    named = {len(structure.sections): structure for structure in structures}
    found: list[Fit] = []
    while fit.is_white and len(fit.structure.sections) - 1 in named:
        sections = fit.theta[1:].reshape(-1, 2)
        plainer = named[len(sections) - 1]
        without = [np.delete(sections, k, axis=0).ravel() for k in range(len(sections))]
        starts = np.stack([np.append(fit.delay, others) for others in without])
        start = fitted_roughly(rough, plainer, starts, steps=_STEPS).likely[0]
        fit = fit_structure(problem, plainer, start)
        found.append(fit)
    return found


def _grown(
    rough: RoughResponse, delay: float, memory: float, structures: list[Structure], *, known: bool
) -> dict[Structure, Real]:
    """Parameters with one more section each time, from the fewest on that come near the best.

    Sections are added while each explains a good part of the residual, at a fixed delay: with a
    free phase, or with only a gain each if the delay is `known`.
    """
    named = {len(structure.sections): structure for structure in structures}
    found: dict[Structure, tuple[float, Real]] = {}
    theta, residual, least = np.array([delay]), rough, np.inf
    for count in range(1, max(named) + 1):
        sections = (2,) * count
        free = replace(structures[0], sections=sections, zeros=2 * count - 1, parallel=True)
        gains = named.get(count, replace(free, zeros=2 * count - 2))
        shape = gains if known else free
        theta = np.concatenate([theta, _peak(residual)])
        leading = fitted_roughly(rough, shape, theta[None], held=True, steps=_STEPS)
        poles = leading.likely[0][1:]
        late = [] if known else _delays(rough, poles, memory)
        starts = [leading.likely[0] if known else theta, *(np.append(one, poles) for one in late)]
        fit = fitted_roughly(rough, gains, np.stack(starts), steps=_STEPS)
        if count in named:
            found[gains] = fit.error, fit.likely[0]
        error = min(fit.error, leading.error)
        if error > (1.0 - FEW) * least:
            break
        if not known and fit.error < TWICE * leading.error:
            leading, shape = fit, gains
        theta, least = leading.likely[0], error
        residual = residual_of(rough, shape, theta)
    least = min((error for error, _ in found.values()), default=0.0)
    return {s: theta for s, (error, theta) in found.items() if PART**2 * error <= least}


def _shapes(omega: Real, theta: Real) -> Complex:
    """Responses 1/A of sections at radians per sample, shape (sections, m)."""
    c1 = np.exp(theta[::2])[:, None]
    c2 = theta[1::2][:, None] * c1**2
    return np.asarray(1.0 / (1.0 + 1j * omega * c1 - omega**2 * c2))


def _peak(rough: RoughResponse) -> Real:
    """Parameters of the section that explains most of a response, shape (2,)."""
    omega, weight = rough.omega, rough.weight
    natural = np.geomspace(omega[0], omega[-1], _FREQUENCIES)
    best, found = -1.0, np.zeros(2)
    for damping in _DAMPING:
        theta = np.stack([np.log(2 * damping / natural), np.full(natural.size, 0.25 / damping**2)])
        shapes = _shapes(omega, theta.T.ravel())
        along = np.abs(shapes.conj() @ (weight * rough.response)) ** 2
        explained = along / (np.abs(shapes) ** 2 @ weight)
        if explained.max() > best:
            best, found = float(explained.max()), theta[:, np.argmax(explained)]
    return found


def _delays(rough: RoughResponse, theta: Real, memory: float) -> list[float]:
    """Delays in samples at which gains alone explain most of a response, the likeliest first.

    The lag of the greatest correlation is later than the delay, by no more than the memory.
    """
    omega = rough.omega
    shapes = _shapes(omega, theta)
    weighted = shapes.conj() * rough.weight
    step = _FINE / omega[-1]
    shifts = np.arange(max(rough.earliest - rough.lag, -memory), 2.0 + step, step)
    # Every shift is the sum of one of few large ones and one of few small ones.
    few = int(np.ceil(np.sqrt(shifts.size)))
    large = np.exp(1j * np.outer(shifts[::few], omega))
    small = np.exp(1j * np.outer(shifts[:few] - shifts[0], omega)).conj().view(np.float64)
    along = (weighted * rough.response)[:, None, :] * large
    cross = (along.view(np.float64) @ small.T).reshape(len(along), -1)[:, : shifts.size]
    gains = np.linalg.lstsq((weighted @ shapes.T).real, cross, rcond=None)[0]
    likeliest = local_minima(-np.sum(cross * gains, axis=0), _DELAYS)
    return [float(rough.lag + shifts[i]) for i in likeliest]
