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
# Products of bins held at once, about 80 MB.
_CHUNK = 1_000_000
# The prediction error of a width is averaged over this many neighbours on either side.
_NEIGHBOURS = 15
# A wider window must predict this much better than a narrower one: what it gains in noise it
# may lose in curvature, which the stated error does not hold.
_TOLERANCE = 0.01


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Spectra:
    """Bins 1 to N/2 of a record whose delay is taken out, and the five products to be summed."""

    products: NDArray[np.complex128]
    u: NDArray[np.complex128]
    y: NDArray[np.complex128]
    frequency: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Local:
    """One window width: response, its variance, and the error of predicting each bin."""

    response: NDArray[np.complex128]
    variance: NDArray[np.float64]
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
    their neighbours alone (cross-validation), averaged over 31 frequencies.

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
        At bins of the record inside the band; `std` from the residual around each frequency,
        `coherence` None: there is one segment only.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than 16 samples, NaN or infinity.
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
        _fit(spectra, centre, width, order)
        for width in _widths(high - low + 1, bins, order, widths)
    ]
    chosen = _choice(np.stack([trial.prediction_error for trial in tried]))
    rows = np.arange(centre.size)
    response = np.stack([trial.response for trial in tried])[chosen, rows]
    variance = np.stack([trial.variance for trial in tried])[chosen, rows]
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
    # Scaled so that the columns of G and T weigh alike in the sums below.
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


def _fit(spectra: _Spectra, centre: NDArray[np.int64], width: int, order: int) -> _Local:
    """Fit G and T around each centre over 2 width + 1 bins.

    The normal equations are made of moments Σ A x^p over the window, x = -1 … 1, of five
    products A; so all frequencies share one matrix of powers. Near the ends of the spectrum
    the window stays inside, and the polynomials are evaluated off its middle.
    """
    bins = spectra.frequency.size
    window = min(2 * width + 1, bins)
    start = np.clip(centre - width, 0, bins - window)
    x = np.linspace(-1.0, 1.0, window)
    powers = x[:, None] ** np.arange(2 * order + 1)
    at = x[centre - start]
    views = sliding_window_view(spectra.products, window, axis=1)
    chunk = max(_CHUNK // window, 1)
    moments = np.concatenate(
        [views[:, start[k : k + chunk]] @ powers for k in range(0, centre.size, chunk)], axis=1
    )
    # Power of U and number of bins in the window scale the two kinds of columns to one.
    size = np.sqrt(np.maximum(moments[0, :, 0].real / window, np.finfo(float).tiny))
    terms = order + 1
    pair = np.add.outer(np.arange(terms), np.arange(terms))
    gram = np.empty((centre.size, 2 * terms, 2 * terms), dtype=np.complex128)
    gram[:, :terms, :terms] = moments[0][:, pair] / (size**2)[:, None, None]
    cross = moments[1][:, pair] / size[:, None, None]
    gram[:, :terms, terms:] = cross
    gram[:, terms:, :terms] = np.conj(cross.swapaxes(1, 2))
    gram[:, terms:, terms:] = powers.sum(axis=0)[pair]
    diagonal = np.arange(2 * terms)
    gram[:, diagonal, diagonal] += _RIDGE * window
    right = np.concatenate((moments[2][:, :terms] / size[:, None], moments[3][:, :terms]), axis=1)
    inverse = np.linalg.inv(gram)
    theta = (inverse @ right[:, :, None])[:, :, 0]
    here = at[:, None] ** np.arange(terms)
    response = np.sum(here * theta[:, :terms], axis=1)
    total = moments[4, :, 0].real
    left = total - np.sum(np.conj(right) * theta, axis=1).real
    # The difference of two nearly equal sums cannot be less than its rounding.
    left = np.maximum(left, 1e-15 * total)
    noise = left / max(window - 2 * terms, 1)
    spread = np.einsum("cp,cpq,cq->c", here, inverse[:, :terms, :terms], here).real
    row = np.concatenate((here * (spectra.u[centre] / size)[:, None], here + 0j), axis=1)
    leverage = np.einsum("cp,cpq,cq->c", row, inverse, np.conj(row)).real
    missed = spectra.y[centre] - np.sum(row * theta, axis=1)
    return _Local(
        response=response / size,
        variance=noise * np.maximum(spread, 0.0) / size**2,
        prediction_error=np.abs(missed / np.maximum(1.0 - leverage, 1e-6)) ** 2,
    )


def _choice(error: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return, at each frequency, the narrowest window that predicts about as well as any."""
    reach = min(_NEIGHBOURS, error.shape[1] // 2)
    padded = np.pad(np.cumsum(error, axis=1), ((0, 0), (1, 0)))
    position = np.arange(error.shape[1])
    begin = np.maximum(position - reach, 0)
    end = np.minimum(position + reach + 1, error.shape[1])
    mean = (padded[:, end] - padded[:, begin]) / (end - begin)
    good = mean <= (1 + _TOLERANCE) * mean.min(axis=0)
    return np.asarray(np.argmax(good, axis=0), dtype=np.int64)
