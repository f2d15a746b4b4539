"""Response from samples to samples, for an input that is held or linear between its samples.

A ratio of sampled spectra depends on the input between its samples, and on its aliases: for a
first-order lag these are a percent of the response well below a quarter of the rate.
"""

from dataclasses import replace

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.model import RationalDelay, response
from hmpim.model.discrete import realised
from hmpim.record import Intersample

__all__ = ["sampled_response"]


def sampled_response(
    system: RationalDelay, frequency: Real, *, fs: float, intersample: Intersample
) -> Complex:
    """Response from samples of the input to samples of the output, at frequencies in Hz, (m,).

    For a held input this is the modified z-transform, exact, by one matrix exponential for each
    part of a sample (C. Van Loan, IEEE TAC, 1978). A linear input is the integral of a held slope.

    Examples
    --------
    A delay of half a sample shows only at the next one:

    >>> half = RationalDelay(delay=0.005, numerator=np.ones(1), denominator=np.ones(1))
    >>> held = sampled_response(half, np.array([10.0]), fs=100.0, intersample="zoh")
    >>> round(float(np.degrees(np.angle(held[0]))), 6)
    -36.0
    """
    if intersample == "zoh":
        return _held(system, frequency, fs)
    if intersample == "foh":
        slope = replace(system, denominator=np.concatenate([[0.0], system.denominator]))
        ahead = np.exp(2j * np.pi * frequency / fs) - 1.0
        return np.asarray(_held(slope, frequency, fs) * ahead * fs)
    return response(system, frequency)


def _held(system: RationalDelay, frequency: Real, fs: float) -> Complex:
    """Response to a held input, with time in samples.

    Within a sample the delayed input has an older value for the fraction of the delay, and then the
    next value.
    """
    whole = np.floor(system.delay * fs + 1e-9)
    late = float(max(system.delay * fs - whole, 0.0))
    rows, entry, output, direct = realised(system, fs)
    order = output.size
    z = np.exp(2j * np.pi * frequency / fs)
    older = 1.0 / z if late > 1e-9 else np.ones(z.size)
    if not order:
        return np.asarray(direct * older * z**-whole)
    first, second = _stepped(rows, entry, late), _stepped(rows, entry, 1.0 - late)
    step = second[:order, :order] @ first[:order, :order]
    from_older = second[:order, :order] @ first[:order, order]
    drive = from_older[:, None] / z + second[:order, order][:, None]
    pencil = z[:, None, None] * np.eye(order) - step
    states = np.linalg.solve(pencil, drive.T[:, :, None].astype(np.complex128))[:, :, 0]
    return np.asarray((states @ output + direct * older) * z**-whole)


def _stepped(rows: Real, entry: Real, span: float) -> Real:
    """Transition of the states over a span, with a constant input as the last state."""
    order = entry.size
    wide = np.zeros((order + 1, order + 1))
    wide[:order, :order] = rows
    wide[:order, order] = entry
    return np.asarray(scipy.linalg.expm(wide * span))
