"""Section III: stimuli in closed form, inside limits, sampled for a rig."""

from hmpim.stimulus.classical import Chirp, Ramp, Sine, Step, SumOfSines
from hmpim.stimulus.lead import RestToRest, rest_to_rest
from hmpim.stimulus.limits import Limits
from hmpim.stimulus.motion import Motion, Peaks, Waveform
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.stimulus import Stimulus, design
from hmpim.stimulus.sweep import Sweep

__all__ = [
    "Chirp",
    "Limits",
    "Motion",
    "Peaks",
    "Ramp",
    "RestToRest",
    "Sine",
    "Step",
    "Stimulus",
    "SumOfSines",
    "Sweep",
    "Waveform",
    "design",
    "rest_to_rest",
    "true_peaks",
]
