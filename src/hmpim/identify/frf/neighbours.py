"""Windows of neighbouring bins of a record's transform, for every local method.

The bins are those of the unwindowed transform, including negative frequencies: these are the
conjugates, so a window may reach through DC. The bin at DC itself holds the bias and never counts.
For circular noise, whose square has mean zero, the mirrored bins add no correlation to E|error|²,
so least squares and its variances stay valid.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.identify.arrays import Complex, Real
from hmpim.identify.kept import kept
from hmpim.identify.signals import whole_lag

__all__ = [
    "NOTHING",
    "RIDGE",
    "WIDEST",
    "Integer",
    "LocalFit",
    "Spectra",
    "Windows",
    "centres_in_band",
    "mirrored",
    "transform",
    "windows_around",
]

# Samples from which the FFT is slow at an awkward length.
_LONG = 100_000

WIDEST = 1000
"""Most bins on either side in a window of polynomials."""

RIDGE = 1e-13
"""Share of each diagonal element that is added to normal equations."""

NOTHING = 1e-24
"""Power of U, over its maximum, that counts as zero."""

Integer = NDArray[np.int64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Spectra:
    """Transforms of a record with its delay removed."""

    frequency: Real  # (b,): Hz, from 0 to below fs/2
    # (b,): input and output; 0 at DC. Of many outputs `y` has shape (..., b).
    u: Complex
    y: Complex


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Windows:
    """Windows of one width, and the window of each centre."""

    start: Integer  # (w,): first bin of each window, negative below DC
    x: Real  # (s,): place of a window's bins, -1 to 1
    counted: Integer  # (w,): number of bins, without DC
    near: Integer  # (c,): window of each centre
    place: Integer  # (c,): place of each centre in its window

    @property
    def size(self) -> int:
        """Bins of a window."""
        return self.x.size

    def powers(self, order: int) -> Real:
        """Return x^p, p = 0 … `order`, shape (s, order + 1)."""
        return np.asarray(self.x[:, None] ** np.arange(order + 1))

    def views(self, values: Complex, reach: int) -> Complex:
        """Return the windows of the rows of `mirrored`, (r, b), shape (w, r, s)."""
        out = np.empty((self.start.size, values.shape[0], self.size), dtype=values.dtype)
        for own, first in zip(out, (self.start + reach).tolist(), strict=True):
            own[...] = values[:, first : first + self.size]
        return out

    def slots(self) -> tuple[Integer, Integer]:
        """Return the centres of each window, (w, k), and the index of each centre in these, (c,).

        Windows with fewer centres than others repeat their last.
        """
        first = np.searchsorted(self.near, np.arange(self.start.size + 1))
        most = int(np.diff(first).max())
        slot = np.minimum(first[:-1, None] + np.arange(most), first[1:, None] - 1)
        at = np.arange(self.near.size) - first[self.near]
        return slot, self.near * most + at


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocalFit:
    """Results of one local method at one width at every centre; all of shape (c,).

    For many outputs at once they have shape (..., c), or one that is broadcast to it.
    """

    response: Complex  # G; with m inputs at once (c, m), as are `spread` and `power`
    spread: Real  # variance of G if the noise of a bin of Y is 1
    noise: Real  # variance of a bin of Y, from the residual over the window
    power: Real  # mean |U|² in the window
    prediction_error: Real  # square of the error at a bin of the fit without it

    def of(self, records: NDArray[Any]) -> "LocalFit":
        """Return the results of some of many records."""
        each = {f.name: getattr(self, f.name) for f in fields(self)}
        return LocalFit(**{n: v[records] if v.ndim > 1 else v for n, v in each.items()})


def mirrored(values: Complex, reach: int) -> Complex:
    """Return spectra, (..., b), with `reach` negative frequencies before them.

    Examples
    --------
    >>> mirrored(np.array([0, 1 + 2j, 3 + 4j]), 1).tolist()
    [(1-2j), 0j, (1+2j), (3+4j)]
    """
    return np.concatenate((np.conj(values[..., reach:0:-1]), values), axis=-1)


def transform(u: Real, y: Real, fs: float, delay: float | Real, highest: float = np.inf) -> Spectra:
    """Transform a record with its delay removed, or many outputs of one input at once.

    The whole samples of the delay are removed by comparing y(n + k) with u(n), so that the record
    holds every response to the stimulus; the rest is removed by its phase, and all of it if the
    input moves only in those samples. The last samples of a long record, at most one in forty, are
    omitted for a length that suits the FFT.

    The output has shape (n,) or (k, n), its delays in s () or (k,), all in the same sample. Bins
    beyond the windows of a response up to `highest`, Hz, are omitted.

    Examples
    --------
    >>> u = np.sin(np.arange(64.0) ** 2 / 50)
    >>> s = transform(u, np.concatenate((np.zeros(4), u[:-4])), 1.0, 4.0)
    >>> bool(np.allclose(s.u, s.y))
    True
    """
    late = np.atleast_1d(delay)
    lag = whole_lag(float(late[0]), fs, u.size)
    if np.ptp(u[max(-lag, 0) :][: u.size - abs(lag)]) == 0.0:
        lag = 0
    length = u.size - abs(lag)
    if length > _LONG:
        length = int(scipy.fft.prev_fast_len(length, real=True))
    count = (length - 1) // 2 + 1  # without the bin at fs/2, which is real
    if highest < fs / 2:
        last = int(highest * length / fs) + 1
        count = min(count, last + max(last // 2, WIDEST) + 1)
    frequency = np.asarray(np.arange(count) * (fs / length), dtype=np.float64)
    spectrum_u = _transform(u[max(-lag, 0) :][:length], count)
    spectrum_y = scipy.fft.rfft(y[..., max(lag, 0) :][..., :length])[..., :count]
    turn = np.exp(2j * np.pi * frequency * (late[:, None] - lag / fs))
    spectrum_y = spectrum_y * turn.reshape(*y.shape[:-1], count)
    spectrum_y[..., 0] = 0.0
    return Spectra(frequency=frequency, u=spectrum_u, y=spectrum_y)


@kept
def _transform(u: Real, count: int) -> Complex:
    """First bins of an input's transform, 0 at DC."""
    spectrum = np.array(scipy.fft.rfft(u)[:count], dtype=np.complex128)
    spectrum[0] = 0.0
    return spectrum


