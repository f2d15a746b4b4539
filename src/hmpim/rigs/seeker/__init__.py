"""A seeker under test: a gimbal that closes its loop on a tracker, on the five-axis table."""

from hmpim.rigs.seeker.loop import Seeker
from hmpim.rigs.seeker.rig import SeekerRig
from hmpim.rigs.seeker.truth import seeker_bandwidth, seeker_response

__all__ = ["Seeker", "SeekerRig", "seeker_bandwidth", "seeker_response"]
