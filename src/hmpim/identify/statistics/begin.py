"""A quick beginning while samples still come: every plain structure, from the data alone.

What `choose` does with all the time there is, done with little of it: a few steps from each start,
and a few more from the best one of each structure. What is not at its end then goes on at the looks
that follow. The run begins at rest.
"""

from dataclasses import replace
from functools import partial

from hmpim.identify.fitting.candidates import nested
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.start import starting_values
from hmpim.identify.fitting.trial import trial_of
from hmpim.identify.statistics.choose import left_over
from hmpim.identify.statistics.fit import Fitted, fit_products, pulse
from hmpim.identify.statistics.products import Products
from hmpim.identify.statistics.run import shortened
from hmpim.identify.statistics.start import rough_of
from hmpim.identify.statistics.statistics import Statistics
from hmpim.model.dynamics import STRUCTURES
from hmpim.record import Intersample

__all__ = ["begin", "only_told"]

_TASTE = 4
"""Evaluations from each start before the best one is followed."""

_FARTHER = 12
"""From there. A structure that needs more lies where the record hardly tells it: looks add more."""


def begin(statistics: Statistics, intersample: Intersample) -> Fit:
    """Fit every plain structure, each from starts of its own, and return the likeliest.

    Parameters
    ----------
    statistics : Statistics
        What was read, of one run from rest; its noise is taken for white.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What the input does between its samples.
    """
    short = only_told(statistics)
    products = Products(short, skipped=0)
    fitted = partial(fit_products, products, pulse(short.reach, intersample), intersample)
    rough = rough_of(short)
    fits: list[Fitted] = []
    for name in PLAIN:
        structure = STRUCTURES[name]
        starts = starting_values(rough, structure)
        if structure.order == 2:  # it is a first-order one too
            starts.append(nested(fits[-1].fit))
        tried = [fitted(structure, theta, evaluations=_TASTE) for theta in starts]
        best = min(tried, key=lambda one: one.fit.objective)
        if not best.fit.converged:
            best = fitted(structure, best.fit.theta, evaluations=_FARTHER)
        fits.append(best)
    least = min(fits, key=lambda one: one.fit.objective)
    count = products.counted * left_over(products, least).share
    return min(
        (one.fit for one in fits), key=lambda fit: trial_of(intersample, fit, count).criterion
    )


def only_told(statistics: Statistics) -> Statistics:
    """The same, without lags that are longer than the run: it tells nothing about them."""
    reach = replace(statistics.reach, lags=min(statistics.lags, statistics.samples))
    runs = tuple(shortened(run, reach) for run in statistics.runs)
    return replace(statistics, reach=reach, runs=runs)
