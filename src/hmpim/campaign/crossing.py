"""Where a measured response crosses -90° from sample to sample: one reading for every mode."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["first_crossing", "samples_bandwidth"]

_CLEAR = 0.3  # share of the response: what is less sure does not count
_FEWEST = 6

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def samples_bandwidth(response: dict[str, Any], *, near: float) -> float | None:
    """First -90° of a measured response, the hold of the command included.

    A parabola through the phase around the crossing: noise in the phase of single frequencies
    does not pull it down, as it did in the paper's Fig. 24.

    Parameters
    ----------
    response : dict
        `frequency` (Hz), `real`, `imag` and `std`, as in the result's JSON.
    near : float
        Where to look first, Hz.

    Returns
    -------
    float or None
        In Hz; None where the response is not clear there.

    Examples
    --------
    >>> f = np.linspace(1.0, 20.0, 200)
    >>> late = np.exp(-2j * np.pi * f * 0.025)  # -90° at 10 Hz
    >>> found = samples_bandwidth(
    ...     {"frequency": f, "real": late.real, "imag": late.imag, "std": 0.01 + 0 * f}, near=12.0
    ... )
    >>> round(found, 6)
    10.0
    """
    f, z, std = _clear_part(response)
    found = near
    for low, high in ((0.6, 1.4), (0.8, 1.2), (0.85, 1.15)):
        seen = (f > low * found) & (f < high * found)
        if np.count_nonzero(seen) < _FEWEST:
            return None
        x = f[seen] / found - 1.0
        beyond = np.angle(1j * z[seen])  # 0 where the phase is -90°
        weight = np.abs(z[seen]) / std[seen]
        roots = np.roots(np.polyfit(x, beyond, 2, w=weight))
        real = roots[np.abs(roots.imag) < 1e-9].real
        inside = real[(real > x.min()) & (real < x.max())]
        if inside.size == 0:
            return None
        found *= 1.0 + float(inside[np.argmin(np.abs(inside))])
    return found


def first_crossing(response: dict[str, Any]) -> float | None:
    """First frequency at which the clear part of a measured response lies beyond -90°.

    Where no model and no reading tells where to look for `samples_bandwidth`, this does.

    Parameters
    ----------
    response : dict
        As `samples_bandwidth` takes it.

    Returns
    -------
    float or None
        In Hz; None where the response is clear nowhere, or does not come so far.

    Examples
    --------
    >>> f = np.linspace(1.0, 20.0, 200)
    >>> late = np.exp(-2j * np.pi * f * 0.025)  # -90° at 10 Hz
    >>> found = first_crossing(
    ...     {"frequency": f, "real": late.real, "imag": late.imag, "std": 0.01 + 0 * f}
    ... )
    >>> round(found, 1)
    10.1
    """
    f, z, _ = _clear_part(response)
    beyond = np.unwrap(np.angle(z)) <= -0.5 * np.pi
    return float(f[np.argmax(beyond)]) if beyond.any() else None


def _clear_part(response: dict[str, Any]) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Frequency, response and its deviation where it is clear."""
    f = np.asarray(response["frequency"], dtype=np.float64)
    z = np.asarray(response["real"]) + 1j * np.asarray(response["imag"])
    std = np.array([np.inf if s is None else s for s in response["std"]], dtype=np.float64)
    clear = (std < _CLEAR * np.abs(z)) & (f > 0.0)
    return f[clear], z[clear], std[clear]
