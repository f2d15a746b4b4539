"""Structures of dynamics: which rational functions of s a fit may try.

Every structure is ``B(s) / A(s)`` with B(0) = A(0) = 1 after the scale factor is taken out;
with zeros at DC, s or s² times such a B. An integrator has s A(s) below instead. A(s) is a
product of sections ``1 + c1 s`` and ``1 + c1 s + c2 s²`` with positive coefficients, so that every
model tried is stable.

Of many modes B(s) is no list of powers of s, whose responses are then too much alike to be told
apart, but a sum: each mode's gain over its own section, ``g1 / A1(s) + g2 / A2(s) + …``.
"""

from dataclasses import dataclass
from typing import Literal, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = [
    "FILTERS",
    "STRUCTURES",
    "Structure",
    "StructureName",
    "coefficients_of",
    "denominator_of",
    "numerator_of",
    "second_order_coefficients",
    "theta_of",
]

StructureName = Literal[
    "static",
    "first_order",
    "second_order",
    "first_order_zero",
    "second_order_zero",
    "second_order_zeros",
    "third_order",
    "third_order_zero",
    "third_order_zeros",
    "fourth_order",
    "fifth_order",
    "sixth_order",
    "two_modes",
    "three_modes",
    "four_modes",
    "five_modes",
    "six_modes",
    "seven_modes",
    "eight_modes",
    "washout",
    "band_pass",
    "washout_second_order",
    "second_order_high_pass",
    "integrator",
    "integrator_first_order",
    "integrator_second_order",
    "fir",
    "iir_1",
    "iir_2",
    "iir_3",
    "iir_4",
    "iir_1_zeros",
    "iir_2_zeros",
    "iir_3_zeros",
    "iir_4_zeros",
    "bilinear_1",
    "bilinear_2",
    "bilinear_3",
    "bilinear_4",
]


@dataclass(frozen=True, slots=True, kw_only=True)
class Structure:
    """A family of rational dynamics.

    Parameters
    ----------
    name : str
        As in the result.
    sections : tuple of int
        Orders, 1 or 2, of the sections of the denominator.
    zeros : int
        Degree of the numerator, at most that of the denominator.
    integrators : int
        Poles at zero, 0 or 1. With one, the scale factor is the output's rate per input.
    dc_zeros : int
        Zeros at zero: the least power of the numerator. With one, a constant input does nothing,
        and the scale factor is the output per rate of the input; with two, per acceleration.
    nyquist_zeros : int
        Of a filter in z: zeros at z = -1, as the bilinear transform puts them.
    sampled : bool
        Whether it is a filter in z: a pole then is at z = e^s of its section's, zeros are powers
        of 1 - 1/z, and the delay is a whole number of samples (`hmpim.model.filters`).
    parallel : bool
        Whether it is a sum of sections of order 2. With 2 zeros less than poles each has a gain;
        a fit then has, for the numerator's coefficients, the gain at DC and the gains of the
        second section on. With 1 less each has a numerator of degree 1, and a fit has those.
    """

    name: StructureName
    sections: tuple[int, ...]
    zeros: int = 0
    integrators: int = 0
    dc_zeros: int = 0
    nyquist_zeros: int = 0
    sampled: bool = False
    parallel: bool = False

    @property
    def order(self) -> int:
        """How many coefficients of the denominator are not linear in the output."""
        return sum(self.sections)

    @property
    def parameters(self) -> int:
        """How many parameters a fit has: delay, denominator, numerator, bias, and noise."""
        above = len(self.sections) if self.parallel else self.zeros + 1 - self.dc_zeros
        return 1 + self.order + above + 2


STRUCTURES: dict[StructureName, Structure] = {
    s.name: s
    for s in (
        Structure(name="static", sections=()),
        Structure(name="first_order", sections=(1,)),
        Structure(name="second_order", sections=(2,)),
        Structure(name="first_order_zero", sections=(1,), zeros=1),
        Structure(name="second_order_zero", sections=(2,), zeros=1),
        Structure(name="second_order_zeros", sections=(2,), zeros=2),
        Structure(name="third_order", sections=(2, 1)),
        Structure(name="third_order_zero", sections=(2, 1), zeros=1),
        Structure(name="third_order_zeros", sections=(2, 1), zeros=2),
        Structure(name="fourth_order", sections=(2, 2)),
        Structure(name="fifth_order", sections=(2, 2, 1)),
        Structure(name="sixth_order", sections=(2, 2, 2)),
        Structure(name="two_modes", sections=(2, 2), zeros=2),
        Structure(name="three_modes", sections=(2,) * 3, zeros=4, parallel=True),
        Structure(name="four_modes", sections=(2,) * 4, zeros=6, parallel=True),
        Structure(name="five_modes", sections=(2,) * 5, zeros=8, parallel=True),
        Structure(name="six_modes", sections=(2,) * 6, zeros=10, parallel=True),
        Structure(name="seven_modes", sections=(2,) * 7, zeros=12, parallel=True),
        Structure(name="eight_modes", sections=(2,) * 8, zeros=14, parallel=True),
        Structure(name="washout", sections=(1,), zeros=1, dc_zeros=1),
        Structure(name="band_pass", sections=(2,), zeros=1, dc_zeros=1),
        Structure(name="washout_second_order", sections=(2, 1), zeros=1, dc_zeros=1),
        Structure(name="second_order_high_pass", sections=(2,), zeros=2, dc_zeros=2),
        Structure(name="integrator", sections=(), integrators=1),
        Structure(name="integrator_first_order", sections=(1,), integrators=1),
        Structure(name="integrator_second_order", sections=(2,), integrators=1),
    )
}

