"""The frequency response from one record, by local fits, with its error at each frequency.

Around each frequency a polynomial or a rational function is fitted over neighbouring bins of
the transform. Which of them, and over how many neighbours, the data choose by how well each
predicts a bin from its neighbours alone.
"""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.arrays import Complex, Real
from hmpim.identify.chance import searched
from hmpim.identify.frf.choice import choose
from hmpim.identify.frf.neighbours import WIDEST, LocalFit, Spectra, centres_in_band, transform
from hmpim.identify.frf.polynomial import polynomial_fits
from hmpim.identify.frf.rational import Regressors, rational_fits
from hmpim.identify.kept import keeping
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.signals import as_pair, bins_in, check_band, check_rate, whole_lag
from hmpim.identify.worth import DEEPEST, MOST, PART

__all__ = ["local_response", "local_responses"]

_FEWEST_SAMPLES = 16
_ORDER = 2
# Each window of polynomials is wider than the last by this.
_RATIO = 2.0
# Narrower windows are too short for eight coefficients beside noise.
_NARROWEST_RATIONAL = 20
# Bins in all windows of one width of rational functions, beyond which they cost too much; a
# record so long has neighbours enough for polynomials.
_AFFORDABLE = 60_000
# Records of one input that are fitted at once: as many as a processor's cache holds.
_AT_ONCE = 32


def local_response(
    u: ArrayLike,
    y: ArrayLike,
    fs: float,
    *,
    band: tuple[float, float],
    delay: float = 0.0,
    points: int = 400,
) -> FrequencyResponse:
    """Return the frequency response by local polynomials and local rational functions.

    At each frequency the data choose between them, with a transient or without, and among
    widths (cross-validation, averaged over 61 frequencies, weighed against the variance of G).
    Windows of half the band and a quarter are always tried, narrower ones where these fall short.
    The delay is taken out first and put back at the end; the bias lies in the bin at DC, which
    is not used. Where an input ends elsewhere than it began, as a step or a ramp does, that jump
    leaks into every bin: both are differenced, which leaves their ratio what it is.

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
    points : int
        Greatest number of frequencies; beyond it they are spaced by a constant ratio.

    Returns
    -------
    FrequencyResponse
        At bins of the record inside the band, without gaps that the input leaves in its
        spectrum. `std` is from the residual around each frequency
        and, where the chosen fit predicts worse than the best, from what it lacks. `coherence`
        is None: there is one segment only.

    Raises
    ------
    RecordError
        For unequal lengths, fewer than 16 samples, NaN or infinity, or a constant `u`.
    ArgumentError
        For a rate, band, delay or number of points that cannot be, or a band without a bin of
        the record.

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
    late = np.array([delay])
    (told,) = local_responses(first, second[None], fs, delays=late, band=band, points=points)
    return told


@keeping()
def local_responses(
    u: Real, outputs: Real, fs: float, *, band: tuple[float, float], delays: Real, points: int = 400
) -> list[FrequencyResponse]:
    """Return the responses of many outputs to one input, each as `local_response` finds it.

    What follows from the input alone is made once, and the fits are made of many records at once.
    Outputs have shape (k, n), one a row, and pure delays in s (k,).

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = np.stack([2 * u, 3 * np.concatenate((np.zeros(30), u[:-30]))])
    >>> two = local_responses(u, y, 200.0, band=(0.1, 20.0), delays=np.array([0.0, 0.15]))
    >>> [bool(np.allclose(np.abs(one.response), k)) for one, k in zip(two, (2.0, 3.0))]
    [True, True]
    """
    if abs(u[-1] - u[0]) > MOST * np.ptp(u):
        u, outputs = np.diff(u, prepend=u[0]), np.diff(outputs, axis=-1, prepend=outputs[:, :1])
    found: dict[int, FrequencyResponse] = {}
    lags = np.array([whole_lag(float(delay), fs, u.size) for delay in delays])
    for lag in np.unique(lags):
        alike = np.flatnonzero(lags == lag)
        regressors: Callable[[int], Regressors] | None = None
        for at in range(0, alike.size, _AT_ONCE):
            some = alike[at : at + _AT_ONCE]
            spectra = transform(u, outputs[some], fs, delays[some], band[1])
            if regressors is None:
                centre = _centres(spectra, band, points)
                regressors = partial(Regressors.around, spectra.u, centre)
                if alike.size > _AT_ONCE:
                    regressors = cache(regressors)
            response, variance = _chosen(spectra, centre, regressors)
            frequency = spectra.frequency[centre]
            response = response * np.exp(-2j * np.pi * frequency * delays[some, None])
            for i, one, own in zip(some.tolist(), response, np.sqrt(variance), strict=True):
                found[i] = FrequencyResponse(
                    frequency=frequency, response=one, std=own, coherence=None
                )
    return [found[i] for i in range(outputs.shape[0])]


def _centres(spectra: Spectra, band: tuple[float, float], points: int) -> NDArray[np.int64]:
    step = float(spectra.frequency[1])
    low, high = bins_in(band, step, spectra.frequency.size)
    if high < low:
        raise ArgumentError(
            f"band is ({band[0]:g}, {band[1]:g}) Hz, and the record has no bin in it, only "
            f"multiples of {step:g} Hz; give a wider band or a longer record"
        )
    centre = centres_in_band(low, high, points)
    return centre[_excited(spectra.u, centre)]


def _excited(u: NDArray[np.complex128], centre: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Where the input moves within the narrowest window, or on one side of it not at all.

    Between two parts of the spectrum with nothing in between, a fit would tell only how it
    bridges them. What leaks into the gap, Hann's window takes away.
    """
    power = np.abs(u - 0.5 * (np.roll(u, 1) + np.roll(u, -1)))[: centre[-1] + 1] ** 2
    power[0] = 0.0  # the mean
    near = scipy.ndimage.maximum_filter1d(power, 4 * (_ORDER + 1) + 1)
    below, above = np.maximum.accumulate(power), np.maximum.accumulate(power[::-1])[::-1]
    return np.asarray(near >= DEEPEST * np.minimum(below, above))[centre]


