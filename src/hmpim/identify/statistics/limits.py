"""Cases that statistics alone cannot distinguish: drift or noise, a long response, software."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hmpim.identify.fitting.rows import Part
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.residual import moved_by
from hmpim.identify.noise.autoregression import spectrum_of_filter
from hmpim.identify.statistics.beyond import TIMED
from hmpim.identify.statistics.fit import Compressed, as_fitted, pulse
from hmpim.identify.statistics.products import Responses
from hmpim.identify.worth import FEW, MOST
from hmpim.record import Finding

__all__ = ["LIMITS"]

_FREQUENCIES = 2_000
_SLOWEST = 1e-7
"""Frequencies at which the power of a noise is summed, and the lowest, in radians per sample."""


def drift_or_noise(evidence: Evidence) -> Iterator[Finding]:
    """Doubt a noise that is mostly slower than the window, as a drifting bias would be.

    The autoregression of the residual gives its spectrum.
    """
    fit = as_fitted(evidence.joint.best.fit)
    lags = fit.products.statistics.lags
    omega = np.geomspace(_SLOWEST, np.pi, _FREQUENCIES)
    power = spectrum_of_filter(fit.left.noise, omega)
    slow = np.where(omega < 2 * np.pi / lags, power, 0.0)
    share = float(np.trapezoid(slow, omega) / np.trapezoid(power, omega))
    if share <= MOST:
        return
    yield Finding(
        code="drift_or_noise",
        message=f"{100 * share:.0f} % of the noise's power is slower than the window of "
        f"{lags / evidence.fs:.3g} s: it may be a drifting bias. Compress with knots, "
        "between which the bias may change.",
        severity="doubt",
        parameters=("noise_std",),
    )


def cut_response(evidence: Evidence) -> Iterator[Finding]:
    """Doubt figures where the impulse response beyond the window counts as noise.

    The response is continued for a second window, and its power compared with the noise's.
    """
    fit = as_fitted(evidence.joint.best.fit)
    products, taps = fit.products.plain, fit.response.size
    reach = products.statistics.reach
    twice = replace(reach, lags=reach.lags + taps)
    longer = Compressed.of(products, pulse(twice, evidence.joint.best.intersample))
    rows = Part(longer, fit.structure, fit.theta).rows[:, taps:]
    beyond = fit.weights[-rows.shape[0] :] @ rows
    cut = float(products.moments(Responses.ending(beyond[None], np.zeros(1))).gram[0, 0])
    share = cut / max(fit.left.power * products.counted, np.finfo(float).tiny)
    if share <= 2 * FEW:  # the noise would be off by few per cent
        return
    yield Finding(
        code="cut_response",
        message=f"The response continues beyond the window of {reach.lags} samples, and that "
        f"part of it is {100 * min(share, 1.0):.0f} % of what counts as noise. Compress with "
        f"lags={2 * reach.lags}.",
        severity="doubt",
        parameters=moved_by(evidence, min(share, 1.0)),
    )


def perhaps_software(evidence: Evidence) -> Iterator[Finding]:
    """Doubt the timing of one pole behind a held input, without noise: it may be a filter.

    From samples the plainer of both is chosen. Their residuals differ by rounding, which products
    do not keep.
    """
    fit = evidence.joint.best.fit
    held = evidence.joint.best.intersample == "zoh"
    if not (evidence.is_without_noise and held and fit.structure.order == 1):
        return
    yield Finding(
        code="perhaps_software",
        message="The output has no noise, so that software may compute it: a filter of samples "
        "has another delay and other bandwidths than one pole behind a held input. Identify "
        "the record itself, with intersample='sampled' if it is software.",
        severity="doubt",
        parameters=TIMED,
    )


LIMITS = (drift_or_noise, cut_response, perhaps_software)
"""The checks for statistics alone."""
