"""The frequency response from one record, by local fits, with its error at each frequency.

Around each frequency a polynomial or a rational function is fitted over neighbouring bins of the
transform. Cross-validation chooses between them, and how many neighbours they use: it measures how
well each predicts a bin from its neighbours alone.
"""

from collections.abc import Callable
from functools import cache, partial

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Complex, Mask, Real
from hmpim.identify.chance import searched
from hmpim.identify.frf.choice import choose, needs_narrow_windows
from hmpim.identify.frf.neighbours import WIDEST, LocalFit, Spectra, centres_in_band, transform
from hmpim.identify.frf.polynomial import polynomial_fits
from hmpim.identify.frf.rational import Regressors, rational_fits
from hmpim.identify.kept import keeping
from hmpim.identify.result import FrequencyResponse
from hmpim.identify.signals import bins_in, check_band, whole_lag
from hmpim.identify.worth import DEEPEST, MOST, PART

__all__ = ["local_response", "local_responses"]

_ORDER = 2
# Ratio of the widths of successive windows of polynomials.
_RATIO = 2.0
# Narrower windows are too short for eight coefficients in noise.
_NARROWEST_RATIONAL = 20
# Bins in all windows of one width of rational functions, beyond which they cost too much. So long
# a record has enough neighbours for polynomials.
_AFFORDABLE = 60_000
# Records of one input that are fitted at once: they fit into a processor's cache.
_AT_ONCE = 32


def local_response(
    u: Real,
    y: Real,
    fs: float,
    *,
    band: tuple[float, float],
    delay: float = 0.0,
    points: int = 400,
    residual: bool = False,
) -> FrequencyResponse:
    """Return the frequency response by local polynomials and local rational functions.

    Cross-validation, averaged over 61 frequencies and weighed against the variance of G, chooses
    at each frequency between them, with a transient or without, and among widths. Windows of half
    the band and a quarter are always tried, narrower ones if these do not suffice. The delay is
    removed first and restored at the end; the bias is in the bin at DC, which is not used. If an
    input ends at another value than it began, as a step or a ramp does, that jump leaks into every
    bin: then both signals are differenced, which does not change their ratio. `residual` says that
    the output is a model's residual, which is often noise: simpler fits then suffice.

    Input and output, (n,), are on one clock; rate and excited band are in Hz, the pure delay is in
    s and need not be exact. The frequencies are bins of the record inside the band, at most
    `points`, spaced by a constant ratio if there are more, without gaps of the input's spectrum.
    `std` comes from the residual around each frequency and from the estimated bias.

    Both are estimates of Pintelon and Schoukens, System Identification, 2nd ed., ch. 7; see
    `hmpim.identify.frf.rational` for how the rational one differs from McKelvey and Guerin.

    Raises
    ------
    ArgumentError
        For an impossible band, or one without a bin.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = 2 * np.concatenate((np.zeros(30), u[:-30])) + 0.6
    >>> frf = local_response(u, y, 200.0, band=(0.1, 20.0), delay=0.15)
    >>> bool(np.allclose(np.abs(frf.response), 2.0))
    True
    """
    check_band(band, fs)
    delays = np.array([delay])
    return local_responses(
        u, y[None], fs, delays=delays, band=band, points=points, residual=residual
    )[0]


@keeping()
def local_responses(
    u: Real,
    outputs: Real,
    fs: float,
    *,
    band: tuple[float, float],
    delays: Real,
    points: int = 400,
    residual: bool = False,
) -> list[FrequencyResponse]:
    """Return the responses of many outputs to one input, each as `local_response` finds it.

    The outputs, (k, n), have pure delays in s, (k,). All that depends on the input alone is
    computed once, and many records are fitted at once.
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
            response, variance = _chosen(spectra, centre, regressors, residual=residual)
            frequency = spectra.frequency[centre]
            response = response * np.exp(-2j * np.pi * frequency * delays[some, None])
            for i, each, std in zip(some.tolist(), response, np.sqrt(variance), strict=True):
                found[i] = FrequencyResponse(
                    frequency=frequency, response=each, std=std, coherence=None
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


def _excited(u: Complex, centre: NDArray[np.int64]) -> Mask:
    """Centres outside gaps of the input's spectrum, in which a fit would only interpolate."""
    # Hann's window removes leakage into a gap.
    power = np.abs(u - 0.5 * (np.roll(u, 1) + np.roll(u, -1)))[: centre[-1] + 1] ** 2
    power[0] = 0.0  # the mean
    near = scipy.ndimage.maximum_filter1d(power, 4 * (_ORDER + 1) + 1)
    below, above = np.maximum.accumulate(power), np.maximum.accumulate(power[::-1])[::-1]
    return np.asarray(near >= DEEPEST * np.minimum(below, above))[centre]


