"""What else is worth saying of a record: colour of the noise, noise on the input."""

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.effects.colour import noise_colour
from hmpim.identify.effects.input_noise import input_noise
from hmpim.record import Finding

__all__ = ["remarks"]

_ATTENUATES = 0.002
"""Share by which noise on the input must lower the gain to be worth a word."""

_SPOILS = 0.01
"""Share from which the scale factor is not to be relied on."""


def remarks(
    residual: NDArray[np.float64],
    u: NDArray[np.float64],
    *,
    fs: float,
    band: tuple[float, float],
    white: bool,
) -> tuple[tuple[Finding, ...], bool]:
    """Say what colours the residual, and whether the input is noisy.

    Parameters
    ----------
    residual, u : ndarray, shapes (m,) and (n,)
        Residual of the samples that counted; the whole input.
    fs : float
        Rate in Hz.
    band : tuple of float
        Excited band in Hz.
    white : bool
        Whether the residual passed for white: then there is nothing to say of it.

    Returns
    -------
    findings : tuple of Finding
    doubtful : bool
        Whether the input is so noisy that gains come out too small by a hundredth or more.
    """
    found: list[Finding] = []
    if not white:
        colour = noise_colour(residual, fs)
        found.append(
            Finding(
                code="noise_colour",
                message=f"What the model leaves over is {colour.description}. "
                "Look for hum, drift or motion that the model does not have.",
            )
        )
    noise = input_noise(u, fs, band=band)
    if noise is not None and noise.attenuation > _ATTENUATES:
        found.append(
            Finding(
                code="input_noise",
                message=f"The input carries noise of {noise.std:.3g} (standard deviation), which "
                f"lowers the gain found by about {100 * noise.attenuation:.2g} %. Use the "
                "command instead of its measurement, if you have it.",
            )
        )
    return tuple(found), noise is not None and noise.attenuation > _SPOILS
