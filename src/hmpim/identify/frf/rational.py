"""Local rational functions: around each frequency Y = (B U + T) / A + noise.

B, T and A are polynomials over neighbouring bins: T. McKelvey and G. Guerin, "Nonparametric
frequency response estimation using a local rational model", SYSID 2012; R. Voorhoeve,
A. van der Maas and T. Oomen, "Non-parametric identification of multivariable systems: a local
rational modeling approach", Mech. Syst. Signal Process. 105, 2018. A rational function of order two
follows a resonance exactly, a polynomial only over a few bins.

McKelvey and Guerin multiply by A and solve the linear problem. This weights the noise by A and puts
it into the regressors, so the result is biased. Here the linear problem only gives the start, from
an output already smoothed, and Gauss-Newton steps on Y itself minimise the true residual. The
covariance is that of this least-squares problem, including the columns of A.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.frf.columns import DENOMINATOR_ORDER, Columns
from hmpim.identify.frf.neighbours import (
    NOTHING,
    RIDGE,
    Integer,
    LocalFit,
    Spectra,
    Windows,
    mirrored,
    windows_around,
)

__all__ = [
    "NUMERATOR",
    "TRANSIENT_ORDER",
    "RationalSolution",
    "RationalState",
    "Regressors",
    "gauss_newton",
    "linear_start",
    "rational_fits",
    "read_off",
    "solved",
]

NUMERATOR = 2
"""Order of B."""

TRANSIENT_ORDER = 3
"""One more than B's: a sampled transient is a polynomial in z, not in jω."""

_STEPS = 4


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RationalState:
    """An iterate at every window, of each record."""

    theta: Complex  # (w, r, q): coefficients of the linear columns, then of A without its 1
    over: Complex  # (w, r, s): 1 / A on the window's bins
    fitted: Complex  # (w, r, s): Y as fitted
    residual: Complex  # (w, r, s): Y - fitted
    weight: Real  # (w, r, s): 1 / |A|²
    squares: Real  # (w, r): Σ |Y - fitted|²; infinite if the iterate diverged


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RationalSolution:
    """The end of the iteration, and the inverse normal matrix there."""

    state: RationalState  # the best iterate of each window
    before: RationalState  # that before the last, small step: derivatives are taken there
    # (w, r, q, q): covariance of `theta` if the noise of a bin is 1; of a polynomial, that of the
    # linear columns alone
    inverse: Complex

    def is_rational(self, columns: Columns) -> bool:
        """Whether there is an A in addition to the linear columns."""
        return bool(self.inverse.shape[-1] > columns.linear.shape[1])

    def rows(self, columns: Columns, place: Integer) -> Complex:
        """Derivatives of the fitted Y at places of each window, (w, k); shape (w, r, k, q)."""
        linear, over = columns.at(place), _at(self.before.over, place)[..., None]
        count = linear.shape[-1]
        rows = np.empty((*over.shape[:-1], self.inverse.shape[-1]), dtype=np.complex128)
        np.multiply(linear[:, None], over, out=rows[..., :count])
        if self.is_rational(columns):
            bent = -_at(self.before.fitted, place)[..., None] * over
            np.multiply(bent, columns.slopes.T[place][:, None], out=rows[..., count:])
        return rows


