"""A local polynomial estimate of the frequency response, with its error at each frequency.

Around each frequency the response G and the transient T are polynomials over a few
neighbouring bins of the unwindowed transform, Y = G U + T + noise, fitted by least squares:
Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, chapter 7; Schoukens,
Vandersteen, Barbé and Pintelon, "Nonparametric preprocessing in system identification", 2009.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.signals import as_pair, check_band, check_rate

__all__ = ["local_polynomial_response"]

_FEWEST_SAMPLES = 16
_RIDGE = 1e-13
# Power of U, relative to its greatest, that counts as none.
_NOTHING = 1e-24
# Products of bins held at once, about 80 MB.
_CHUNK = 1_000_000
# The prediction error of a fit is averaged over this many neighbours on either side.
_NEIGHBOURS = 30
# Fits that predict within this of the best count as equally good.
_TOLERANCE = 0.03
# The next narrower window is taken unless the square of its error is this much greater.
_DEAREST = 2.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Spectra:
    """Bins 1 to N/2 of a record whose delay is taken out, and the five products to be summed."""

    products: NDArray[np.complex128]
    u: NDArray[np.complex128]
    y: NDArray[np.complex128]
    frequency: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Normal:
    """Normal equations around c centres: first the columns of G, then those of T."""

    gram: NDArray[np.complex128]
    right: NDArray[np.complex128]
    row: NDArray[np.complex128]
    here: NDArray[np.float64]
    size: NDArray[np.float64]
    power: NDArray[np.float64]
    y: NDArray[np.complex128]
    window: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Local:
    """One fit at every centre.

    The variance of `response` is `spread` times `noise`, the variance of a bin of Y; `power` is
    the mean |U|² in the window; `prediction_error` is the square of what the fit without a
    bin misses there.
    """

    response: NDArray[np.complex128]
    spread: NDArray[np.float64]
    noise: NDArray[np.float64]
    power: NDArray[np.float64]
    prediction_error: NDArray[np.float64]


def local_polynomial_response(
    u: ArrayLike,
    y: ArrayLike,
    fs: float,
    *,
    band: tuple[float, float],
    delay: float = 0.0,
    order: int = 2,
    widths: tuple[int, ...] | None = None,
    points: int = 400,
) -> FrequencyResponse:
    """Return the frequency response by the local polynomial method.

    The delay is taken out first: its whole samples by comparing y(n + k) with u(n), so that
    no response to the stimulus lies beyond the end of the record, and the rest by its phase;
    it is put back at the end. The bias lies in the bin at DC, which is not used. The number of
    neighbours is chosen at each frequency from the data: the one that best predicts bins from
    their neighbours alone (cross-validation), averaged over 61 frequencies, weighed against the
    variance of G. Where G without T predicts as well, T is left out: a sweep passes the ends of
    its band so early or late that the two can hardly be told apart there.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Input and output on one clock, n >= 16.
    fs : float
        Sampling rate, Hz.
    band : tuple of float
        Excited band, Hz.
    delay : float
        Pure delay in s, not negative, as well as it is known; it need not be exact.
    order : int
        Order R of the polynomials of G and T, 0 to 6; less where the record is too short.
    widths : tuple of int or None
        Numbers of neighbours on either side to choose among; None for a series from 6 up to a
        third of the band's bins.
    points : int
        Greatest number of frequencies; beyond it they are spaced by a constant ratio.

    Returns
    -------
    FrequencyResponse
        At bins of the record inside the band. `std` is from the residual around each frequency
        and, where no fit is without one, from what the best fit lacks. `coherence` is None:
        there is one segment only.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than 16 samples, NaN or infinity, or a constant `u`.
    ArgumentError
        For a rate, band, delay, order, width or number of points that cannot be, or a band
        without a bin of the record.

    Examples
    --------
    >>> import numpy as np
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = 2 * np.concatenate((np.zeros(30), u[:-30])) + 0.6
    >>> frf = local_polynomial_response(u, y, 200.0, band=(0.1, 20.0), delay=0.15)
    >>> bool(np.allclose(np.abs(frf.response), 2.0))
    True
    """
    first, second = as_pair(u, y)
    check_rate(fs)
    check_band(band, fs)
    _check_options(first.size, delay=delay, order=order, widths=widths, points=points)
    if np.ptp(first) == 0:
        raise RecordError(f"u is constant at {first[0]:g}; an input must move")
    spectra = _spectra(first, second, fs, delay)
    bins = spectra.frequency.size
    step = float(spectra.frequency[0])
    low = max(int(np.ceil(band[0] / step - 1e-9)), 1) - 1
    high = min(int(np.floor(band[1] / step + 1e-9)), bins) - 1
    if high < low:
        raise ArgumentError(
            f"band is ({band[0]:g}, {band[1]:g}) Hz, and the record has no bin in it, only "
            f"multiples of {step:g} Hz; give a wider band or a longer record"
        )
    centre = _centres(low, high, points)
    # Each polynomial has order + 1 coefficients, and residuals must be left over.
    order = min(order, max((bins - 2) // 4 - 1, 0))
    tried = [
        fit
        for width in _widths(high - low + 1, bins, order, widths)
        for fit in _fits(spectra, centre, width, order)
    ]
    chosen, bent = _choice(tried)
    rows = np.arange(centre.size)
    response = np.stack([fit.response for fit in tried])[chosen, rows]
    variance = np.stack([fit.spread * fit.noise for fit in tried])[chosen, rows] + bent
    frequency = spectra.frequency[centre]
    return FrequencyResponse(
        frequency=frequency,
        response=response * np.exp(-2j * np.pi * frequency * delay),
        std=np.sqrt(variance),
        coherence=None,
    )


def _check_options(
    samples: int, *, delay: float, order: int, widths: tuple[int, ...] | None, points: int
) -> None:
    if samples < _FEWEST_SAMPLES:
        raise RecordError(f"the record has {samples} samples; give at least {_FEWEST_SAMPLES}")
    if not (np.isfinite(delay) and delay >= 0):
        raise ArgumentError(f"delay is {delay} s; give a finite number, 0 or more")
    if not 0 <= order <= 6:
        raise ArgumentError(f"order is {order}; give 0 to 6, usually 2")
    if points < 1:
        raise ArgumentError(f"points is {points}; give at least 1")
    if widths is not None and (not widths or min(widths) < 1):
        raise ArgumentError(f"widths is {widths}; give at least one, each 1 or more")


def _spectra(u: NDArray[np.float64], y: NDArray[np.float64], fs: float, delay: float) -> _Spectra:
    """Transform the record with the delay taken out."""
    # A delay beyond half the record leaves too little; the phase then takes the rest.
    lag = min(int(np.floor(delay * fs + 1e-9)), u.size // 2)
    length = u.size - lag
    count = (length - 1) // 2  # without DC and without the bin at fs/2, which is real
    frequency = np.asarray(np.arange(1, count + 1) * (fs / length), dtype=np.float64)
    spectrum_u = np.asarray(fft.rfft(u[:length]))[1 : count + 1]
    spectrum_y = np.asarray(fft.rfft(y[lag:]))[1 : count + 1]
    rest = delay - lag / fs
    spectrum_y = spectrum_y * np.exp(2j * np.pi * frequency * rest)
    products = np.stack(
        (
            np.abs(spectrum_u) ** 2 + 0j,
            np.conj(spectrum_u),
            np.conj(spectrum_u) * spectrum_y,
            spectrum_y,
            np.abs(spectrum_y) ** 2 + 0j,
        )
    )
    return _Spectra(products=products, u=spectrum_u, y=spectrum_y, frequency=frequency)


def _centres(low: int, high: int, points: int) -> NDArray[np.int64]:
    if high - low + 1 <= points:
        return np.arange(low, high + 1)
    # Bin 0 here is the first above DC: its number in the transform is one more.
    return np.unique(np.rint(np.geomspace(low + 1, high + 1, points)).astype(np.int64)) - 1


def _widths(excited: int, bins: int, order: int, widths: tuple[int, ...] | None) -> tuple[int, ...]:
    """Return the numbers of neighbours to try, each leaving residuals, none twice."""
    least = (4 * (order + 1)) // 2
    most = max((bins - 1) // 2, 1)
    if widths is None:
        top = min(max(excited // 3, least + 1), 1000)
        count = max(int(np.ceil(np.log(top / least) / np.log(1.4))), 1)
        widths = tuple(int(w) for w in np.rint(np.geomspace(least, top, count + 1)))
    return tuple(sorted({min(max(width, order + 1), most) for width in widths}))


def _fits(
    spectra: _Spectra, centre: NDArray[np.int64], width: int, order: int
) -> tuple[_Local, _Local]:
    """Fit G and T, and G alone, around each centre over 2 width + 1 bins.

    The normal equations are made of moments Σ A x^p over the window, x = -1 … 1, of five
    products A; so all frequencies share one matrix of powers. Near the ends of the spectrum
    the window stays inside, and the polynomials are evaluated off its middle.
    """
    bins = spectra.frequency.size
    window = min(2 * width + 1, bins)
    start = np.clip(centre - width, 0, bins - window)
    x = np.linspace(-1.0, 1.0, window)
    powers = x[:, None] ** np.arange(2 * order + 1)
    views = sliding_window_view(spectra.products, window, axis=1)
    chunk = max(_CHUNK // window, 1)
    moments = np.concatenate(
        [views[:, start[k : k + chunk]] @ powers for k in range(0, centre.size, chunk)], axis=1
    )
    terms = order + 1
    pair = np.add.outer(np.arange(terms), np.arange(terms))
    # G's columns are scaled to the size of T's, whatever the unit of U; where there is no U at
    # all, G comes out as zero with a huge error.
    floor = _NOTHING * float(spectra.products[0].real.max())
    size = np.sqrt(np.maximum(moments[0, :, 0].real / window, floor))
    gram = np.empty((centre.size, 2 * terms, 2 * terms), dtype=np.complex128)
    gram[:, :terms, :terms] = moments[0][:, pair] / (size**2)[:, None, None]
    cross = moments[1][:, pair] / size[:, None, None]
    gram[:, :terms, terms:] = cross
    gram[:, terms:, :terms] = np.conj(cross.swapaxes(1, 2))
    gram[:, terms:, terms:] = powers.sum(axis=0)[pair]
    gram[:, np.arange(2 * terms), np.arange(2 * terms)] += _RIDGE * window
    right = np.concatenate((moments[2][:, :terms] / size[:, None], moments[3][:, :terms]), axis=1)
    here = x[centre - start][:, None] ** np.arange(terms)
    row = np.concatenate((here * (spectra.u[centre] / size)[:, None], here + 0j), axis=1)
    problem = _Normal(
        gram=gram,
        right=right,
        row=row,
        here=here,
        size=size,
        power=moments[4, :, 0].real,
        y=spectra.y[centre],
        window=window,
    )
    return _solve(problem, 2 * terms), _solve(problem, terms)


def _solve(problem: _Normal, columns: int) -> _Local:
    """Solve the normal equations of the first `columns` columns."""
    terms = problem.here.shape[1]
    right = problem.right[:, :columns]
    row = problem.row[:, :columns]
    inverse = np.linalg.inv(problem.gram[:, :columns, :columns])
    theta = (inverse @ right[:, :, None])[:, :, 0]
    left = problem.power - np.sum(np.conj(right) * theta, axis=1).real
    # The difference of two nearly equal sums is never less than its rounding.
    left = np.maximum(left, 1e-15 * problem.power)
    noise = left / max(problem.window - columns, 1)
    here = problem.here[:, :, None]
    spread = (here.swapaxes(1, 2) @ inverse[:, :terms, :terms] @ here)[:, 0, 0].real
    leverage = (row[:, None, :] @ inverse @ np.conj(row[:, :, None]))[:, 0, 0].real
    missed = problem.y - np.sum(row * theta, axis=1)
    return _Local(
        response=np.sum(problem.here * theta[:, :terms], axis=1) / problem.size,
        spread=np.maximum(spread, 0.0) / problem.size**2,
        noise=noise,
        power=problem.size**2,
        prediction_error=np.abs(missed / np.maximum(1.0 - leverage, 1e-6)) ** 2,
    )


def _choice(tried: list[_Local]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return which fit to take at each frequency, and the square of the error it leaves in.

    Prediction alone does not see that G and T cannot be told apart in a narrow window, nor
    variance that a wide one is bent. So the error of G is weighed: its variance, plus what a
    fit predicts worse than the best of them, referred to G through the power of U. Then the
    next narrower window is taken, if it costs little, so that what curvature leaves over is
    small beside the stated error (undersmoothing).
    """
    missed = np.stack([fit.prediction_error for fit in tried])
    count = missed.shape[1]
    reach = min(_NEIGHBOURS, count // 2)
    total = np.pad(np.cumsum(missed, axis=1), ((0, 0), (1, 0)))
    position = np.arange(count)
    begin, end = np.maximum(position - reach, 0), np.minimum(position + reach + 1, count)
    mean = (total[:, end] - total[:, begin]) / (end - begin)
    least = mean.min(axis=0)
    spread = np.stack([fit.spread for fit in tried])
    power = np.stack([fit.power for fit in tried])
    bent = np.maximum(mean - (1 + _TOLERANCE) * least, 0.0) / power
    cost = spread * least + bent
    best = np.argmin(cost, axis=0)
    # Fits come in pairs, with and without T: the same kind one width down stands two before.
    narrower = np.where(best >= 2, best - 2, best)
    cheap = cost[narrower, position] <= _DEAREST * cost[best, position]
    chosen = np.asarray(np.where(cheap, narrower, best), dtype=np.int64)
    return chosen, bent[chosen, position]
