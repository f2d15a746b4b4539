"""Reading a frequency response: phase, bandwidths, damping (equations 19-25, Fig. 16).

Phases are in degrees here, as in the paper's figures, and lag is negative.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from hmpim.identify.arrays import Real, median
from hmpim.identify.worth import FEW

__all__ = ["damping_from_hump", "delay_phase", "falling_crossing", "near_dc", "peak_gain", "phase"]


def phase(response: ArrayLike, *, inverted: ArrayLike = False) -> Real:
    """Return the phase φ of equation (23), tan φ = I/R, in degrees and without jumps.

    The signs of R and I give the quadrant. The phase is unwrapped from the first frequency upwards,
    so that no step exceeds 180°. Pass the excited band only: outside it the phase is noise, and
    would add false turns. The median of the lowest twentieth of the band is within 180° of zero.

    Parameters
    ----------
    response : array_like of complex, shape (..., m)
        G(jω) inside the excited band, frequency increasing, finite; many devices along other axes.
    inverted : array_like of bool, shape (...)
        True for a device that inverts the sign: the phase is then that of -G.

    Returns
    -------
    ndarray, shape (..., m)
        Phase in degrees.

    Examples
    --------
    >>> phase(np.exp(-1j * np.radians([10, 110, 210, 310, 410]))).round(6)
    array([ -10., -110., -210., -310., -410.])
    """
    g = np.asarray(response, dtype=np.complex128)
    g = np.where(np.asarray(inverted)[..., None], -g, g)
    if g.size == 0:
        return np.zeros(g.shape)
    turning = np.degrees(np.unwrap(np.angle(g)))
    start = np.median(turning[..., : near_dc(g.shape[-1])], axis=-1)
    return np.asarray(turning - 360.0 * np.round(start / 360.0)[..., None])


def near_dc(bins: int) -> int:
    """Return how many of a band's bins count as near DC: the lowest twentieth, at least one."""
    return max(math.ceil(FEW * bins), 1)


def delay_phase(frequency: ArrayLike, delay: float) -> Real:
    """Return the phase of a pure delay by equation (25): -ω δ, in degrees, shape (m,).

    Frequencies are in Hz, δ in s. Fig. 16 shows a phase without it.

    Examples
    --------
    >>> delay_phase([0.0, 1.0, 2.0], 0.125)
    array([ -0., -45., -90.])
    """
    return -360.0 * np.asarray(frequency, dtype=np.float64) * delay


def falling_crossing(frequency: ArrayLike, curve: ArrayLike, level: float) -> float | None:
    """Return the first frequency, interpolated linearly, at which a curve falls through a level.

    The phase falls through -90° at the effective bandwidth, the paper's basic measure of merit
    (Fig. 15), and without the delay at the natural frequency of a quadratic lag (Fig. 16). The
    magnitude falls through 1/√2 of the gain at DC (-3.01 dB) at the 3 dB bandwidth.

    Frequencies, (m,), increase; the curve, (m,), is finite, a phase without jumps. None if the
    curve starts below the level or never falls through it.

    Examples
    --------
    >>> falling_crossing([1.0, 2.0, 3.0], [0.0, -80.0, -120.0], -90.0)
    2.25
    """
    f, c = np.asarray(frequency, dtype=np.float64), np.asarray(curve, dtype=np.float64)
    above = c >= level
    if c.size < 2 or not above[0]:
        return None
    falls = np.flatnonzero(above[:-1] & ~above[1:])
    if falls.size == 0:
        return None
    k = int(falls[0])
    return float(f[k] + (f[k + 1] - f[k]) * (c[k] - level) / (c[k] - c[k + 1]))


def peak_gain(magnitude: ArrayLike) -> float | None:
    """Return the hump of Fig. 16: the greatest magnitude relative to the gain near DC.

    |G| has shape (m,), inside the band; the gain near DC is its median over the lowest twentieth.
    None if there is no hump: the greatest magnitude is near DC or at the upper end of the band.

    Examples
    --------
    >>> peak_gain([1.0, 1.1, 1.4, 0.9])
    1.4
    """
    g = np.asarray(magnitude, dtype=np.float64)
    if g.size < 3:
        return None
    start = near_dc(g.size)
    top = int(np.argmax(g))
    gain = median(g[:start])
    if top < start or top == g.size - 1 or gain <= 0:
        return None
    return float(g[top]) / gain


def damping_from_hump(peak: float) -> float | None:
    """Return the damping ratio of a quadratic lag from its hump (Fig. 16).

    |G|max/|G(0)| = 1/(2ζ√(1-ζ²)) is solved for the ζ below 1/√2, beyond which there is no
    hump; None if the ratio is not above 1.

    Examples
    --------
    >>> round(damping_from_hump(1.3639), 3)
    0.4
    """
    if not peak > 1 or not math.isfinite(peak):
        return None
    # ζ² = (1 - √(1 - 1/p²))/2, in the form that does not cancel for sharp resonances.
    inverse = 1.0 / (peak * peak)
    return math.sqrt(inverse / (2.0 * (1.0 + math.sqrt(1.0 - inverse))))
