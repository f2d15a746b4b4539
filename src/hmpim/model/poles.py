r"""Response of one pole, behind a delay, to a spline: closed form for tap and slope.

A rational system is a sum of single poles, 1/A(s) = Σ rₖ/(s - pₖ). One pole answers one B-spline
of degree d by d + 2 samples of its own and then by e^(pt) for ever, so that its response to a
whole record is one recursion of first order. With

    g(t) = ∫₀ᵗ e^(p(t-x)) xᵈ/d! dx = t^(d+1) φ_(d+1)(pt),

φ the functions of exponential integrators (M. Hochbruck and A. Ostermann, Acta Numerica 19, 2010,
section 2.1), the answer to a B-spline is the difference of order d + 1 of g. Its derivative by p
is known as well: φₖ' = φₖ - k φₖ₊₁. φ is summed by quadrature, or by recursion where its
argument is large. `hmpim.model.sampled` gives the same by a matrix exponential;
each checks the other.

In this module time is counted in samples.
"""

from functools import cache, cached_property
from math import factorial, floor
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.model.sampled import (
    MARGIN,
    SampledInput,
    delayed_response,
    spline_at,
    spline_signs,
)

__all__ = [
    "APART",
    "PoleResponses",
    "distances",
    "fractions",
    "input_responses",
    "modal_form",
    "parted",
    "partial_fractions",
    "placed",
    "pole_taps",
    "rational_response",
]

_NODES = 24
_QUADRATURE = 12.0
"""Modulus up to which quadrature gives φ to the last digit; beyond it the recursion from e^z."""

APART = 2e-4
"""Least distance of two poles, over their size: a double pole is taken as two that are as near,
which changes no response by more than the square of this."""

_AGREES = 1e-8
"""Share of the largest response by which a sum of poles may miss it."""

_COMPANION = 6
"""Poles up to which a companion matrix, and powers of z, keep them apart."""

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


@cache
def _nodes(order: int) -> tuple[Real, Real]:
    """Gauss-Legendre nodes 1 - x on (0, 1) and weights x^(k-1)/(k-1)! of ∫ e^((1-x) z) dx."""
    x, weight = np.polynomial.legendre.leggauss(_NODES)
    x = (x + 1.0) / 2.0
    return 1.0 - x, weight / 2.0 * x ** (order - 1) / factorial(order - 1)


def _phi(z: Complex, order: int) -> tuple[Complex, Complex]:
    """φ of an order from 1 on, and its derivative, elementwise."""
    nodes, weights = _nodes(order)
    small = np.abs(z) < _QUADRATURE
    near = small.all()
    waves = np.exp((z if near else np.where(small, z, 0.0))[..., None] * nodes)
    low, slope = waves @ weights, waves @ (weights * nodes)
    if not near:
        outer = np.where(small, 1.0, z)
        value = np.exp(outer)
        for k in range(order):
            value = (value - 1.0 / factorial(k)) / outer
        following = (value - 1.0 / factorial(order)) / outer
        low = np.where(small, low, value)
        slope = np.where(small, slope, value - order * following)
    return np.asarray(low), np.asarray(slope)


@cache
def _differences(degree: int) -> Real:
    """The difference of order d + 1 of a row of d + 3 samples, as a matrix to its right."""
    size, signs = degree + 3, enumerate(spline_signs(degree))
    return np.asarray(sum(sign * np.eye(size, k=j) for j, sign in signs))


def pole_taps(poles: Complex, lag: float, degree: int) -> tuple[Complex, Complex]:
    """Answer of 1/(s - p) to one B-spline, and its derivative by p, as numerators over 1 - e^p/z.

    Parameters
    ----------
    poles : complex ndarray, shape (k,)
        Per sample, real part at most 0.
    lag : float
        The answer is sampled at i - lag, 0 <= lag < 1.
    degree : int
        Of the spline, which begins at time 0.

    Returns
    -------
    taps, slopes : complex ndarray, shape (k, degree + 3)
        The answer's z-transform is Σ taps z^-i / (1 - e^p/z). That of its derivative is
        Σ slopes z^-i / (1 - e^p/z) plus e^p/z / (1 - e^p/z) times the answer's own.

    Examples
    --------
    >>> taps, _ = pole_taps(np.array([-1.0 + 0j]), 0.0, 0)  # a held input
    >>> taps[0].real.round(6).tolist()
    [0.0, 0.632121, 0.0]
    """
    t = np.maximum(np.arange(degree + 3) - lag, 0.0)
    z = poles[:, None] * t
    phi, rate = _phi(z, degree + 1)
    powers = t ** (degree + 1)
    value, slope = powers * phi, powers * t * rate
    differences = _differences(degree)
    answer, turned = value @ differences, slope @ differences
    decay = np.exp(poles)[:, None]
    taps, slopes = answer.copy(), turned.copy()
    taps[:, 1:] -= decay * answer[:, :-1]
    # From (1 - q/z) h = taps, differentiated: (1 - q/z) h' = taps' + q/z h.
    slopes[:, 1:] -= decay * (turned[:, :-1] + answer[:, :-1])
    return taps, slopes