def _chosen(
    spectra: Spectra, centre: NDArray[np.int64], regressors: Callable[[int], Regressors]
) -> tuple[Complex, Real]:
    """Response and variance at each centre, of each record.

    Polynomials come first; what they predict starts the rational functions, which are fitted over
    the two widest windows. Narrower ones follow, in turn, for a record that takes the narrowest so
    far, or polynomials narrower than the next, at many frequencies, or that leaves a bin which is
    no chance: the power of noise is exponentially distributed.
    """
    widths, polynomials = _polynomials(spectra, centre)
    _, response, variance = choose(polynomials, ())
    rational = _rational_widths(centre, spectra.u.size)
    if not rational:
        return response, variance
    inside = np.arange(centre[0], centre[-1] + 1)
    smooth = spectra.y.copy()
    smooth[:, inside] = spectra.u[inside] * np.stack(
        [np.interp(inside, centre, own) for own in response]
    )
    asking, y = np.arange(spectra.y.shape[0]), spectra.y
    fits: list[LocalFit] = []
    for k, width in enumerate(rational):
        some = Spectra(frequency=spectra.frequency, u=spectra.u, y=y[asking])
        own, peak = rational_fits(some, regressors(width), smooth[asking])
        fits = own + fits
        if k == 0 and len(rational) > 1:
            continue  # the widest is judged by the next
        chosen, response[asking], variance[asking] = choose(polynomials, fits)
        if k + 1 == len(rational):
            break
        below = 2 * sum(w < rational[k + 1] for w in widths)
        first = len(polynomials)
        narrow = (chosen < below) | ((chosen >= first) & (chosen < first + 2))
        more = (narrow.mean(axis=-1) > PART) | (peak > searched(spectra.u.size))
        if not more.any():
            break
        asking = asking[more]
        polynomials, fits = ([fit.of(more) for fit in kind] for kind in (polynomials, fits))
    return response, variance


def _polynomials(spectra: Spectra, centre: NDArray[np.int64]) -> tuple[list[int], list[LocalFit]]:
    """Widths, and two fits of each."""
    bins = spectra.u.size - 1
    # Each polynomial has order + 1 coefficients, and residuals must be left over.
    order = min(_ORDER, max((bins - 2) // 4 - 1, 0))
    least = 2 * (order + 1)
    top = min(max(int(centre[-1] - centre[0] + 1) // 3, least + 1), WIDEST)
    count = max(int(np.ceil(np.log(top / least) / np.log(_RATIO))), 1)
    widths = tuple(int(w) for w in np.rint(np.geomspace(least, top, count + 1)))
    most = max((bins - 1) // 2, 1)
    each = sorted({min(max(w, order + 1), most) for w in widths})
    return each, polynomial_fits(spectra, centre, tuple(each), order)


def _rational_widths(centre: NDArray[np.int64], bins: int) -> list[int]:
    """Return half the band, a quarter, and so on, as far as each can be paid for."""
    widths = []
    span = int(centre[-1] - centre[0] + 1)
    width = min(span // 2, (bins - 1) // 2)
    while width >= _NARROWEST_RATIONAL:
        if (2 * width + 1) * min(centre.size, 3 * span // width + 1) <= _AFFORDABLE:
            widths.append(width)
        width //= 2
    return widths
