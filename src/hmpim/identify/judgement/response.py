"""Bandwidths that the measured response and the model put apart."""

import numpy as np

from hmpim.identify.chance import DEVIATIONS
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.result.groups import PHASE_SPLIT
from hmpim.identify.worth import TOLERATED
from hmpim.record import Finding

__all__ = ["bandwidth_disagrees"]

_GAIN_SHAPE = ("natural_frequency", "damping_ratio", "time_constant", "peak_gain_db")
"""What shapes the gain about -3 dB."""


def bandwidth_disagrees(evidence: Evidence) -> tuple[Finding, ...]:
    """Doubt bandwidths apart beyond their error bars, and what of the model shapes them.

    Of an output that is held the measured response shows the hold too: there it says nothing.
    """
    if evidence.held:
        return ()
    touched: list[str] = []
    message = ""
    for name, words, shaped_by in (
        ("bandwidth_phase90", "-90° bandwidth", PHASE_SPLIT),
        ("bandwidth_phase90_without_delay", "-90° bandwidth without delay", PHASE_SPLIT),
        ("bandwidth_3db", "-3 dB bandwidth", _GAIN_SHAPE),
    ):
        one = getattr(evidence.measured, name)
        other = getattr(evidence.readings.parameters, name)
        if one is None or other is None:
            continue
        apart = abs(one.value - other.value)
        if apart <= max(
            DEVIATIONS * float(np.hypot(one.spread, other.spread)), TOLERATED * other.value
        ):
            continue
        touched += [name, *shaped_by]
        message = message or (  # one sentence is enough
            f"The {words} is {one.value:.4g} Hz by the measured response and "
            f"{other.value:.4g} Hz by the model, further apart than their errors allow. Look "
            "at the Bode plot there before using either."
        )
    if not touched:
        return ()
    parameters = tuple(dict.fromkeys(touched))
    return (
        Finding(
            code="bandwidth_disagrees", message=message, severity="doubt", parameters=parameters
        ),
    )
