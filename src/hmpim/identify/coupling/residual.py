"""Whether the residual of an output, with all inputs fitted, still follows one of them."""

from collections.abc import Sequence

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.misfit import Delayed, Misfit, misfit
from hmpim.identify.section_iv.correlation import likeness

__all__ = ["misfit_at_any_lag", "misfits_of_inputs"]


def misfit_at_any_lag(
    u: Real, y: Real, band: tuple[float, float], others: Sequence[Delayed] = ()
) -> Misfit:
    """Test whether an output follows an input, at the lag at which they are most alike.

    What follows the other inputs, each with its delay in samples, is not counted.

    The record is tested as it is, and after Hann's window. The transient at the record's beginning
    can hide a response from the first test, a weak middle of the record from the second. After the
    window, every other bin is independent: the bins of the record folded in two. The band is in
    cycles per sample. The probability is that of either test.
    """
    lag = likeness(u, y, u.size // 2 - 1).lag
    half = u.size // 2
    window = np.hanning(u.size)

    def folded(x: Real, late: int = 0) -> Real:
        shifted = np.concatenate([np.zeros(late), (x - x.mean())[: x.size - late]]) * window
        return np.asarray(shifted[:half] + shifted[half : 2 * half])

    known = [(folded(x, max(round(late), 0)), 0.0) for x, late in others]
    tests = (
        misfit(u, y, delay=float(lag), band=band, others=others),
        misfit(folded(u, lag), folded(y), delay=0.0, band=band, others=known),
    )
    significant = [test for test in tests if test.probability < FALSE_ALARM] or tests
    return Misfit(
        share=max(test.share for test in significant),
        within=max(test.within for test in significant),
        probability=min(len(tests) * min(test.probability for test in significant), 1.0),
    )


def misfits_of_inputs(
    inputs: Sequence[Real], fits: Sequence[JointFit], bands: Sequence[tuple[float, float]]
) -> tuple[Misfit, ...]:
    """Test how far the residual of all inputs still follows each of them, (n,).

    The test is at the delay of the pair's own fit and, if the residual is not white, at the lag
    at which residual and input are most alike: that of a response that was not found. The band that
    each input excites is in cycles per sample. Related fits share one residual.
    """
    some = next((fit.best.fit for fit in fits if fit.related), None)
    coloured = None if some is None or some.is_white else some.residual
    found = []
    for u, fit, band in zip(inputs, fits, bands, strict=True):
        tests = [Misfit(share=0.0, within=0.0, probability=1.0)]
        if fit.related:
            best = fit.best.fit
            tests.append(misfit(u, best.residual, delay=best.delay, band=band))
        if coloured is not None:
            tests.append(misfit_at_any_lag(u, coloured, band))
        found.append(min(tests, key=lambda test: test.probability))
    return tuple(found)