def placed(source: SampledInput, delay: float) -> tuple[int, float]:
    """Where in a source's coefficients the record begins behind a delay, and the lag left.

    Parameters
    ----------
    source : SampledInput
        The prepared input.
    delay : float
        Samples of the record.

    Returns
    -------
    begin : int
        Fine sample of the filtered coefficients at which the record begins.
    lag : float
        Fine samples, 0 <= lag < 1.
    """
    half = 0.0 if source.degree == 0 else (source.degree + 1) / 2
    offset = delay * source.oversampling - half
    whole = floor(offset)
    return source.oversampling * MARGIN - whole, offset - whole


class PoleResponses:
    """Responses of e^(-sτ)/(s - p) to an input's deviation from its first sample, from rest.

    Parameters
    ----------
    source : SampledInput
        The prepared input.
    delay : float
        Pure delay in samples, at least -20.
    poles : complex ndarray, shape (k,)
        Per sample of the record, real part at most 0.

    Examples
    --------
    >>> from hmpim.model.sampled import prepare_input
    >>> held = prepare_input(np.array([0.0, 1.0, 1.0, 1.0]), "zoh")
    >>> PoleResponses(held, 0.0, np.array([-0.5 + 0j])).waves.round(6).tolist()
    [[0.0, 0.0, 0.786939, 1.264241]]
    """

    def __init__(self, source: SampledInput, delay: float, poles: Complex) -> None:
        factor = source.oversampling
        begin, lag = placed(source, delay)
        self._source, self._turning = source, np.flatnonzero(poles.imag)
        self._c, self._first = _reaching(source, begin)
        self._taps, self._turned = pole_taps(poles / factor, lag, source.degree)
        self._powers = np.exp(poles[:, None] / factor * np.arange(factor + 1))
        self._answers = self._recursive(_products(self._taps, self._powers) / factor)
        self.waves = self._kept(self._answers)
        """Real parts, then the imaginary parts of those that have one, shape (waves, n)."""

    @cached_property
    def slopes(self) -> Real:
        """Derivatives by p, the responses of e^(-sτ)/(s - p)², as `waves` are."""
        powers = self._powers
        factor = powers.shape[1] - 1
        weights = _products(self._turned, powers)
        weights += _products(self._taps, powers * np.arange(factor + 1))
        return self._kept(self._recursive(weights / factor**2, again=True))

    def summed(self, weights: Complex, waves: Real) -> Real:
        """Real parts of sums over poles, shape (rows, n), of `waves` or their slopes.

        Parameters
        ----------
        weights : complex ndarray, shape (rows, k)
        waves : ndarray, shape (waves, n)
        """
        return np.asarray(self.parts(weights.conj().T).T @ waves)

    def parts(self, each: Complex) -> Real:
        """Values of each pole, shape (k, n), as `waves` are."""
        return np.concatenate([each.real, each.imag[self._turning]])

    def _recursive(self, weights: Complex, *, again: bool = False) -> Real:
        """Weighted sums of coefficients, over 1 - q/z for each pole; z is a sample of the record.

        Where it is `again`, the answers one sample before are driven by too, times q.
        """
        start = self._first % self._source.oversampling
        count = self._first // self._source.oversampling + self._source.samples
        answers = np.empty((weights.shape[0] + self._turning.size, count))
        imaginary = dict(
            zip(self._turning.tolist(), range(weights.shape[0], len(answers)), strict=True)
        )
        for k, q in enumerate(self._powers[:, -1].tolist()):
            at = imaginary.get(k)
            driven = self._filtered(weights[k].real, start, count)
            if at is None:
                if again:
                    driven[1:] += q.real * self._answers[k, :-1]
                answers[k] = scipy.signal.lfilter(_ONE, [1.0, -q.real], driven)
                continue
            both = np.empty(count, dtype=np.complex128)
            both.real, both.imag = driven, self._filtered(weights[k].imag, start, count)
            if again:
                real, imag = self._answers[k, :-1], self._answers[at, :-1]
                both.real[1:] += q.real * real - q.imag * imag
                both.imag[1:] += q.real * imag + q.imag * real
            both = scipy.signal.lfilter(_ONE, [1.0, -q], both)
            answers[k], answers[at] = both.real, both.imag
        return answers

    def _filtered(self, weights: Real, start: int, count: int) -> Real:
        """Weighted sums of the coefficients up to each sample of the record and before it."""
        factor = self._source.oversampling
        if factor == 1:
            return np.convolve(self._c, weights)[:count]
        out = np.zeros(count)
        for phase in range(factor):
            late = phase > start  # the sample before holds it
            c = self._c[start - phase + factor * late :: factor]
            part = np.convolve(c, weights[phase::factor])[: count - late]
            out[late : late + part.size] += part
        return out

    def _kept(self, answers: Real) -> Real:
        return np.asarray(answers[:, self._first // self._source.oversampling :])


_ONE = np.ones(1)


def _products(taps: Complex, powers: Complex) -> Complex:
    """Taps of each row times its powers q^j z^-j, j below the oversampling.

    The recursion over 1 - q/z then needs one step per sample of the record: 1/(1 - q/z) is
    Σ q^j z^-j / (1 - q^f z^-f).
    """
    factor = powers.shape[1] - 1
    out = np.zeros((taps.shape[0], taps.shape[1] + factor - 1), dtype=np.complex128)
    for j in range(factor):
        out[:, j : j + taps.shape[1]] += powers[:, j : j + 1] * taps
    return out


def input_responses(source: SampledInput, delay: float, *, slopes: bool) -> Real:
    """The delayed input's deviation from its first sample, and its rate per sample.

    A held input has no rate; 0 stands for it.

    Parameters
    ----------
    source, delay, slopes
        As for `PoleResponses`; whether to give the rate too.

    Returns
    -------
    ndarray, shape (1, n) or (2, n)

    Examples
    --------
    >>> from hmpim.model.sampled import prepare_input
    >>> ramp = prepare_input(np.arange(5.0), "foh")
    >>> input_responses(ramp, 0.5, slopes=True).tolist()
    [[0.0, 0.5, 1.5, 2.5, 3.5], [0.0, 1.0, 1.0, 1.0, 1.0]]
    """
    begin, lag = placed(source, delay)
    c, first = _reaching(source, begin)
    rows = np.zeros((2 if slopes else 1, source.samples))
    rows[0] = _kept(np.convolve(c, spline_at(lag, source.degree)), source, first)
    if slopes and source.degree > 0:
        lower = spline_at(lag, source.degree - 1)
        taps = np.append(lower, 0.0) - np.concatenate([[0.0], lower])
        rows[1] = source.oversampling * _kept(np.convolve(c, taps), source, first)
    return rows


def _reaching(source: SampledInput, begin: int) -> tuple[Real, int]:
    """Coefficients up to the record's last sample, and where the record begins in them."""
    before = max(-begin, 0)
    last = begin + source.oversampling * (source.samples - 1)
    c = source.coefficients[: max(last + 1, 0)]
    after = max(last + 1 - source.coefficients.size, 0)
    if before or after:
        c = np.concatenate([np.zeros(before), c, np.full(after, c[-1] if c.size else 0.0)])
    return c, begin + before


def _kept(fine: NDArray[Any], source: SampledInput, first: int) -> NDArray[Any]:
    factor = source.oversampling
    return fine[first : first + factor * (source.samples - 1) + 1 : factor]


def parted(poles: Complex) -> Complex:
    """Poles of different sections that coincide, moved apart."""
    for i in range(1, poles.size):
        for j in range(i):
            if abs(poles[i] - poles[j]) < APART * abs(poles[i]):
                poles[i] *= 1.0 + 2.0 * APART
    return poles


def rational_response(
    source: SampledInput, *, delay: float, numerator: Real, denominator: Real
) -> Real:
    """Response of e^(-sτ) B(s)/A(s) to an input's deviation from its first sample, from rest.

    Parameters
    ----------
    source, delay
        As for `PoleResponses`.
    numerator, denominator : ndarray, shapes (m + 1,) and (n + 1,)
        B and A by rising powers of s per sample, m at most n.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> from hmpim.model.sampled import prepare_input
    >>> held = prepare_input(np.array([0.0, 1.0, 1.0, 1.0]), "zoh")
    >>> lag = rational_response(held, delay=0.0, numerator=np.ones(1), denominator=np.array([1, 2]))
    >>> lag.round(6).tolist()
    [0.0, 0.0, 0.393469, 0.632121]
    """
    denominator = np.trim_zeros(denominator, "b")
    expanded = _expanded(numerator, denominator)
    if expanded is None:
        rows = delayed_response(source, delay=delay, denominator=denominator, powers=numerator.size)
        return np.asarray(numerator @ rows)
    poles, residues, through = expanded
    answers = PoleResponses(source, delay, poles)
    out = answers.summed(residues[None], answers.waves)[0]
    if through:
        out += through * input_responses(source, delay, slopes=False)[0]
    return np.asarray(out)


def modal_form(numerator: Real, denominator: Real) -> tuple[Real, Real, Real, float] | None:
    """State matrices of B(s)/A(s) of many poles, each pair a block of its own.

    None of few poles, or of such as are too much alike to be told apart.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (m + 1,) and (n + 1,)
        B and A by rising powers of s, m at most n.

    Returns
    -------
    generator, entry, output : ndarray, shapes (n, n), (n,) and (n,)
    through : float
    """
    expanded = _expanded(numerator, denominator)
    if expanded is None:
        return None
    poles, residues, through = expanded
    blocks, entry, output = [], [], []
    for p, r in zip(poles, residues, strict=True):
        if p.imag:
            blocks.append(np.array([[p.real, -p.imag], [p.imag, p.real]]))
            entry += [1.0, 0.0]
            output += [r.real, -r.imag]
        else:
            blocks.append(np.array([[p.real]]))
            entry.append(1.0)
            output.append(r.real)
    return scipy.linalg.block_diag(*blocks), np.array(entry), np.array(output), through


def _expanded(numerator: Real, denominator: Real) -> tuple[Complex, Complex, float] | None:
    """Poles, one of each conjugate pair, residues that stand for both, and what is fed through.

    None of few poles, and where the sum does not come to B/A, as of many that coincide.
    """
    if denominator.size - 1 <= _COMPANION:
        return None
    every = parted(np.roots(denominator[::-1]).astype(np.complex128))
    simple, constants, _ = partial_fractions(numerator[None, :], every, float(denominator[-1]))
    s = 1j * np.abs(every)
    exact = np.polynomial.polynomial.polyval(s, numerator)
    exact = exact / np.polynomial.polynomial.polyval(s, denominator)
    error = np.sum(simple[0] / (s[:, None] - every), axis=1) + constants[0] - exact
    if not np.abs(error).max() <= _AGREES * np.abs(exact).max():
        return None
    kept = every.imag >= 0.0
    doubled = np.where(every.imag > 0.0, 2.0, 1.0)
    return every[kept], (simple[0] * doubled)[kept], float(constants[0])


def partial_fractions(
    numerators: Real, poles: Complex, leading: float
) -> tuple[Complex, Real, Complex]:
    """Expand each B(s) / (a Π(s - pₖ)) into its poles and a constant.

    Parameters
    ----------
    numerators : ndarray, shape (rows, m + 1)
        B by rising powers of s, m at most the number of poles.
    poles : complex ndarray, shape (k,)
        All different; an expansion about two that are the same is not a number.
    leading : float
        a, the factor of the highest power below.

    Returns
    -------
    residues : complex ndarray, shape (rows, k)
        Factors of 1/(s - pₖ).
    constants : ndarray, shape (rows,)
        What is fed through: 0 unless m equals the number of poles.
    apart : complex ndarray, shape (k, k)
        1/(pⱼ - pₖ), 0 on the diagonal.

    Examples
    --------
    >>> poles = np.array([-1.0, -2.0], dtype=complex)
    >>> square = np.array([[0.0, 0.0, 1.0]])  # s²/((s + 1)(s + 2)) = 1 + 1/(s + 1) - 4/(s + 2)
    >>> residues, constants, _ = partial_fractions(square, poles, 1.0)
    >>> residues[0].real.tolist(), constants.tolist()
    ([1.0, -4.0], [1.0])
    """
    apart, product = distances(poles)
    return (*fractions(numerators, poles, leading * product, leading), apart)


def fractions(
    numerators: Real, poles: Complex, steepness: Complex, leading: float
) -> tuple[Complex, Real]:
    """Residues and constants as `partial_fractions` gives them, from A'(p) at each pole."""
    count = poles.size
    above = numerators @ poles ** np.arange(numerators.shape[1])[:, None]
    fed = numerators.shape[1] > count
    constants = numerators[:, count] / leading if fed else np.zeros(len(numerators))
    return above / steepness, constants


def distances(poles: Complex) -> tuple[Complex, Complex]:
    """1/(pⱼ - pₖ), 0 on the diagonal, and the product of each pole's differences to all others."""
    count = poles.size
    differences = poles[:, None] - poles
    differences[differences == 0.0] = _NOWHERE
    differences.flat[:: count + 1] = 1.0
    apart = 1.0 / differences
    apart.flat[:: count + 1] = 0.0
    return apart, differences.prod(axis=1)


_NOWHERE = complex("nan")
"""Distance of poles that are the same: no expansion."""
