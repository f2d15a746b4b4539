"""The regressors of local rational functions, and their normal equations.

Y = (B U + T) / A is linear in B and T, with the columns U x^p and x^p over A. The columns of A
itself are -Y / A times the powers of x.
"""

from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.frf.neighbours import Integer

__all__ = ["DENOMINATOR_ORDER", "Columns"]

DENOMINATOR_ORDER = 2
"""Of A: one resonance within a window."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Columns:
    """Linear columns C x^p, p = 0 up to an order, of some carriers C, over all windows.

    The products of all columns are moments Σ conj(C) C' x^p, so that a few sums give all of them.
    The products of carriers and powers serve every record and every step.
    """

    products: Real  # (w, s, k): real and imaginary parts of conj(C) C' x^p of each two carriers
    mirrored: Complex  # (w, s, h): conj(C) x^p, p up to the sum of the orders of C and A
    orders: tuple[int, ...]  # highest power with each carrier
    powers: Real  # (s, p): x^p, p = 0 up to twice the highest power of all
    slopes: Complex  # (d, s): the powers of x in A
    linear: Complex  # (w, l, s): the columns themselves

    @classmethod
    def of(cls, carriers: Complex, orders: tuple[int, ...], x: Real) -> "Columns":
        """Make them from carriers, shape (w, a, s), and x from -1 to 1, shape (s,)."""
        most = max(*orders, DENOMINATOR_ORDER)
        powers = np.asarray(x ** np.arange(2 * most + 1)[:, None])
        parts: list[tuple[Any, int]] = []
        for i, j in _pairs(len(orders)):
            product, count = np.conj(carriers[:, i]) * carriers[:, j], orders[i] + orders[j] + 1
            parts += [(part, count) for part in (product.real, product.imag)[: 1 + (i != j)]]
        backwards = np.conj(carriers)
        around = [(backwards[:, a], p + DENOMINATOR_ORDER + 1) for a, p in enumerate(orders)]
        ahead = [carriers[:, a, None] * powers[: p + 1] for a, p in enumerate(orders)]
        return cls(
            products=_multiplied(parts, powers, np.float64),
            mirrored=_multiplied(around, powers, np.complex128),
            orders=orders,
            powers=powers.T,
            slopes=powers[1 : DENOMINATOR_ORDER + 1].astype(np.complex128),
            linear=np.concatenate(ahead, axis=1),
        )

    def without_last(self) -> "Columns":
        """Those of all carriers but the last."""
        orders = self.orders[:-1]
        products = sum((orders[i] + orders[j] + 1) * (1 + (i != j)) for i, j in _pairs(len(orders)))
        most = max(*orders, DENOMINATOR_ORDER)
        return Columns(
            products=self.products[..., :products],
            mirrored=self.mirrored[..., : sum(p + DENOMINATOR_ORDER + 1 for p in orders)],
            orders=orders,
            powers=self.powers[:, : 2 * most + 1],
            slopes=self.slopes,
            linear=self.linear[:, : sum(p + 1 for p in orders)],
        )

    def at(self, place: Integer) -> Complex:
        """Return the linear columns at places of each window, (w, k); shape (w, k, l)."""
        return np.asarray(self.linear.swapaxes(1, 2)[np.arange(place.shape[0])[:, None], place])

    def normal(
        self, over: Complex | None, weight: Real, fitted: Complex, residual: Complex
    ) -> tuple[Complex, Complex]:
        """Normal equations of the columns over A, and of -fitted / A times the powers of A.

        All arguments have shape (w, r, s): 1 / A, None for 1; 1 / |A|²; Y as fitted; and the signal
        of the right side. The left side has shape (w, r, q, q), the right side (w, r, q, 1).
        """
        windows, records, _ = fitted.shape
        places, count = _places(self.orders), self.mirrored.shape[-1]
        signals = np.empty((windows, 2, *fitted.shape[1:]), dtype=np.complex128)
        np.multiply(fitted, weight, out=signals[:, 0])
        if over is None:
            signals[:, 1] = residual
        else:
            np.multiply(np.conj(over), residual, out=signals[:, 1])
        moments = np.empty((windows, records, places.ends[-1]))
        ends = places.ends
        np.matmul(weight, self.products, out=moments[..., : ends[0]])
        power = fitted.real**2 + fitted.imag**2
        power *= weight
        np.matmul(power, self.powers, out=moments[..., ends[0] : ends[1]])
        both = signals.reshape(windows, 2 * records, -1) @ self.mirrored
        both = both.reshape(windows, 2, records, count).view(np.float64)
        moments[..., ends[1] : ends[2]] = both[:, 0]
        moments[..., ends[2] : ends[3]] = both[:, 1]
        own = (np.conj(fitted) * signals[:, 1]) @ self.slopes.T
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


def _pairs(carriers: int) -> list[tuple[int, int]]:
    """Each two carriers, those with the last one last."""
    return [(i, j) for j in range(carriers) for i in range(j + 1)]


def _multiplied(parts: list[tuple[Any, int]], powers: Real, kind: type) -> Any:
    """Concatenate the products of each part, (w, s), and the first of the powers, (p, s)."""
    windows, size = parts[0][0].shape
    ends = np.cumsum([0, *(count for _, count in parts)])
    out = np.empty((windows, ends[-1], size), dtype=kind)
    for (part, count), end in zip(parts, ends[1:], strict=True):
        np.multiply(part[:, None], powers[:count], out=out[:, end - count : end])
    return out.swapaxes(1, 2)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Places:
    """Indices into the sums of `Columns.normal`, real and imaginary parts in turn."""

    # Where the sums of each product of signals end: of 1 / |A|², of |fitted|² / |A|², of fitted /
    # |A|², of the right side over A's conjugate, and of that with fitted
    ends: tuple[int, ...]
    gram: Integer  # (2 q q,): the sums of the left side
    right: Integer  # (2 q,): the sums of the right side
    sign: Real  # (2 q q,): -1 for the conjugate or negative of a sum, 0 for a part that is zero


@cache
def _places(orders: tuple[int, ...]) -> _Places:
    """Indices for carriers of these orders; the columns of A come last."""
    inner, last = len(orders), DENOMINATOR_ORDER
    first: dict[tuple[int, int], tuple[int, int]] = {}
    at = 0
    for i, j in _pairs(inner):
        count = orders[i] + orders[j] + 1
        first[i, j] = (at, at if i == j else at + count)
        at += count * (1 + (i != j))
    own, at = at, at + 2 * max(*orders, last) + 1
    mixed = at + 2 * np.cumsum((0, *(p + last + 1 for p in orders)))
    rest = 2 * int(mixed[-1]) - at
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
                gram[a, b] = mixed[low] + 2 * (p + r) + np.arange(2)
                sign[a, b] = -1.0, -mirror
    second = int(mixed[-1]) - at
    right = [mixed[i] + second + 2 * p if i < inner else rest + 2 * (p - 1) for i, p in column]
    return _Places(
        ends=(own, at, int(mixed[-1]), rest, rest + 2 * last),
        gram=np.ravel(gram),
        right=np.ravel(np.array(right)[:, None] + np.arange(2)),
        sign=np.ravel(sign),
    )
