"""Exact response of a rational system with delay to an input known at its samples only.

What the input does between its samples is one of three assumptions (of a held command,
derivatives may be held too), and each is a cardinal B-spline: held (degree 0), linear
(degree 1), and band-limited, taken as the spline of degree 5, which interpolates a band-limited
signal with a relative error of about 2 (f / (fs - f))^6 (Unser, Splines: a perfect fit for signal
and image processing, IEEE Signal Processing Magazine, 1999, eq. 12). An input with content nearer
to the Nyquist frequency is interpolated to a higher rate first.

A system 1/A(s) of order n answers one B-spline by a sequence that an n-th order difference
equation continues; its first samples come from one matrix exponential (C. Van Loan,
Computing integrals involving the matrix exponential, IEEE TAC, 1978). So the response to the whole
record costs one recursive filter, whatever the delay, whole sample or not.

In this module time is counted in samples: coefficients are in powers of s/fs.
"""

from dataclasses import dataclass, replace
from functools import cache, lru_cache
from math import ceil, comb, factorial, floor

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.record import Intersample, is_held

__all__ = [
    "MARGIN",
    "PRECISION",
    "SAMPLES_ALONE",
    "WINDOW",
    "SampledInput",
    "check_fed_forward",
    "companion",
    "delayed_response",
    "interpolation_error",
    "prepare_input",
    "spline_at",
    "spline_signs",
]

MARGIN = 24
"""Samples by which the input is continued at either end: a spline's reach, with room."""

PRECISION = 3e-5
"""Share of the input's deviation (r.m.s.) by which what lies between its samples may be missed."""

SAMPLES_ALONE = -1
"""Degree that stands for an input of which nothing but its samples is seen."""

WINDOW = 1.3e-6
"""Share that a window as long as the margins misses of what is interpolated to a higher rate."""

_STRETCH = 65_536
"""Most samples of a stretch; spectra of stretches show how fast an input moves."""

_DEGREE: dict[Intersample, int] = {
    "zoh": 0,
    "foh": 1,
    "bandlimited": 5,
    "feedforward": 0,
    "sampled": SAMPLES_ALONE,
}

