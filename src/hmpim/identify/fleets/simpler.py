"""Simpler structures than that of a fleet, fitted to all its records at once.

`hmpim.identify` compares them with the chosen one. The outputs of such a structure are a surface of
one or two parameters, represented as in `hmpim.identify.fleets.learnt`.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.candidates import fit_plain
from hmpim.identify.fitting.fit import fit_structure
from hmpim.identify.fitting.rows import Problem
from hmpim.identify.fitting.start import rough_response
from hmpim.identify.fleets.fits import descended
from hmpim.identify.fleets.learnt import Fleet, answers, box_around, in_basis
from hmpim.identify.fleets.surface import Surface, places_in
from hmpim.identify.result import PairIdentification
from hmpim.identify.signals import longest_lag
from hmpim.model.dynamics import STRUCTURES, Structure, StructureName
from hmpim.model.sampled import prepare_input

__all__ = ["Simpler", "costs_of", "learn_simpler"]

_DEGREE = 9

_LEAST = (0.02, 0.005)
"""Least deviations between units that are assumed: samples, and the logarithm of a time."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simpler:
    """One simpler structure under the natural assumption, with a surface as of a `Member`.

    The surface is a function of the fit's own parameters.
    """

    structure: Structure
    basis: Real
    surface: Surface


def learn_simpler(
    fleet: Fleet, pairs: Sequence[PairIdentification], outputs: Sequence[Real]
) -> tuple[Simpler, ...] | None:
    """Learn the surfaces of simpler structures from results of `identify` and outputs, (n,).

    None where most records were compared with different structures.
    """
    tried = [
        frozenset(
            (c.structure, c.intersample)
            for c in pair.candidates
            if c.structure != fleet.structure.name
        )
        for pair in pairs
    ]
    # A record whose first fit had not converged is compared under other assumptions as well.
    ordinary, count = Counter(tried).most_common(1)[0]
    if 2 * count < len(tried) or any(mode != fleet.natural for _, mode in ordinary):
        return None
    names: tuple[StructureName, ...] = tuple(n for n in STRUCTURES if n in {s for s, _ in ordinary})
    if any(STRUCTURES[name].order > 1 or STRUCTURES[name].parameters > 5 for name in names):
        return None
    usual = [output for output, own in zip(outputs, tried, strict=True) if own == ordinary]
    source, longest = prepare_input(fleet.u, fleet.natural), longest_lag(fleet.u.size)
    problems = [Problem(source=source, y=y, valid=None, longest_delay=longest + 2.0) for y in usual]
    rough = rough_response(fleet.u, usual[0], longest_delay=longest)
    first = fit_plain(problems[0], rough, (fleet.structure.name, *names))
    starts = {fit.structure.name: fit.theta for fit in first}
    found = []
    for name in names:
        structure = STRUCTURES[name]
        own = [fit_structure(problems[0], structure, starts[name]).theta]
        own += [fit_structure(problem, structure, own[0]).theta for problem in problems[1:]]
        low, high = box_around(np.stack(own), np.array(_LEAST[: own[0].size]))
        places = places_in(low, high, _DEGREE)
        basis, values = in_basis(answers(source, structure, places))
        surface = Surface.fitted(low, high, places, values, degree=_DEGREE)
        found.append(Simpler(structure=structure, basis=basis, surface=surface))
    return tuple(found)


def costs_of(simpler: Simpler, centred: Real, power: Real) -> Real:
    """Least residual sum of squares of a simpler structure for each output, shape (k,).

    Given are outputs less their means, (k, n), and their sums of squares, (k,).
    """
    z, surface = centred @ simpler.basis.T, simpler.surface
    outside = np.maximum(power - np.vecdot(z, z), 0.0)
    start = np.tile((surface.low + surface.high) / 2, (z.shape[0], 1))
    theta = descended(surface, z, outside, start, samples=centred.shape[1])
    g = surface.values(theta)[:, :-1]
    explained = np.vecdot(z, g) ** 2 / np.vecdot(g, g)
    return np.asarray(np.maximum(power - explained, 0.0))
