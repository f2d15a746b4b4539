"""Whether a residual still follows the input."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept
from hmpim.identify.noise.spectra import transform_of, windowed_power
from hmpim.identify.worth import DEEPEST, PART

__all__ = ["Delayed", "Misfit", "misfit", "misfits", "unexplained_response"]

Delayed = tuple[Real, float]
"""A signal, (n,), and a delay in samples."""

_GROUPS = 24
"""Most groups of neighbouring bins in the band."""

_NEAR = 24
"""Bins on either side of a line from which its noise is estimated."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Misfit:
    """How much of the residual still follows the input; by default nothing."""

    # of the residual's power, at all frequencies, explained by a smooth response to the input
    # within its band beyond what noise would explain; 0 when none
    share: float = 0.0
    within: float = 0.0  # the same, of the residual's power within the band
    probability: float = 1.0  # chance of so much, or more, if the model were right


def misfit(
    u: Real,
    residual: Real,
    *,
    delay: float,
    band: tuple[float, float],
    others: Sequence[Delayed] = (),
) -> Misfit:
    """Test whether the residual is still coherent with the input.

    The residual's spectrum is divided into groups of neighbouring bins, and in each one complex
    gain from the input is fitted. If the model is right, that gain explains two degrees of freedom
    of the noise in the same group, whatever its colour. The input is moved by the delay, in
    samples, so that the gain is smooth over a group. The excited band is in cycles per sample.

    Each of the other inputs, with its delay in samples, has a gain of its own in each group: what
    their models lack would otherwise count as noise.

    If the input consists of a few lines, neighbouring bins have no gain in common, and steeply
    coloured noise would look like one. Then the power at the lines is compared with that next to
    them.
    """
    lines = _misfit_at_lines(u, residual, band)
    if lines is not None:
        return lines
    stimulus = transform_of(u)
    bins = min(1 << int(band[1] * u.size + 1).bit_length(), stimulus.size)
    spectra, delays = _transform(residual, bins)[None], np.array([delay])
    known = [(transform_of(other)[:bins], late - delay) for other, late in others]
    found = misfits(
        stimulus[:bins], spectra, samples=u.size, delays=delays, band=band, others=known
    )
    followed, inside, probability = (float(values[0]) for values in found)
    total = 0.5 * u.size * float(residual @ residual)  # of the bins above 0
    return Misfit(
        share=min(followed / total, 1.0) if total else 0.0,
        within=followed / inside if inside else 0.0,
        probability=probability,
    )