def _chosen(
    spectra: Spectra,
    centre: NDArray[np.int64],
    regressors: Callable[[int], Regressors],
    *,
    residual: bool,
) -> tuple[Complex, Real]:
    """Response and variance at each centre, of each record.

    The polynomials give the start of the rational functions, which are fitted over the two widest
    windows, for a `residual` only if it is not noise: then the polynomials need narrow windows.
    Narrower windows follow, one by one, for records that do not suffice with these: the narrowest
    so far, or a polynomial narrower than the next, is chosen at many frequencies, or a bin of the
    residual exceeds the noise, whose power has an exponential distribution.
    """
    widths, polynomials = _polynomials(spectra, centre)
    chosen, response, variance = choose(polynomials, ())
    rational = _rational_widths(centre, spectra.u.size)
    rough = np.ones(spectra.y.shape[0], dtype=bool)
    if residual:
        rough = needs_narrow_windows(chosen, len(widths))
    if not rational or not rough.any():
        return response, variance
    polynomials = [fit.of(rough) for fit in polynomials]
    inside = np.arange(centre[0], centre[-1] + 1)
    smooth = spectra.y.copy()
    between = [np.interp(inside, centre, own) for own in response]
    smooth[:, inside] = spectra.u[inside] * np.stack(between)
    open_records = np.flatnonzero(rough)
    fits: list[LocalFit] = []
    for k, width in enumerate(rational):
        some = Spectra(frequency=spectra.frequency, u=spectra.u, y=spectra.y[open_records])
        own, peak = rational_fits(some, regressors(width), smooth[open_records])
        fits = own + fits
        if k == 0 and len(rational) > 1:
            continue  # the next width decides about the widest
        chosen, response[open_records], variance[open_records] = choose(polynomials, fits)
        if k + 1 == len(rational):
            break
        below = 2 * sum(w < rational[k + 1] for w in widths)
        first = len(polynomials)
        narrow = (chosen < below) | ((chosen >= first) & (chosen < first + 2))
        more = (narrow.mean(axis=-1) > PART) | (peak > searched(spectra.u.size))
        if not more.any():
            break
        open_records = open_records[more]
        polynomials, fits = ([fit.of(more) for fit in kind] for kind in (polynomials, fits))
    return response, variance


def _polynomials(spectra: Spectra, centre: NDArray[np.int64]) -> tuple[list[int], list[LocalFit]]:
    """Widths, and two fits of each."""
    bins = spectra.u.size - 1
    # Each polynomial has order + 1 coefficients; the window must hold more bins than coefficients.
    order = min(_ORDER, max((bins - 2) // 4 - 1, 0))
    least = 2 * (order + 1)
    top = min(max(int(centre[-1] - centre[0] + 1) // 3, least + 1), WIDEST)
    count = max(int(np.ceil(np.log(top / least) / np.log(_RATIO))), 1)
    most = max((bins - 1) // 2, 1)
    widths = np.rint(np.geomspace(least, top, count + 1))
    each = sorted({min(max(int(width), order + 1), most) for width in widths})
    return each, polynomial_fits(spectra, centre, tuple(each), order)


def _rational_widths(centre: NDArray[np.int64], bins: int) -> list[int]:
    """Return half the band, a quarter, and so on, if each is affordable."""
    widths = []
    span = int(centre[-1] - centre[0] + 1)
    width = min(span // 2, (bins - 1) // 2)
    while width >= _NARROWEST_RATIONAL:
        if (2 * width + 1) * min(centre.size, 3 * span // width + 1) <= _AFFORDABLE:
            widths.append(width)
        width //= 2
    return widths
