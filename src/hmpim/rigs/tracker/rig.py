"""A tracker under test: the stimulus moves the line of sight, the tracker's output is recorded."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, LimitsError
from hmpim.record import Finding
from hmpim.rigs.block import Block, ChannelSpec, Layout, RunReport
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.stimuli import stimuli_by_axis
from hmpim.rigs.tracker.camera import Camera, Shot, Watching
from hmpim.rigs.tracker.scene import Image, Scene
from hmpim.rigs.tracker.trackers import Tracker, TrackerName, make_tracker
from hmpim.stimulus import Limits
from hmpim.units import conversion_factor

__all__ = ["TrackedFrame", "TrackerRig", "findings_of", "kept_frames"]

FloatArray = NDArray[np.float64]

_KEPT = 6  # frames for the page


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackedFrame:
    """A frame of a run, to be shown.

    Parameters
    ----------
    time : float
        When it was taken, s.
    image : ndarray of uint8, shape (height, width)
        What the tracker got.
    target : (float, float)
        Where the target was, pixels.
    point : (float, float) or None
        Where the tracker saw it, pixels; None where it had lost it.
    """

    time: float
    image: Image
    target: tuple[float, float]
    point: tuple[float, float] | None


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class TrackerRig(Simulated):
    """A camera and a tracker as the unit under test.

    The stimulus is the target's line of sight, to the right of the optical axis. Frames are taken
    at the camera's own rate from the motion itself, wherever it is between the samples. The
    tracker's answer is there `latency` later, and stays until the next.

    Parameters
    ----------
    tracker : {'centroid', 'template', 'csrt'} or callable
        One of OpenCV's, or a function of a frame; see `hmpim.rigs.tracker.trackers`.
    reset : callable or None
        Called before each run, for a tracker of one's own with a memory.
    scene : Scene
        What is looked at.
    camera : Camera
        Frame rate, latency, frames lost.
    scale_factor : float
        Angle that the tracker takes for one that is seen: 1 if it knows its pixels well.
    boresight : float
        What it says of a target on the axis, deg.
    name, input_name, output_name : str
        Name of the rig, and of its record's channels.

    Raises
    ------
    ArgumentError
        If a value is out of range.

    Examples
    --------
    >>> from hmpim.stimulus import Sine, Stimulus
    >>> shake = Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=200.0, unit="deg")
    >>> from hmpim.experiment import run
    >>> record = run(TrackerRig(camera=Camera(latency=0.0)), shake, rng=0)
    >>> seen, truth = record.outputs[0].values, record.inputs[0].values
    >>> bool(np.abs(seen - truth).max() < 0.15)  # held for 1/60 s
    True
    """

    tracker: TrackerName | Tracker = "centroid"
    reset: Callable[[], object] | None = None
    scene: Scene = field(default_factory=Scene)
    camera: Camera = field(default_factory=Camera)
    scale_factor: float = 1.0
    boresight: float = 0.0
    name: str = "tracker"
    input_name: str = "line of sight"
    output_name: str = "tracked"
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)
    _seen: list[TrackedFrame] = field(default_factory=list, init=False, repr=False, compare=False)
    _counts: dict[str, int] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("scale_factor", "boresight"):
            if not math.isfinite(getattr(self, name)):
                raise ArgumentError(f"{name} = {getattr(self, name)!r} must be finite")

    @property
    def axes(self) -> tuple[str, ...]:
        """Empty: any one stimulus is seen."""
        return ()

    @property
    def limits(self) -> Limits:
        """The whole target stays in the frame."""
        return Limits(position=self.scene.reach, unit="deg")

    @property
    def frames(self) -> tuple[TrackedFrame, ...]:
        """Some frames of the last run, to be shown."""
        return tuple(self._seen)

    def report(self) -> RunReport:
        """Say how many frames were lost or repeated."""
        return RunReport(findings=findings_of(self._counts))

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Take every frame of the run, and ask the tracker.

        Raises
        ------
        LimitsError
            If the target would leave the frame.
        RigError
            If the tracker fails.
        """
        ((axis, only),) = stimuli_by_axis(stimulus, name=repr(self.name)).items()
        to_deg = conversion_factor(only.unit, to="deg") if only.unit else 1.0
        rng = self._playing.take_rng()
        times = self.camera.times((only.samples - 1) / only.fs)
        angles = to_deg * np.asarray(only.motion(times).position)
        if np.abs(angles).max() > self.scene.reach:
            raise LimitsError(
                f"the target would leave the frame: {np.abs(angles).max():.4g} deg from the axis, "
                f"where only {self.scene.reach:.4g} deg is visible; scale the stimulus down"
            )
        watching = Watching(
            self.camera, self.scene.backdrop(rng), self._tracker(float(angles[0])), rng
        )
        shots = [watching.take(float(angle)) for angle in angles]
        said = self._answers(shots) / to_deg
        self._seen[:] = kept_frames(shots, times, angles, self.scene)
        self._counts.update(watching.counts)
        due = np.arange(only.samples) / only.fs
        # The newest answer that is there; none yet: on the axis, as when it was switched on.
        newest = self.camera.newest(due)
        read = np.where(newest < 0, self.boresight / to_deg, said[np.maximum(newest, 0)])
        self._playing.state = (only.position, read)
        given = ChannelSpec(
            name=self.input_name, role="input", unit=only.unit, axis=axis, quantity="position"
        )
        return Layout(
            channels=(given, ChannelSpec(name=self.output_name, role="output", unit=only.unit)),
            intersample="bandlimited",
            source=f"{self._called} tracker at {self.camera.frame_rate:g} frames per second",
        )

    def play(self, block: Block, /) -> dict[str, FloatArray]:
        """Return the line of sight and what the tracker said of it at the block's times."""
        given, read = self._playing.current(self.name)
        part = slice(block.start, block.stop)
        return {self.input_name: given[part], self.output_name: read[part]}

    @property
    def _called(self) -> str:
        if isinstance(self.tracker, str):
            return self.tracker
        return getattr(self.tracker, "__name__", "own")

    def _tracker(self, first: float) -> Tracker:
        if self.reset is not None:
            self.reset()
        if not isinstance(self.tracker, str):
            return self.tracker
        x, y = self.scene.middle
        size = (self.scene.target_width, self.scene.target_height)
        return make_tracker(self.tracker, at=(x + first / self.scene.pixel, y), size=size)

    def _answers(self, shots: list[Shot | None]) -> FloatArray:
        """Angle in deg that stands after each frame; a lost one leaves the last."""
        last, values = self.boresight, np.empty(len(shots))
        for k, shot in enumerate(shots):
            if shot is not None and shot.point is not None:
                angle = self.scene.pixel * (shot.point[0] - self.scene.middle[0])
                last = self.scale_factor * angle + self.boresight
            values[k] = last
        return values