def _misfit_at_lines(u: Real, residual: Real, band: tuple[float, float]) -> Misfit | None:
    """Test whether a residual is stronger at the lines of an input than next to them.

    An F test on the windowed spectrum, of which every other bin is independent, and the share of
    the power that exceeds the noise. None if the input has no lines with room between them.
    """
    power = windowed_power(u)
    first = max(int(band[0] * u.size) - _NEAR, 1)
    inside = slice(first, min(int(band[1] * u.size) + _NEAR, power.size))
    moved = power[inside] > DEEPEST * power.max()
    count = int(np.count_nonzero(moved))
    window = np.ones(2 * _NEAR + 1)
    if not 0 < count < PART * moved.size or moved.size < window.size:
        return None
    whole = windowed_power(residual)
    power = whole[inside]
    others = np.convolve(np.where(moved, 0.0, power), window, mode="same")
    room = np.convolve(~moved, window, mode="same")
    if not np.all((others[moved] > 0.0) & (room[moved] >= _NEAR // 2)):
        return None
    noise = others[moved] / room[moved]
    ratio = float(np.mean(power[moved] / noise))
    above = float(np.sum(power[moved] - noise))
    return Misfit(
        share=max(above, 0.0) / float(whole.sum()),
        within=max(above, 0.0) / float(power.sum()),
        probability=float(scipy.special.fdtrc(count, float(room[moved].min()), ratio)),
    )


@partial(kept, long=True)
def _transform(residual: Real, bins: int) -> Complex:
    """First bins of a residual's transform."""
    return np.array(scipy.fft.rfft(residual)[:bins], dtype=np.complex128)


def misfits(
    stimulus: Complex,
    residuals: Complex,
    *,
    samples: int,
    delays: Real,
    band: tuple[float, float],
    others: Sequence[tuple[Complex, float]] = (),
) -> tuple[Real, Real, Real]:
    """Test many residuals of one input as `misfit` does one.

    Returned are the power that follows the input, that within the band, and the probability, (k,).

    `stimulus`, (m,), is the transform of the input less its mean, `residuals`, (k, m), those of the
    residuals, and `delays`, (k,), are in samples. `others` holds transforms of other inputs, (m,),
    each with the samples by which its response is later.
    """
    power, taken, total, width = _followed(
        stimulus, residuals, samples=samples, delays=delays, band=band, others=others
    )
    if not power.size:
        return np.zeros(delays.size), np.zeros(delays.size), np.ones(delays.size)
    noise = (total - taken) / (width - 1)
    noisy = np.all(noise > 0, axis=1)
    noise = np.where(noisy[:, None], noise, 1.0)
    # Fisher's sum over groups: each ratio is F(2, 2 width - 2), with a tail in closed form.
    tail = (1.0 + taken / noise / (width - 1)) ** (-(width - 1.0))
    statistic = -2.0 * np.sum(np.log(np.maximum(tail, 1e-300)), axis=1)
    beyond = np.sum(taken - noise, axis=1)
    return (
        np.where(noisy, np.maximum(beyond, 0.0), 0.0),
        np.sum(total, axis=1),
        np.where(noisy, scipy.special.chdtrc(2 * power.size, statistic), 1.0),
    )


def _followed(
    stimulus: Complex,
    answers: Complex,
    *,
    samples: int,
    delays: Real,
    band: tuple[float, float],
    others: Sequence[tuple[Complex, float]] = (),
) -> tuple[Real, Real, Real, int]:
    """Explain each answer by one gain from the input in each group of neighbouring bins.

    Returned are the power of the input in each group, (g,), the explained and the total power of
    each answer, both (k, g), and the number of independent bins in a group, all without what one
    gain from each of the `others` explains. A band with too few bins has no groups.
    """
    count, n = answers.shape[0], samples
    first = max(int(np.ceil(band[0] * n)), 1)
    last = min(int(band[1] * n), stimulus.size - 1)
    width = max((last + 1 - first) // _GROUPS, 4 + len(others))
    groups = max(last + 1 - first, 0) // width
    bins = np.arange(first, first + groups * width)
    U = stimulus[bins].reshape(groups, width)
    E = (answers[:, bins] * np.exp((2j * np.pi / n) * np.outer(delays, bins))).reshape(
        count, groups, width
    )
    if others and groups:
        known = np.stack([x[bins] * np.exp(-2j * np.pi / n * late * bins) for x, late in others])
        basis = np.linalg.qr(known.reshape(-1, groups, width).transpose(1, 2, 0))[0]
        U = U - np.einsum("gwm,gvm,gv->gw", basis, basis.conj(), U, optimize=True)
        E = E - np.einsum("gwm,gvm,kgv->kgw", basis, basis.conj(), E, optimize=True)
        width -= len(others)
    power = np.sum(np.abs(U) ** 2, axis=1)
    along = np.sum(U.conj() * E, axis=2) / np.sqrt(np.where(power > 0, power, 1.0))
    taken = along.real**2 + along.imag**2  # of any unit
    return power, taken, np.sum(E.real**2 + E.imag**2, axis=2), width


def unexplained_response(
    u: Real, y: Real, residual: Real, *, delay: float, band: tuple[float, float]
) -> float:
    """Share of the response (r.m.s. over frequency) that is still in the residual, from 0 to 1.

    A sweep within limits moves most at its low end, so a model may miss two thirds of the response
    at the high end and still explain 99 % of the output's power. Here every group of bins has the
    same weight. Twice the share that noise alone would explain is subtracted. Delay and band are
    as for `misfit`.
    """
    answers, delays = np.asarray(scipy.fft.rfft(np.stack([y, residual]))), np.full(2, delay)
    power, taken, total, width = _followed(
        transform_of(u), answers, samples=u.size, delays=delays, band=band
    )
    excited = power > 0.0
    noise = np.maximum(total - taken, 0.0) / (width - 1)
    missed = np.maximum(taken - 2.0 * noise, 0.0)[1, excited] / power[excited]
    gains = np.sum(taken[0, excited] / power[excited])
    return float(np.sqrt(np.sum(missed) / gains)) if gains > 0.0 else 0.0
