"""Local polynomials: around each frequency Y = G U + T + noise, G and T polynomials in it.

Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, chapter 7; Schoukens,
Vandersteen, Barbé and Pintelon, "Nonparametric preprocessing in system identification", 2009.
"""

from dataclasses import dataclass
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.frf.neighbours import (
    NOTHING,
    RIDGE,
    LocalFit,
    Spectra,
    Windows,
    mirrored,
    windows_around,
)
from hmpim.identify.kept import kept

__all__ = ["polynomial_fits"]

# Products of bins in memory at once, about 80 MB.
_CHUNK = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Way:
    """Normal equations with T, or without: the columns of G, then those of T."""

    inverse: NDArray[np.inexact]  # (w, q, q): of the normal equations
    spread: Real  # (k, c): variance of G if the noise of a bin is 1
    leverage: Real  # (k, c): weight of a centre's own bin in its fit
    freedom: NDArray[np.int64]  # (w,): bins of a window less coefficients


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solver:
    """All that depends on the input alone, for windows of k widths, one width after the other."""

    windows: tuple[Windows, ...]  # of each width
    powers: tuple[Real, ...]  # (s, order + 1): x^p on a window's bins
    near: NDArray[np.int64]  # (k, c): window of each centre
    here: Real  # (k, c, order + 1): x^p at each centre
    size: Real  # (w,): scale of G's columns
    row: Complex  # (k, c, q): conjugates of the columns at each centre
    ways: tuple[_Way, ...]  # with T, and without


def polynomial_fits(
    spectra: Spectra, centre: NDArray[np.int64], widths: tuple[int, ...], order: int
) -> list[LocalFit]:
    """Fit G and T, and G alone, over windows of each width.

    The normal equations consist of moments Σ A x^p over a window, x = -1 … 1, of five products A,
    so that all windows share one matrix of powers. Their left sides, which depend on the input
    alone, are computed once for records of one stimulus.

    The centres have shape (c,), the widths are numbers of neighbours on either side, and both
    polynomials have one order. Each width has two fits: with T, and without.

    Examples
    --------
    >>> from hmpim.identify.frf.neighbours import transform
    >>> u = np.sin(np.arange(200) ** 2 / 500)
    >>> fits = polynomial_fits(transform(u, 3 * u, 1.0, 0.0), np.arange(5, 30), (8,), 2)
    >>> [abs(fit.response[0] - 3).round(6).item() for fit in fits]
    [0.0, 0.0]
    """
    reach = min(max(widths), spectra.u.size - 1)
    power = spectra.y.real**2 + spectra.y.imag**2
    products = mirrored(np.stack((np.conj(spectra.u) * spectra.y, spectra.y, power)), reach)
    solver = _solver(spectra.u, centre, widths, order)
    sums = [
        _moments(products, windows, reach, powers)
        for windows, powers in zip(solver.windows, solver.powers, strict=True)
    ]
    both, alone, total = np.concatenate(sums, axis=-2)
    right = np.concatenate((both / solver.size[:, None], alone), axis=-1)
    pairs = [
        _solve(solver, way, right, total[..., 0].real, spectra.y[..., None, centre])
        for way in solver.ways
    ]
    return [fit for pair in zip(*pairs, strict=True) for fit in pair]


