"""The inputs of a simultaneous test alone: whether one record distinguishes them.

Around each frequency, every input is multiplied by a polynomial over neighbouring bins, as in
`hmpim.identify.frf.multivariable`. If these of two inputs span the same space, an output that
follows one cannot be distinguished from one that follows the other: one input is a copy of the
other, scaled, filtered, or passing that frequency at the same time and speed. The worst-determined
direction names them.
"""

from collections.abc import Sequence
from itertools import groupby

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Mask, Real
from hmpim.identify.frf.neighbours import centres_in_band, mirrored, windows_around
from hmpim.identify.noise.spectra import transform_of
from hmpim.identify.result.inputs import Alike, InputSet
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.identify.worth import DEEPEST, MATERIAL, MUCH
from hmpim.record.runs import runs_of

__all__ = ["input_set", "own_band"]

_POINTS = 240
_TERMS = 3
_SINGULAR = 1e6
"""Condition beyond which it is rounding, and taken as infinite."""


def own_band(u: Real, fs: float, stated: tuple[float, float] | None) -> tuple[float, float]:
    """Band that one of several inputs excites, in Hz.

    `u`, (n,), is the input, `fs` the rate in Hz, and `stated` the band stated for the record, in
    Hz. A stated band holds for all inputs together; this input's own part is where its power is
    above about a thousandth of its maximum (50 dB down).
    """
    low, high = excited_band(u, fs)
    if stated is None:
        return low, high
    power = np.abs(transform_of(u)) ** 2
    level = np.sqrt(np.convolve(power, np.ones(5) / 5, mode="same"))
    reached = np.flatnonzero(level >= np.sqrt(DEEPEST) * level.max())
    high = max(high, float(reached[-1]) * fs / u.size)
    return max(low, stated[0]), max(min(high, stated[1]), 2 * max(low, stated[0]))


def input_set(
    inputs: Sequence[Real],
    names: Sequence[str],
    fs: float,
    *,
    stated: tuple[float, float] | None = None,
) -> InputSet:
    """Find which inputs one record distinguishes, and where.

    The inputs, (n,), are sampled on one clock at a rate in Hz, and none is constant; each has a
    name. `stated` is the band stated for the record, in Hz.
    """
    bands = tuple(own_band(u, fs, stated) for u in inputs)
    size = inputs[0].size
    step = fs / size
    spectra = [np.array(scipy.fft.rfft(u - u.mean()))[: (size - 1) // 2 + 1] for u in inputs]
    low = max(round(min(b[0] for b in bands) / step), 1)
    high = min(round(max(b[1] for b in bands) / step), spectra[0].size - 1)
    centre = centres_in_band(low, max(high, low + 1), _POINTS)
    frequency: Real = centre.astype(np.float64) * step
    active = np.array([(frequency >= b[0]) & (frequency <= b[1]) for b in bands])
    condition = np.ones(centre.size)
    involved: list[tuple[str, ...]] = [()] * centre.size
    for _, run in groupby(range(centre.size), key=lambda k: active[:, k].tobytes()):
        some = np.array(list(run))
        which = np.flatnonzero(active[:, some[0]])
        if which.size < 2:
            continue
        condition[some], shares = _conditions([spectra[j] for j in which], centre[some])
        for k, share in zip(some, shares, strict=True):
            if condition[k] > MATERIAL**-0.5:
                involved[k] = tuple(names[j] for j in which[share > MUCH * share.max()])
    return InputSet(
        names=tuple(names),
        bands=bands,
        frequency=frequency,
        condition=condition,
        alike=_alike(involved, frequency, active, tuple(names)),
    )


def _conditions(spectra: Sequence[Complex], centre: NDArray[np.int64]) -> tuple[Real, Real]:
    """Condition at each centre, (c,), and each input's share of the worst direction, (c, m)."""
    m = len(spectra)
    reach = max(int(centre[-1] - centre[0] + 1) // 8, 4 * (m + 1))
    reach = min(reach, spectra[0].size - 1)
    windows = windows_around(centre, spectra[0].size, reach)
    block = windows.views(mirrored(np.stack(spectra), reach), reach).swapaxes(1, 2)
    powers = windows.powers(_TERMS - 1)
    design = (block[:, :, :, None] * powers[:, None, :]).reshape(*block.shape[:2], -1)
    size = np.sqrt(np.maximum(np.sum(np.abs(design) ** 2, axis=1, keepdims=True), 1e-300))
    unit = (design / size)[windows.near]
    place = windows.x[windows.place][:, None] ** np.arange(_TERMS)
    slope = np.zeros((centre.size, m, m * _TERMS))
    for j in range(m):
        slope[:, j, j * _TERMS : (j + 1) * _TERMS] = place
    slope = slope / size[windows.near]
    # Errors of the responses at the centre, of all inputs together and of each alone.
    _, values, right = np.linalg.svd(unit, full_matrices=False)
    least = np.maximum(values, 1e-12 * values[:, :1])
    mapped = slope @ np.conj(right.swapaxes(1, 2)) / least[:, None, :]
    alone = np.empty((centre.size, m))
    for j in range(m):
        own = slice(j * _TERMS, (j + 1) * _TERMS)
        gram = np.conj(unit[:, :, own].swapaxes(1, 2)) @ unit[:, :, own]
        gram = gram + 1e-12 * np.eye(_TERMS)
        rows = slope[:, j, own]
        solved = np.linalg.solve(gram, rows[:, :, None])[:, :, 0]
        alone[:, j] = np.sqrt(np.maximum(np.sum(rows * solved, axis=1).real, 1e-300))
    left, spread, _ = np.linalg.svd(mapped / alone[:, :, None], full_matrices=False)
    condition = spread[:, 0] / np.maximum(spread[:, -1], 1e-300)
    return np.where(condition > _SINGULAR, np.inf, condition), np.abs(left[:, :, 0])


def _alike(
    involved: Sequence[tuple[str, ...]], frequency: Real, active: Mask, names: tuple[str, ...]
) -> tuple[Alike, ...]:
    """Collect the frequencies at which the same inputs cannot be distinguished."""
    found = []
    for group in sorted({g for g in involved if g}, key=lambda g: -list(involved).count(g)):
        here = np.array([g == group for g in involved])
        common = np.all(active[[names.index(n) for n in group]], axis=0)
        first, stop = runs_of(here)
        spans = zip(frequency[first].tolist(), frequency[stop - 1].tolist(), strict=True)
        share = float(np.sum(here) / max(int(np.sum(common)), 1))
        found.append(Alike(names=group, bands=tuple(spans), share=share))
    return tuple(found)
