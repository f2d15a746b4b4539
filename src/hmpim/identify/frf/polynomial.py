"""Local polynomials: around each frequency Y = G U + T + noise, G and T polynomials in it.

Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, chapter 7; Schoukens,
Vandersteen, Barbé and Pintelon, "Nonparametric preprocessing in system identification", 2009.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.frf.neighbours import LocalFit, Spectra, Windows, mirrored, windows_around
from hmpim.identify.kept import kept

__all__ = ["polynomial_fits"]

_RIDGE = 1e-13
# Power of U, relative to its greatest, that counts as none.
_NOTHING = 1e-24
# Products of bins held at once, about 80 MB.
_CHUNK = 1_000_000

_Way = tuple[Complex, Real, Real]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Solver:
    """What the input says of one window width: first the columns of G, then those of T.

    Parameters
    ----------
    windows : Windows
        Of this width.
    powers : ndarray, shape (s, order + 1)
        x^p on a window's bins.
    here : ndarray, shape (c, order + 1)
        x^p at each centre.
    size : ndarray, shape (w,)
        By what G's columns are scaled.
    row : complex ndarray, shape (c, q)
        Conjugates of the columns at each centre.
    ways : tuple of (inverse, spread, leverage)
        With T, and without: inverse of the normal equations, (w, q, q), variance of G where the
        noise of a bin is 1, and what a centre's own bin weighs in its fit, both (c,).
    """

    windows: Windows
    powers: Real
    here: Real
    size: Real
    row: Complex
    ways: tuple[_Way, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Right:
    """What the outputs say of each window: right sides, (..., w, q), and power, (..., w)."""

    right: Complex
    power: Real


def polynomial_fits(
    spectra: Spectra, centre: NDArray[np.int64], widths: tuple[int, ...], order: int
) -> list[LocalFit]:
    """Fit G and T, and G alone, over windows of each width.

    The normal equations are made of moments Σ A x^p over a window, x = -1 … 1, of five
    products A; so all windows share one matrix of powers. Their left sides, all that is told of
    the input alone, are made once for records of one stimulus.

    Parameters
    ----------
    spectra : Spectra
        With the delay taken out.
    centre : integer ndarray, shape (c,)
        Bins to answer at.
    widths : tuple of int
        Neighbours on either side.
    order : int
        Of both polynomials.

    Returns
    -------
    list of LocalFit
        Two for each width: with T, and without.

    Examples
    --------
    >>> from hmpim.identify.frf.neighbours import transform
    >>> u = np.sin(np.arange(200) ** 2 / 500)
    >>> fits = polynomial_fits(transform(u, 3 * u, 1.0, 0.0), np.arange(5, 30), (8,), 2)
    >>> [abs(fit.response[0] - 3).round(6).item() for fit in fits]
    [0.0, 0.0]
    """
    fits: list[LocalFit] = []
    reach = min(max(widths), spectra.u.size - 1)
    power = spectra.y.real**2 + spectra.y.imag**2
    products = mirrored(np.stack((np.conj(spectra.u) * spectra.y, spectra.y, power)), reach)
    for width in widths:
        solver = _solver(spectra.u, centre, width, order)
        right = _right_of(products, solver, reach)
        fits.extend(_solve(solver, way, right, spectra.y[..., centre]) for way in solver.ways)
    return fits


@kept
def _solver(u: Complex, centre: NDArray[np.int64], width: int, order: int) -> _Solver:
    windows, terms = windows_around(centre, u.size, width), order + 1
    reach, size = min(width, u.size - 1), windows.size
    powers = windows.powers(2 * order)
    folded = mirrored(u, reach)
    squares, own = _moments(
        np.stack((np.abs(folded) ** 2 + 0j, np.conj(folded))), windows, reach, powers
    )
    pair = np.add.outer(np.arange(terms), np.arange(terms))
    ones = np.repeat(powers.sum(axis=0)[None], windows.start.size, axis=0)
    crosses = windows.counted < size
    ones[crosses] -= powers[-windows.start[crosses]]
    # G's columns are scaled to the size of T's, whatever the unit of U; where there is no U at
    # all, G comes out as zero with a huge error.
    floor = _NOTHING * float(np.max(np.abs(folded) ** 2))
    scale = np.sqrt(np.maximum(squares[:, 0].real / windows.counted, floor))
    gram = np.empty((windows.start.size, 2 * terms, 2 * terms), dtype=np.complex128)
    gram[:, :terms, :terms] = squares[:, pair] / (scale**2)[:, None, None]
    cross = own[:, pair] / scale[:, None, None]
    gram[:, :terms, terms:] = cross
    gram[:, terms:, :terms] = np.conj(cross.swapaxes(1, 2))
    gram[:, terms:, terms:] = ones[:, pair]
    gram[:, np.arange(2 * terms), np.arange(2 * terms)] += _RIDGE * size
    here = windows.x[windows.place][:, None] ** np.arange(terms)
    row = np.concatenate((here * (u[centre] / scale[windows.near])[:, None], here + 0j), axis=1)
    return _Solver(
        windows=windows,
        powers=np.ascontiguousarray(powers[:, :terms]),
        here=here,
        size=scale,
        row=np.conj(row),
        ways=tuple(_way(windows, gram, here, row, columns) for columns in (2 * terms, terms)),
    )


def _way(windows: Windows, gram: Complex, here: Real, row: Complex, columns: int) -> _Way:
    """Inverse, spread and leverage with the first `columns` columns."""
    inverse = np.asarray(np.linalg.inv(gram[:, :columns, :columns]), dtype=np.complex128)
    pair = np.zeros((windows.near.size, 2, columns), dtype=np.complex128)
    pair[:, 0, : here.shape[1]] = here
    pair[:, 1] = row[:, :columns]
    forms = windows.forms(pair, inverse)
    return inverse, np.maximum(forms[:, 0], 0.0), forms[:, 1]


def _moments(products: Complex, windows: Windows, reach: int, powers: Real) -> Complex:
    """Σ A x^p over each window, (..., w, p), of products A, (..., b), that `mirrored` made."""
    views = sliding_window_view(products, windows.size, axis=-1)
    start = windows.start + reach
    chunk = max(_CHUNK // windows.size, 1)
    some = [views[..., start[k : k + chunk], :] @ powers for k in range(0, start.size, chunk)]
    return np.concatenate(some, axis=-2)


def _right_of(products: Complex, solver: _Solver, reach: int) -> _Right:
    both, alone, power = _moments(products, solver.windows, reach, solver.powers)
    return _Right(
        right=np.concatenate((both / solver.size[:, None], alone), axis=-1),
        power=power[..., 0].real,
    )


def _solve(solver: _Solver, way: _Way, of_output: _Right, y: Complex) -> LocalFit:
    """Solve the normal equations of one way, and read off each centre."""
    inverse, spread, leverage = way
    columns, terms = inverse.shape[1], solver.here.shape[1]
    windows, near, row = solver.windows, solver.windows.near, solver.row
    right = of_output.right[..., :columns]
    theta = (inverse @ right[..., None])[..., 0]
    left = of_output.power - np.vecdot(right, theta).real
    # The difference of two nearly equal sums is never less than its rounding.
    left = np.maximum(left, 1e-15 * of_output.power)
    noise = left / np.maximum(windows.counted - columns, 1)
    theta, size = theta.take(near, axis=-2), solver.size[near]
    missed = y - np.vecdot(row[:, :columns], theta)
    return LocalFit(
        response=np.vecdot(solver.here, theta[..., :terms]) / size,
        spread=spread / size**2,
        noise=noise.take(near, axis=-1),
        power=size**2,
        prediction_error=(missed.real**2 + missed.imag**2) / np.maximum(1.0 - leverage, 1e-6) ** 2,
    )
