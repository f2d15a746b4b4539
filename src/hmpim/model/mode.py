"""The modes of a model: each pair of conjugate poles, and how surely it is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mode", "modes_of"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """A pair of conjugate poles.

    Parameters
    ----------
    natural_frequency : float
        Hz.
    damping_ratio : float
        From 0 to 1.
    natural_frequency_std, damping_ratio_std : float or None
        Standard deviations; None of a model without a spread.
    """

    natural_frequency: float
    damping_ratio: float
    natural_frequency_std: float | None
    damping_ratio_std: float | None


def modes_of(
    denominator: NDArray[np.float64], covariance: NDArray[np.float64] | None
) -> tuple[Mode, ...]:
    """Return the modes of a denominator, the lowest first.

    A coefficient of s^k moves a pole p of A by dp = -p^k / A'(p) times its own change; what that
    does to ln|p| and to the damping ratio -Re p / |p| is taken to first order.

    Parameters
    ----------
    denominator : ndarray, shape (n + 1,)
        A by falling powers of s, in seconds.
    covariance : ndarray, shape (n, n), or None
        Of all its coefficients but the last that is not 0.

    Examples
    --------
    >>> two = np.polymul([0.01, 0.02, 1.0], [0.0001, 0.002, 1.0])
    >>> [round(2 * np.pi * mode.natural_frequency, 6) for mode in modes_of(two, None)]
    [10.0, 100.0]
    """
    size = denominator.size - 1
    behind = 1 if size and denominator[-1] == 0.0 else 0  # of an integrator s^1 is known
    powers = np.arange(size, -1, -1)
    corner = (abs(denominator[0] / denominator[-1 - behind])) ** (-1.0 / max(size - behind, 1))
    scaled = denominator * corner**powers  # high powers of s would leave no digits
    poles = np.roots(scaled)
    poles = poles[poles.imag > 0.0]
    own = powers[: size - behind]
    found = []
    for p in poles[np.argsort(np.abs(poles))]:
        natural, damping = abs(p), float(-p.real / abs(p))
        spread: list[float | None] = [None, None]
        if covariance is not None:
            known = covariance * np.outer(corner**own, corner**own)
            moved = -(p**own) / np.polyval(np.polyder(scaled), p) / p  # of ln p
            by_damping = moved.imag * np.sqrt(1.0 - damping**2)
            spread = [
                float(np.sqrt(max(row @ known @ row, 0.0))) for row in (moved.real, by_damping)
            ]
        hertz = float(natural * corner / (2.0 * np.pi))
        found.append(
            Mode(
                natural_frequency=hertz,
                damping_ratio=damping,
                natural_frequency_std=None if spread[0] is None else spread[0] * hertz,
                damping_ratio_std=spread[1],
            )
        )
    return tuple(found)
