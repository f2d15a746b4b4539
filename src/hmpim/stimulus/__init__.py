"""Section III: stimuli in closed form, inside limits, sampled for a rig."""

from hmpim.stimulus.base import BaseRoom, Shuttle, Superposed, room_beside_base, shuttle_for
from hmpim.stimulus.classical import Chirp, Ramp, Sine, Step, SumOfSines
from hmpim.stimulus.command import Command, leave_room
from hmpim.stimulus.ending import left_early, passes_band_at
from hmpim.stimulus.exponential import ExponentialSweep
from hmpim.stimulus.inside import check_inside
from hmpim.stimulus.kinds import KINDS, Kind, design
from hmpim.stimulus.lead import RestToRest, rest_to_rest
from hmpim.stimulus.limits import Limits
from hmpim.stimulus.motion import Motion, Peaks, Waveform
from hmpim.stimulus.multisine import (
    Multisine,
    interleaved_multisines,
    random_phase_multisine,
    schroeder_multisine,
)
from hmpim.stimulus.peaks import true_peaks
from hmpim.stimulus.profile import Prbs, Steps, smooth_prbs, smooth_steps
from hmpim.stimulus.quintic import Quintic
from hmpim.stimulus.repeated import Repeated, repeated_sweeps
from hmpim.stimulus.reverse import Reversed
from hmpim.stimulus.sampled import SampledMotion
from hmpim.stimulus.scale import scale_to_limits
from hmpim.stimulus.scaled import scaled_stimulus
from hmpim.stimulus.section_v import FIG_4, section_v
from hmpim.stimulus.spectrum import (
    OverFrequency,
    Redesign,
    SignalToNoise,
    check_spectrum,
    measured_noise,
    signal_to_noise,
)
from hmpim.stimulus.stimulus import Stimulus, blocks
from hmpim.stimulus.sweep import Sweep

__all__ = [
    "FIG_4",
    "KINDS",
    "BaseRoom",
    "Chirp",
    "Command",
    "ExponentialSweep",
    "Kind",
    "Limits",
    "Motion",
    "Multisine",
    "OverFrequency",
    "Peaks",
    "Prbs",
    "Quintic",
    "Ramp",
    "Redesign",
    "Repeated",
    "RestToRest",
    "Reversed",
    "SampledMotion",
    "Shuttle",
    "SignalToNoise",
    "Sine",
    "Step",
    "Steps",
    "Stimulus",
    "SumOfSines",
    "Superposed",
    "Sweep",
    "Waveform",
    "blocks",
    "check_inside",
    "check_spectrum",
    "design",
    "interleaved_multisines",
    "leave_room",
    "left_early",
    "measured_noise",
    "passes_band_at",
    "random_phase_multisine",
    "repeated_sweeps",
    "rest_to_rest",
    "room_beside_base",
    "scale_to_limits",
    "scaled_stimulus",
    "schroeder_multisine",
    "section_v",
    "shuttle_for",
    "signal_to_noise",
    "smooth_prbs",
    "smooth_steps",
    "true_peaks",
]
