"""The frequency response from one record, by local fits, with its error at each frequency.

Around each frequency a polynomial or a rational function is fitted over neighbouring bins of
the transform. Which of them, and over how many neighbours, the data choose by how well each
predicts a bin from its neighbours alone.
"""

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.frf.choice import choose
from hmpim.identify.frf.neighbours import LocalFit, Spectra, centres_in_band, transform
from hmpim.identify.frf.polynomial import polynomial_fits
from hmpim.identify.frf.rational import rational_fits
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.signals import as_pair, as_signal, check_band, check_rate, whole_lag

__all__ = ["local_polynomial_response", "local_response"]

_FEWEST_SAMPLES = 16
_ORDER = 2
# Widest window of polynomials, on either side.
_WIDEST = 1000
# Each window of polynomials is wider than the last by this.
_RATIO = 1.6
# Where rational functions are tried too, fewer will do.
_RATIO_BESIDE_RATIONAL = 2.0
# Narrower windows are too short for eight coefficients beside noise.
_NARROWEST_RATIONAL = 20
# Bins in all windows of one width of rational functions, beyond which they cost too much; a
# record so long has neighbours enough for polynomials.
_AFFORDABLE = 60_000


def local_response(
    u: ArrayLike,
    y: ArrayLike,
    fs: float,
    *,
    band: tuple[float, float],
    delay: float = 0.0,
    valid: ArrayLike | None = None,
    fill: ArrayLike | None = None,
    points: int = 400,
) -> FrequencyResponse:
    """Return the frequency response by local polynomials and local rational functions.

    At each frequency the data choose between them, with a transient or without, and among
    widths (cross-validation, averaged over 61 frequencies, weighed against the variance of G).
    The delay is taken out first and put back at the end; the bias lies in the bin at DC, which
    is not used.

    Samples of `y` that are not valid are replaced. With `fill` the record is split in two: the
    response that `fill` has already, and what the valid samples add to it, found from the input
    and from y - fill with both zero inside the gaps. So the filling lends no certainty: where a
    gap covers the time at which a sweep passes a frequency, the error grows. `fill` must be a
    good prediction, such as that of a fitted model. Without it the gaps are bridged by a
    monotone cubic, which serves for gaps short beside a period; the stated error sees what
    that does only as far as it is no smooth function of frequency.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Input and output on one clock, n >= 16; finite inside gaps too.
    fs : float
        Sampling rate, Hz.
    band : tuple of float
        Excited band, Hz.
    delay : float
        Pure delay in s, as well as it is known; it need not be exact.
    valid : array_like of bool, shape (n,), optional
        False where `y` is missing; all of it valid by default.
    fill : array_like, shape (n,), optional
        What a model predicts for `y`, bias included; used only if samples are missing.
    points : int
        Greatest number of frequencies; beyond it they are spaced by a constant ratio.

    Returns
    -------
    FrequencyResponse
        At bins of the record inside the band. `std` is from the residual around each frequency
        and, where the chosen fit predicts worse than the best, from what it lacks. `coherence`
        is None: there is one segment only.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than 16 (valid) samples, NaN or infinity, or a constant `u`.
    ArgumentError
        For a rate, band, delay or number of points that cannot be, a band without a bin of the
        record, or a mask of the wrong shape.

    Notes
    -----
    Both are estimates of Pintelon and Schoukens, System Identification, 2nd ed., ch. 7; see
    `hmpim.identify.frf.rational` for where the rational one departs from McKelvey and Guerin.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = 2 * np.concatenate((np.zeros(30), u[:-30])) + 0.6
    >>> frf = local_response(u, y, 200.0, band=(0.1, 20.0), delay=0.15)
    >>> bool(np.allclose(np.abs(frf.response), 2.0))
    True
    """
    first, second = _checked(u, y, fs, band, delay=delay, points=points)
    mask = _checked_mask(valid, second)
    if mask is None:
        return _single(first, second, fs, delay=delay, band=band, points=points)
    if fill is None:
        inside = np.flatnonzero(~mask)
        joined = second.copy()
        joined[inside] = scipy.interpolate.PchipInterpolator(np.flatnonzero(mask), second[mask])(
            inside
        )
        return _single(first, joined, fs, delay=delay, band=band, points=points)
    guess = as_signal("fill", fill)
    if guess.size != second.size:
        raise RecordError(f"fill has {guess.size} samples and y has {second.size}; give as many")
    rest = second - guess
    known = _single(first, guess, fs, delay=delay, band=band, points=points)
    added = _masked(first, rest - rest[mask].mean(), mask, fs, delay, band, points)
    return FrequencyResponse(
        frequency=known.frequency,
        response=known.response + added.response,
        std=np.hypot(known.std, added.std),
        coherence=None,
    )


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
    """Return the frequency response by local polynomials alone.

    As `local_response`, without rational functions. Where G without T predicts as well, T is
    left out: a sweep passes the ends of its band so early or late that the two can hardly be
    told apart there.

    Parameters
    ----------
    u, y : array_like, shape (n,)
        Input and output on one clock, n >= 16.
    fs : float
        Sampling rate, Hz.
    band : tuple of float
        Excited band, Hz.
    delay : float
        Pure delay in s, as well as it is known; it need not be exact.
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
        At bins of the record inside the band.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than 16 samples, NaN or infinity, or a constant `u`.
    ArgumentError
        For a rate, band, delay, order, width or number of points that cannot be, or a band
        without a bin of the record.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = 2 * np.concatenate((np.zeros(30), u[:-30])) + 0.6
    >>> frf = local_polynomial_response(u, y, 200.0, band=(0.1, 20.0), delay=0.15)
    >>> bool(np.allclose(np.abs(frf.response), 2.0))
    True
    """
    first, second = _checked(u, y, fs, band, delay=delay, points=points)
    if not 0 <= order <= 6:
        raise ArgumentError(f"order is {order}; give 0 to 6, usually 2")
    if widths is not None and (not widths or min(widths) < 1):
        raise ArgumentError(f"widths is {widths}; give at least one, each 1 or more")
    spectra = transform(first, second, fs, delay)
    centre = _centres(spectra, band, points)
    return _answer(spectra, centre, delay, _polynomials(spectra, centre, order, widths), ())


