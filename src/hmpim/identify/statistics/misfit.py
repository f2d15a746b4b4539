"""Whether the residual of a model still follows the input: a score test, from statistics alone.

The test adds short responses to all parameters of the model, a cosine and a sine for each of
several frequencies across the excited band (C. R. Rao, Proc. Camb. Phil. Soc. 44, 1948). Under a
right model their gain is chi-squared.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.fitting.growth import HiddenPole, response_to_square
from hmpim.identify.fitting.least_squares import UNSEEN, added, explained
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.statistics.fit import Fitted
from hmpim.identify.statistics.products import Products, Responses
from hmpim.identify.statistics.reach import AHEAD

__all__ = ["TESTABLE", "Probes", "explained_by", "hidden_pole_of", "misfit_of", "probes_at"]

_GROUPS = 12
"""Frequencies that are tested."""

TESTABLE = 1e-6
"""Share of the largest direction, or of its own power, below which a direction is not tested,
because the model's parameters explain it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Probes:
    """Responses that are tested, (2 groups, taps), about a delay in samples, and their transforms.

    They are made once for several looks at a run; the transforms are without a noise model.
    """

    delay: float
    rows: Real
    transforms: Complex


def probes_at(
    delay: float, band: tuple[float, float], products: Products, *, groups: int = _GROUPS
) -> Probes:
    """Cosines and sines within a window about a delay in samples; the band is as in `misfit_of`."""
    (low, high), taps = band, products.statistics.reach.taps
    lag = np.arange(taps) - AHEAD - delay
    width = groups / max(high - low, 1e-9)
    before, after = min(width, AHEAD + delay + 1.0), min(width, taps - AHEAD - delay)
    edge = np.where(lag < 0, before, max(after, 1.0))
    window = np.where(np.abs(lag) < edge, 0.5 + 0.5 * np.cos(np.pi * lag / edge), 0.0)
    centres = low + (high - low) * (np.arange(groups) + 0.5) / groups
    phase = 2 * np.pi * np.outer(centres, lag)
    rows = np.vstack([np.cos(phase), np.sin(phase)]) * window
    return Probes(delay=delay, rows=rows, transforms=products.transform(rows))


def misfit_of(
    fitted: Fitted, products: Products, band: tuple[float, float], probes: Probes
) -> Misfit:
    """Test whether the residual of a fit is still coherent with the input.

    The products are those that whiten the residual, so that its colour does not matter; the excited
    band is in cycles per sample.
    """
    gain, left, cost, *_ = _in_addition(fitted, products, probes.rows, probes.transforms)
    power, count = explained(left, gain, least=TESTABLE)
    freedom = products.counted - fitted.weights.size - 1
    return explained_by(float(power), int(count), cost, freedom)


def explained_by(power: float, count: int, cost: float, freedom: int) -> Misfit:
    """Compare the power that so many directions explain with the noise's.

    `cost` is the sum of squares of the residual, and `freedom` its degrees of freedom.
    """
    variance = cost / max(freedom, 1)
    share = max((power - count * variance) / cost, 0.0)
    return Misfit(
        share=share,
        within=share,
        probability=float(scipy.special.chdtrc(count, power / variance)),
    )


def hidden_pole_of(fitted: Fitted) -> HiddenPole:
    """Test a fit for one more pole, the delay shortened by its time constant, from statistics.

    This is `hmpim.identify.fitting.growth.hidden_pole` without samples. Where the model's own
    parameters imitate the response of a pole, the products contain rounding alone.
    """
    row = response_to_square(fitted.problem, fitted)
    gain, left, _, shift, whole = _in_addition(fitted, fitted.products, row[None])
    size = max(float(left[0, 0]), UNSEEN * float(whole[0]), np.finfo(float).tiny)
    return HiddenPole(
        squared=float(gain[0]) / size,
        std=float(np.sqrt(fitted.variance / size)),
        shift=np.append(shift[:, 0], 0.0),  # the bias is solved separately
        fit=fitted,
    )


def _in_addition(
    fitted: Fitted, products: Products, rows: Real, known: Complex | None = None
) -> tuple[Real, Real, float, Real, Real]:
    """Try more responses in addition to a model.

    Returns their products with the residual, the products among them with the model's own rows
    projected out, the residual's power, how theta and the numerator change with their weights, and
    their power before the projection.
    """
    count = rows.shape[0]
    both = Responses.ending(rows, rows.sum(axis=1)).and_also(fitted.responses)
    moments = products.moments(both, known=known)
    gram, linear = moments.gram, fitted.weights
    residual = moments.cross - gram[:, count:] @ linear
    shift, left, gain = added(
        gram[count:, count:],
        gram[:count, count:],
        gram[:count, :count],
        residual[count:],
        residual[:count],
    )
    cost = moments.energy - linear @ (moments.cross[count:] + residual[count:])
    least = float(np.finfo(float).eps * moments.energy)
    return gain, left, max(float(cost), least), shift, np.diag(gram)[:count]
