"""How much of a response a model leaves out, every part of the band counting alike.

A sweep inside limits moves most at its low end, so that a model may leave out two thirds of the
response at the high end and still explain 99 % of the output's power.
"""

import numpy as np
import scipy

from hmpim.identify.arrays import Real

__all__ = ["unexplained_response"]


def unexplained_response(
    u: Real, y: Real, residual: Real, *, delay: float, band: tuple[float, float], groups: int = 24
) -> float:
    """Share of the response (r.m.s. over frequency) that the residual still holds.

    In each group of neighbouring bins one complex gain from the input is fitted to the output
    and one to the residual. What noise alone would give the latter, twice over, is taken off.

    Parameters
    ----------
    u, y, residual : ndarray, shape (n,)
        Input, output, and what the model leaves of the output.
    delay : float
        Delay in samples; the input is moved by it so that the gains are smooth over a group.
    band : tuple of float
        Excited band, in cycles per sample.
    groups : int
        How many groups to cut the band into, at most.

    Returns
    -------
    float
        0 where nothing follows the input, 1 where all of the response is left over.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> u = rng.standard_normal(2000)
    >>> y = 2.0 * u
    >>> round(unexplained_response(u, y, 0.1 * y, delay=0.0, band=(0.0, 0.5)), 3)
    0.1
    """
    n = u.size
    first = max(int(np.ceil(band[0] * n)), 1)
    bins = np.arange(first, min(int(band[1] * n), n // 2) + 1)
    width = max(bins.size // groups, 4)
    groups = bins.size // width
    if groups == 0:
        return 0.0
    bins = bins[: groups * width]
    shape = (groups, width)
    moved = (scipy.fft.rfft(u - u.mean())[bins] * np.exp(-2j * np.pi * bins * delay / n)).reshape(
        shape
    )
    power = np.sum(np.abs(moved) ** 2, axis=1)
    seen = power > 0.0

    def followed(x: Real) -> tuple[Real, Real]:
        """Power of a signal that one gain of each group explains, and of all of it."""
        wave = scipy.fft.rfft(x - x.mean())[bins].reshape(shape)
        taken = np.abs(np.sum(moved.conj() * wave, axis=1)) ** 2 / np.where(seen, power, 1.0)
        return taken, np.sum(np.abs(wave) ** 2, axis=1)

    explained, _ = followed(y)
    taken, total = followed(residual)
    noise = np.maximum(total - taken, 0.0) / (width - 1)
    gains = np.sum(explained[seen] / power[seen])
    left = np.sum(np.maximum(taken - 2.0 * noise, 0.0)[seen] / power[seen])
    return float(np.sqrt(left / gains)) if gains > 0.0 else 0.0