@partial(kept, long=True)
def _solver(u: Complex, centre: NDArray[np.int64], widths: tuple[int, ...], order: int) -> _Solver:
    windows, terms = tuple(windows_around(centre, u.size, width) for width in widths), order + 1
    powers = [own.powers(2 * order) for own in windows]
    reach = min(max(widths), u.size - 1)
    folded = mirrored(u, reach)
    power = np.abs(folded) ** 2
    # The last product is that of T with itself: 1, and 0 at DC.
    products = np.stack((power + 0j, np.conj(folded), (np.arange(folded.size) != reach) + 0j))
    sums = [_moments(products, own, reach, x) for own, x in zip(windows, powers, strict=True)]
    squares, own, ones = np.concatenate(sums, axis=-2)
    counted = np.concatenate([each.counted for each in windows])
    # G's columns are scaled to the size of T's, in any unit of U; without any U, G is zero with a
    # huge error.
    size = np.sqrt(np.maximum(squares[:, 0].real / counted, NOTHING * float(np.max(power))))
    pair = np.add.outer(np.arange(terms), np.arange(terms))
    gram = np.empty((size.size, 2 * terms, 2 * terms), dtype=np.complex128)
    gram[:, :terms, :terms] = squares[:, pair] / (size**2)[:, None, None]
    cross = own[:, pair] / size[:, None, None]
    gram[:, :terms, terms:] = cross
    gram[:, terms:, :terms] = np.conj(cross.swapaxes(1, 2))
    gram[:, terms:, terms:] = ones[:, pair]
    counts = [each.start.size for each in windows]
    bins = np.repeat([each.size for each in windows], counts)
    gram.reshape(bins.size, -1)[:, :: 2 * terms + 1] += RIDGE * bins[:, None]
    first = np.cumsum([0, *counts[:-1]])
    near = np.stack([each.near for each in windows]) + first[:, None]
    here = np.stack([x[each.place] for each, x in zip(windows, powers, strict=True)])
    input_here = u[centre] / size[near]
    inverse = np.linalg.inv(gram)
    plain = np.linalg.inv(gram[:, :terms, :terms].real)
    mixed = inverse[:, :terms, terms:]
    kinds = (inverse[:, :terms, :terms], mixed, mixed.imag, inverse[:, terms:, terms:], plain)
    blocks = np.stack([kind.real.reshape(bins.size, -1) for kind in kinds], axis=1)
    forms = np.einsum("kcij,kcj->ikc", (blocks @ _collected(order))[near], here)
    own_form, real, imaginary, rest, plain_form = forms
    squared = input_here.real**2 + input_here.imag**2
    cross_form = 2 * (input_here.real * real - input_here.imag * imaginary)
    rows = (here[..., :terms] * input_here[..., None], here[..., :terms])
    return _Solver(
        windows=windows,
        powers=tuple(np.ascontiguousarray(x[:, :terms]) for x in powers),
        near=near,
        here=here[..., :terms],
        size=size,
        row=np.conj(np.concatenate(rows, -1)),
        ways=(
            _Way(
                inverse=inverse,
                spread=np.maximum(own_form, 0.0),
                leverage=squared * own_form + cross_form + rest,
                freedom=counted - 2 * terms,
            ),
            _Way(
                inverse=plain,
                spread=np.maximum(plain_form, 0.0),
                leverage=squared * plain_form,
                freedom=counted - terms,
            ),
        ),
    )


@cache
def _collected(order: int) -> Real:
    """Matrix that sums coefficients of x^p x^r by power of x, ((order + 1)², 2 order + 1)."""
    index = np.arange(order + 1)
    return np.asarray(np.add.outer(index, index).reshape(-1, 1) == np.arange(2 * order + 1)) * 1.0


def _moments(products: Complex, windows: Windows, reach: int, powers: Real) -> Complex:
    """Σ A x^p over each window, (..., w, p), of mirrored products A, (..., b)."""
    start = windows.start + reach
    chunk, index = max(_CHUNK // windows.size, 1), np.arange(windows.size)
    some = (start[k : k + chunk, None] + index for k in range(0, start.size, chunk))
    parts = [products.take(here, axis=-1) @ powers for here in some]
    return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=-2)


def _solve(solver: _Solver, way: _Way, right: Complex, power: Real, y: Complex) -> list[LocalFit]:
    """One fit for each width, from right sides with T, (..., w, q), and power of Y, (..., w)."""
    columns, terms = way.inverse.shape[-1], solver.here.shape[-1]
    near, right = solver.near, right[..., :columns]
    theta = (way.inverse @ right[..., None])[..., 0]
    squares = power - np.vecdot(right, theta).real
    # The difference of two nearly equal sums cannot be less than its rounding.
    noise = np.maximum(squares, 1e-15 * power) / np.maximum(way.freedom, 1)
    theta, size = theta.take(near, axis=-2), solver.size[near]
    missed = y - np.vecdot(solver.row[..., :columns], theta)
    response = np.vecdot(solver.here, theta[..., :terms]) / size
    noise, spread, weight = noise.take(near, axis=-1), way.spread / size**2, size**2
    error = (missed.real**2 + missed.imag**2) / np.maximum(1.0 - way.leverage, 1e-6) ** 2
    return [
        LocalFit(
            response=response[..., k, :],
            spread=spread[k],
            noise=noise[..., k, :],
            power=weight[k],
            prediction_error=error[..., k, :],
        )
        for k in range(near.shape[0])
    ]
