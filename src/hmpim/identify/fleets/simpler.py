"""Simpler structures beside that of a fleet, fitted to all its records at once.

`hmpim.identify` weighs them against the one that is chosen, and says by how much they are behind.
What such a structure makes of one stimulus is a surface of one or two parameters, held as
`hmpim.identify.fleets.learnt` holds that of the fleet.
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
"""Deviations between units that are allowed for anyway: samples, and the logarithm of a time."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Simpler:
    """One structure that is weighed against that of the fleet, as its natural `Member` is held.

    Its surface is a function of the fit's own parameters.
    """

    structure: Structure
    basis: Real
    surface: Surface


def learn_simpler(
    fleet: Fleet, pairs: Sequence[PairIdentification], outputs: Sequence[Real]
) -> tuple[Simpler, ...] | None:
    """Learn where the simpler structures lie; None where most were held against different ones.

    From what `identify` said of some records, and from their outputs, (n,).
    """
    tried = [
        frozenset(
            (c.structure, c.intersample)
            for c in pair.candidates
            if c.structure != fleet.structure.name
        )
        for pair in pairs
    ]
    # One whose first climb was not at its end is held against them under other assumptions as well.
    ordinary, count = Counter(tried).most_common(1)[0]
    if 2 * count < len(tried) or any(mode != fleet.natural for _, mode in ordinary):
        return None
    names: tuple[StructureName, ...] = tuple(n for n in STRUCTURES if n in {s for s, _ in ordinary})
    if any(STRUCTURES[name].order > 1 or STRUCTURES[name].parameters > 5 for name in names):
        return None
    usual = [output for output, own in zip(outputs, tried, strict=True) if own == ordinary]
    places = _places(fleet, usual, names)
    return tuple(_learnt(fleet, STRUCTURES[name], np.stack(own)) for name, own in places.items())


def _places(
    fleet: Fleet, outputs: Sequence[Real], names: tuple[StructureName, ...]
) -> dict[StructureName, list[Real]]:
    """Where the fit of each structure ends for each output; units are alike, so the first helps."""
    source, n = prepare_input(fleet.u, fleet.natural), fleet.u.size
    longest = longest_lag(n)
    problems = [
        Problem(source=source, y=y, valid=None, longest_delay=longest + 2.0) for y in outputs
    ]
    rough = rough_response(fleet.u, outputs[0], longest_delay=longest)
    starts = {
        fit.structure.name: fit.theta
        for fit in fit_plain(problems[0], rough, (fleet.structure.name, *names))
    }
    found: dict[StructureName, list[Real]] = {name: [] for name in names}
    for problem in problems:
        for name, ends in found.items():
            start = ends[0] if ends else starts[name]
            ends.append(fit_structure(problem, STRUCTURES[name], start).theta)
    return found


def _learnt(fleet: Fleet, structure: Structure, found: Real) -> Simpler:
    low, high = box_around(found, np.array(_LEAST[: found.shape[1]]))
    places = places_in(low, high, _DEGREE)
    source = prepare_input(fleet.u, fleet.natural)
    basis, values = in_basis(answers(source, structure, places))
    surface = Surface.fitted(low, high, places, values, degree=_DEGREE)
    return Simpler(structure=structure, basis=basis, surface=surface)


def costs_of(fleet: Fleet, one: Simpler, centred: Real, power: Real) -> Real:
    """Least sum of squares that a simpler structure leaves of each output, shape (k,).

    Of outputs less their means, (k, n), and of their sums of squares, (k,).
    """
    z = centred @ one.basis.T
    outside = np.maximum(power - np.vecdot(z, z), 0.0)
    surface = one.surface
    start = np.tile((surface.low + surface.high) / 2, (z.shape[0], 1))
    theta = descended(surface, z, outside, start, samples=fleet.u.size)
    g = surface.values(theta)[:, :-1]
    taken = np.vecdot(z, g) ** 2 / np.vecdot(g, g)
    return np.asarray(np.maximum(power - taken, 0.0))
