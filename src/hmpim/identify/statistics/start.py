"""Starting point: a rough response from statistics alone.

The impulse response with the least squared error, of any shape, solves the Toeplitz system of the
auto- and the cross-correlation. The method of minimal residuals with FFTs solves it, and a small
ridge keeps the response small where nothing is excited. Its transform gives the starts of the joint
fit.
"""

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.fitting.start import RoughResponse
from hmpim.identify.section_iv.spectrum import band_of_levels
from hmpim.identify.statistics.products import spectrum_of
from hmpim.identify.statistics.reach import AHEAD
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.worth import DEEPEST

__all__ = ["correlations", "excited", "rough_of"]

_RIDGE = 1e-5
"""Share of the input's greatest power; where there is less, the response is pulled to 0."""

_STEPS, _PRECISION = 200, 1e-7
"""Of the solution of the system, which is only a start."""


def correlations(statistics: Statistics) -> tuple[Real, Real]:
    """Auto- and cross-correlation about the means, lags 0 … span and -forth … back."""
    reach = statistics.reach
    uu, yu = np.zeros(reach.span + 1), np.zeros(reach.forth + reach.back + 1)
    for run in statistics.runs:
        mean_u = run.total(reach) / run.samples
        mean_y = run.vv[: reach.rows, -1, 0].sum() / run.samples
        # Sums without the first k samples, and without the last k.
        late_u, early_u = (
            _without(run.samples * mean_u, x) for x in (run.head_u, run.tail_u[::-1])
        )
        late_y, early_y = (
            _without(run.samples * mean_y, x) for x in (run.head_y, run.tail_y[::-1])
        )
        left = np.maximum(run.samples - np.arange(reach.span + 1), 0)
        uu += run.uu - mean_u * (late_u + early_u - left * mean_u)
        behind, ahead = slice(None, reach.back + 1), slice(reach.forth, 0, -1)
        taken_u = np.concatenate([late_u[ahead], early_u[behind]])
        taken_y = np.concatenate([early_y[ahead], late_y[behind]])
        both = np.concatenate([left[ahead], left[behind]])
        yu += run.vu[-1] - mean_y * taken_u - mean_u * (taken_y - both * mean_y)
    return uu, yu


def _without(total: float, samples: Real) -> Real:
    """A sum less the first 0, 1, … of some samples."""
    return np.asarray(total - np.concatenate([[0.0], np.cumsum(samples)]))


def _power_of(uu: Real, length: int) -> Real:
    """Power spectrum of an autocorrelation at length // 2 + 1 frequencies, smoothed by a window."""
    windowed = uu * scipy.signal.windows.blackman(2 * uu.size - 1)[uu.size - 1 :]
    return np.asarray(np.maximum(spectrum_of(windowed, length), 0.0))


def excited(statistics: Statistics) -> tuple[float, float]:
    """Excited band in Hz: as stated, or where the input's power is not negligible."""
    if statistics.band is not None:
        return statistics.band
    length = scipy.fft.next_fast_len(4 * statistics.reach.span, real=True)
    level = np.sqrt(_power_of(correlations(statistics)[0], length))
    level[0] = 0.0
    return band_of_levels(level, statistics.fs / length)


def rough_of(
    statistics: Statistics,
    *,
    known: Real | None = None,
    lag: int | None = None,
    differenced: bool = False,
) -> RoughResponse:
    """Estimate the response without a model, from the correlations of input and output.

    An impulse response that is `known`, (taps,), is subtracted. The delay to begin from is that of
    the greatest correlation unless `lag` gives it, in samples. If `differenced`, the output is the
    response to the running sum of the input.
    """
    reach = statistics.reach
    uu, yu = correlations(statistics)
    if differenced:
        yu = np.diff(yu, prepend=0.0)
    cross = yu[reach.forth - AHEAD :][: reach.taps]
    length = int(scipy.fft.next_fast_len(2 * reach.span + 1, real=True))
    spectrum = spectrum_of(uu, length)
    if known is not None:
        made = scipy.fft.irfft(scipy.fft.rfft(known, length) * spectrum, length)
        cross = cross - made[: cross.size]
    power = _power_of(uu, length)
    ridge = _RIDGE * float(power.max())
    answer = _solved(spectrum, ridge, cross, length)
    moved = scipy.fft.rfft(answer, length) * np.exp(
        2j * np.pi * np.arange(power.size) * AHEAD / length
    )
    power[0] = 0.0
    bins = np.flatnonzero(power > DEEPEST * power.max())
    omega = 2 * np.pi * bins / length
    if lag is None:
        lag = int(np.argmax(np.abs(cross[AHEAD:])))
    response = moved[bins] * (1.0 + ridge / power[bins]) * np.exp(1j * omega * lag)
    return RoughResponse(
        lag=lag,
        length=length,
        bins=bins,
        omega=omega,
        response=response,
        weight=power[bins] / power[bins].max(),
    )


def _solved(spectrum: Real, ridge: float, right: Real, length: int) -> Real:
    """Solution of a Toeplitz system with a ridge; the ends of a run make it not quite definite."""
    power, most = float(spectrum.max()), float(np.abs(right).max()) or 1.0  # any unit will do
    spectrum, ridge = spectrum / power, ridge / power

    def times(x: Real) -> Real:
        made = scipy.fft.irfft(scipy.fft.rfft(x, length) * spectrum, length)
        return np.asarray(made[: x.size] + ridge * x)

    matrix = scipy.sparse.linalg.LinearOperator((right.size,) * 2, matvec=times, dtype=float)
    x, _ = scipy.sparse.linalg.minres(matrix, right / most, rtol=_PRECISION, maxiter=_STEPS)
    return np.asarray(x * (most / power))
