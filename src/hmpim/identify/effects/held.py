"""A model's output at the instants at which a held output was updated.

A sample with a new value shows the output as it was some part of a sample earlier, when it was
read. For the model that is one more delay, of another size at each sample. Responses are computed
at a few such delays and interpolated between them. If the period is a simple fraction, as 20/3
samples, only a few delays occur, and all are exact.
"""

from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.effects.hold import Updates
from hmpim.identify.fitting.derivatives import jacobian
from hmpim.identify.fitting.fit import Fit, Problem

__all__ = ["held_prediction", "rows_at_updates"]

_EXACT = 6
"""Up to so many different ages are computed one by one."""

_SMOOTH_NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(5) / 4)
"""Ages for a smooth input: interpolation of degree 4, Chebyshev nodes of the second kind."""

_HELD_NODES = np.linspace(0.0, 1.0, 17)
"""Ages for a held or linear input, whose response bends at the samples: linear interpolation."""


def _weights(age: Real, *, smooth: bool) -> tuple[Real, ...]:
    """Ages to compute at, shape (k,), and the weight of each for each sample, shape (k, m)."""
    distinct, which = np.unique(np.round(age, 6), return_inverse=True)
    if distinct.size <= _EXACT:
        return distinct, np.eye(distinct.size)[:, which]
    if not smooth:
        apart = np.abs(age - _HELD_NODES[:, None]) * (_HELD_NODES.size - 1)
        return _HELD_NODES, np.maximum(1.0 - apart, 0.0)
    nodes = _SMOOTH_NODES
    share = np.ones((nodes.size, age.size))
    for i, node in enumerate(nodes):
        for j, other in enumerate(nodes):
            if i != j:
                share[i] *= (age - other) / (node - other)
    return nodes, share


def rows_at_updates(problem: Problem, fit: Fit, arrivals: Updates) -> Real:
    """Derivatives of the output at each update with respect to `theta`, then `linear`, (p, m).

    The rows from `theta.size` on, times `linear`, are the output itself. `valid` is ignored.
    """
    whole = replace(problem, valid=None)
    nodes, share = _weights(arrivals.age, smooth=problem.source.degree > 1)
    rows = np.zeros((fit.theta.size + fit.linear.size, arrivals.index.size))
    for node, weight in zip(nodes, share, strict=True):
        theta = fit.theta.copy()
        theta[0] += node
        rows += weight * jacobian(whole, replace(fit, theta=theta))[:, arrivals.index]
    return rows


def held_prediction(values: Real, arrivals: Updates, samples: int) -> Real:
    """Repeat each update's value until the next, shape (samples,).

    Examples
    --------
    >>> arrivals = Updates(index=np.array([1, 3]), age=np.zeros(2))
    >>> held_prediction(np.array([5.0, 7.0]), arrivals, 5).tolist()
    [5.0, 5.0, 5.0, 7.0, 7.0]
    """
    last = np.searchsorted(arrivals.index, np.arange(samples), side="right") - 1
    return np.asarray(values[np.maximum(last, 0)])
