"""The same stimulus, smaller or larger."""

from dataclasses import replace

from hmpim.errors import ArgumentError
from hmpim.stimulus.motion import Scalable
from hmpim.stimulus.stimulus import Stimulus

__all__ = ["scaled_stimulus"]


def scaled_stimulus(stimulus: Stimulus, factor: float) -> Stimulus:
    """Return the same stimulus, `factor` times as large; its limits stay.

    Parameters
    ----------
    stimulus : Stimulus
        Any.
    factor : float
        At most as large as its limits allow.

    Raises
    ------
    ArgumentError
        If its waveform has no scale to change.
    LimitsError
        If it would leave its limits.

    Examples
    --------
    >>> from hmpim.stimulus.classical import Sine
    >>> sine = Stimulus(waveform=Sine(frequency=1.0, duration=3.0, amplitude=2.0), fs=10.0)
    >>> round(scaled_stimulus(sine, 0.1).peaks.position, 6)
    0.2
    """
    if not isinstance(stimulus.waveform, Scalable):
        raise ArgumentError(f"a {type(stimulus.waveform).__name__} has no scale to change")
    return replace(stimulus, waveform=stimulus.waveform.scaled(factor))