_SPLINE_DERIVATIVES = (
    np.array([1.0, 10.0, 0.0, -10.0, -1.0]) / 24.0,
    np.array([1.0, 2.0, -6.0, 2.0, 1.0]) / 6.0,
)
"""First and second derivative of the B-spline of degree 5 at -2 to 2."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampledInput:
    """An input prepared once for many responses.

    Parameters
    ----------
    coefficients : ndarray, shape (..., oversampling * (n + 2 * margin))
        B-spline coefficients of the deviation from the first sample.
    first : float
        First sample; before the record the input stood there.
    degree : int
        Degree of the spline between the samples; `SAMPLES_ALONE` for software.
    oversampling : int
        Fine samples per sample of the record.
    samples : int
        Length n of the record.
    derivatives : ndarray, shape (2, ..., n + 2 * margin), or None
        Coefficients of velocity and acceleration per sample, if these are held too.
    """

    coefficients: NDArray[np.float64]
    first: float
    degree: int
    oversampling: int
    samples: int
    derivatives: NDArray[np.float64] | None = None

    def combined(self, numerator: NDArray[np.float64]) -> "SampledInput":
        """Return B(s) of the command, its derivatives held too: the input to 1/A(s).

        Parameters
        ----------
        numerator : ndarray, shape (1 to 3,)
            B by rising powers of s per sample.
        """
        check_fed_forward(numerator)
        parts = zip(numerator, self.commands, strict=False)
        whole = sum(weight * part.coefficients for weight, part in parts)
        return replace(self, coefficients=np.asarray(whole), derivatives=None)

    @property
    def commands(self) -> tuple["SampledInput", ...]:
        """The command, and its velocity and acceleration if these are held too, each alone."""
        rates = () if self.derivatives is None else self.derivatives
        every = (self.coefficients, *rates)
        return tuple(replace(self, coefficients=c, derivatives=None) for c in every)


def check_fed_forward(numerator: NDArray[np.float64]) -> None:
    """Refuse a numerator that needs more derivatives than a command with feedforward has."""
    if numerator.size > 1 + len(_SPLINE_DERIVATIVES):
        raise ArgumentError(
            f"a numerator of degree {numerator.size - 1} is given; a command with feedforward has "
            "velocity and acceleration only, so give degree 2 at most"
        )


def prepare_input(
    u: NDArray[np.float64],
    intersample: Intersample,
    *,
    rest: bool = True,
    precision: float = PRECISION,
) -> SampledInput:
    """Turn samples into spline coefficients, under an assumption on what lies between.

    Parameters
    ----------
    u : ndarray, shape (..., n)
        Uniform samples. Many inputs at once must begin with the same one, and are not interpolated
        to a higher rate: the precision of band-limited ones is infinite.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'}
        Held, linear, or band-limited; held together with velocity and acceleration, which are
        commanded too; 'sampled' for software, which sees the samples alone.
    rest : bool
        Whether the input stood at its first sample before the record. Else it is continued there
        as after the last sample, so that no corner rings; the free response of the state answers
        for what it did.
    precision : float
        Share of the input's deviation (r.m.s.) by which a band-limited one may be missed.

    Examples
    --------
    >>> prepare_input(np.array([1.0, 2.0, 4.0]), "zoh").first
    1.0
    """
    first = float(u.flat[0])
    deviation = u - first
    still = is_held(intersample) or intersample == "sampled"
    last = deviation[..., -1:]
    after = np.repeat(last, MARGIN, axis=-1) if still else _continued(deviation)
    before = np.zeros_like(after)
    if not (rest or still):
        before = _continued(deviation[..., ::-1])[..., ::-1]
    extended = np.concatenate([before, deviation, after], axis=-1)
    oversampling = 1
    if intersample == "bandlimited":
        oversampling = _oversampling(deviation, precision)
        if oversampling > 1:
            extended = _interpolated(extended, oversampling, min(precision, WINDOW))
        extended = scipy.ndimage.spline_filter1d(extended, order=5, mode="mirror")
    return SampledInput(
        coefficients=extended,
        first=first,
        degree=_DEGREE[intersample],
        oversampling=oversampling,
        samples=u.shape[-1],
        derivatives=_derivatives(u, precision) if intersample == "feedforward" else None,
    )


def _derivatives(u: NDArray[np.float64], precision: float) -> NDArray[np.float64]:
    """Velocity and acceleration of a band-limited input at its samples; 0 before and after them.

    Where a spline misses a share x⁶ of the input, it misses about x⁴ of the acceleration: x⁴ ≤ p
    needs x⁶ ≤ p^1.5, and the square is on the safe side.
    """
    smooth = prepare_input(u, "bandlimited", rest=False, precision=precision**2)
    factor = smooth.oversampling
    here = slice(MARGIN * factor, (MARGIN + smooth.samples) * factor, factor)
    found = [
        factor**order * scipy.ndimage.convolve1d(smooth.coefficients, weights)[..., here]
        for order, weights in enumerate(_SPLINE_DERIVATIVES, start=1)
    ]
    around = [(0, 0)] * u.ndim + [(MARGIN, MARGIN)]
    return np.pad(np.stack(found), around)


def _continued(deviation: NDArray[np.float64]) -> NDArray[np.float64]:
    """What follows a last sample, odd about it: neither value nor slope jumps."""
    reach = min(MARGIN, deviation.shape[-1] - 1)
    after = 2.0 * deviation[..., -1:] - deviation[..., -2 : -2 - reach : -1]
    last = after[..., -1:] if reach else np.zeros_like(deviation)
    return np.concatenate([after, np.repeat(last, MARGIN - reach, axis=-1)], axis=-1)


def interpolation_error(u: NDArray[np.float64], oversampling: int) -> float:
    """Share of an input's deviation, (n,), that its spline misses (r.m.s.), 2 (f / (F - f))^6.

    The power spectrum of a long input is summed over stretches of it.
    """
    size = u.size // -(-u.size // _STRETCH)
    stretches = (u - u[0])[: u.size // size * size].reshape(-1, size)
    taper = np.hanning(size + 2)[1:-1]  # the ends' jump is not content
    power = np.sum(np.abs(scipy.fft.rfft(stretches * taper)) ** 2, axis=0)
    total = float(power.sum())
    if total == 0.0:
        return 0.0
    frequency = np.arange(power.size) / size
    share = frequency / (oversampling - frequency)
    missed = 2.0 * (share * share**2) ** 2  # a square is multiplied, and a higher power is not
    return float(np.sqrt(power @ missed**2 / total))


def _oversampling(deviation: NDArray[np.float64], precision: float) -> int:
    """Factor that brings the content of the input below the spline's good band."""
    for factor in (1, 2):
        if precision == np.inf or interpolation_error(deviation, factor) <= precision:
            return factor
    return 4


