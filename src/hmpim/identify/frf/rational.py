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
from dataclasses import dataclass
from functools import cache
from itertools import combinations_with_replacement

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
    """An iterate at every window.

    Parameters
    ----------
    theta : complex ndarray, shape (..., w, q)
        Coefficients of the linear columns, then of A without its constant 1.
    over, fitted : complex ndarray, shape (..., w, s)
        1 / A, and Y as fitted, on the window's bins.
    squares : ndarray, shape (..., w)
        Σ |Y - fitted|²; infinite where the iterate ran off.
    """

    theta: Complex
    over: Complex
    fitted: Complex
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
    inverse : complex ndarray, shape (..., w, q, q)
        Of the products of the conjugates of the derivatives with them: the covariance of `theta`
        where the noise of a bin is 1.
    """

    state: RationalState
    before: RationalState
    inverse: Complex

    def rows(self, columns: "Columns", windows: Windows) -> Complex:
        """Derivatives of the fitted Y at each centre, shape (..., c, q)."""
        near, place = windows.near, windows.place
        linear, over = columns.linear[near, :, place], windows.at(self.before.over)[..., None]
        count = linear.shape[-1]
        rows = np.empty((*over.shape[:-1], count + DENOMINATOR_ORDER), dtype=np.complex128)
        np.multiply(linear, over, out=rows[..., :count])
        bent = -windows.at(self.before.fitted)[..., None] * over
        np.multiply(bent, columns.slopes.T[place], out=rows[..., count:])
        return rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Linear columns C x^p, p = 0 up to an order, of some carriers C, over all windows.

    The products of all columns are moments Σ conj(C) C' x^p, so that few sums give all of them.

    Parameters
    ----------
    mirrored : complex ndarray, shape (a, w, s)
        Conjugates of the inputs, and 1 where there is a T.
    products : ndarray, shape (k, w, s)
        Real and imaginary parts of conj(C) C' of each two of them, the same for every output.
    orders : tuple of int
        Highest power with each.
    powers : ndarray, shape (s, k)
        x^p, p = 0 up to twice the highest power of all.
    linear : complex ndarray, shape (w, l, s)
        The columns themselves.
    """

    mirrored: Complex
    products: Real
    orders: tuple[int, ...]
    powers: Real
    linear: Complex

    @classmethod
    def of(cls, carriers: Complex, orders: tuple[int, ...], x: Real) -> "Columns":
        """Make them; x from -1 to 1, shape (s,)."""
        most = max(*orders, DENOMINATOR_ORDER)
        powers = np.asarray(x[:, None] ** np.arange(2 * most + 1))
        each = [carriers[:, a, None] * powers.T[: p + 1] for a, p in enumerate(orders)]
        products = []
        for i, j in combinations_with_replacement(range(len(orders)), 2):
            product = np.conj(carriers[:, i]) * carriers[:, j]
            products += [product.real] if i == j else [product.real, product.imag]
        return cls(
            mirrored=np.conj(carriers.swapaxes(0, 1), order="C"),
            products=np.stack(products),
            orders=orders,
            powers=powers,
            linear=np.concatenate(each, axis=1),
        )

    @property
    def slopes(self) -> Real:
        """Powers of x that A is made of, shape (d, s)."""
        return self.powers.T[1 : DENOMINATOR_ORDER + 1]

    def normal(self, over: Complex | None, bent: Complex, left: Complex) -> tuple[Complex, Complex]:
        """Normal equations of the columns over A, and of `bent` times the powers of A.

        Parameters
        ----------
        over : complex ndarray, shape (..., w, s), or None
            1 / A; None for 1.
        bent : complex ndarray, shape (..., w, s)
            What carries the powers of A.
        left : complex ndarray, shape (..., w, s)
            The right side.

        Returns
        -------
        gram : complex ndarray, shape (..., w, q, q)
        right : complex ndarray, shape (..., w, q, 1)
        """
        outer, size = bent.shape[:-1], bent.shape[-1]
        places = _places(self.orders)
        parts = np.empty((places.parts, *outer, size))
        known = self.products.shape[0]
        weight = np.ones(()) if over is None else over.real**2 + over.imag**2
        for part, own in zip(parts, self.products, strict=False):
            np.multiply(own, weight, out=part)
        np.add(bent.real**2, bent.imag**2, out=parts[known])
        mirror = [own if over is None else own * np.conj(over) for own in self.mirrored]
        each = [own * bent for own in mirror] + [own * left for own in (*mirror, np.conj(bent))]
        for k, product in enumerate(each):
            parts[known + 1 + 2 * k], parts[known + 2 + 2 * k] = product.real, product.imag
        sums = (parts.reshape(places.parts, -1, size) @ self.powers).swapaxes(0, 1)
        moments = sums.reshape(sums.shape[0], -1)
        gram = np.take(moments, places.gram, axis=1)
        gram *= places.sign
        right = np.take(moments, places.right, axis=1)
        q = places.right.size // 2
        return (
            gram.view(np.complex128).reshape(*outer, q, q),
            right.view(np.complex128).reshape(*outer, q, 1),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Places:
    """Where the sums of `Columns.normal` stand, real and imaginary parts in turns.

    Parameters
    ----------
    parts : int
        Real products of carriers that are summed, each with all powers.
    gram, right : integer ndarray, shapes (2 q q,) and (2 q,)
        Part times the number of powers, plus the power.
    sign : ndarray, shape (2 q q,)
        -1 where a product's mirror is summed, 0 where a part is none.
    """

    parts: int
    gram: Integer
    right: Integer
    sign: Real


@cache
def _places(orders: tuple[int, ...]) -> _Places:
    """Of carriers of these orders, and A's own the last."""
    inner, powers = len(orders), 2 * max(*orders, DENOMINATOR_ORDER) + 1
    count = inner + 1
    pairs = [(i, j) for i in range(inner) for j in range(i, inner)]
    pairs += [(inner, inner), *((i, inner) for i in range(inner))]
    part, parts = np.zeros((count, count, 2), dtype=np.int64), 0
    for i, j in pairs:
        own = (parts, parts) if i == j else (parts, parts + 1)
        part[i, j] = part[j, i] = own
        parts += 1 + (i != j)
    last = np.arange(1, DENOMINATOR_ORDER + 1)
    power = np.concatenate([*(np.arange(p + 1) for p in orders), last])
    carrier = np.repeat(np.arange(count), [*(p + 1 for p in orders), last.size])
    right = parts + 2 * carrier[:, None] + np.arange(2)
    imaginary = np.sign(np.subtract.outer(carrier, carrier)) * -1.0
    return _Places(
        parts=parts + 2 * count,
        gram=np.ravel(
            part[carrier[:, None], carrier] * powers + np.add.outer(power, power)[..., None]
        ),
        right=np.ravel(right * powers + power[:, None]),
        sign=np.ravel(np.stack((np.ones_like(imaginary), imaginary), axis=-1)),
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
    """

    windows: Windows
    power: Real
    both: Columns
    plain: Columns

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
        return cls(
            windows=windows,
            power=power,
            both=Columns.of(carriers, (_NUMERATOR, TRANSIENT_ORDER), windows.x),
            plain=Columns.of(scaled, (_NUMERATOR,), windows.x),
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
    folded = [mirrored(v, reach) for v in (spectra.y, smooth)]
    fits = []
    for own in regressors:
        y, start = (own.windows.view(v, reach) for v in folded)
        # Sharp features hide in wide windows, whose start is far off; they are also the fewest.
        steps = 2 if own.windows.size // 2 < 32 else 4
        # An iterate may run off to infinity; it is then not taken.
        with np.errstate(all="ignore"):
            fits.extend(_fit(own, y, start, steps))
    return fits


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
    """Solve A Y = linear columns · coefficients for a Y nearly free of noise, shape (..., w, q).

    Examples
    --------
    >>> x = np.linspace(-1, 1, 9)
    >>> y = (2.0 / (1 + 0.5j * x))[None]
    >>> one = Columns.of(np.ones((1, 1, 9)) + 0j, (0,), x)
    >>> np.abs(linear_start(one, y)).round(9).tolist()
    [[2.0, 0.5, 0.0]]
    """
    return _solution(*columns.normal(None, -smooth, smooth))


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
    y : complex ndarray, shape (..., w, s)
        Y; of many records at once with an axis before.
    theta : complex ndarray, shape (..., w, l + d)
        Start, such as that of `linear_start`.
    steps : int
        At least 1; each window keeps its best iterate.

    Examples
    --------
    >>> x = np.linspace(-1, 1, 9)
    >>> y = (2.0 / (1 + 0.5j * x))[None]
    >>> one, start = Columns.of(np.ones((1, 1, 9)) + 0j, (0,), x), np.array([[1.9, 0.4j, 0.0]])
    >>> found = gauss_newton(one, y, start, steps=4)
    >>> np.abs(found.state.theta).round(9).tolist()
    [[2.0, 0.5, 0.0]]
    """
    state = _state(columns, y, theta)
    for k in range(steps):
        gram, right = columns.normal(state.over, -state.fitted * state.over, y - state.fitted)
        if k < steps - 1:
            step = _solution(gram, right)
        else:
            inverse, step = solved(gram, right)
        before, state = state, _better(state, _state(columns, y, state.theta + step))
    return RationalSolution(state=state, before=before, inverse=inverse)


def _state(columns: Columns, y: Complex, theta: Complex) -> RationalState:
    count = columns.linear.shape[-2]
    denominator = 1.0 + theta[..., count:] @ columns.slopes
    # Quicker than a complex division, which guards against what is not taken: overflow.
    inverse = 1.0 / (denominator.real**2 + denominator.imag**2)
    over: Complex = np.multiply(np.conj(denominator), inverse, dtype=np.complex128)
    # All records of a window in one product: few large ones are quicker than many small.
    each = theta.reshape(-1, *theta.shape[-2:]).swapaxes(0, 1)[..., :count] @ columns.linear
    fitted = each.swapaxes(0, 1).reshape(over.shape) * over
    left = y - fitted
    squares = np.vecdot(left, left).real
    return RationalState(
        theta=theta,
        over=over,
        fitted=fitted,
        squares=np.where(np.isfinite(squares), squares, np.inf),
    )


def _better(one: RationalState, other: RationalState) -> RationalState:
    """Take each window from the iterate that leaves less."""
    take = other.squares < one.squares
    if take.all():
        return other
    return RationalState(
        theta=np.where(take[..., None], other.theta, one.theta),
        over=np.where(take[..., None], other.over, one.over),
        fitted=np.where(take[..., None], other.fitted, one.fitted),
        squares=np.where(take, other.squares, one.squares),
    )


def _read_off(
    regressors: Regressors, columns: Columns, found: RationalSolution, y: Complex
) -> LocalFit:
    """Response, its spread and the prediction error at each centre."""
    windows, power, terms = regressors.windows, regressors.power, _NUMERATOR + 1
    near, place = windows.near, windows.place
    state, row = found.state, found.rows(columns, windows)
    theta, own = state.theta[..., :terms].take(near, axis=-2), windows.at(state.over)
    over = own / np.sqrt(power[near])
    b = columns.powers[place, :terms]
    response = np.vecdot(b, theta) * over
    pair = np.zeros((*over.shape, 2, row.shape[-1]), dtype=np.complex128)
    np.multiply(b, over[..., None], out=pair[..., 0, :terms])
    bent = (-response * own)[..., None]
    np.multiply(bent, columns.slopes.T[place], out=pair[..., 0, -DENOMINATOR_ORDER:])
    pair[..., 1, :] = row
    forms = windows.forms(pair, found.inverse)
    spread, leverage = forms[..., 0], forms[..., 1]
    missed = (windows.at(y) - windows.at(state.fitted)) / np.maximum(1.0 - leverage, 1e-6)
    error = missed.real**2 + missed.imag**2
    squares = np.maximum(state.squares, 1e-15 * np.vecdot(y, y).real)
    noise = squares / np.maximum(windows.counted - row.shape[-1], 1)
    failed = ~(np.isfinite(response) & np.isfinite(spread) & np.isfinite(error))
    return LocalFit(
        response=np.where(failed, 0.0, response),
        spread=np.where(failed, 1.0 / power[near], np.maximum(spread, 0.0)),
        noise=noise.take(near, axis=-1),
        power=power[near],
        prediction_error=np.where(failed, np.inf, error),
    )
