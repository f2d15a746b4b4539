"""Filters in z: what software does to its input's samples, with its poles and gain as sections.

With δ = 1 - 1/z in place of s, a filter of unit gain at DC is B(δ)/A(δ), B(0) = A(0) = 1, as a
system in continuous time is: powers of δ are differences from sample to sample as those of s are
rates (R. H. Middleton and G. C. Goodwin, Digital Control and Estimation, 1990, ch. 3). So a
structure, its parameters and their meaning are one for both; a pole is at z = e^s of the section's.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.model.dynamics import Structure

__all__ = [
    "delta_of",
    "in_delta",
    "in_z",
    "nyquist_taps",
    "poles_in_z",
    "section_parameters",
]

_Real = NDArray[np.float64]
_Complex = NDArray[np.complex128]

_NEAREST, _FARTHEST = 1e-8, 0.9999999
"""Bounds of a pole's distance from z = 0 when a section is made of it."""


def poles_in_z(structure: Structure, coefficients: ArrayLike) -> _Complex:
    """Poles of A, shape (order,), from the sections' coefficients in samples.

    Examples
    --------
    >>> from hmpim.model.dynamics import FILTERS
    >>> poles_in_z(FILTERS["iir_1"], [1.0]).real.round(6).tolist()  # e^-1
    [0.367879]
    """
    values = np.asarray(coefficients, dtype=np.float64)
    found: list[complex] = []
    start = 0
    for order in structure.sections:
        c1 = values[start]
        if order == 1 or values[start + 1] == 0.0:
            found.append(-1.0 / c1)
            if order == 2:
                found.append(-np.inf)
        else:
            c2 = values[start + 1]
            away = np.sqrt(complex(c1 * c1 - 4 * c2))
            fast = -(c1 + away) / (2 * c2)
            found += [fast, 1.0 / (c2 * fast)]
        start += order
    return np.exp(np.array(found, dtype=np.complex128))


def in_delta(structure: Structure, coefficients: ArrayLike, taps: _Real) -> tuple[_Real, _Real]:
    """Numerator and denominator by rising powers of δ, the denominator's first coefficient 1.

    Parameters
    ----------
    structure : Structure
        One of `hmpim.model.dynamics.FILTERS`.
    coefficients : array_like, shape (order,)
        Of the sections, in samples.
    taps : ndarray, shape (zeros + 1,)
        Of the numerator beside the zeros at z = -1, by rising powers of δ.
    """
    numerator = np.convolve(taps, in_z(nyquist_taps(structure)))  # and back: it is its own inverse
    denominator = np.ones(1, dtype=np.complex128)
    for pole in poles_in_z(structure, coefficients):
        denominator = np.convolve(denominator, [1.0, pole / (1.0 - pole)])
    return numerator, np.asarray(denominator.real)


def nyquist_taps(structure: Structure) -> _Real:
    """((1 + 1/z) / 2)ⁿ by rising powers of 1/z: what zeros at z = -1 do, of unit gain at DC."""
    taps = np.atleast_1d(np.poly(np.full(structure.nyquist_zeros, -1.0)))
    return np.asarray(taps / taps.sum(), dtype=np.float64)


def in_z(coefficients: _Real) -> _Real:
    """Turn a polynomial in δ, by rising powers, into one in 1/z.

    Examples
    --------
    >>> in_z(np.array([1.0, 1.0])).tolist()  # 1 + (1 - 1/z)
    [2.0, -1.0]
    """
    out = np.zeros(1)
    for c in coefficients[::-1]:
        out = np.convolve(out, [1.0, -1.0])
        out[0] += c
    return out[: coefficients.size]


def delta_of(frequency: _Real, step: float) -> _Complex:
    """δ = 1 - 1/z at frequencies in Hz, a sample every `step` s."""
    return np.asarray(1.0 - np.exp(-2j * np.pi * np.asarray(frequency) * step))


def section_parameters(structure: Structure, poles: _Complex) -> _Real:
    """Parameters of the sections (`hmpim.model.dynamics.coefficients_of`) for poles in z.

    Poles that no section has (on or outside the unit circle, left of z = 0) are moved to the
    nearest that one has, as starts for a fit may be.

    Parameters
    ----------
    structure : Structure
        As many sections as there are poles.
    poles : complex ndarray, shape (order,)
        In conjugate pairs where complex.
    """
    size = np.clip(np.abs(poles), _NEAREST, _FARTHEST)
    s = np.log(size) + 1j * np.where(poles.real > 0, np.angle(poles), np.pi / 2 * (poles.imag > 0))
    paired = sorted(s[np.abs(s.imag) > 1e-9], key=lambda p: (p.real, abs(p.imag)))
    alone = sorted((p.real for p in s[np.abs(s.imag) <= 1e-9]), reverse=True)
    pairs = [(p, p.conjugate()) for p in paired if p.imag > 0]
    out: list[float] = []
    for order in structure.sections:
        if order == 2 and pairs:
            p, q = pairs.pop()
        elif order == 2:
            p, q = (alone.pop(0), alone.pop(0)) if len(alone) > 1 else (-0.3, -0.4)
        else:
            p = alone.pop(0) if alone else -0.3
            out.append(float(np.log(-1.0 / p)))
            continue
        c1, c2 = float((-(p + q) / (p * q)).real), float((1.0 / (p * q)).real)
        out += [float(np.log(c1)), c2 / c1**2]
    return np.array(out)
