"""Modes in parallel, grown one after the other from the peaks of what is left over.

The response is a sum of modes, Σ gₖ/Aₖ(s), behind a delay. Poles and delay held, the gains are
linear; a wrong delay turns each mode, and may turn its sign. So the poles are found first, each
mode free to turn by a residue of its own, g + hs for g (B. Gustavsen and A. Semlyen, IEEE Trans.
Power Delivery 14, 1999, fit residues and move poles as well). At those poles one sum over the
rough response tells the delays at which gains alone explain it, and from there all is moved
together. One more mode is placed where of all natural frequencies it explains most of the rest.
"""

from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.data import Data
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.start import RoughResponse
from hmpim.identify.worth import PART, PAST
from hmpim.model.dynamics import Structure

__all__ = ["grown_modes"]

_DAMPING = (0.02, 0.06, 0.2)
"""Damping ratios of the modes that are looked for."""

_FREQUENCIES = 200
"""Natural frequencies that they are looked for at, over the band."""

_DELAYS = 3
"""Delays to start from, the likeliest first."""

_FINE = 0.3
"""Steps of the delay turn the highest frequency by so much, in rad."""

_TASTE = 12
"""Steps from each start before the best is followed to its end."""


def grown_modes(problem: Problem, data: Data, best: Fit, structures: list[Structure]) -> list[Fit]:
    """Fits of sections in parallel, one more each time, until white noise is left.

    They are grown at the delay of the best fit so far, and once more at the delay that they come
    to themselves if that leaves more than noise, or a mode beyond the band: at a wrong delay some
    modes stand for it.

    Parameters
    ----------
    problem : Problem
        The data.
    data : Data
        Whose rough response the delay is looked for in.
    best : Fit
        The best fit so far, for its delay.
    structures : list of Structure
        Those that may be chosen, each of so many sections of order 2.
    """
    found: list[Fit] = []
    for again in (False, True) if structures else ():
        found += _grown(problem, data, best.delay, structures, known=again)
        if not found or (found[-1].is_white and _is_inside(found[-1], data)):
            break
        best = min(found, key=lambda fit: fit.objective)
    return [
        min((fit for fit in found if fit.structure == structure), key=lambda fit: fit.objective)
        for structure in structures
        if any(fit.structure == structure for fit in found)
    ]


def _is_inside(fit: Fit, data: Data) -> bool:
    """Whether all modes are where the record tells them."""
    c1, shape = np.exp(fit.theta[1::2]), fit.theta[2::2]
    return bool(np.all(PAST * data.rough.omega[-1] * c1 * np.sqrt(shape) > 1.0))


def _grown(
    problem: Problem, data: Data, delay: float, structures: list[Structure], *, known: bool
) -> list[Fit]:
    """Fits of one more section each time, while one more explains a good part of what is left."""
    named = {len(structure.sections): structure for structure in structures}
    found: list[Fit] = []
    theta, rough, least = np.array([delay]), data.rough, np.inf
    for count in range(1, max(named) + 1):
        sections = (2,) * count
        free = replace(structures[0], sections=sections, zeros=2 * count - 1, parallel=True)
        gains = named.get(count, replace(free, zeros=2 * count - 2))
        theta = np.concatenate([theta, _peak(rough)])
        held = replace(problem, shortest_delay=theta[0], longest_delay=theta[0])
        leading = fit_structure(held, gains if known else free, theta, iterations=_TASTE)
        starts = [leading.theta] if known else [theta, *_turned_back(data.rough, leading)]
        fit = min(
            (fit_structure(problem, gains, start, iterations=_TASTE) for start in starts),
            key=lambda fit: fit.objective,
        )
        if not fit.converged and fit.objective < leading.objective:
            fit = fit_structure(problem, gains, fit.theta)
        found += [fit] if count in named else []
        if not known and fit.objective < leading.objective:
            leading = fit
        if fit.is_white or leading.objective > (1.0 - PART) * least:
            break
        theta, least = leading.theta, leading.objective
        rough = data.rough_left(leading)
    return found


def _turned_back(rough: RoughResponse, fit: Fit) -> list[Real]:
    """Starts at a fit's poles and the likeliest delays."""
    poles = fit.theta[1:]
    return [np.append(late, poles) for late in _delays(rough, poles, fit.memory)]


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
        told = along / (np.abs(shapes) ** 2 @ weight)
        if told.max() > best:
            best, found = float(told.max()), theta[:, np.argmax(told)]
    return found


def _delays(rough: RoughResponse, theta: Real, memory: float) -> list[float]:
    """Delays in samples at which gains alone explain most of a response, the likeliest first.

    The lag of the greatest correlation is later than the delay, by no more than the memory.
    """
    shapes = _shapes(rough.omega, theta)
    weighted = shapes.conj() * rough.weight
    step = _FINE / rough.omega[-1]
    shifts = np.arange(max(rough.earliest - rough.lag, -memory), 2.0 + step, step)
    turns = np.exp(1j * np.outer(rough.omega, shifts))
    cross = ((weighted * rough.response) @ turns).real
    gains = np.linalg.lstsq((weighted @ shapes.T).real, cross, rcond=None)[0]
    told = np.concatenate([[-np.inf], np.sum(cross * gains, axis=0), [-np.inf]])
    tops = np.flatnonzero((told[1:-1] >= told[:-2]) & (told[1:-1] >= told[2:]))
    likeliest = tops[np.argsort(-told[1:-1][tops])][:_DELAYS]
    return [float(rough.lag + shifts[i]) for i in likeliest]
