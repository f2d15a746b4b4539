"""A structure's poles, and partial fractions over them.

The denominator is a product of sections 1 + c₁s and 1 + c₁s + c₂s². Its poles differ, so that
B(s)/A(s) is a sum of single poles. The derivative by a coefficient of one section, -s^m B/(A Aₖ),
is a sum of single and double poles. The free response of an initial state is also a B/A, with B of
one degree less than A and an impulse as input, and has the same expansion.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.model.dynamics import Structure, coefficients_of
from hmpim.model.fractions import APART, distances, fractions, parted

__all__ = ["Expansion", "Parallel", "Poles", "poles_of"]

_NONE = np.empty((0, 0), dtype=np.complex128)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Expansion:
    """Partial fractions: rows as weights of simple responses.

    `simple` and `double`, (rows, k), are weights of the responses of 1/(s - p) and 1/(s - p)², for
    one of each conjugate pair: the rows are the real parts. Rows of B/A itself have no `double`.
    `direct` and `rate`, (rows,), are weights of the input itself and of its rate; None if all 0.
    """

    simple: Complex
    double: Complex
    direct: Real
    rate: Real | None = None


class Poles:
    """Poles of a structure at given parameters, in samples.

    `every`, (integrators + order,), are all poles, those of integrators first, and `coefficients`
    are c₁ (and c₂) of each section.
    """

    def __init__(self, every: Complex, coefficients: Sequence[Real]) -> None:
        self.every, self.coefficients = every, coefficients
        self._kept = np.flatnonzero(every.imag >= 0.0)
        self.upper = every[self._kept]
        """One of each conjugate pair."""
        self._multiplicity = np.where(self.upper.imag > 0, 2.0, 1.0)
        self._leading = math.prod(float(c[-1]) for c in coefficients)
        self._apart, product = distances(every)
        self._steepness = self._leading * product

    def expand(self, numerators: Real) -> Expansion:
        """Rows of B(s)/A(s), one for each row of `numerators`, by rising powers of s."""
        residues, constants = fractions(numerators, self.every, self._steepness, self._leading)
        return Expansion(simple=self._halved(residues), double=_NONE, direct=constants)

    def slopes(self, numerator: Real) -> Expansion:
        """Rows of the derivatives of B(s)/A(s): by the delay, then by the sections' parameters.

        The derivative by the delay is -s B/A. That by a coefficient of a section Aₖ is B/A times
        -s^m/Aₖ, each a sum over poles; in the product of the two

            1/((s - p)(s - q)) = (1/(s - p) - 1/(s - q)) / (p - q).
        """
        (residues,), (constant,) = fractions(
            numerator[None, :], self.every, self._steepness, self._leading
        )
        factors, fed = self._by_parameters()
        simple = np.empty((1 + fed.size, self.every.size), dtype=np.complex128)
        double, direct, rate = np.zeros_like(simple), np.empty(1 + fed.size), np.zeros(1 + fed.size)
        simple[0] = -residues * self.every
        direct[0], rate[0] = -residues.sum().real, -constant
        simple[1:] = -residues * (factors @ self._apart.T) - factors * (self._apart @ residues)
        simple[1:] -= fed[:, None] * residues + constant * factors
        double[1:], direct[1:] = -residues * factors, -constant * fed
        return Expansion(
            simple=self._halved(simple), double=self._halved(double), direct=direct, rate=rate
        )

    def _by_parameters(self) -> tuple[Complex, Real]:
        """1/Aₖ times the derivative of Aₖ by each parameter: residues and direct terms."""
        rows = sum(c.size for c in self.coefficients)
        factors = np.zeros((rows, self.every.size), dtype=np.complex128)
        fed, row, at = np.ones(rows), 0, self.every.size - rows
        for c in self.coefficients:
            p = complex(self.every[at])
            if c.size == 1:
                factors[row, at] = p
            else:
                q = complex(self.every[at + 1])
                c1, c2 = float(c[0]), float(c[1])
                steep = c2 * (p - q)
                factors[row, at] = (c1 + 2.0 * c2 * p) * p / steep
                factors[row, at + 1] = -(c1 + 2.0 * c2 * q) * q / steep
                factors[row + 1, at] = c1 * c1 * p * p / steep
                factors[row + 1, at + 1] = -c1 * c1 * q * q / steep
                fed[row], fed[row + 1] = 2.0, c1 * c1 / c2
            row += c.size
            at += c.size
        return factors, fed

    def _halved(self, rows: Complex) -> Complex:
        """Weights for one of each conjugate pair, doubled to represent both."""
        return np.asarray(rows[:, self._kept] * self._multiplicity)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Parallel:
    """Sections of order 2 in parallel, with the interface of `Poles`.

    A numerator has degree 1 for each section in turn: a₁ + b₁s over A₁, a₂ + b₂s over A₂, …. Each
    sum of poles then involves one section only.
    """

    sections: tuple[Poles, ...]

    @property
    def upper(self) -> Complex:
        """One of each conjugate pair."""
        return np.concatenate([one.upper for one in self.sections])

    def expand(self, numerators: Real) -> Expansion:
        """Rows of the sum, one for each row of `numerators`, shape (rows, 2 sections)."""
        split = np.split(numerators, len(self.sections), axis=1)
        expanded = [one.expand(n) for one, n in zip(self.sections, split, strict=True)]
        simple, direct = np.hstack([e.simple for e in expanded]), np.zeros(numerators.shape[0])
        return Expansion(simple=simple, double=_NONE, direct=direct)

    def slopes(self, numerator: Real) -> Expansion:
        """Rows of the derivatives by the delay, then by the sections' parameters."""
        split = np.split(numerator, len(self.sections))
        own = [one.slopes(n) for one, n in zip(self.sections, split, strict=True)]
        direct = np.concatenate([[sum(e.direct[0] for e in own)], *(e.direct[1:] for e in own)])
        by_delay = np.hstack([e.simple[:1] for e in own])
        simple = np.vstack([by_delay, _blocks([e.simple[1:] for e in own])])
        none = np.zeros((1, 0), dtype=np.complex128)
        double = _blocks([none, *(e.double[1:] for e in own)])
        return Expansion(simple=simple, double=double, direct=direct)