def _at(values: NDArray[Any], place: Integer) -> NDArray[Any]:
    """Values on windows, (w, r, s), at places of each, (w, k); shape (w, r, k)."""
    # The two indices are not adjacent, so that their result comes first.
    return np.asarray(values[np.arange(place.shape[0])[:, None], :, place].swapaxes(1, 2))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regressors:
    """All that depends on the input alone, for windows of one width."""

    windows: Windows  # of this width
    power: Real  # (w, m): mean |U|² of each window and input, to which inputs are scaled
    both: Columns  # with T
    plain: Columns  # without T
    place: Integer  # (w, k): centres of each window, the last repeated
    centres: Integer  # (c,): each centre among these

    @classmethod
    def around(
        cls, u: Complex, centre: Integer, width: int, *, transient: int = TRANSIENT_ORDER
    ) -> "Regressors":
        """Make them from the transform of an input, (b,), or of several, (m, b).

        The centres have shape (c,), the width is at least 6 neighbours on either side, and
        `transient` is the order of T.
        """
        u = np.atleast_2d(u)
        windows = windows_around(centre, u.shape[-1], width)
        floor = NOTHING * float(np.max(np.abs(u)) ** 2)
        inputs = windows.views(mirrored(u, width), width)
        power = np.sum(np.abs(inputs) ** 2, axis=2) / windows.counted[:, None]
        power = np.maximum(power, floor)
        ones = (windows.start[:, None] + np.arange(windows.size) != 0).astype(np.complex128)
        scaled = inputs / np.sqrt(power)[:, :, None]
        carriers = np.concatenate((scaled, ones[:, None]), axis=1)
        slot, centres = windows.slots()
        both = Columns.of(carriers, (*(NUMERATOR,) * len(u), transient), windows.x)
        return cls(
            windows=windows,
            power=power,
            both=both,
            plain=both.without_last(),
            place=windows.place[slot],
            centres=centres,
        )

    def views(self, values: Complex) -> Complex:
        """Return the windows of spectra, (r, b), shape (w, r, s)."""
        reach = self.windows.size // 2
        return self.windows.views(mirrored(values, reach), reach)

    def at_centres(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values at each place of each window, (w, r, k, ...), shape (r, c, ...)."""
        flat = values.swapaxes(0, 1).reshape(values.shape[1], -1, *values.shape[3:])
        return flat.take(self.centres, axis=1)


def rational_fits(
    spectra: Spectra, own: Regressors, smooth: Complex
) -> tuple[list[LocalFit], Real]:
    """Fit rational functions of order 2 over 2, with T and without, over windows of one width.

    `own` are the regressors of `spectra.u`, and `smooth`, (r, b), is a first estimate of Y, nearly
    free of noise. With the two fits comes, for each of the r records, the greatest power of a bin
    in the residual of the fit with T, over the mean of its window.
    """
    y = own.views(spectra.y)
    fits = []
    with np.errstate(all="ignore"):  # an iterate may diverge; it is then not used
        full = gauss_newton(own.both, y, linear_start(own.both, own.views(smooth)), steps=_STEPS)
        plain = gauss_newton(own.plain, y, _restricted(full, NUMERATOR + 1), steps=1)
        for columns, found in ((own.both, full), (own.plain, plain)):
            fit, _ = read_off(own, columns, found, y)
            response, spread, power = fit.response[..., 0], fit.spread[..., 0], fit.power[..., 0]
            fits.append(replace(fit, response=response, spread=spread, power=power))
        squares = full.state.residual.real**2 + full.state.residual.imag**2
        peak = np.max(squares.max(axis=-1) / squares.mean(axis=-1), axis=0)
    return fits, peak


def solved(gram: Complex, right: Complex) -> tuple[Complex, Complex]:
    """Return inverse, (..., q, q), and solution, (..., q), of normal equations, columns scaled.

    Examples
    --------
    >>> inverse, x = solved(np.array([[[4.0 + 0j]]]), np.array([[[2.0 + 0j]]]))
    >>> x.real.round(9).tolist()
    [[0.5]]
    """
    scaled, scale = _scaled(gram)
    by = scale[..., :, None] * scale[..., None, :]
    inverse = np.asarray(np.linalg.inv(scaled) * by, dtype=np.complex128)
    return inverse, (inverse @ right)[..., 0]


def _solution(gram: Complex, right: Complex) -> Complex:
    """Solution alone, in half of the time."""
    scaled, scale = _scaled(gram)
    return np.asarray(np.linalg.solve(scaled, right * scale[..., None])[..., 0] * scale)


def _scaled(gram: Complex) -> tuple[Complex, Real]:
    """Normal matrix of columns of size 1, (..., q, q), and the factor of each column."""
    q = gram.shape[-1]
    scale = 1.0 / np.sqrt(np.maximum(gram.diagonal(axis1=-2, axis2=-1).real, 1e-300))
    scaled = gram * (scale[..., :, None] * scale[..., None, :])
    diagonal = np.arange(q)
    scaled[..., diagonal, diagonal] += RIDGE * q
    return scaled, scale


def linear_start(columns: Columns, smooth: Complex) -> Complex:
    """Solve A Y = linear columns · coefficients for a Y nearly free of noise, shape (w, r, q).

    Examples
    --------
    >>> x = np.linspace(-1, 1, 9)
    >>> y = (2.0 / (1 + 0.5j * x))[None, None]
    >>> columns = Columns.of(np.ones((1, 1, 9)) + 0j, (0,), x)
    >>> np.abs(linear_start(columns, y)).round(9).tolist()
    [[[2.0, 0.5, 0.0]]]
    """
    return _solution(*columns.normal(None, np.ones(smooth.shape), smooth, smooth))


def _restricted(found: RationalSolution, kept: int) -> Complex:
    """Return the solution, to first order, with only the first `kept` linear columns."""
    # θ₁ - V₁₂ V₂₂⁻¹ θ₂ is the least-squares solution under θ₂ = 0.
    q = found.state.theta.shape[-1]
    out = np.arange(kept, q - DENOMINATOR_ORDER)
    stay = np.delete(np.arange(q), out)
    part = found.inverse[..., out]
    gone = _solution(part[..., out, :], found.state.theta[..., out, None])
    return np.asarray(found.state.theta[..., stay] - (part[..., stay, :] @ gone[..., None])[..., 0])


def gauss_newton(columns: Columns, y: Complex, theta: Complex, *, steps: int) -> RationalSolution:
    """Fit Y = (linear columns · coefficients) / A, A = 1 + powers of x · coefficients.

    The records have shape (w, r, s), the start, as of `linear_start`, (w, r, l + d). At least one
    step is made; each window keeps its best iterate.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 9)
    >>> y = (2.0 / (1 + 0.5j * x))[None, None]
    >>> columns, start = Columns.of(np.ones((1, 1, 9)) + 0j, (0,), x), np.array([[[1.9, 0.4j, 0]]])
    >>> found = gauss_newton(columns, y, start, steps=4)
    >>> np.abs(found.state.theta).round(9).tolist()
    [[[2.0, 0.5, 0.0]]]
    """
    state = _state(columns, y, theta)
    for k in range(steps):
        gram, right = columns.normal(state.over, state.weight, state.fitted, state.residual)
        if k < steps - 1:
            step = _solution(gram, right)
        else:
            inverse, step = solved(gram, right)
        before, state = state, _better(state, _state(columns, y, state.theta + step))
    return RationalSolution(state=state, before=before, inverse=inverse)


def _state(columns: Columns, y: Complex, theta: Complex) -> RationalState:
    count = columns.linear.shape[-2]
    denominator = theta[..., count:] @ columns.slopes
    denominator += 1.0
    # Faster than a complex division, which guards against overflow: such iterates are not used.
    weight = 1.0 / (denominator.real**2 + denominator.imag**2)
    over: Complex = np.multiply(np.conj(denominator), weight, dtype=np.complex128)
    fitted = theta[..., :count] @ columns.linear
    fitted *= over
    residual = y - fitted
    squares = np.vecdot(residual, residual).real
    return RationalState(
        theta=theta,
        over=over,
        fitted=fitted,
        residual=residual,
        weight=weight,
        squares=np.where(np.isfinite(squares), squares, np.inf),
    )


def _better(old: RationalState, new: RationalState) -> RationalState:
    """Take each window from the iterate with the smaller residual; this overwrites `new`."""
    kept = ~(new.squares < old.squares)
    if kept.any():
        for name in (field.name for field in fields(RationalState)):
            getattr(new, name)[kept] = getattr(old, name)[kept]
    return new


def read_off(
    regressors: Regressors, columns: Columns, found: RationalSolution, y: Complex
) -> tuple[LocalFit, Complex]:
    """Return the responses to all inputs at each centre, (r, c, m), and their derivatives.

    The derivatives by the coefficients, (w, r, m, k, q), are at `Regressors.place`, for inputs
    scaled to a power of 1. `prediction_error` is infinite if the iteration failed.
    """
    windows, power, terms = regressors.windows, regressors.power, NUMERATOR + 1
    place, near, m = regressors.place, regressors.windows.near, regressors.power.shape[1]
    b, x = columns.powers[place, :terms].astype(np.complex128), columns.slopes.T[place]
    row = found.rows(columns, place)
    own = _at(found.state.over, place)
    coefficients = found.state.theta[..., : m * terms].reshape(*own.shape[:2], m, terms)
    response = (coefficients @ b[:, None].swapaxes(2, 3)) * own[:, :, None]
    moved = np.zeros((*own.shape[:2], m + 1, *row.shape[2:]), dtype=np.complex128)
    upper = b[:, None] * own[..., None]
    for j in range(m):
        moved[:, :, j, :, j * terms : (j + 1) * terms] = upper
    if found.is_rational(columns):
        bent = (-response * own[:, :, None])[..., None]
        np.multiply(bent, x[:, None, None], out=moved[:, :, :m, :, -DENOMINATOR_ORDER:])
    moved[:, :, m] = row
    flat = moved.reshape(*own.shape[:2], -1, row.shape[-1])
    product = flat @ found.inverse  # only the real part of v V vᴴ is needed
    forms = np.vecdot(flat.view(np.float64), product.view(np.float64)).reshape(moved.shape[:-1])
    missed = _at(found.state.residual, place) / np.maximum(1.0 - forms[:, :, m], 1e-6)
    error = missed.real**2 + missed.imag**2
    squares = np.maximum(found.state.squares, 1e-15 * np.vecdot(y, y).real)
    noise = squares / np.maximum(windows.counted - row.shape[-1], 1)[:, None]
    response, spread = response.swapaxes(2, 3), forms[:, :, :m].swapaxes(2, 3)
    failed = ~(np.isfinite(error) & np.isfinite(response + spread).all(axis=-1))
    lost, size = failed[..., None], power[:, None, None]
    fit = LocalFit(
        response=regressors.at_centres(np.where(lost, 0.0, response) / np.sqrt(size)),
        spread=regressors.at_centres(np.where(lost, 1.0, np.maximum(spread, 0.0)) / size),
        noise=noise.T.take(near, axis=-1),
        power=power[near],
        prediction_error=regressors.at_centres(np.where(failed, np.inf, error)),
    )
    return fit, moved[:, :, :m]
