"""The picket fence (section IV.D.3, Fig. 23): what the bins of a record show of a response."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.curves import BodeCurve
from hmpim.plots.description import Axis, Curve, Dashes, Figure, Item, Marker, Panel
from hmpim.plots.style import Colour, plain

__all__ = ["picket_fence"]

_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit")
_MARKS: tuple[Marker, ...] = ("o", "s", "^", "v")
_DASHES: tuple[Dashes, ...] = ("-", "--", "-.", ":")


def picket_fence(
    records: Sequence[tuple[str, NDArray[np.float64], NDArray[np.complex128], BodeCurve | None]],
    *,
    band: tuple[float, float],
) -> Figure:
    """Describe ratios of spectra at the bins of each record, and the local estimates between them.

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
    >>> len(figure.panels)
    2
    """
    magnitude: list[Item] = []
    phase: list[Item] = []
    lows: list[float] = []
    highs: list[float] = []
    for i, (label, frequency, ratio, curve) in enumerate(records):
        inside = (frequency >= band[0]) & (frequency <= band[1])
        f, z = frequency[inside], ratio[inside]
        turned = np.unwrap(np.angle(z))
        if curve is not None:
            smooth = np.radians(np.interp(f, curve.frequency, curve.phase))
            turned = smooth + np.angle(z * np.exp(-1j * smooth))
        level = 20.0 * np.log10(np.maximum(np.abs(z), 1e-12))
        bins = Curve(
            x=f,
            y=level,
            label=f"{plain(label)}, bins of the record",
            colour=_COLOURS[i % len(_COLOURS)],
            width=0.5,
            marker=_MARKS[i % len(_MARKS)],
            size=2.4,
            opacity=0.6,
        )
        magnitude.append(bins)
        phase.append(replace(bins, y=np.degrees(turned), label=""))
        if curve is not None:
            seen = (curve.frequency >= band[0]) & (curve.frequency <= band[1])
            smoothed = Curve(
                x=curve.frequency[seen],
                y=curve.magnitude_db[seen],
                label=f"{plain(label)}, estimated between them",
                colour=bins.colour,
                dashes=_DASHES[i % len(_DASHES)],
                width=1.8,
            )
            magnitude.append(smoothed)
            phase.append(replace(smoothed, y=curve.phase[seen], label=""))
            lows.append(float(np.quantile(level, 0.01)))
            highs.append(float(np.quantile(level, 0.99)))
    x = Axis(low=band[0], high=band[1], numbered=False)
    y = Axis(
        label="Magnitude (dB)",
        low=min(lows) - 2.0 if lows else None,
        high=max(highs) + 2.0 if lows else None,
    )
    below = replace(x, label="Frequency (Hz)", numbered=True)
    return Figure(
        panels=(
            Panel(x=x, y=y, items=tuple(magnitude)),
            Panel(x=below, y=Axis(label="Phase (deg)"), items=tuple(phase), row=1),
        ),
        alt=f"Close-up of a response from {band[0]:.4g} to {band[1]:.4g} Hz, bin by bin: "
        + ", ".join(plain(label) for label, *_ in records)
        + ".",
        heights=(2.5, 2.5),
    )