_SECTIONS: dict[int, tuple[int, ...]] = {1: (1,), 2: (2,), 3: (2, 1), 4: (2, 2)}

FILTERS: dict[str, Structure] = {
    "static": Structure(name="static", sections=(), sampled=True),
    **{
        f"fir_{taps}": Structure(name="fir", sections=(), zeros=taps - 1, sampled=True)
        for taps in range(2, 17)
    },
    **{
        f"{kind}_{n}{end}": Structure(
            name=cast(StructureName, f"{kind}_{n}{end}"),
            sections=sections,
            zeros=n if end else 0,
            nyquist_zeros=n if kind == "bilinear" else 0,
            sampled=True,
        )
        for kind, end in (("iir", ""), ("bilinear", ""), ("iir", "_zeros"))
        for n, sections in _SECTIONS.items()
    },
}
"""What software may do, sample over sample: z⁻ᵏ B/A, each pole of A the z = e^s of a section's."""


def denominator_of(structure: Structure, coefficients: ArrayLike) -> NDArray[np.float64]:
    """Multiply the sections out: A(s) by rising powers of s.

    Parameters
    ----------
    structure : Structure
        Which sections.
    coefficients : array_like, shape (order,)
        c1 (and c2) of each section in turn, positive, in s and s².

    Returns
    -------
    ndarray, shape (integrators + order + 1,)

    Examples
    --------
    >>> denominator_of(STRUCTURES["second_order"], [0.5, 0.25]).tolist()
    [1.0, 0.5, 0.25]
    """
    values = np.asarray(coefficients, dtype=np.float64)
    product = np.concatenate([np.zeros(structure.integrators), [1.0]])
    start = 0
    for order in structure.sections:
        section = np.concatenate([[1.0], values[start : start + order]])
        product = np.convolve(product, section)
        start += order
    return product


def numerator_of(
    structure: Structure, coefficients: ArrayLike, weights: ArrayLike
) -> NDArray[np.float64]:
    """B(s) by rising powers of s, the scale factor included.

    Parameters
    ----------
    structure : Structure
        Which sections.
    coefficients : array_like, shape (order,)
        As for `denominator_of`.
    weights : array_like, shape (m,)
        The linear parameters of a fit: the coefficients of B themselves, or of sections in
        parallel the gain at DC and the gains of the second section on.

    Returns
    -------
    ndarray, shape (zeros + 1,)

    Examples
    --------
    2/(1 + s + s²) + 1/(1 + 2s + s²) has a gain of 3 at DC:

    >>> pair = Structure(name="two_modes", sections=(2, 2), zeros=2, parallel=True)
    >>> numerator_of(pair, [1.0, 1.0, 2.0, 1.0], [3.0, 1.0]).tolist()
    [3.0, 5.0, 3.0]
    """
    told = np.asarray(weights, dtype=np.float64)
    if not structure.parallel:
        return np.concatenate([np.zeros(structure.dc_zeros), told])
    gains = told.copy()
    gains[0] -= told[1:].sum()
    sections = np.insert(np.reshape(coefficients, (-1, 2)).astype(np.float64), 0, 1.0, axis=1)
    total = np.zeros(structure.zeros + 1)
    for k, gain in enumerate(gains):
        product = np.array([gain])
        for section in np.delete(sections, k, axis=0):
            product = np.convolve(product, section)
        total += product
    return total


def coefficients_of(structure: Structure, theta: ArrayLike) -> NDArray[np.float64]:
    """Section coefficients from the parameters that a fit moves.

    A section 1 + c1 s has the parameter ln c1. A section 1 + c1 s + c2 s² has ln c1 and
    c2 / c1² = 1 / (4ζ²), which is 0 where the section turns into one of first order: there the
    output still has a slope in it, as it would not have in ln c2.

    Parameters
    ----------
    structure : Structure
        Which sections.
    theta : array_like, shape (order,)
        Parameters of each section in turn.

    Examples
    --------
    >>> coefficients_of(STRUCTURES["second_order"], [0.0, 0.25]).tolist()
    [1.0, 0.25]
    """
    values = np.array(theta, dtype=np.float64)
    start = 0
    for order in structure.sections:
        values[start] = np.exp(values[start])
        if order == 2:
            values[start + 1] *= values[start] ** 2
        start += order
    return values


def theta_of(structure: Structure, coefficients: ArrayLike) -> NDArray[np.float64]:
    """Parameters that a fit moves, from section coefficients; undoes `coefficients_of`.

    Examples
    --------
    >>> theta_of(STRUCTURES["second_order"], [1.0, 0.25]).tolist()
    [0.0, 0.25]
    """
    values = np.array(coefficients, dtype=np.float64)
    start = 0
    for order in structure.sections:
        if order == 2:
            values[start + 1] /= values[start] ** 2
        values[start] = np.log(values[start])
        start += order
    return values


def second_order_coefficients(
    natural_frequency: float, damping_ratio: float
) -> NDArray[np.float64]:
    """Coefficients c1 = 2ζ/ω, c2 = 1/ω² of the section 1 + c1 s + c2 s², time in seconds.

    Parameters
    ----------
    natural_frequency : float
        Undamped natural frequency in Hz.
    damping_ratio : float
        Damping ratio ζ.

    Examples
    --------
    >>> second_order_coefficients(1 / (2 * np.pi), 0.5).tolist()
    [1.0, 1.0]
    """
    omega = 2 * np.pi * natural_frequency
    return np.array([2 * damping_ratio / omega, 1 / omega**2])
