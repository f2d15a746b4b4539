"""Whether what a model leaves over still follows the input: a score test, from statistics alone.

Short responses of their own, one pair (cosine and sine) for each of several frequencies across the
excited band, are asked for beside all parameters of the model (C. R. Rao, Proc. Camb. Phil. Soc.
44, 1948). Under a right model what they gain is chi-squared.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.growth import HiddenPole, response_to_square
from hmpim.identify.fitting.least_squares import UNSEEN, solved
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.statistics.fit import Fitted
from hmpim.identify.statistics.products import Products, Responses
from hmpim.identify.statistics.reach import AHEAD

__all__ = ["Asked", "asked_of", "hidden_pole_of", "misfit_of"]

_GROUPS = 12
"""Frequencies that are asked for."""

_SEEN = 1e-6
"""Share of a direction that the model's own parameters leave, below which it is not asked for."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Asked:
    """Responses that are asked for about a delay, in samples, made once for several looks at a run.

    `rows` has shape (2 groups, taps); `transforms` are theirs, for products without a noise model.
    """

    delay: float
    rows: Real
    transforms: Complex


def asked_of(
    delay: float, band: tuple[float, float], products: Products, *, groups: int = _GROUPS
) -> Asked:
    """Cosines and sines behind a window about a delay, in samples; `band` as for `misfit_of`."""
    (low, high), taps = band, products.statistics.reach.taps
    lag = np.arange(taps) - AHEAD - delay
    width = groups / max(high - low, 1e-9)
    before, after = min(width, AHEAD + delay + 1.0), min(width, taps - AHEAD - delay)
    edge = np.where(lag < 0, before, max(after, 1.0))
    window = np.where(np.abs(lag) < edge, 0.5 + 0.5 * np.cos(np.pi * lag / edge), 0.0)
    centres = low + (high - low) * (np.arange(groups) + 0.5) / groups
    phase = 2 * np.pi * np.outer(centres, lag)
    rows = np.vstack([np.cos(phase), np.sin(phase)]) * window
    return Asked(delay=delay, rows=rows, transforms=products.transform(rows))


def misfit_of(
    fitted: Fitted, products: Products, band: tuple[float, float], *, asked: Asked | None = None
) -> Misfit:
    """Test whether the residual of a fit is still coherent with the input.

    Parameters
    ----------
    fitted : Fitted
        The fit.
    products : Products
        With what the fit leaves over whitened, so that its colour does no harm.
    band : (float, float)
        Excited band, in cycles per sample.
    asked : Asked, optional
        What is asked for, where it is known already: about the fit's own delay by default.
    """
    if asked is None:
        asked = asked_of(fitted.delay, band, products)
    gain, left, cost, *_ = _beside(fitted, products, asked.rows, asked.transforms)
    variance = cost / max(products.counted - fitted.weights.size - 1, 1)
    power_left = np.diag(left)
    size = np.sqrt(np.where(power_left > 1e-200 * power_left.max(), power_left, 1.0))
    values, vectors = np.linalg.eigh(left / np.outer(size, size))
    kept = values > _SEEN * values[-1]
    projected = (vectors.T @ (gain / size))[kept]
    power = float(np.sum(projected**2 / values[kept]))
    freedom = int(kept.sum())
    beyond = (power - freedom * variance) / cost
    return Misfit(
        share=max(beyond, 0.0), probability=float(scipy.special.chdtrc(freedom, power / variance))
    )


def hidden_pole_of(fitted: Fitted) -> HiddenPole:
    """Test a fit for one more pole, the delay shortened by as much.

    As `hmpim.identify.fitting.growth.hidden_pole`, from statistics. Of a pole's response that the
    model's own parameters imitate, products keep rounding alone.
    """
    row = response_to_square(fitted.problem, fitted)
    gain, left, _, shift, whole = _beside(fitted, fitted.products, row[None])
    size = max(float(left[0, 0]), UNSEEN * float(whole[0]), np.finfo(float).tiny)
    return HiddenPole(
        squared=float(gain[0]) / size,
        std=float(np.sqrt(fitted.variance / size)),
        shift=np.append(shift[:, 0], 0.0),  # the bias is solved apart
        fit=fitted,
    )


def _beside(
    fitted: Fitted, products: Products, asked: Real, known: Complex | None = None
) -> tuple[Real, Real, float, Real, Real]:
    """Try more responses in addition to a model.

    Returns their products with the residual, the products among them with the model's own rows
    projected out, the residual's power, how theta and the numerator change with their weights, and
    their power before anything was projected out.
    """
    count = asked.shape[0]
    both = Responses.ending(asked, asked.sum(axis=1)).and_also(fitted.responses)
    moments = products.moments(both, known=known)
    linear, mixed = fitted.weights, moments.gram[:count, count:]
    shift = -solved(moments.gram[count:, count:], mixed.T)
    left = moments.gram[:count, :count] + mixed @ shift
    residual = moments.cross - moments.gram[:, count:] @ linear
    gain = residual[:count] + shift.T @ residual[count:]
    cost = moments.energy - linear @ (moments.cross[count:] + residual[count:])
    least = float(np.finfo(float).eps * moments.energy)
    return gain, left, max(float(cost), least), shift, np.diag(moments.gram)[:count]
