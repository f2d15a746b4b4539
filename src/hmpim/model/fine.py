"""Signals on a clock finer than the samples: what is not linear happens between them too."""

from functools import cache

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.model.sampled import MARGIN, delayed_response, prepare_input
from hmpim.record import Intersample

__all__ = ["FINE", "finely", "joined", "sampled"]

_Real = NDArray[np.float64]

FINE = 8
"""Steps of the finer clock to a sample."""


def finely(u: _Real, mode: Intersample) -> _Real:
    """An input, (n,), on the finer clock from its first sample to its last.

    Examples
    --------
    >>> finely(np.array([0.0, 1.0, 1.0, 0.0]), "foh")[:10].tolist()
    [0.0, 0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0, 1.0]
    """
    source = prepare_input(u, mode)
    still = np.ones(1)
    steps = [delayed_response(source, delay=-k / FINE, denominator=still)[0] for k in range(FINE)]
    return np.asarray(source.first + joined(np.stack(steps, axis=1)))


def joined(steps: _Real) -> _Real:
    """Signal on the finer clock, from its values at each step after each sample, (n, FINE)."""
    return np.asarray(steps.ravel()[: 1 - FINE])


def sampled(fine: _Real) -> _Real:
    """The part of a signal on the finer clock below half the sampling rate, at the samples."""
    reach = min(MARGIN * FINE, fine.size - 1)
    longer = np.pad(fine, reach, mode="reflect", reflect_type="odd")
    smooth = scipy.signal.oaconvolve(longer, _below_half_the_rate(), mode="same")
    return np.asarray(smooth[reach : reach + fine.size : FINE])


@cache
def _below_half_the_rate() -> _Real:
    """Windowed sinc on the finer clock that keeps what the samples determine."""
    size = 2 * MARGIN * FINE + 1
    return np.asarray(scipy.signal.firwin(size, 1.0 / FINE, window=("kaiser", 12.0)))
