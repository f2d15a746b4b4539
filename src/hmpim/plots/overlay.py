"""Several measured responses, or stimuli's levels, over each other."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.curves import BodeCurve
from hmpim.plots.description import Axis, Curve, Dashes, Figure, Item, Panel, Rule
from hmpim.plots.style import Colour

__all__ = ["overlaid_bode", "overlaid_levels"]

_COLOURS: tuple[Colour, ...] = ("input", "output", "other", "limit", "model", "muted")
_DASHES: tuple[Dashes, ...] = ("-", "--", "-.")


def overlaid_bode(
    curves: Sequence[tuple[str, BodeCurve]],
    *,
    bandwidths: Sequence[tuple[float, float] | None] = (),
    phase_level: float | None = -90.0,
    pairs: bool = True,
) -> Figure:
    """Describe magnitude and phase of several curves over each other (Figs 19 to 22).

    Parameters
    ----------
    curves : sequence of (label, BodeCurve)
        Drawn in this order, told apart by colour and then by dashes; their bands are left out.
    bandwidths : sequence of (float, float) or None
        -90° frequency of each curve and its standard deviation, in Hz: a thin line in the
        phase's panel, its 95 % interval shaded.
    phase_level : float, optional
        Phase in degrees at which a thin line is drawn.
    pairs : bool
        True draws every second curve thin over a wide one: of two that are the same both show.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> curve = BodeCurve(frequency=f, magnitude_db=0.0 * f, phase=-54.0 * f)
    >>> figure = overlaid_bode([("first", curve), ("second", curve)])
    >>> len(figure.panels[0].items)
    2
    """
    phase_items: list[Item] = []
    magnitude_items: list[Item] = []
    for i, (label, curve) in enumerate(curves):
        look = Curve(
            x=curve.frequency,
            y=curve.magnitude_db,
            label=label,
            colour=_COLOURS[i % len(_COLOURS)],
            dashes=_DASHES[(i + i // len(_COLOURS)) % len(_DASHES)],
            width=_width(i) if pairs else 1.2,
        )
        magnitude_items.append(look)
        phase_items.append(replace(look, y=curve.phase))
    for i, bandwidth in enumerate(bandwidths):
        if bandwidth is not None:
            value, reach = bandwidth[0], 1.96 * bandwidth[1]
            mark = Rule(
                at=value,
                low=value - reach,
                high=value + reach,
                colour=_COLOURS[i % len(_COLOURS)],
                dashes=":",
            )
            phase_items.append(mark)
    if phase_level is not None:
        phase_items.append(Rule(at=phase_level, axis="y", colour="muted", dashes=":", width=0.8))
    x = Axis(scale="log", numbered=False)
    magnitude = Axis(label="Magnitude (dB)")
    phase = Axis(label="Phase (deg)", degrees=True)
    filled = [curve for _, curve in curves if curve.frequency.size > 1]
    if filled:
        x = replace(
            x,
            low=min(float(c.frequency[0]) for c in filled),
            high=max(float(c.frequency[-1]) for c in filled),
        )
        # What noise makes of the far end must not set the heights.
        bottom = min(float(np.nanquantile(c.phase, 0.02)) for c in filled)
        phase = replace(phase, low=max(bottom, -400.0) - 15.0, high=20.0)
        bottom = min(float(np.nanquantile(c.magnitude_db, 0.02)) for c in filled)
        top = max(float(np.nanmax(c.magnitude_db)) for c in filled)
        magnitude = replace(magnitude, low=max(bottom, -50.0) - 2.0, high=min(top, 20.0) + 2.0)
    lower = replace(x, label="Frequency (Hz)", numbered=True)
    return Figure(
        panels=(
            Panel(x=x, y=magnitude, items=tuple(magnitude_items)),
            Panel(x=lower, y=phase, items=tuple(phase_items), row=1, legend=False),
        ),
        alt="Bode plots over each other: " + ", ".join(label for label, _ in curves) + ".",
        heights=(2.5, 2.5),
    )


def _width(place: int) -> float:
    return 1.0 if place % 2 else 2.6


def overlaid_levels(
    levels: Sequence[tuple[str, NDArray[np.float64], NDArray[np.float64]]],
    *,
    unit: str = "",
    level: float | None = None,
) -> Figure:
    """Describe the spectra of several stimuli over each other (Fig. 18).

    Parameters
    ----------
    levels : sequence of (label, frequency, level)
        Frequency in Hz and level in dB, each shape (m,).
    unit : str
        What 0 dB stands for one of.
    level : float, optional
        A level to mark with a thin line.

    Examples
    --------
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> len(overlaid_levels([("azimuth", f, 30.0 + 0.0 * f)]).panels[0].items)
    1
    """
    items: list[Item] = [
        Curve(
            x=frequency,
            y=values,
            colour=_COLOURS[i % len(_COLOURS)],
            dashes=_DASHES[(i + i // len(_COLOURS)) % len(_DASHES)],
            label=label,
            width=_width(i),
        )
        for i, (label, frequency, values) in enumerate(levels)
    ]
    if level is not None:
        items.append(Rule(at=level, axis="y", colour="muted", dashes=":", width=0.8))
    reference = f"dB re 1 {unit}" if unit else "dB"
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Frequency (Hz)", scale="log"),
                y=Axis(label=f"Level ({reference})"),
                items=tuple(items),
            ),
        ),
        alt="Spectra over each other: " + ", ".join(label for label, _, _ in levels) + ".",
        heights=(2.8,),
    )
