"""A quick beginning while samples still come: every plain structure, from the data alone.

What `choose` does with all the time there is, done with little of it: a few steps from each start,
and a few more from the best one of each structure. What is not at its end then goes on at the looks
that follow. The run begins at rest.
"""

from functools import partial

from hmpim.identify.fitting.candidates import nested
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.rows import Problem
from hmpim.identify.fitting.start import starting_values
from hmpim.identify.fitting.trial import trial_of
from hmpim.identify.statistics.choose import left_over
from hmpim.identify.statistics.fit import Fitted, fit_products
from hmpim.identify.statistics.products import Products
from hmpim.identify.statistics.start import rough_of
from hmpim.model.dynamics import STRUCTURES
from hmpim.record import Intersample

__all__ = ["begin"]

_TASTE = 2
"""Steps from each start before the best one is followed."""

_FARTHER = 8
"""Steps from there. A structure that needs more lies where the record hardly tells it: a look adds
a few more."""


def begin(products: Products, problem: Problem, intersample: Intersample) -> Fitted:
    """Fit every plain structure, each from starts of its own, and return the likeliest.

    Parameters
    ----------
    products : Products
        Of what was read; its noise is taken for white.
    problem : Problem
        From `hmpim.identify.statistics.fit.pulse`.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What that assumes.
    """
    rough = rough_of(products.statistics)
    fitted = partial(fit_products, products, problem, intersample)
    fits: list[Fitted] = []
    for name in PLAIN:
        structure = STRUCTURES[name]
        starts = starting_values(rough, structure, earliest=-2)
        if structure.order == 2:  # it is a first-order one too
            starts.append(nested(fits[-1].fit))
        tried = [fitted(structure, theta, iterations=_TASTE) for theta in starts]
        best = min(tried, key=lambda one: one.fit.objective)
        if not best.fit.converged:
            best = fitted(structure, best.fit.theta, iterations=_FARTHER)
        fits.append(best)
    least = min(fits, key=lambda one: one.fit.objective)
    count = products.counted * left_over(products, least).share
    return min(fits, key=lambda one: trial_of(intersample, one.fit, count).criterion)
