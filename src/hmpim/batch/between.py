"""Spread between units: how much they differ beyond what their error bars explain.

The model of random effects: what is found of unit i scatters about the fleet's mean with variance
τ² + sᵢ², sᵢ its own standard error. τ² is estimated by restricted maximum likelihood and has an
interval by the Q-profile (W. Viechtbauer, Journal of Educational and Behavioral Statistics 30,
2005; Statistics in Medicine 26, 2007).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError

__all__ = ["Between", "between_units"]

Real = NDArray[np.float64]

_STEPS = 200
_SETTLED = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True)
class Between:
    """A fleet's mean, and the spread between its units.

    Parameters
    ----------
    units : int
        How many.
    mean, mean_std : float
        Of the fleet, and its standard error.
    spread : float
        Standard deviation between units beyond their error bars, τ.
    spread_ci95 : (float, float)
        Its 95 % interval; (0, ...) where the error bars may explain all.
    share : float
        Share of the variance that lies between units, 0 to 1.
    """

    units: int
    mean: float
    mean_std: float
    spread: float
    spread_ci95: tuple[float, float]
    share: float


def between_units(values: Real, errors: Real) -> Between:
    """Tell the spread between units from their error bars.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One of each unit; at least two.
    errors : ndarray, shape (n,)
        Standard errors, positive.

    Raises
    ------
    ArgumentError
        For fewer than two units, or errors that are not positive.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> errors = np.full(400, 0.1)
    >>> values = 5 + 0.3 * rng.standard_normal(400) + errors * rng.standard_normal(400)
    >>> found = between_units(values, errors)
    >>> round(found.mean, 1), round(found.spread, 1), found.spread_ci95[0] > 0.2
    (5.0, 0.3, True)
    """
    if values.size < 2 or values.size != errors.size:
        raise ArgumentError(f"{values.size} units and {errors.size} errors; give two units or more")
    if not (np.isfinite(values).all() and np.isfinite(errors).all() and (errors > 0).all()):
        raise ArgumentError("values must be finite and errors positive; leave out the others")
    # In units of their own scatter, so that nothing depends on the unit.
    middle = float(np.median(values))
    scale = float(np.std(values)) or float(errors.mean())
    x, variance = (values - middle) / scale, (errors / scale) ** 2
    between = _restricted(x, variance)
    weights = 1.0 / (variance + between)
    mean = float(weights @ x / weights.sum())
    low, high = (_profiled(x, variance, level) for level in (0.025, 0.975))
    inner = float((x.size - 1) / _typical(variance))
    return Between(
        units=x.size,
        mean=middle + scale * mean,
        mean_std=scale / float(np.sqrt(weights.sum())),
        spread=scale * float(np.sqrt(between)),
        spread_ci95=(scale * float(np.sqrt(low)), scale * float(np.sqrt(high))),
        share=between / (between + inner) if between else 0.0,
    )


def _restricted(x: Real, variance: Real) -> float:
    """τ² by restricted maximum likelihood: Fisher's scoring, held at 0."""
    between = max(float(x.var(ddof=1) - variance.mean()), 0.0)
    for _ in range(_STEPS):
        w = 1.0 / (variance + between)
        mean = w @ x / w.sum()
        gain = w**2 @ ((x - mean) ** 2 - variance) / (w**2).sum() + 1.0 / w.sum()
        after = max(float(gain), 0.0)
        if abs(after - between) < _SETTLED:
            return after
        between = after
    return between


def _profiled(x: Real, variance: Real, level: float) -> float:
    """τ² at which the generalised Q is the quantile of chi-squared that the level asks for."""
    wanted = float(scipy.special.chdtri(x.size - 1, level))

    def off(between: float) -> float:
        w = 1.0 / (variance + between)
        mean = w @ x / w.sum()
        return float(w @ (x - mean) ** 2) - wanted

    if off(0.0) <= 0.0:
        return 0.0
    top = 1.0
    while off(top) > 0.0:
        top *= 4.0
    return float(scipy.optimize.brentq(off, 0.0, top))


def _typical(variance: Real) -> float:
    """One over the typical variance within, times units less one (Higgins and Thompson, 2002).

    Σw - Σw²/Σw as a sum over pairs: where one weight is nearly all, the difference is rounding.
    """
    w = np.sort(1.0 / variance)
    return float(2.0 * (w[1:] / w.sum()) @ np.cumsum(w)[:-1])
