"""Output of a rational system with delay, driven by an input from its first sample on."""

import numpy as np
from numpy.typing import NDArray

from hmpim.model.poles import rational_response
from hmpim.model.response import RationalDelay, per_step
from hmpim.model.sampled import SampledInput

__all__ = ["driven"]


def driven(
    system: RationalDelay, source: SampledInput, fs: float, *, early: float = 0.0
) -> NDArray[np.float64]:
    """Output at the samples, (n,), for an input that stood at its first sample before.

    Parameters
    ----------
    system : RationalDelay
        Delay in s and dynamics in powers of s.
    source : SampledInput
        The input.
    fs : float
        Rate in Hz.
    early : float
        Part of a sample after each sample at which the output is taken.
    """
    y = rational_response(
        source,
        delay=system.delay * fs - early,
        numerator=per_step(system.numerator, fs),
        denominator=per_step(system.denominator, fs),
    )
    level: float | NDArray[np.float64] = float(system.numerator[0]) * source.first
    if system.denominator[0] == 0:
        since = np.arange(source.samples) / fs - (system.delay - early / fs)
        level = level * np.maximum(since, 0.0)
    return np.asarray(y + level)