def centres_in_band(low: int, high: int, points: int) -> Integer:
    """Return the bins of a response: all from `low` to `high`, or spaced by a constant ratio.

    Examples
    --------
    >>> centres_in_band(1, 1000, 4).tolist()
    [1, 10, 100, 1000]
    """
    if high - low + 1 <= points:
        return np.arange(low, high + 1)
    return np.unique(np.rint(np.geomspace(low, high, points)).astype(np.int64))


def windows_around(centre: Integer, bins: int, width: int) -> Windows:
    """Return windows of 2 `width` + 1 bins, one for every third of a width that has centres.

    A polynomial or rational function is as good a little off the middle of its window, so one fit
    serves all centres within a sixth of the width. At the upper end of the spectrum windows stay
    inside. The centres, (c,), increase and are above 0; the bins of the spectra include DC; the
    width is the number of neighbours on either side.

    Examples
    --------
    >>> w = windows_around(np.arange(1, 9), 100, 6)
    >>> w.start.tolist(), w.near.tolist()
    ([-5, -3, -1, 1], [0, 0, 1, 1, 2, 2, 3, 3])
    """
    stride = max(width // 3, 1)
    groups = (centre - centre[0]) // stride
    first = np.concatenate(([True], groups[1:] != groups[:-1]))
    group, near = groups[first], np.cumsum(first) - 1
    middle = np.minimum(centre[0] + group * stride + (stride - 1) // 2, centre[-1])
    size = min(2 * width + 1, 2 * bins - 1)
    start = np.maximum(np.minimum(middle - width, bins - size), 1 - bins)
    crosses = (start <= 0) & (start + size > 0)
    return Windows(
        start=start,
        x=np.arange(1 - size, size, 2) / (size - 1.0),
        counted=size - crosses.astype(np.int64),
        near=near,
        place=centre - start[near],
    )