@lru_cache(maxsize=16)
def _interpolator(factor: int, missed: float) -> NDArray[np.float64]:
    """A sinc in a Kaiser window that misses so much, longer for less: as steep as `WINDOW`'s.

    J. F. Kaiser, Nonrecursive digital filter design using the I0-sinh window function, 1974.
    """
    down, usual = (-20.0 * np.log10(share) for share in (missed, WINDOW))
    half = factor * ceil(MARGIN * (down - 8.0) / (usual - 8.0))
    beta = 0.1102 * (down - 8.7)
    return factor * np.asarray(
        scipy.signal.firwin(2 * half + 1, 1.0 / factor, window=("kaiser", beta))
    )


def _interpolated(extended: NDArray[np.float64], factor: int, missed: float) -> NDArray[np.float64]:
    """Band-limited interpolation by a windowed sinc; beyond the margins the input stands still."""
    kernel = _interpolator(factor, max(missed, float(np.finfo(float).eps)))
    more = max(kernel.size // (2 * factor) - MARGIN, 0)
    longer = np.pad(extended, more, mode="edge")
    stuffed = np.zeros(longer.size * factor)
    stuffed[::factor] = longer
    fine = scipy.signal.oaconvolve(stuffed, kernel, mode="same")
    return np.asarray(fine[factor * more : fine.size - factor * more], dtype=np.float64)


@cache
def spline_signs(degree: int) -> NDArray[np.float64]:
    """Binomial coefficients of alternating sign: a B-spline is that difference of powers."""
    return np.array([(-1.0) ** j * comb(degree + 1, j) for j in range(degree + 2)])


def companion(denominator: NDArray[np.float64], chained: int) -> NDArray[np.float64]:
    """State matrix of 1/A driven by a chain of integrators, shape (n + chained, n + chained).

    The first n states are the output of 1/A and its derivatives. The first state of the chain
    drives them; the last is constant. The denominator is by rising powers of s, (n + 1,).
    """
    n = denominator.size - 1
    matrix = np.eye(n + chained, k=1)
    matrix[n - 1, :n] = -denominator[:-1] / denominator[-1]
    matrix[n - 1, n] = 1.0 / denominator[-1]
    return matrix


@lru_cache(maxsize=16)  # a fit asks for the same system several times in a row
def _spline_taps(
    coefficients: tuple[float, ...], lag: float, degree: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Answer of s^i / A(s), i = 0..n-1, to one B-spline, as numerators in z^-1.

    The spline begins at time 0; the answer is sampled at i - lag, 0 <= lag < 1.
    Returns numerators, shape (n, n + degree + 2), and the denominator, shape (n + 1,).
    """
    denominator = np.array(coefficients)
    n = denominator.size - 1
    taps = n + degree + 2
    matrix = companion(denominator, degree + 1)  # t^p/p!, ..., t, 1 drive it
    start = np.zeros(n + degree + 1)
    start[-1] = 1.0
    step, part = scipy.linalg.expm(np.stack([matrix, matrix * (1.0 - lag)]))
    truncated = np.zeros((taps, n))  # answers to t_+^p / p! at i - lag
    state = part @ start
    for i in range(1, taps):
        truncated[i] = state[:n]
        state = step @ state
    recursion = _characteristic(step[:n, :n])
    # Differences make the spline of the truncated powers, the recursion makes it finite.
    weights = np.zeros(taps + 1)
    both = np.convolve(spline_signs(degree), recursion)
    weights[: min(both.size, taps)] = both[:taps]
    numerators = weights[_lower(taps)] @ truncated
    return np.ascontiguousarray(numerators.T), recursion


@cache
def _lower(taps: int) -> NDArray[np.intp]:
    """Index i - j of a lower triangular Toeplitz matrix; above the diagonal that of a zero."""
    i = np.arange(taps)
    back = i[:, None] - i[None, :]
    return np.asarray(np.where(back >= 0, back, taps))


def _characteristic(step: NDArray[np.float64]) -> NDArray[np.float64]:
    """Characteristic polynomial of the transition matrix, highest power first."""
    if step.shape == (1, 1):
        return np.array([1.0, -step[0, 0]])
    if step.shape == (2, 2):
        return np.array(
            [
                1.0,
                -step[0, 0] - step[1, 1],
                step[0, 0] * step[1, 1] - step[0, 1] * step[1, 0],
            ]
        )
    return np.asarray(np.poly(step).real)


def spline_at(lag: float, degree: int) -> NDArray[np.float64]:
    """One B-spline itself, sampled at i - lag: the answer of a system without dynamics."""
    i = np.arange(degree + 2)
    t = i - lag - i[:, None]  # one row for each of the powers that it is the difference of
    powers = np.where(t >= 0.0, 1.0, 0.0) if degree == 0 else np.maximum(t, 0.0) ** degree
    return np.asarray(spline_signs(degree) @ powers / factorial(degree))


def delayed_response(
    source: SampledInput,
    *,
    delay: float,
    denominator: NDArray[np.float64],
    powers: int = 1,
) -> NDArray[np.float64]:
    r"""Responses of :math:`s^i e^{-s\tau} / A(s)`, i = 0..powers-1, at rest before the record.

    Parameters
    ----------
    source : SampledInput
        The prepared input; its first sample is taken as the level before the record, and
        the response to that level is not included (add `first` times the gain at DC).
    delay : float
        Pure delay in samples, at least -20.
    denominator : ndarray, shape (n + 1,)
        A(s) by rising powers of s per sample, stable; A = [1] is a system without dynamics.
    powers : int
        How many responses, at most n + 1; the last of these is fed through, and with n = 0
        it is the delayed input itself.

    Returns
    -------
    ndarray, shape (powers, ..., samples)

    Examples
    --------
    >>> held = prepare_input(np.array([0.0, 1.0, 1.0, 1.0]), "zoh")
    >>> first_order = np.array([1.0, 2.0])
    >>> y = delayed_response(held, delay=0.0, denominator=first_order)
    >>> bool(np.allclose(y[0], [0, 0, 1 - np.exp(-0.5), 1 - np.exp(-1.0)]))
    True
    """
    factor = source.oversampling
    half = 0.0 if source.degree == 0 else (source.degree + 1) / 2
    offset = delay * factor - half
    whole = floor(offset)
    lag = offset - whole
    n = denominator.size - 1
    begin = factor * MARGIN - whole  # where in the filtered coefficients the record begins
    stop = begin + factor * source.samples
    c = source.coefficients
    out = np.zeros((powers, *c.shape[:-1], source.samples))
    if stop <= 0:  # delayed beyond the record's end
        return out
    if stop > c.shape[-1]:
        c = np.concatenate([c, np.repeat(c[..., -1:], stop - c.shape[-1], axis=-1)], axis=-1)
    c = c[..., :stop]

    def filtered(
        numerator: NDArray[np.float64], recursion: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        y = scipy.signal.lfilter(numerator, recursion, c)
        if begin < 0:
            late = np.zeros((*y.shape[:-1], min(-begin, factor * source.samples)))
            y = np.concatenate([late, y], axis=-1)
        return np.asarray(y[..., max(begin, 0) :: factor][..., : source.samples])

    if n:
        scale = float(factor) ** np.arange(n + 1)
        numerators, recursion = _spline_taps(
            tuple((denominator * scale).tolist()), lag, source.degree
        )
        for i in range(min(powers, n)):
            out[i] = filtered(numerators[i] * scale[i], recursion)
    if powers > n:
        fed = filtered(spline_at(lag, source.degree), np.ones(1))
        out[n] = (fed - np.tensordot(denominator[:-1], out[:n], 1)) / denominator[-1] if n else fed
    return out
