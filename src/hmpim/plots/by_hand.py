"""Values that an engineer reads by eye, drawn beside those that were found."""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from hmpim.plots.curves import measured_curve, model_curve
from hmpim.plots.description import Curve, Figure, Item, Panel, Rule

if TYPE_CHECKING:
    from hmpim.identify import PairIdentification

__all__ = ["with_hand_values"]

_PANELS = {
    "bandwidth_phase90": (1, "−90°"),
    "bandwidth_phase90_without_delay": (1, "−90° without delay"),
    "bandwidth_3db": (0, "−3 dB"),
    "natural_frequency": (0, "natural frequency"),
}


def with_hand_values(
    figure: Figure, pair: "PairIdentification", hand: Mapping[str, float]
) -> Figure:
    """Add values set by hand to a pair's Bode plot, marked as such.

    A frequency becomes an upright line. A delay takes its part of the phase (equation 25) off the
    measured phase, which is drawn beside the measured one.

    Parameters
    ----------
    figure : Figure
        From `hmpim.plots.pair_bode`: magnitude above phase.
    pair : PairIdentification
        What was found.
    hand : mapping of str to float
        Values by parameter, in the parameter's unit: frequencies in Hz, the delay in s.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.identify import FrequencyResponse, PairIdentification
    >>> from hmpim.identify import PaperEstimates, Parameters
    >>> from hmpim.plots import pair_bode
    >>> f = np.geomspace(0.1, 10.0, 50)
    >>> late = FrequencyResponse(frequency=f, response=np.exp(-0.2j * np.pi * f), std=0.1 + 0 * f)
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=0.0,
    ...     parameters=Parameters(), paper=PaperEstimates(), frequency_response=late,
    ...     numerator=(), denominator=(), candidates=(), verdict="doubtful", warnings=())
    >>> phase = with_hand_values(pair_bode(pair), pair, {"delay": 0.1}).panels[1]
    >>> phase.items[-1].label, float(np.abs(phase.items[-1].y).max()) < 1e-9
    ('measured without 0.1 s by hand', True)
    """
    added: dict[int, list[Item]] = {0: [], 1: []}
    for name, value in hand.items():
        if name in _PANELS:
            place, words = _PANELS[name]
            said = f"{words} at {value:.4g} Hz by hand"
            added[place].append(Rule(at=value, words=said, colour="limit", words_at=0.5))
    response = pair.frequency_response
    positive = response.frequency[response.frequency > 0]
    if "delay" in hand and positive.size:
        curve = measured_curve(response, near=model_curve(pair, positive))
        label = f"measured without {hand['delay']:.4g} s by hand"
        phase = curve.phase + 360.0 * curve.frequency * hand["delay"]
        added[1].append(Curve(x=curve.frequency, y=phase, label=label, colour="limit"))
    panels = tuple(_more(panel, added.get(k, [])) for k, panel in enumerate(figure.panels))
    return replace(figure, panels=panels)


def _more(panel: Panel, items: list[Item]) -> Panel:
    return replace(panel, items=(*panel.items, *items)) if items else panel