def kept_frames(
    shots: list[Shot | None], times: FloatArray, angles: FloatArray, scene: Scene
) -> list[TrackedFrame]:
    """Choose some frames to be shown, spread over the run."""
    there = [(k, shot) for k, shot in enumerate(shots) if shot is not None]
    places = np.unique(np.linspace(0, len(there) - 1, _KEPT).round().astype(int))
    chosen = [there[place] for place in places.tolist()]
    x, y = scene.middle
    return [
        TrackedFrame(
            time=float(times[k]),
            image=shot.image,
            target=(x + float(angles[k]) / scene.pixel, y),
            point=shot.point,
        )
        for k, shot in chosen
    ]


def findings_of(counts: dict[str, int]) -> tuple[Finding, ...]:
    """Say in the record how many frames were dropped, repeated and lost.

    Examples
    --------
    >>> findings_of({"frames": 10, "dropped": 2, "repeated": 0, "lost": 0})[0].message
    '2 of 10 frames were dropped; the previous answer was held.'
    """
    words = {
        "dropped": "dropped; the previous answer was held",
        "repeated": "repeated; the tracker saw the previous frame again",
        "lost": "lost to the tracker; it did not find the target, and its previous answer was held",
    }
    return tuple(
        Finding(
            code=f"frames_{what}",
            message=f"{counts[what]} of {counts['frames']} frames were {text}.",
            severity="info",
            parameters=(),
        )
        for what, text in words.items()
        if counts.get(what)
    )
