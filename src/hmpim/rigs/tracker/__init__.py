"""A scene, a camera, and a tracker under test: what a line of sight becomes on its way."""

from hmpim.rigs.tracker.camera import Camera, Shot
from hmpim.rigs.tracker.rig import TrackedFrame, TrackerRig
from hmpim.rigs.tracker.scene import Scene
from hmpim.rigs.tracker.trackers import TRACKERS, Tracker, make_tracker

__all__ = [
    "TRACKERS",
    "Camera",
    "Scene",
    "Shot",
    "TrackedFrame",
    "Tracker",
    "TrackerRig",
    "make_tracker",
]
