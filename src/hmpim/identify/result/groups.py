"""Parameters that stand or fall together: what a finding names when it touches more than one."""

from dataclasses import fields

from hmpim.identify.result.parameters import Parameters

__all__ = ["EVERY", "FIXED_UNITS", "GAIN", "MODELLED", "PHASE_SPLIT", "TIMING", "in_words"]

EVERY = tuple(f.name for f in fields(Parameters))
"""Every parameter."""

_SEEN = (
    "delay_correlation",
    "hold_period",
    "saturation_low",
    "saturation_high",
    "quantization_step",
)
"""Those that are seen in the record itself, whatever the model."""

MODELLED = tuple(name for name in EVERY if name not in _SEEN)
"""Those that are read off the fitted model, or off what it leaves over."""

PHASE_SPLIT = (
    "delay",
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    "bandwidth_phase90_without_delay",
)
"""Those that depend on how the phase is divided between a delay and poles.

The response within the band is the same either way: so are gain, bandwidths with the delay in
them, and the slope of the phase at DC.
"""

TIMING = ("delay", "delay_correlation", "delay_low_frequency", "bandwidth_phase90")
"""Those that move when one channel's clock moves against the other's."""

GAIN = (
    "scale_factor",
    "natural_frequency",
    "damping_ratio",
    "time_constant",
    "bandwidth_3db",
    "peak_gain_db",
)
"""Those that depend on the size of the response."""

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
