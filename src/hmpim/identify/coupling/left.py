"""What all inputs together leave of an output: whether it still follows one of them."""

from collections.abc import Sequence

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.misfit import Misfit, misfit
from hmpim.identify.section_iv.correlation import likeness

__all__ = ["left_over", "misfit_at_any_lag"]


def misfit_at_any_lag(u: Real, y: Real, band: tuple[float, float]) -> Misfit:
    """Test whether an output follows an input, at the lag at which they are most alike.

    Of the record as it is, or after a window: what is left of the record's beginning hides a
    response from the one, little of it in the middle of the record from the other. After Hann's
    window every other bin is independent, and those are the bins of the record folded in two.
    The band is in cycles per sample.

    Returns
    -------
    Misfit
        The chance of either, and the larger share of what either finds.
    """
    lag = likeness(u, y, u.size // 2 - 1).lag
    half = u.size // 2
    window = np.hanning(u.size)
    late = np.concatenate([np.zeros(lag), (u - u.mean())[: u.size - lag]])
    pair = window * late, window * (y - y.mean())
    folded = [one[:half] + one[half : 2 * half] for one in pair]
    asked = misfit(u, y, delay=float(lag), band=band), misfit(*folded, delay=0.0, band=band)
    told = [one for one in asked if one.probability < FALSE_ALARM] or asked
    return Misfit(
        share=max(one.share for one in told),
        probability=min(len(asked) * min(one.probability for one in told), 1.0),
    )


def left_over(
    inputs: Sequence[Real], fits: Sequence[JointFit], bands: Sequence[tuple[float, float]]
) -> tuple[Misfit, ...]:
    """How far the residual of all inputs still follows each of them.

    At the delay of its own fit, as of a single input, and at the lag at which the two are most
    alike: a response that was not found, or found elsewhere, has another. White noise follows
    nothing.

    Parameters
    ----------
    inputs : sequence of ndarray, shape (n,)
        Values of each input.
    fits : sequence of JointFit
        One for each input; those that are related share one residual.
    bands : sequence of (float, float)
        Band that each input excites, in cycles per sample.
    """
    some = next((fit.best.fit for fit in fits if fit.related), None)
    coloured = None if some is None or some.is_white else some.residual
    found = []
    for u, fit, band in zip(inputs, fits, bands, strict=True):
        asked = [Misfit(share=0.0, probability=1.0)]
        if fit.related:
            best = fit.best.fit
            asked.append(misfit(u, best.residual, delay=best.delay, band=band))
        if coloured is not None:
            asked.append(misfit_at_any_lag(u, coloured, band))
        found.append(min(asked, key=lambda one: one.probability))
    return tuple(found)
