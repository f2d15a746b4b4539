"""The picket fence (section IV.D.3, Fig. 23): what the bins of a record show of a response."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.curves import BodeCurve
from hmpim.plots.style import COLOURS, Colour, draw_legend, finish_axes, new_figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["picket_fence"]

_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit")
_MARKS = ("o", "s", "^", "v")


def picket_fence(
    records: Sequence[tuple[str, NDArray[np.float64], NDArray[np.complex128], BodeCurve | None]],
    *,
    band: tuple[float, float],
) -> "Figure":
    """Draw ratios of spectra at the bins of each record, and the local estimates between them.

    Parameters
    ----------
    records : sequence of (label, frequency, ratio, curve)
        Bins in Hz and the ratio of the spectra there, each shape (m,); the estimate that goes
        on between the bins, or None.
    band : tuple of float
        Close-up, Hz.

    Examples
    --------
    >>> f = np.arange(30.0, 60.0, 0.1)
    >>> figure = picket_fence([("slow", f, np.exp(-0.02j * f), None)], band=(40.0, 50.0))
    >>> len(figure.axes)
    2
    """
    figure, (magnitude, phase) = new_figure(2, height=2.5)
    highs: list[float] = []
    lows: list[float] = []
    for i, (label, frequency, ratio, curve) in enumerate(records):
        colour = COLOURS[_COLOURS[i % len(_COLOURS)]]
        inside = (frequency >= band[0]) & (frequency <= band[1])
        f, z = frequency[inside], ratio[inside]
        turned = np.unwrap(np.angle(z))
        seen = None
        if curve is not None:
            seen = (curve.frequency >= band[0]) & (curve.frequency <= band[1])
            smooth = np.radians(np.interp(f, curve.frequency, curve.phase))
            turned = smooth + np.angle(z * np.exp(-1j * smooth))
        level = 20.0 * np.log10(np.maximum(np.abs(z), 1e-12))
        for axes, values in ((magnitude, level), (phase, np.degrees(turned))):
            axes.plot(
                f,
                values,
                _MARKS[i % len(_MARKS)],
                color=colour,
                markersize=2.4,
                alpha=0.55,
                linestyle="-",
                linewidth=0.5,
                label=f"{plain(label)}, bins of the record" if axes is magnitude else None,
            )
        if curve is not None and seen is not None:
            for axes, values in ((magnitude, curve.magnitude_db), (phase, curve.phase)):
                axes.plot(
                    curve.frequency[seen],
                    values[seen],
                    color=colour,
                    linewidth=1.8,
                    label=f"{plain(label)}, estimated between them" if axes is magnitude else None,
                )
            lows.append(float(np.quantile(level, 0.01)))
            highs.append(float(np.quantile(level, 0.99)))
    magnitude.set_xlim(*band)
    if lows:
        magnitude.set_ylim(min(lows) - 2.0, max(highs) + 2.0)
    finish_axes(magnitude, y="Magnitude (dB)")
    finish_axes(phase, x="Frequency (Hz)", y="Phase (deg)")
    draw_legend(magnitude, columns=2)
    figure.align_ylabels([magnitude, phase])
    return figure