def _checked(
    u: ArrayLike, y: ArrayLike, fs: float, band: tuple[float, float], *, delay: float, points: int
) -> tuple[Real, Real]:
    first, second = as_pair(u, y)
    check_rate(fs)
    check_band(band, fs)
    if first.size < _FEWEST_SAMPLES:
        raise RecordError(f"the record has {first.size} samples; give at least {_FEWEST_SAMPLES}")
    if not np.isfinite(delay):
        raise ArgumentError(f"delay is {delay} s; give a finite number")
    if points < 1:
        raise ArgumentError(f"points is {points}; give at least 1")
    if np.ptp(first) == 0:
        raise RecordError(f"u is constant at {first[0]:g}; an input must move")
    return first, second


def _checked_mask(valid: ArrayLike | None, y: Real) -> Mask | None:
    """Return the mask, None where nothing is missing."""
    if valid is None:
        return None
    mask = np.asarray(valid, dtype=np.bool_)
    if mask.shape != y.shape:
        raise ArgumentError(f"valid has shape {mask.shape}; give that of y, {y.shape}")
    count = int(np.count_nonzero(mask))
    if count < _FEWEST_SAMPLES:
        raise RecordError(f"{count} samples are valid; give at least {_FEWEST_SAMPLES}")
    return None if count == y.size else mask


def _centres(spectra: Spectra, band: tuple[float, float], points: int) -> NDArray[np.int64]:
    step = float(spectra.frequency[1])
    low = max(int(np.ceil(band[0] / step - 1e-9)), 1)
    high = min(int(np.floor(band[1] / step + 1e-9)), spectra.frequency.size - 1)
    if high < low:
        raise ArgumentError(
            f"band is ({band[0]:g}, {band[1]:g}) Hz, and the record has no bin in it, only "
            f"multiples of {step:g} Hz; give a wider band or a longer record"
        )
    return centres_in_band(low, high, points)


