"""Groups of parameters that a finding concerns together."""

from dataclasses import fields

from hmpim.identify.result.measured import ResponseBandwidths
from hmpim.identify.result.parameters import Parameters

__all__ = [
    "AT_DC",
    "BANDWIDTHS",
    "EVERY",
    "FIXED_UNITS",
    "GAIN",
    "MODELLED",
    "PHASE_SPLIT",
    "SIZES",
    "TIMING",
    "in_words",
]

EVERY = tuple(f.name for f in fields(Parameters))
"""Every parameter."""

_SEEN = (
    "delay_correlation",
    "hold_period",
    "saturation_low",
    "saturation_high",
    "quantization_step",
)
"""Parameters that are read off the record itself, whatever the model."""

MODELLED = tuple(name for name in EVERY if name not in _SEEN)
"""Parameters that are read off the fitted model, or off its residual."""

PHASE_SPLIT = (
    "delay",
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    "bandwidth_phase90_without_delay",
)
"""Parameters that depend on how the phase is divided between a delay and poles.

The response within the band does not depend on that, nor do gain, bandwidths that include the
delay, and the slope of the phase at DC.
"""

AT_DC = (
    "scale_factor",
    "time_constant",
    "delay_low_frequency",
    "bandwidth_3db",
    "peak_gain_db",
)
"""Parameters at DC or relative to the gain at DC, and the time constant."""

BANDWIDTHS = tuple(f.name for f in fields(ResponseBandwidths))
"""Every bandwidth."""

SIZES = ("scale_factor", "natural_frequency", "damping_ratio", "time_constant", *BANDWIDTHS)
"""Parameters whose error is stated as a share of their value."""

TIMING = ("delay", "delay_correlation", "delay_low_frequency", "bandwidth_phase90")
"""Parameters that change when the clock of one channel shifts against that of the other."""

GAIN = (
    "scale_factor",
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    "bandwidth_3db",
    "peak_gain_db",
)
"""Parameters that depend on the size of the response."""

FIXED_UNITS = {
    "delay": "s",
    "delay_correlation": "s",
    "delay_low_frequency": "s",
    "natural_frequency": "Hz",
    "time_constant": "s",
    "bandwidth_phase90": "Hz",
    "bandwidth_phase90_without_delay": "Hz",
    "bandwidth_3db": "Hz",
    "peak_gain_db": "dB",
    "hold_period": "s",
}
"""Units that do not depend on the channels."""

_IN_WORDS = {
    "delay_correlation": "delay by correlation",
    "delay_low_frequency": "low-frequency delay",
    "noise_std": "noise",
    "bandwidth_phase90": "−90° bandwidth",
    "bandwidth_phase90_without_delay": "−90° bandwidth without delay",
    "bandwidth_3db": "−3 dB bandwidth",
    "peak_gain_db": "peak gain",
    "saturation_low": "low saturation",
    "saturation_high": "high saturation",
    "quantization_step": "quantisation step",
}


def in_words(name: str) -> str:
    """Return a parameter's name within a sentence.

    Examples
    --------
    >>> in_words("bandwidth_3db"), in_words("damping_ratio")
    ('−3 dB bandwidth', 'damping ratio')
    """
    return _IN_WORDS.get(name, name.replace("_", " "))
