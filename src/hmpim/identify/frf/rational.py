"""Local rational functions: around each frequency Y = (B U + T) / A + noise.

B, T and A are polynomials over neighbouring bins: T. McKelvey and G. Guerin, "Nonparametric
frequency response estimation using a local rational model", SYSID 2012; R. Voorhoeve,
A. van der Maas and T. Oomen, "Non-parametric identification of multivariable systems: a local
rational modeling approach", Mech. Syst. Signal Process. 105, 2018. A resonance, which a
polynomial follows over a few bins only, a rational function of order two follows exactly.

McKelvey and Guerin multiply by A and solve the linear problem, which weighs the noise by A and
sets it among the regressors; the answer is biased. Here the linear problem only gives the
start, from an output already smoothed, and Gauss-Newton steps on Y itself lead to the least
squares of the true residual. The covariance is that of those least squares, the columns of A
included, so it knows what the denominator costs.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache
from itertools import combinations_with_replacement
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.frf.neighbours import LocalFit, Spectra, Windows, mirrored, windows_around

__all__ = [
    "DENOMINATOR_ORDER",
    "TRANSIENT_ORDER",
    "Columns",
    "RationalSolution",
    "RationalState",
    "Regressors",
    "gauss_newton",
    "linear_start",
    "rational_fits",
    "restricted",
    "solved",
]

Integer = NDArray[np.int64]

_NUMERATOR = 2
TRANSIENT_ORDER = 3
"""One more than of B: what a sampled transient rings with is a polynomial in z, not in jω."""

DENOMINATOR_ORDER = 2
"""One resonance within a window."""

_NOTHING = 1e-24
_RIDGE = 1e-13


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RationalState:
    """An iterate at every window, of each record.

    Parameters
    ----------
    theta : complex ndarray, shape (w, r, q)
        Coefficients of the linear columns, then of A without its constant 1.
    over, fitted, left : complex ndarray, shape (w, r, s)
        1 / A, Y as fitted, and what that leaves of Y, on the window's bins.
    weight : ndarray, shape (w, r, s)
        1 / |A|².
    squares : ndarray, shape (w, r)
        Σ |Y - fitted|²; infinite where the iterate ran off.
    """

    theta: Complex
    over: Complex
    fitted: Complex
    left: Complex
    weight: Real
    squares: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RationalSolution:
    """Where the iteration ended, and the inverse of the products of the derivatives there.

    Parameters
    ----------
    state : RationalState
        The best iterate of each window.
    before : RationalState
        That before the last step, which was small: derivatives are taken there.
    inverse : complex ndarray, shape (w, r, q, q)
        Of the products of the conjugates of the derivatives with them: the covariance of `theta`
        where the noise of a bin is 1.
    """

    state: RationalState
    before: RationalState
    inverse: Complex

    def rows(self, linear: Complex, place: Integer, x: Complex) -> Complex:
        """Derivatives of the fitted Y at some places of each window, shape (w, r, k, q).

        Parameters
        ----------
        linear : complex ndarray, shape (w, k, l)
            Linear columns there.
        place : integer ndarray, shape (w, k)
            The places.
        x : complex ndarray, shape (w, k, d)
            Powers of x there that A is made of.
        """
        over = _at(self.before.over, place)[..., None]
        count = linear.shape[-1]
        rows = np.empty((*over.shape[:-1], count + DENOMINATOR_ORDER), dtype=np.complex128)
        np.multiply(linear[:, None], over, out=rows[..., :count])
        bent = -_at(self.before.fitted, place)[..., None] * over
        np.multiply(bent, x[:, None], out=rows[..., count:])
        return rows


def _at(values: NDArray[Any], place: Integer) -> NDArray[Any]:
    """Values on windows, (w, r, s), at places of each, (w, k); shape (w, r, k)."""
    return np.take_along_axis(values, place[:, None], axis=-1)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Linear columns C x^p, p = 0 up to an order, of some carriers C, over all windows.

    The products of all columns are moments Σ conj(C) C' x^p, so that few sums give all of them;
    what the carriers bring to these is multiplied out once, for every record and every step.

    Parameters
    ----------
    products : ndarray, shape (w, s, k)
        Real and imaginary parts of conj(C) C' x^p of each two carriers.
    mirrored : complex ndarray, shape (w, s, h)
        conj(C) x^p, p up to the order and that of A.
    orders : tuple of int
        Highest power with each.
    powers : ndarray, shape (s, p)
        x^p, p = 0 up to twice the highest power of all.
    linear : complex ndarray, shape (w, l, s)
        The columns themselves.
    """

    products: Real
    mirrored: Complex
    orders: tuple[int, ...]
    powers: Real
    linear: Complex

    @classmethod
    def of(cls, carriers: Complex, orders: tuple[int, ...], x: Real) -> "Columns":
        """Make them of carriers, shape (w, a, s); x from -1 to 1, shape (s,)."""
        most = max(*orders, DENOMINATOR_ORDER)
        powers = np.asarray(x[:, None] ** np.arange(2 * most + 1))
        each = [carriers[:, a, None] * powers.T[: p + 1] for a, p in enumerate(orders)]
        products = []
        for i, j in combinations_with_replacement(range(len(orders)), 2):
            product, count = np.conj(carriers[:, i]) * carriers[:, j], orders[i] + orders[j] + 1
            parts = [product.real] if i == j else [product.real, product.imag]
            products += [part[..., None] * powers[:, :count] for part in parts]
        mirrored = [
            np.conj(carriers[:, a, :, None]) * powers[:, : p + DENOMINATOR_ORDER + 1]
            for a, p in enumerate(orders)
        ]
        return cls(
            products=np.concatenate(products, axis=-1),
            mirrored=np.concatenate(mirrored, axis=-1),
            orders=orders,
            powers=powers,
            linear=np.concatenate(each, axis=1),
        )

    @property
    def slopes(self) -> Complex:
        """Powers of x that A is made of, shape (d, s)."""
        return np.asarray(self.powers.T[1 : DENOMINATOR_ORDER + 1], dtype=np.complex128)

    def normal(
        self, over: Complex | None, weight: Real, fitted: Complex, left: Complex
    ) -> tuple[Complex, Complex]:
        """Normal equations of the columns over A, and of -fitted / A times the powers of A.

        Parameters
        ----------
        over : complex ndarray, shape (w, r, s), or None
            1 / A; None for 1.
        weight : ndarray, broadcast to (w, r, s)
            1 / |A|².
        fitted : complex ndarray, shape (w, r, s)
            Y as fitted.
        left : complex ndarray, shape (w, r, s)
            The right side.

        Returns
        -------
        gram : complex ndarray, shape (w, r, q, q)
        right : complex ndarray, shape (w, r, q, 1)
        """
        windows, records, _ = fitted.shape
        places, count = _places(self.orders), self.mirrored.shape[-1]
        turned = np.empty((windows, 2, *fitted.shape[1:]), dtype=np.complex128)
        np.multiply(fitted, weight, out=turned[:, 0])
        if over is None:
            turned[:, 1] = left
        else:
            np.multiply(np.conj(over), left, out=turned[:, 1])
        moments = np.empty((windows, records, places.ends[-1]))
        ends = places.ends
        np.matmul(np.broadcast_to(weight, fitted.shape), self.products, out=moments[..., : ends[0]])
        power = fitted.real**2 + fitted.imag**2
        power *= weight
        np.matmul(power, self.powers, out=moments[..., ends[0] : ends[1]])
        both = turned.reshape(windows, 2 * records, -1) @ self.mirrored
        both = both.reshape(windows, 2, records, count).view(np.float64)
        moments[..., ends[1] : ends[2]] = both[:, 0]
        moments[..., ends[2] : ends[3]] = both[:, 1]
        own = (np.conj(fitted) * turned[:, 1]) @ self.slopes.T
        moments[..., ends[3] :] = own.view(np.float64)
        gram = moments.take(places.gram, axis=-1)
        gram *= places.sign
        right = moments.take(places.right, axis=-1)
        q = places.right.size // 2
        right[..., -2 * DENOMINATOR_ORDER :] *= -1.0
        return (
            gram.view(np.complex128).reshape(windows, records, q, q),
            right.view(np.complex128)[..., None],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Places:
    """Where the sums of `Columns.normal` stand, real and imaginary parts in turns.

    Parameters
    ----------
    ends : tuple of int
        Where the sums of each product of signals end: of 1 / |A|², of |fitted|² / |A|², of
        fitted / |A|², of the right side over A's conjugate, and of that with fitted.
    gram, right : integer ndarray, shapes (2 q q,) and (2 q,)
        Which of them.
    sign : ndarray, shape (2 q q,)
        -1 where a sum's mirror or negative is asked for, 0 where a part is none.
    """

    ends: tuple[int, ...]
    gram: Integer
    right: Integer
    sign: Real


@cache
def _places(orders: tuple[int, ...]) -> _Places:
    """Of carriers of these orders, and A's own the last."""
    inner, last = len(orders), DENOMINATOR_ORDER
    first: dict[tuple[int, int], tuple[int, int]] = {}
    at = 0
    for i, j in combinations_with_replacement(range(inner), 2):
        count = orders[i] + orders[j] + 1
        first[i, j] = (at, at if i == j else at + count)
        at += count * (1 + (i != j))
    own, at = at, at + 2 * max(*orders, last) + 1
    turned = at + 2 * np.cumsum((0, *(p + last + 1 for p in orders)))
    rest = 2 * int(turned[-1]) - at
    column = [(i, p) for i, most in enumerate((*orders, last)) for p in range(most + 1)]
    column = [(i, p) for i, p in column if i < inner or p > 0]
    q = len(column)
    gram, sign = np.zeros((q, q, 2), dtype=np.int64), np.ones((q, q, 2))
    for a, (i, p) in enumerate(column):
        for b, (j, r) in enumerate(column):
            low, high = (i, j) if i <= j else (j, i)
            mirror = 1.0 if i < j else -1.0
            if high < inner:
                gram[a, b] = np.add(first[low, high], p + r)
                sign[a, b] = 1.0, mirror * (i != j)
            elif low == inner:
                gram[a, b], sign[a, b] = own + p + r, (1.0, 0.0)
            else:
                gram[a, b] = turned[low] + 2 * (p + r) + np.arange(2)
                sign[a, b] = -1.0, -mirror
    second = int(turned[-1]) - at
    right = [turned[i] + second + 2 * p if i < inner else rest + 2 * (p - 1) for i, p in column]
    return _Places(
        ends=(own, at, int(turned[-1]), rest, rest + 2 * last),
        gram=np.ravel(gram),
        right=np.ravel(np.array(right)[:, None] + np.arange(2)),
        sign=np.ravel(sign),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regressors:
    """What the input alone says of windows of one width.

    Parameters
    ----------
    windows : Windows
        Of this width.
    power : ndarray, shape (w,)
        Mean |U|² of each, to which its input is scaled.
    both, plain : Columns
        With T, and without.
    place : integer ndarray, shape (w, k)
        Centres of each window, the last repeated.
    centres : integer ndarray, shape (c,)
        Each centre among these.
    """

    windows: Windows
    power: Real
    both: Columns
    plain: Columns
    place: Integer
    centres: Integer

    @classmethod
    def around(cls, u: Complex, centre: Integer, width: int) -> "Regressors":
        """Make them.

        Parameters
        ----------
        u : complex ndarray, shape (b,)
            Transform of the input.
        centre : integer ndarray, shape (c,)
            Bins to answer at.
        width : int
            Neighbours on either side, at least 6.
        """
        windows = windows_around(centre, u.size, width)
        floor = _NOTHING * float(np.max(np.abs(u)) ** 2)
        seen = windows.view(mirrored(u, width), width)
        power = np.maximum(np.sum(np.abs(seen) ** 2, axis=1) / windows.counted, floor)
        scaled = (seen / np.sqrt(power)[:, None])[:, None, :]
        one = windows.without_dc()[:, None, :].astype(np.complex128)
        carriers = np.concatenate((scaled, one), axis=1)
        place, centres = windows.slots()
        return cls(
            windows=windows,
            power=power,
            both=Columns.of(carriers, (_NUMERATOR, TRANSIENT_ORDER), windows.x),
            plain=Columns.of(scaled, (_NUMERATOR,), windows.x),
            place=place,
            centres=centres,
        )


def rational_fits(
    spectra: Spectra, regressors: Sequence[Regressors], smooth: Complex
) -> list[LocalFit]:
    """Fit rational functions of order 2 over 2, with T and without, over windows of each width.

    Parameters
    ----------
    spectra : Spectra
        With the delay taken out.
    regressors : sequence of Regressors
        Those of `spectra.u`, one for each width.
    smooth : complex ndarray, shape (..., b), as that of `spectra.y`
        Y as a first estimate predicts it, nearly free of noise; starts the iteration.

    Returns
    -------
    list of LocalFit
        Two for each width: with T, and without. `prediction_error` is infinite where the
        iteration came to nothing.

    Examples
    --------
    >>> from hmpim.identify.frf.neighbours import transform
    >>> n = np.arange(400)
    >>> u, y = np.sin(n**2 / 1000), np.zeros(400)
    >>> for k in n[2:]:  # poles at 0.9 exp(±0.44 i)
    ...     y[k] = 1.628 * y[k - 1] - 0.81 * y[k - 2] + u[k]
    >>> s = transform(u, y, 1.0, 0.0)
    >>> fit = rational_fits(s, [Regressors.around(s.u, np.arange(20, 40), 16)], s.y)[0]
    >>> z = np.exp(2j * np.pi * s.frequency[20])
    >>> bool(abs(fit.response[0] * (1 - 1.628 / z + 0.81 / z**2) - 1) < 1e-3)
    True
    """
    reach = max(own.windows.size // 2 for own in regressors)
    folded = [mirrored(np.atleast_2d(v), reach) for v in (spectra.y, smooth)]
    fits = []
    for own in regressors:
        y, start = (own.windows.views(v, reach) for v in folded)
        # Sharp features hide in wide windows, whose start is far off; they are also the fewest.
        steps = 2 if own.windows.size // 2 < 32 else 4
        # An iterate may run off to infinity; it is then not taken.
        with np.errstate(all="ignore"):
            fits.extend(_fit(own, y, start, steps))
    return fits if spectra.y.ndim > 1 else [_of_one(fit) for fit in fits]


def _of_one(fit: LocalFit) -> LocalFit:
    """The only record's."""
    return LocalFit(
        response=fit.response[0],
        spread=fit.spread[0],
        noise=fit.noise[0],
        power=fit.power,
        prediction_error=fit.prediction_error[0],
    )


def _fit(own: Regressors, y: Complex, smooth: Complex, steps: int) -> list[LocalFit]:
    full = gauss_newton(own.both, y, linear_start(own.both, smooth), steps=steps)
    start = restricted(full, _NUMERATOR + 1)
    plain = gauss_newton(own.plain, y, start, steps=(steps + 1) // 2)
    return [_read_off(own, own.both, full, y), _read_off(own, own.plain, plain, y)]


def solved(gram: Complex, right: Complex) -> tuple[Complex, Complex]:
    """Return inverse, (..., q, q), and solution, (..., q), of normal equations, columns scaled.

    Examples
    --------
    >>> inverse, x = solved(np.array([[[4.0 + 0j]]]), np.array([[[2.0 + 0j]]]))
    >>> x.real.round(9).tolist()
    [[0.5]]
    """
    scaled, scale = _scaled(gram)
    inverse: Complex = np.asarray(
        np.linalg.inv(scaled) * (scale[..., :, None] * scale[..., None, :]), dtype=np.complex128
    )
    return inverse, (inverse @ right)[..., 0]


def _solution(gram: Complex, right: Complex) -> Complex:
    """Solution alone, in a third of the time."""
    scaled, scale = _scaled(gram)
    return np.asarray(np.linalg.solve(scaled, right * scale[..., None])[..., 0] * scale)


def _scaled(gram: Complex) -> tuple[Complex, Real]:
    """Normal equations of columns of size 1, and by what each was multiplied."""
    index = np.arange(gram.shape[-1])
    scale = 1.0 / np.sqrt(np.maximum(gram[..., index, index].real, 1e-300))
    scaled = gram * (scale[..., :, None] * scale[..., None, :])
    scaled[..., index, index] += _RIDGE * gram.shape[-1]
    return scaled, scale


def linear_start(columns: Columns, smooth: Complex) -> Complex:
    """Solve A Y = linear columns · coefficients for a Y nearly free of noise, shape (w, r, q).

    Examples
    --------
    >>> x = np.linspace(-1, 1, 9)
    >>> y = (2.0 / (1 + 0.5j * x))[None, None]
    >>> one = Columns.of(np.ones((1, 1, 9)) + 0j, (0,), x)
    >>> np.abs(linear_start(one, y)).round(9).tolist()
    [[[2.0, 0.5, 0.0]]]
    """
    return _solution(*columns.normal(None, np.ones(()), smooth, smooth))


def restricted(found: RationalSolution, kept: int) -> Complex:
    """Return what a solution becomes, to first order, if only `kept` linear columns may stay.

    θ₁ - V₁₂ V₂₂⁻¹ θ₂, V the inverse of the products: least squares under θ₂ = 0.
    """
    q = found.state.theta.shape[-1]
    out = np.arange(kept, q - DENOMINATOR_ORDER)
    stay = np.delete(np.arange(q), out)
    part = found.inverse[..., out]
    scale = 1.0 / np.sqrt(np.maximum(part[..., out, np.arange(out.size)].real, 1e-300))
    block = part[..., out, :] * (scale[..., :, None] * scale[..., None, :])
    block[..., np.arange(out.size), np.arange(out.size)] += _RIDGE
    gone = np.linalg.solve(block, (found.state.theta[..., out] * scale)[..., None])
    change = (part[..., stay, :] * scale[..., None, :]) @ gone
    return np.asarray(found.state.theta[..., stay] - change[..., 0])


def gauss_newton(columns: Columns, y: Complex, theta: Complex, *, steps: int) -> RationalSolution:
    """Fit Y = (linear columns · coefficients) / A, A = 1 + powers of x · coefficients.

    Parameters
    ----------
    columns : Columns
        Those of B and T.
    y : complex ndarray, shape (w, r, s)
        Y of each record.
    theta : complex ndarray, shape (w, r, l + d)
        Start, such as that of `linear_start`.
    steps : int
        At least 1; each window keeps its best iterate.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 9)
    >>> y = (2.0 / (1 + 0.5j * x))[None, None]
    >>> one, start = Columns.of(np.ones((1, 1, 9)) + 0j, (0,), x), np.array([[[1.9, 0.4j, 0.0]]])
    >>> found = gauss_newton(one, y, start, steps=4)
    >>> np.abs(found.state.theta).round(9).tolist()
    [[[2.0, 0.5, 0.0]]]
    """
    state = _state(columns, y, theta)
    for k in range(steps):
        gram, right = columns.normal(state.over, state.weight, state.fitted, state.left)
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
    # Quicker than a complex division, which guards against what is not taken: overflow.
    weight = 1.0 / (denominator.real**2 + denominator.imag**2)
    over: Complex = np.multiply(np.conj(denominator), weight, dtype=np.complex128)
    fitted = theta[..., :count] @ columns.linear
    fitted *= over
    left = y - fitted
    squares = np.vecdot(left, left).real
    return RationalState(
        theta=theta,
        over=over,
        fitted=fitted,
        left=left,
        weight=weight,
        squares=np.where(np.isfinite(squares), squares, np.inf),
    )


def _better(one: RationalState, other: RationalState) -> RationalState:
    """Take each window from the iterate that leaves less; what is not taken of `other` is lost."""
    kept = ~(other.squares < one.squares)
    if kept.any():
        for name in (field.name for field in fields(RationalState)):
            getattr(other, name)[kept] = getattr(one, name)[kept]
    return other


def _read_off(
    regressors: Regressors, columns: Columns, found: RationalSolution, y: Complex
) -> LocalFit:
    """Response, its spread and the prediction error at each centre, of each record (r, c)."""
    windows, power, terms = regressors.windows, regressors.power, _NUMERATOR + 1
    place, near = regressors.place, regressors.windows.near
    powers = columns.powers[place].astype(np.complex128)
    b, x = powers[..., :terms], powers[..., 1 : DENOMINATOR_ORDER + 1]
    linear = np.take_along_axis(columns.linear, place[:, None], axis=-1).swapaxes(1, 2)
    row = found.rows(linear, place, x)
    own = _at(found.state.over, place)
    over = own / np.sqrt(power)[:, None, None]
    response = (found.state.theta[..., :terms] @ b.swapaxes(1, 2)) * over
    pair = np.zeros((*own.shape[:2], 2, *row.shape[2:]), dtype=np.complex128)
    np.multiply(b[:, None], over[..., None], out=pair[:, :, 0, :, :terms])
    bent = (-response * own)[..., None]
    np.multiply(bent, x[:, None], out=pair[:, :, 0, :, -DENOMINATOR_ORDER:])
    pair[:, :, 1] = row
    inner = pair.reshape(*own.shape[:2], -1, row.shape[-1]) @ found.inverse
    # Real parts alone of the products are asked for.
    forms = np.vecdot(pair.view(np.float64), inner.reshape(pair.shape).view(np.float64))
    spread, leverage = forms[:, :, 0], forms[:, :, 1]
    missed = _at(found.state.left, place) / np.maximum(1.0 - leverage, 1e-6)
    error = missed.real**2 + missed.imag**2
    squares = np.maximum(found.state.squares, 1e-15 * np.vecdot(y, y).real)
    noise = squares / np.maximum(windows.counted - row.shape[-1], 1)[:, None]
    failed = ~(np.isfinite(response) & np.isfinite(spread) & np.isfinite(error))

    def told(values: NDArray[Any]) -> NDArray[Any]:
        flat = values.swapaxes(0, 1).reshape(values.shape[1], -1)
        return flat.take(regressors.centres, axis=-1)

    return LocalFit(
        response=told(np.where(failed, 0.0, response)),
        spread=told(np.where(failed, 1.0 / power[:, None, None], np.maximum(spread, 0.0))),
        noise=noise.T.take(near, axis=-1),
        power=power[near],
        prediction_error=told(np.where(failed, np.inf, error)),
    )
