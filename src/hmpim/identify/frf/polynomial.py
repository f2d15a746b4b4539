"""Local polynomials: around each frequency Y = G U + T + noise, G and T polynomials in it.

Pintelon and Schoukens, System Identification, 2nd ed., Wiley 2012, chapter 7; Schoukens,
Vandersteen, Barbé and Pintelon, "Nonparametric preprocessing in system identification", 2009.
"""

from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from hmpim.identify.frf.neighbours import LocalFit, Spectra, Windows, mirrored, windows_around

__all__ = ["polynomial_fits"]

_RIDGE = 1e-13
# Power of U, relative to its greatest, that counts as none.
_NOTHING = 1e-24
# Products of bins held at once, about 80 MB.
_CHUNK = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Normal:
    """Normal equations of each window: first the columns of G, then those of T."""

    gram: NDArray[np.complex128]
    right: NDArray[np.complex128]
    size: NDArray[np.float64]
    power: NDArray[np.float64]


def polynomial_fits(
    spectra: Spectra, centre: NDArray[np.int64], widths: tuple[int, ...], order: int
) -> list[LocalFit]:
    """Fit G and T, and G alone, over windows of each width.

    The normal equations are made of moments Σ A x^p over a window, x = -1 … 1, of five
    products A; so all windows share one matrix of powers.

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
    reach = min(max(widths), spectra.u.size - 1)
    u, y = mirrored(spectra.u, reach), mirrored(spectra.y, reach)
    products = np.stack((np.abs(u) ** 2 + 0j, np.conj(u), np.conj(u) * y, y, np.abs(y) ** 2 + 0j))
    fits: list[LocalFit] = []
    for width in widths:
        windows = windows_around(centre, spectra.u.size, width)
        problem = _normal(products, windows, reach, order)
        terms = order + 1
        here = windows.x[windows.place][:, None] ** np.arange(terms)
        row = np.concatenate(
            (here * (spectra.u[centre] / problem.size[windows.near])[:, None], here + 0j), axis=1
        )
        fits.extend(
            _solve(problem, windows, here, row[:, :columns], spectra.y[centre], columns)
            for columns in (2 * terms, terms)
        )
    return fits


def _normal(products: NDArray[np.complex128], windows: Windows, reach: int, order: int) -> _Normal:
    size, terms = windows.size, order + 1
    powers = windows.powers(2 * order)
    views = sliding_window_view(products, size, axis=1)
    start = windows.start + reach
    chunk = max(_CHUNK // size, 1)
    moments = np.concatenate(
        [views[:, start[k : k + chunk]] @ powers for k in range(0, start.size, chunk)], axis=1
    )
    pair = np.add.outer(np.arange(terms), np.arange(terms))
    ones = np.repeat(powers.sum(axis=0)[None], start.size, axis=0)
    crosses = windows.counted < size
    ones[crosses] -= powers[-windows.start[crosses]]
    # G's columns are scaled to the size of T's, whatever the unit of U; where there is no U at
    # all, G comes out as zero with a huge error.
    floor = _NOTHING * float(products[0].real.max())
    scale = np.sqrt(np.maximum(moments[0, :, 0].real / windows.counted, floor))
    gram = np.empty((start.size, 2 * terms, 2 * terms), dtype=np.complex128)
    gram[:, :terms, :terms] = moments[0][:, pair] / (scale**2)[:, None, None]
    cross = moments[1][:, pair] / scale[:, None, None]
    gram[:, :terms, terms:] = cross
    gram[:, terms:, :terms] = np.conj(cross.swapaxes(1, 2))
    gram[:, terms:, terms:] = ones[:, pair]
    gram[:, np.arange(2 * terms), np.arange(2 * terms)] += _RIDGE * size
    right = np.concatenate((moments[2][:, :terms] / scale[:, None], moments[3][:, :terms]), axis=1)
    return _Normal(gram=gram, right=right, size=scale, power=moments[4, :, 0].real)


def _solve(
    problem: _Normal,
    windows: Windows,
    here: NDArray[np.float64],
    row: NDArray[np.complex128],
    y: NDArray[np.complex128],
    columns: int,
) -> LocalFit:
    """Solve the normal equations of the first `columns` columns, and read off each centre."""
    near, terms = windows.near, here.shape[1]
    right = problem.right[:, :columns]
    inverse = np.asarray(np.linalg.inv(problem.gram[:, :columns, :columns]), dtype=np.complex128)
    theta = (inverse @ right[:, :, None])[:, :, 0]
    left = problem.power - np.sum(np.conj(right) * theta, axis=1).real
    # The difference of two nearly equal sums is never less than its rounding.
    left = np.maximum(left, 1e-15 * problem.power)
    noise = left / np.maximum(windows.counted - columns, 1)
    theta, size = theta[near], problem.size[near]
    pair = np.zeros((near.size, 2, columns), dtype=np.complex128)
    pair[:, 0, :terms] = here
    pair[:, 1] = row
    forms = windows.forms(pair, inverse)
    spread, leverage = forms[:, 0], forms[:, 1]
    missed = y - np.sum(row * theta, axis=1)
    return LocalFit(
        response=np.sum(here * theta[:, :terms], axis=1) / size,
        spread=np.maximum(spread, 0.0) / size**2,
        noise=noise[near],
        power=size**2,
        prediction_error=np.abs(missed / np.maximum(1.0 - leverage, 1e-6)) ** 2,
    )
