"""The stimuli of section V: five axes of a flight motion simulator, at 500 and 1000 Hz.

The paper states the limits of the axes (Fig. 4) and for azimuth and elevation the band, 0.1
to 20 Hz, with "severe extinction" and velocity and acceleration lowered further to protect
the scene projector (Fig. 18). It does not print the amplitudes, nor the lowered limits, nor
the bands of the inner axes: those here are ours. Azimuth and elevation keep half of their
rate and nineteen twentieths of their acceleration, with which the level just stays above
30 dB up to 10 Hz at 500 Hz, as the paper reads it off Fig. 18; the inner bands reach half an
octave beyond the stated bandwidths.
"""

from dataclasses import replace
from typing import Literal

from hmpim.stimulus.kinds import design
from hmpim.stimulus.limits import Limits
from hmpim.stimulus.stimulus import Stimulus

__all__ = ["FIG_4", "section_v"]

Axis = Literal["roll", "yaw", "pitch", "azimuth", "elevation"]

# deg, deg/s, deg/s²
FIG_4: dict[Axis, Limits] = {
    "roll": Limits(position=120, velocity=800, acceleration=33_000, unit="deg"),
    "yaw": Limits(position=55, velocity=400, acceleration=16_000, unit="deg"),
    "pitch": Limits(position=120, velocity=200, acceleration=14_000, unit="deg"),
    "azimuth": Limits(position=45, velocity=180, acceleration=1_000, unit="deg"),
    "elevation": Limits(position=45, velocity=180, acceleration=900, unit="deg"),
}
_LAST: dict[Axis, float] = {  # Hz
    "roll": 60.0,
    "yaw": 36.0,
    "pitch": 30.0,
    "azimuth": 20.0,
    "elevation": 20.0,
}
_TRAVEL = 10.0  # deg, as in Figs 12 and 13
_DURATION = 10.0  # s
_OUTER = ("azimuth", "elevation")


def section_v(*, fs: float = 500.0) -> dict[Axis, Stimulus]:
    """Design the five stimuli of section V, from rest to rest.

    Parameters
    ----------
    fs : float
        Command rate in Hz; the paper has 500 and 1000.

    Returns
    -------
    dict of str to Stimulus
        For roll, yaw, pitch, azimuth and elevation, in degrees.

    Raises
    ------
    LimitsError
        If the rate is too low for the bands.

    Examples
    --------
    >>> stimuli = section_v(fs=500.0)
    >>> {axis: round(stimulus.extinction, 2) for axis, stimulus in stimuli.items()}
    {'roll': 1.06, 'yaw': 1.06, 'pitch': 1.02, 'azimuth': 1.72, 'elevation': 1.76}
    """
    made: dict[Axis, Stimulus] = {}
    for axis, stated in FIG_4.items():
        limits = replace(stated, position=_TRAVEL)
        if axis in _OUTER:
            limits = replace(
                limits,
                velocity=0.5 * stated.velocity,
                acceleration=0.95 * stated.acceleration,
            )
        made[axis] = design(
            band=(0.1, _LAST[axis]), duration=_DURATION, fs=fs, limits=limits, axis=axis
        )
    return made
