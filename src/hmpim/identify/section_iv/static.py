"""Scale factor, bias and noise as in the paper (equations 9 and 11 to 14), from checked samples."""

import math

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.kept import kept
from hmpim.identify.worth import FEW, MOST

__all__ = [
    "bias_by_autocorrelation",
    "initial_period",
    "noise_by_autocorrelation",
    "scale_factor_near_dc",
    "time_corrected_error",
]

_BEGINNING = 4096
"""Samples in which the first cycle is first searched for."""


def time_corrected_error(u: Real, y: Real, lag: int) -> Real:
    """Return the time-corrected measurement error of equation (9): truth minus measurement.

    ε_meas(n) = u(n) - y(n + lag), shape (n - lag,), from the true and the measured signal, (n,),
    and the processing delay in samples. The paper writes n - δ; the measurement is late, so its
    sample to compare with u(n) is δ later in the record.

    Examples
    --------
    >>> time_corrected_error(np.array([1, 2, 3, 4, 5]), np.array([9, 0, 1, 2, 3]), lag=1)
    array([1, 1, 1, 1])
    """
    return u[: u.size - lag] - y[lag:]


def bias_by_autocorrelation(error: Real) -> float:
    """Return the paper's measurement bias K_C of equation (11): the r.m.s. error.

    K_C = √R(0), with R the autocorrelation (10) of the time-corrected error (9), shape (n,). This
    is the bias only if the error contains nothing else; noise and the dynamics add to it (0.68 for
    the true 0.6 of the paper's Fig. 17). The sign is that of the mean of measurement minus truth.

    Examples
    --------
    >>> bias_by_autocorrelation(np.array([-0.6, -0.6, -0.6, -0.6]))
    0.6
    """
    # R(0), the mean square, needs no transform.
    rms = math.sqrt(float(error @ error) / error.size)
    return -rms if error.mean() > 0 else rms


@kept
def initial_period(u: Real) -> int:
    """Return how many samples the first full cycle of the excitation takes, 1 to n.

    The sweep begins near DC, so its first cycle is the "initial period" that gives the paper's
    scale factor. The cycle ends where the excitation crosses zero for the second time. Crossings
    within 5 % of the peak do not count, so that noise on a measured excitation does not end the
    cycle early. An excitation, (n,), without a complete cycle, such as a step, is used whole.

    Examples
    --------
    >>> initial_period(np.sin(2 * np.pi * np.arange(500) / 100 - 1e-9))
    101
    """
    threshold = FEW * float(np.max(np.abs(u)))
    count, turns = 0, np.zeros(0, dtype=np.intp)
    while turns.size < 2 and count < u.size:
        count = min(max(8 * count, _BEGINNING), u.size)
        beyond = np.flatnonzero(np.abs(u[:count]) > threshold)
        turns = beyond[1:][np.diff(u[beyond] > 0.0)]  # samples that prove a crossing
    if turns.size < 2:
        return u.size
    # The crossing itself is before the sample that proves it.
    proof = int(turns[1])
    same_side = u[: proof + 1] * u[proof] > 0
    return proof - int(np.argmin(same_side[::-1])) + 1


def scale_factor_near_dc(u: Real, y: Real, lag: int, bias: float) -> float | None:
    """Return the paper's scale factor K_ε of equations (12) and (13).

    y(n + lag) = u(n) K_ε + K_C (12) is solved for K_ε at the non-zero points of the initial period
    (13): those at least half as far from zero as the peak on their side. The means above and below
    zero have equal weight, so that an error of the bias K_C cancels between the two half-cycles.

    Excitation and measurement have shape (n,), the processing delay `lag` is in samples. None if
    the excitation is zero throughout.

    Examples
    --------
    >>> u = np.sin(2 * np.pi * np.arange(300) / 100)
    >>> round(scale_factor_near_dc(u, 1.02 * u + 0.6, lag=0, bias=0.6), 9)
    1.02
    """
    count = min(initial_period(u), u.size - lag)
    excitation, corrected = u[:count], y[lag : lag + count]
    means = []
    for side in (excitation, -excitation):
        top = float(side.max())
        if top > 0:
            # Equation (13) divides by the excitation: only its upper half counts.
            used = side >= MOST * top
            means.append(float(np.mean((corrected[used] - bias) / excitation[used])))
    return sum(means) / len(means) if means else None


def noise_by_autocorrelation(error: Real) -> float:
    """Return the standard deviation of the noise by equation (14): σ² = R(0) - R(∞).

    R(0) is the mean square of the time-corrected error, (n,); R(∞) is the square of its mean, as
    the paper states. The error due to the dynamics counts as noise too: 0.32 instead of the true
    0.1 in Fig. 17.

    Examples
    --------
    >>> round(noise_by_autocorrelation(np.array([0.7, 0.5, 0.7, 0.5])), 6)
    0.1
    """
    return float(np.std(error))
