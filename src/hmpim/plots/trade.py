"""The trade of section III: how gentle a stimulus can be, against the accuracy it buys."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from hmpim.plots.description import Axis, Curve, Figure, Item, Panel, Points, Span, Words
from hmpim.units import rate_label

if TYPE_CHECKING:
    from hmpim.optimal import Gentle, Gentlest, TradePoint

__all__ = ["gentle_label", "trade_plot"]

_WORDS: "dict[Gentle, str]" = {
    "peak_acceleration": "Peak acceleration",
    "rms_acceleration": "R.m.s. acceleration",
    "travel": "Distance moved",
    "duration": "Duration",
}


def gentle_label(gentle: "Gentle", unit: str) -> str:
    """Name of what is kept small, with its unit.

    Examples
    --------
    >>> gentle_label("travel", "deg"), gentle_label("peak_acceleration", "deg")
    ('Distance moved (deg)', 'Peak acceleration (deg/s²)')
    """
    orders = {"peak_acceleration": 2, "rms_acceleration": 2, "travel": 0}
    of = "s" if gentle == "duration" else rate_label(unit, orders[gentle])
    return f"{_WORDS[gentle]} ({of or '–'})"


def trade_plot(found: "Gentlest", points: "Sequence[TradePoint]") -> Figure:
    """Describe what each accuracy costs, what was wanted, and what the other families cost.

    Parameters
    ----------
    found : Gentlest
        The result.
    points : sequence of TradePoint
        From `hmpim.optimal.trade`.

    Examples
    --------
    >>> from hmpim.optimal import Accuracy, RoughModel, gentlest, trade
    >>> from hmpim.stimulus import Limits
    >>> found = gentlest(accuracy=Accuracy(), noise_std=0.1, fs=100.0, duration=3.0,
    ...     model=RoughModel(natural_frequency=5, damping_ratio=0.5),
    ...     limits=Limits(position=10, unit="deg"), families=("multisine",))
    >>> trade_plot(found, trade(found, factors=(1.0,))).panels[0].y.label
    'Peak acceleration (deg/s²)'
    """
    met = sorted((p.factor, p.value) for p in points if p.value is not None)
    factor = np.array([f for f, _ in met])
    value = np.array([v for _, v in met])
    missed = [p.factor for p in points if p.value is None]
    all_factors = [p.factor for p in points] + [1.0]
    left, right = min(all_factors) / 1.15, max(all_factors) * 1.15
    items: list[Item] = []
    if missed:
        beyond = Span(
            low=left, high=max(missed), colour="limit", opacity=0.10, label="beyond the limits"
        )
        items.append(beyond)
    items.append(Curve(x=factor, y=value, label=found.family, marker="o"))
    for candidate in found.candidates[1:]:
        if candidate.use <= 1.0:
            there = np.array([1.0]), np.array([candidate.value])
            items.append(Points(x=there[0], y=there[1], colour="muted", marker="s", size=5.0))
            items.append(Words(x=1.0, y=candidate.value, text=candidate.family))
    wanted = np.array([1.0]), np.array([found.value])
    items.append(Points(x=wanted[0], y=wanted[1], colour="output", size=7.0, label="wanted"))
    return Figure(
        panels=(
            Panel(
                x=Axis(
                    label="Errors allowed, relative to those wanted",
                    scale="log",
                    low=left,
                    high=right,
                ),
                y=Axis(label=gentle_label(found.wish.gentle, found.wish.limits.unit), scale="log"),
                items=tuple(items),
                title="Gentleness against accuracy",
            ),
        ),
        alt=f"{gentle_label(found.wish.gentle, found.wish.limits.unit)} over the errors allowed; "
        f"{found.value:.4g} for those wanted, by a {found.family}.",
        heights=(3.2,),
    )
