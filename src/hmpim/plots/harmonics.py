"""Harmonics of a sweep against its frequency: where a system is not linear, and how."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.description import Axis, Band, Curve, Dashes, Figure, Item, Marker, Panel
from hmpim.plots.style import Colour

if TYPE_CHECKING:
    from hmpim.identify import HarmonicCurve

__all__ = ["harmonics"]

LOOKS: dict[int, tuple[Colour, Dashes, Marker]] = {
    2: ("input", "--", "s"),
    3: ("output", "-", "o"),
    4: ("other", ":", "^"),
    5: ("limit", "-.", "v"),
}
WHOLE = 100.0  # per cent of the output
SEEN = 3.0  # standard deviations from which an amplitude is no noise


def harmonics(curves: "Sequence[HarmonicCurve]") -> Figure:
    """Describe each harmonic's amplitude as a share of the output's own, in per cent.

    What stands out of the noise by three standard deviations is drawn, and the level of three
    standard deviations itself.

    Parameters
    ----------
    curves : sequence of HarmonicCurve
        Order 1, the output's own amplitude, and at least one other.

    Examples
    --------
    >>> from hmpim.identify import HarmonicCurve
    >>> own = HarmonicCurve(order=1, frequency=(1.0, 10.0), amplitude=(1.0, 2.0), std=(0.0, 0.0))
    >>> third = HarmonicCurve(
    ...     order=3, frequency=(1.0, 10.0), amplitude=(0.1, 0.1), std=(0.01, 0.01))
    >>> line = harmonics([own, third]).panels[0].items[0]
    >>> [round(float(value), 2) for value in line.y]
    [10.0, 5.0]
    """
    own = next(curve for curve in curves if curve.order == 1)
    items: list[Item] = []
    floor: dict[float, float] = {}
    lowest, highest = np.inf, WHOLE
    for curve in curves:
        if curve.order == 1 or not curve.frequency:
            continue
        colour, dashes, marker = LOOKS[curve.order]
        frequency = np.array(curve.frequency)
        level = np.interp(frequency, *_rising(own)) / 100.0
        amplitude, noise = np.array(curve.amplitude), SEEN * np.array(curve.std)
        turn = np.argsort(frequency)
        for at, value in zip(frequency, noise / level, strict=True):
            floor[float(at)] = max(floor.get(float(at), 0.0), float(value))
        seen = amplitude > noise
        if not seen.any():
            continue
        lowest = min(lowest, float(np.min((amplitude / level)[seen])))
        highest = max(highest, float(np.max((amplitude / level)[seen])))
        items.append(
            Curve(
                x=frequency[turn],
                y=np.where(seen, amplitude / level, np.nan)[turn],
                colour=colour,
                dashes=dashes,
                marker=marker,
                size=3.5,
                label=f"order {curve.order}",
            )
        )
    along = np.array(sorted(floor))
    lowest = min([lowest, *(level for level in floor.values() if level > 0)])
    bottom = 0.5 * lowest if np.isfinite(lowest) else None
    noise = np.array([floor[at] for at in along])
    top = highest if noise.size and noise.max() > highest else None  # there is next to no output
    items.append(
        Band(
            x=along,
            low=np.full(along.size, bottom or 0.0),
            high=noise,
            label="within noise",
            colour="muted",
            opacity=0.15,
        )
    )
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Frequency of the sweep (Hz)", scale="log"),
                y=Axis(label="Share of the output (%)", scale="log", low=bottom, high=top),
                items=tuple(items),
            ),
        ),
        alt="Harmonics of the sweep as shares of the output, over the frequency of the sweep: "
        + (", ".join(item.label for item in items if isinstance(item, Curve)) or "none")
        + " stand out of the noise.",
        heights=(2.6,),
    )


def _rising(curve: "HarmonicCurve") -> "tuple[Sequence[float], Sequence[float]]":
    """Frequencies and amplitudes by rising frequency."""
    pairs = sorted(zip(curve.frequency, curve.amplitude, strict=True))
    return [f for f, _ in pairs], [a for _, a in pairs]
