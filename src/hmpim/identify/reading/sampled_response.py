"""Response from samples to samples, for an input that is held or linear between its samples.

A ratio of sampled spectra depends on the input between its samples, and on its aliases: for a
first-order lag these are a percent of the response well below a quarter of the rate.
"""

from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Complex, Real
from hmpim.model import RationalDelay, response
from hmpim.model.discrete import discretise
from hmpim.record import Intersample

__all__ = ["sampled_response"]


def sampled_response(
    system: RationalDelay, frequency: Real, *, fs: float, intersample: Intersample
) -> Complex:
    """Response from samples of the input to samples of the output, at frequencies in Hz, (m,)."""
    if intersample not in ("zoh", "foh"):
        return response(system, frequency)
    whole = np.floor(system.delay * fs + 1e-9) / fs  # may be negative, unlike that of a program
    rest = replace(system, delay=max(system.delay - whole, 0.0))
    stepped = discretise(rest, fs=fs, intersample=intersample)
    return np.asarray(stepped.response(frequency) * np.exp(-2j * np.pi * frequency * whole))