def _blocks(parts: list[Complex]) -> Complex:
    """Matrices along the diagonal, in a ninth of the time of `scipy.linalg.block_diag`."""
    out = np.zeros(np.sum([part.shape for part in parts], axis=0), dtype=np.complex128)
    row = column = 0
    for part in parts:
        height, width = part.shape
        out[row : row + height, column : column + width] = part
        row, column = row + height, column + width
    return out


def poles_of(structure: Structure, theta: Real) -> Poles | Parallel:
    """Poles of a structure at the parameters of its sections, (order,), time in samples."""
    flat = coefficients_of(structure, theta)
    every = [0.0 + 0.0j] * structure.integrators
    coefficients, start = [], 0
    for order in structure.sections:
        c = flat[start : start + order]
        every += [complex(-1.0 / c[0])] if order == 1 else _pair(c[0], c[1])
        coefficients.append(c)
        start += order
    poles = np.array(every, dtype=np.complex128)
    if structure.parallel:
        pairs = zip(poles.reshape(-1, 2), coefficients, strict=True)
        return Parallel(sections=tuple(Poles(pair, [c]) for pair, c in pairs))
    return Poles(parted(poles), coefficients)


def _pair(c1: float, c2: float) -> list[complex]:
    """Roots of 1 + c₁s + c₂s², kept far enough apart for partial fractions."""
    inside = 1.0 - 4.0 * c2 / c1**2
    if abs(inside) < APART**2:
        inside = APART**2
    if inside < 0.0:
        real, imag = -c1 / (2.0 * c2), c1 * float(np.sqrt(-inside)) / (2.0 * c2)
        return [complex(real, imag), complex(real, -imag)]
    slow = -2.0 / (c1 * (1.0 + float(np.sqrt(inside))))
    return [complex(slow), complex(1.0 / (c2 * slow))]
