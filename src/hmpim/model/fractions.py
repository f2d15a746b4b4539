"""A rational function as a sum of single poles, and back to matrices."""

import numpy as np
import scipy
from numpy.typing import NDArray

__all__ = [
    "APART",
    "distances",
    "expanded",
    "fractions",
    "modal_form",
    "parted",
    "partial_fractions",
]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

APART = 2e-4
"""Least distance of two poles, over their size: a double pole is taken as two that are as near,
which changes no response by more than the square of this."""

_AGREES = 1e-8
"""Share of the largest response by which a sum of poles may miss it."""

_COMPANION = 6
"""Poles up to which a companion matrix, and powers of z, keep them apart."""

_NOWHERE = complex("nan")
"""Distance of poles that are the same: no expansion."""


def parted(poles: Complex) -> Complex:
    """Poles of different sections that coincide, moved apart."""
    for i in range(1, poles.size):
        for j in range(i):
            if abs(poles[i] - poles[j]) < APART * abs(poles[i]):
                poles[i] *= 1.0 + 2.0 * APART
    return poles


def modal_form(numerator: Real, denominator: Real) -> tuple[Real, Real, Real, float] | None:
    """State matrices of B(s)/A(s) of many poles, each pair a block of its own.

    None of few poles, or of such as are too much alike to be told apart.

    Parameters
    ----------
    numerator, denominator : ndarray, shapes (m + 1,) and (n + 1,)
        B and A by rising powers of s, m at most n.

    Returns
    -------
    generator, entry, output : ndarray, shapes (n, n), (n,) and (n,)
    through : float
    """
    found = expanded(numerator, denominator)
    if found is None:
        return None
    poles, residues, through = found
    blocks, entry, output = [], [], []
    for p, r in zip(poles, residues, strict=True):
        if p.imag:
            blocks.append(np.array([[p.real, -p.imag], [p.imag, p.real]]))
            entry += [1.0, 0.0]
            output += [r.real, -r.imag]
        else:
            blocks.append(np.array([[p.real]]))
            entry.append(1.0)
            output.append(r.real)
    return scipy.linalg.block_diag(*blocks), np.array(entry), np.array(output), through


def expanded(numerator: Real, denominator: Real) -> tuple[Complex, Complex, float] | None:
    """Poles, one of each conjugate pair, residues that stand for both, and what is fed through.

    None of few poles, and where the sum does not come to B/A, as of many that coincide.

    Parameters
    ----------
    numerator, denominator
        As for `modal_form`.

    Returns
    -------
    poles, residues : complex ndarray, shape (k,)
    through : float
    """
    if denominator.size - 1 <= _COMPANION:
        return None
    every = parted(np.roots(denominator[::-1]).astype(np.complex128))
    simple, constants, _ = partial_fractions(numerator[None, :], every, float(denominator[-1]))
    away = np.abs(every)
    s = 1j * np.where(away > 0.0, away, away.max())  # the pole of an integrator is no place to ask
    exact = np.polynomial.polynomial.polyval(s, numerator)
    exact = exact / np.polynomial.polynomial.polyval(s, denominator)
    error = np.sum(simple[0] / (s[:, None] - every), axis=1) + constants[0] - exact
    if not np.abs(error).max() <= _AGREES * np.abs(exact).max():
        return None
    kept = every.imag >= 0.0
    doubled = np.where(every.imag > 0.0, 2.0, 1.0)
    return every[kept], (simple[0] * doubled)[kept], float(constants[0])


def partial_fractions(
    numerators: Real, poles: Complex, leading: float
) -> tuple[Complex, Real, Complex]:
    """Expand each B(s) / (a Π(s - pₖ)) into its poles and a constant.

    Parameters
    ----------
    numerators : ndarray, shape (rows, m + 1)
        B by rising powers of s, m at most the number of poles.
    poles : complex ndarray, shape (k,)
        All different; an expansion about two that are the same is not a number.
    leading : float
        a, the factor of the highest power below.

    Returns
    -------
    residues : complex ndarray, shape (rows, k)
        Factors of 1/(s - pₖ).
    constants : ndarray, shape (rows,)
        What is fed through: 0 unless m equals the number of poles.
    apart : complex ndarray, shape (k, k)
        1/(pⱼ - pₖ), 0 on the diagonal.

    Examples
    --------
    >>> poles = np.array([-1.0, -2.0], dtype=complex)
    >>> square = np.array([[0.0, 0.0, 1.0]])  # s²/((s + 1)(s + 2)) = 1 + 1/(s + 1) - 4/(s + 2)
    >>> residues, constants, _ = partial_fractions(square, poles, 1.0)
    >>> residues[0].real.tolist(), constants.tolist()
    ([1.0, -4.0], [1.0])
    """
    apart, product = distances(poles)
    return (*fractions(numerators, poles, leading * product, leading), apart)


def fractions(
    numerators: Real, poles: Complex, steepness: Complex, leading: float
) -> tuple[Complex, Real]:
    """Residues and constants as `partial_fractions` gives them, from A'(p) at each pole."""
    count = poles.size
    above = numerators @ poles ** np.arange(numerators.shape[1])[:, None]
    fed = numerators.shape[1] > count
    constants = numerators[:, count] / leading if fed else np.zeros(len(numerators))
    return above / steepness, constants


def distances(poles: Complex) -> tuple[Complex, Complex]:
    """1/(pⱼ - pₖ), 0 on the diagonal, and the product of each pole's differences to all others."""
    count = poles.size
    differences = poles[:, None] - poles
    differences[differences == 0.0] = _NOWHERE
    differences.flat[:: count + 1] = 1.0
    apart = 1.0 / differences
    apart.flat[:: count + 1] = 0.0
    return apart, differences.prod(axis=1)