def _cut(spectra: Spectra, highest: int) -> Spectra:
    """Leave out the bins that no window reaches: most of a long record's."""
    end = highest + max(highest // 2, _WIDEST) + 1
    return Spectra(frequency=spectra.frequency[:end], u=spectra.u[:end], y=spectra.y[:end])


def _single(
    u: Real, y: Real, fs: float, *, delay: float, band: tuple[float, float], points: int
) -> FrequencyResponse:
    """Polynomials first; what they predict starts the rational functions; then choose of all."""
    spectra = transform(u, y, fs, delay)
    centre = _centres(spectra, band, points)
    spectra = _cut(spectra, int(centre[-1]))
    polynomials = _polynomials(spectra, centre, _ORDER, None, ratio=_RATIO_BESIDE_RATIONAL)
    widths = _rational_widths(centre, spectra.u.size)
    if not widths:
        return _answer(spectra, centre, delay, polynomials, ())
    chosen, _ = choose(polynomials, ())
    g = np.stack([fit.response for fit in polynomials])[chosen, np.arange(centre.size)]
    inside = np.arange(centre[0], centre[-1] + 1)
    smooth = spectra.y.copy()
    smooth[inside] = spectra.u[inside] * np.interp(inside, centre, g)
    rationals = rational_fits(spectra, centre, widths, smooth)
    return _answer(spectra, centre, delay, polynomials, rationals)


def _polynomials(
    spectra: Spectra,
    centre: NDArray[np.int64],
    order: int,
    widths: tuple[int, ...] | None,
    ratio: float = _RATIO,
) -> list[LocalFit]:
    bins = spectra.u.size - 1
    # Each polynomial has order + 1 coefficients, and residuals must be left over.
    order = min(order, max((bins - 2) // 4 - 1, 0))
    least = 2 * (order + 1)
    if widths is None:
        top = min(max(int(centre[-1] - centre[0] + 1) // 3, least + 1), _WIDEST)
        count = max(int(np.ceil(np.log(top / least) / np.log(ratio))), 1)
        widths = tuple(int(w) for w in np.rint(np.geomspace(least, top, count + 1)))
    most = max((bins - 1) // 2, 1)
    return polynomial_fits(
        spectra, centre, tuple(sorted({min(max(w, order + 1), most) for w in widths})), order
    )


def _rational_widths(centre: NDArray[np.int64], bins: int) -> tuple[int, ...]:
    """Return half the band, a quarter, and so on, as far as each can be paid for."""
    widths = []
    span = int(centre[-1] - centre[0] + 1)
    width = min(span // 2, (bins - 1) // 2)
    while width >= _NARROWEST_RATIONAL:
        if (2 * width + 1) * min(centre.size, 3 * span // width + 1) <= _AFFORDABLE:
            widths.append(width)
        width //= 2
    return tuple(reversed(widths))


def _answer(
    spectra: Spectra,
    centre: NDArray[np.int64],
    delay: float,
    polynomials: list[LocalFit],
    rationals: list[LocalFit] | tuple[()],
) -> FrequencyResponse:
    chosen, bent = choose(polynomials, rationals)
    tried, rows = (*polynomials, *rationals), np.arange(centre.size)
    response = np.stack([fit.response for fit in tried])[chosen, rows]
    variance = np.stack([fit.spread * fit.noise for fit in tried])[chosen, rows]
    frequency = spectra.frequency[centre]
    return FrequencyResponse(
        frequency=frequency,
        response=response * np.exp(-2j * np.pi * frequency * delay),
        std=np.sqrt(variance + bent),
        coherence=None,
    )


def _masked(
    u: Real, y: Real, mask: Mask, fs: float, delay: float, band: tuple[float, float], points: int
) -> FrequencyResponse:
    """Estimate with the input zero wherever its response, a delay later, is missing."""
    lag = whole_lag(delay, fs, u.size)
    length = u.size - abs(lag)
    answered = np.ones(u.size, dtype=np.bool_)
    answered[max(-lag, 0) :][:length] = mask[max(lag, 0) :][:length]
    return _single(
        np.where(answered, u, 0.0),
        np.where(mask, y, 0.0),
        fs,
        delay=delay,
        band=band,
        points=points,
    )
