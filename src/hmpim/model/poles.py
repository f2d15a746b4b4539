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

from dataclasses import replace
from functools import cache, cached_property
from math import factorial, floor
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.model.fractions import Complex, Real, expanded
from hmpim.model.sampled import (
    MARGIN,
    SampledInput,
    delayed_response,
    spline_at,
    spline_signs,
)

__all__ = [
    "PoleResponses",
    "placed",
    "pole_taps",
    "rational_response",
]

_NODES = 24
_QUADRATURE = 12.0
"""Modulus up to which quadrature gives φ to the last digit; beyond it the recursion from e^z."""


_BLOCK = 16
"""Samples of a block; a longer one costs more products, a shorter one more steps between blocks."""

_AT_ONCE = 1024
"""Blocks that are multiplied at once: as many as fit into a processor's cache."""


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
    """Sums of responses of e^(-sτ)/(s - p), from rest, to an input less its first sample.

    Within a block of samples, a sum is one convolution with a few coefficients. All that came
    before the block is held by one state for each pole, and a recursion leads from block to block.
    So a sum is one product of matrices, however many poles it has.

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
    >>> PoleResponses(held, 0.0, np.array([-0.5 + 0j])).summed(np.ones((1, 1))).round(6).tolist()
    [[0.0, 0.0, 0.786939, 1.264241]]
    """

    def __init__(self, source: SampledInput, delay: float, poles: Complex) -> None:
        factor = source.oversampling
        begin, self._lag = placed(source, delay)
        self._source, self._poles = source, poles
        self._tail = source.degree + 2  # age from which on a coefficient is answered by e^(pt)
        self._ages = np.arange(factor * _BLOCK + self._tail)
        self._powers: Complex = np.exp(poles[:, None] / factor * self._ages)
        self._taps, self._turned = pole_taps(poles / factor, self._lag, source.degree)
        self._answers = _followed(self._taps, self._powers) / factor
        self._fine, self._before = _in_blocks(source, begin, self._tail)

    @cached_property
    def _slopes(self) -> Complex:
        """Derivatives of the answers by the poles."""
        late = _followed(self._taps, self._powers * self._ages)
        return (_followed(self._turned, self._powers) + late) / self._source.oversampling**2

    @cached_property
    def _states(self) -> Complex:
        """What each pole remembers when a block begins, shape (k, blocks)."""
        return self._carried(self._answers[:, self._tail, None], None)

    @cached_property
    def _state_slopes(self) -> Complex:
        """Derivatives of the states by the poles."""
        late = self._answers[:, self._tail, None] * self._ages[: -self._tail]
        weights = self._slopes[:, self._tail, None] + late / self._source.oversampling
        return self._carried(weights, _BLOCK * self._states)

    def _carried(self, weights: Complex, driving: Complex | None) -> Complex:
        """Sums over all before each block, weighted by what each age leaves of a coefficient."""
        count, left = self._poles.size, (weights * self._powers[:, : -self._tail])[:, ::-1]
        parts = np.concatenate([left.real, left.imag]) @ self._fine[:-1].T
        new = parts[:count] + 1j * parts[count:]
        out = np.zeros_like(new)
        for k, q in enumerate(np.exp(self._poles * _BLOCK).tolist()):
            own = new[k] if driving is None else new[k] + q * driving[k]
            out[k, 1:] = scipy.signal.lfilter(_ONE, [1.0, -q], own)[:-1]
        return out

    def summed(
        self,
        simple: Complex,
        *,
        double: Complex | None = None,
        direct: Real | None = None,
        rate: Real | None = None,
        here: slice = slice(None),
    ) -> Real:
        """Real parts of weighted sums, shape (rows, n).

        Parameters
        ----------
        simple, double : complex ndarray, shape (rows, k)
            Weights of the responses of 1/(s - p), and of their derivatives by p, which are the
            responses of 1/(s - p)².
        direct, rate : ndarray, shape (rows,)
            Weights of the delayed input itself, and of its rate per sample.
        here : slice
            Samples that are asked for, instead of all n.
        """
        source, lag = self._source, self._lag
        waves = self._powers[:, : -self._tail : source.oversampling]
        answers = (simple @ self._answers).real
        weights, states = [simple[:, :, None] * waves], [self._states]
        if double is not None:
            answers += (double @ self._slopes).real
            weights[0] += double[:, :, None] * (waves * np.arange(_BLOCK))
            weights.append(double[:, :, None] * waves)
            states.append(self._state_slopes)
        if direct is not None:
            answers[:, : self._tail] += np.outer(direct, spline_at(lag, source.degree))
        if rate is not None:
            slope = source.oversampling * _spline_slope(lag, source.degree)
            answers[:, : self._tail] += np.outer(rate, slope)
        short = _padded(answers).take(_ages(self._tail, source.oversampling), axis=1)
        parts = [part for each in weights for part in (each.real, -each.imag)]
        start, stop, _ = here.indices(source.samples)
        first = start // _BLOCK
        out = self._multiplied(
            np.concatenate([short, *parts], axis=1), states, first, -(-stop // _BLOCK) - first
        )
        return out[:, start - first * _BLOCK : stop - first * _BLOCK]

    def _multiplied(self, matrices: Real, states: list[Complex], start: int, blocks: int) -> Real:
        """Coefficients about some blocks and the states there, times a matrix for each row."""
        step = self._fine.shape[1]
        out = np.empty((matrices.shape[0], blocks, _BLOCK))
        some = np.empty((min(blocks, _AT_ONCE), matrices.shape[1]))
        for first in range(0, blocks, _AT_ONCE):
            here = slice(first, min(first + _AT_ONCE, blocks))
            at = slice(here.start + start + self._before, here.stop + start + self._before)
            rows, column = some[: here.stop - here.start], step + self._tail
            rows[:, :step] = self._fine[at]
            rows[:, step:column] = self._fine[at.start + 1 : at.stop + 1, : self._tail]
            for state in states:
                for part in (state.real, state.imag):
                    rows[:, column : column + len(part)] = part[:, at].T
                    column += len(part)
            for own, matrix in zip(out, matrices, strict=True):
                np.matmul(rows, matrix, out=own[here])
        return out.reshape(len(out), -1)


_ONE = np.ones(1)


def _padded(rows: NDArray[Any]) -> NDArray[Any]:
    """Rows with a zero behind them, which index -1 takes."""
    return np.concatenate([rows, np.zeros((rows.shape[0], 1))], axis=1)


def _followed(taps: Complex, powers: Complex) -> Complex:
    """Convolutions of taps, (k, m), with powers, (k, size): shape (k, size)."""
    late = _padded(powers).take(_late(powers.shape[1], taps.shape[1]), axis=1)
    return np.asarray((late @ taps[:, :, None])[:, :, 0])


@cache
def _late(size: int, taps: int) -> NDArray[np.intp]:
    """Index j - l of a convolution, -1 where it is below 0."""
    return np.asarray(np.maximum(np.arange(size)[:, None] - np.arange(taps), -1))


@cache
def _ages(tail: int, factor: int) -> NDArray[np.intp]:
    """Age of each coefficient about a block at each of its samples; -1 where it is later."""
    latest = tail - 1 + factor * np.arange(_BLOCK)
    return np.asarray(np.maximum(latest - np.arange(factor * _BLOCK + tail)[:, None], -1))


def _in_blocks(source: SampledInput, begin: int, tail: int) -> tuple[Real, int]:
    """Coefficients in blocks, shape (blocks + 1, m), and how many lie before the record.

    A block begins with the first coefficient that is younger than `tail` at its first sample.
    """
    step = source.oversampling * _BLOCK
    before = -(-max(begin, 0) // source.oversampling // _BLOCK)
    blocks = before - (-source.samples // _BLOCK)
    fine = np.zeros((blocks + 1, step))
    c, flat = source.coefficients, fine.reshape(-1)
    start = tail - 1 + before * step - begin
    stop = begin + source.oversampling * (source.samples - 1) + 1
    used = min(max(stop, 0), c.size)
    if used:
        flat[start : start + used] = c[:used]
    flat[start + c.size : start + max(stop, c.size)] = c[-1]
    return fine, before


def _spline_slope(lag: float, degree: int) -> Real:
    """Derivative of one B-spline, sampled as `spline_at`; 0 where it jumps."""
    if degree == 0:
        return np.zeros(2)
    lower = spline_at(lag, degree - 1)
    return np.asarray(np.append(lower, 0.0) - np.concatenate([[0.0], lower]))


def rational_response(
    source: SampledInput, *, delay: float, numerator: Real, denominator: Real
) -> Real:
    """Response of e^(-sτ) B(s)/A(s) to an input's deviation from its first sample, from rest.

    Or to many inputs at once, from `prepare_input` together.

    Parameters
    ----------
    source, delay
        As for `PoleResponses`.
    numerator, denominator : ndarray, shapes (m + 1,) and (n + 1,)
        B and A by rising powers of s per sample, m at most n.

    Returns
    -------
    ndarray, shape (..., n)

    Examples
    --------
    >>> from hmpim.model.sampled import prepare_input
    >>> held = prepare_input(np.array([0.0, 1.0, 1.0, 1.0]), "zoh")
    >>> lag = rational_response(held, delay=0.0, numerator=np.ones(1), denominator=np.array([1, 2]))
    >>> lag.round(6).tolist()
    [0.0, 0.0, 0.393469, 0.632121]
    """
    denominator = np.trim_zeros(denominator, "b")
    if source.derivatives is not None and numerator.size > 1:
        source, numerator = source.combined(numerator), np.ones(1)
    found = expanded(numerator, denominator)
    if found is None:
        rows = delayed_response(source, delay=delay, denominator=denominator, powers=numerator.size)
        return np.asarray(np.tensordot(numerator, rows, 1))
    poles, residues, through = found
    direct = np.array([through])
    each = [
        PoleResponses(replace(source, coefficients=own), delay, poles).summed(
            residues[None], direct=direct
        )
        for own in source.coefficients.reshape(-1, source.coefficients.shape[-1])
    ]
    return np.reshape(each, (*source.coefficients.shape[:-1], source.samples))
