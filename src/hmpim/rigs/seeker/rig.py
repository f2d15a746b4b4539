"""A seeker on the five-axis table: the target moves, the platform follows what a tracker sees."""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError
from hmpim.rigs.block import Block, ChannelSpec, Layout, RunReport
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.seeker.platform import Platform
from hmpim.rigs.seeker.truth import seeker_bandwidth
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.stimuli import stimuli_by_axis
from hmpim.rigs.table import MotionTable
from hmpim.rigs.tracker import Camera, Scene, TrackedFrame, Tracker, make_tracker
from hmpim.rigs.tracker.camera import Shot, Watching
from hmpim.rigs.tracker.rig import findings_of, kept_frames
from hmpim.rigs.tracker.trackers import TrackerName
from hmpim.stimulus import Limits, Stimulus

__all__ = ["SeekerRig"]

FloatArray = NDArray[np.float64]

_SIGHT = "line-of-sight rate"
_BODY = "body rate"


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SeekerRig(Simulated):
    """A seeker as the unit under test, on the table's inner axes, its target on the outer ones.

    The camera sits on a platform, which is stabilised: it turns at the rate that it is commanded,
    with a lag, whatever the body does, but for a share of the body's rate. The tracker sees the
    pointing error, and the platform is commanded to turn at `track_gain` times that. A stimulus
    for ``azimuth`` moves the line of sight, one for ``yaw`` the body; one that names no axis moves
    the line of sight. From line-of-sight rate to platform rate command is `seeker_response`.

    Parameters
    ----------
    track_gain : float
        Rate command over pointing error, 1/s.
    lag : float
        Time constant of the platform's rate loop, s.
    coupling : float
        Share of the body's rate that comes through to the platform.
    tracker : {'centroid', 'template', 'csrt'} or callable
        One of OpenCV's, or a function of a frame.
    reset : callable or None
        Called before each run, for a tracker of one's own with a memory.
    scene : Scene
        What is looked at; the projector moves the target alone.
    camera : Camera
        Frame rate, latency, frames lost.
    table : MotionTable
        What moves target and body.
    name : str
        Name of the rig.

    Raises
    ------
    ArgumentError
        If a value is out of range.

    Examples
    --------
    >>> round(SeekerRig().bandwidth(), 2)
    1.83
    """

    track_gain: float = 5.0
    lag: float = 0.01
    coupling: float = 0.02
    tracker: TrackerName | Tracker = "centroid"
    reset: Callable[[], object] | None = None
    scene: Scene = field(default_factory=Scene)
    camera: Camera = field(default_factory=Camera)
    table: MotionTable = field(default_factory=lambda: MotionTable(mode="PVA"))
    name: str = "seeker"
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)
    _seen: list[TrackedFrame] = field(default_factory=list, init=False, repr=False, compare=False)
    _counts: dict[str, int] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("track_gain", "lag"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise ArgumentError(f"{name} = {value!r} must be positive and finite")
        if not math.isfinite(self.coupling):
            raise ArgumentError(f"coupling = {self.coupling!r} must be finite")

    @property
    def axes(self) -> tuple[str, ...]:
        """The table's axis that moves the target, and the one that moves the body."""
        return ("azimuth", "yaw")

    @property
    def limits(self) -> dict[str, Limits]:
        """Those of the table."""
        return {"azimuth": self.table.limits_of("azimuth"), "yaw": self.table.limits_of("yaw")}

    @property
    def frames(self) -> tuple[TrackedFrame, ...]:
        """Some frames of the last run, to be shown."""
        return tuple(self._seen)

    def bandwidth(self, *, hold: Literal["included", "removed"] = "included") -> float:
        """Frequency in Hz at which the rate command lags the line-of-sight rate by 90°.

        With the hold of the command, or behind it; see `seeker_response`.
        """
        return seeker_bandwidth(
            gain=self.track_gain,
            lag=self.lag,
            latency=self.camera.latency,
            frame_rate=self.camera.frame_rate,
            hold=hold,
        )

    def report(self) -> RunReport:
        """Say how many frames were lost or repeated."""
        return RunReport(findings=findings_of(self._counts))

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Move the table, and let the seeker follow.

        Raises
        ------
        LimitsError
            If the table may not do it.
        RigError
            If the tracker fails.
        """
        if isinstance(stimulus, Stimulus) and not stimulus.axis:
            stimulus = {"azimuth": stimulus}
        named = stimuli_by_axis(stimulus, self.axes, name=repr(self.name))
        rng = self._playing.take_rng()
        moved = self.table.simulate(named, rng=rng)
        fs = next(iter(named.values())).fs
        sight, body = moved.of("azimuth"), moved.of("yaw")
        sight, body = sight - sight[0], body - body[0]
        answers = self._followed(
            scipy.interpolate.CubicSpline(moved.time, sight),
            scipy.interpolate.CubicSpline(moved.time, body),
            moved.time[-1],
            rng,
        )
        newest = self.camera.newest(moved.time)
        rates = {
            _SIGHT: moved.of("azimuth", "velocity"),
            _BODY: moved.of("yaw", "velocity"),
        }
        given = [name for name, axis in ((_SIGHT, "azimuth"), (_BODY, "yaw")) if axis in named]
        values = {name: rates[name] for name in given}
        values["platform rate command"] = np.where(newest < 0, 0.0, answers[np.maximum(newest, 0)])
        self._playing.state = values
        inputs = tuple(ChannelSpec(name=name, role="input", unit="deg/s") for name in given)
        output = ChannelSpec(name="platform rate command", role="output", unit="deg/s")
        tracker = self.tracker if isinstance(self.tracker, str) else "own"
        return Layout(
            channels=(*inputs, output),
            intersample="bandlimited",
            source=f"simulated {self.name} on the table at {fs:g} Hz, {tracker} tracker at "
            f"{self.camera.frame_rate:g} frames per second",
        )

    def play(self, block: Block, /) -> dict[str, FloatArray]:
        """Return what moved, and what the seeker commanded."""
        values: dict[str, FloatArray] = self._playing.current(self.name)
        return {name: row[block.start : block.stop] for name, row in values.items()}

    def _followed(
        self,
        sight: scipy.interpolate.CubicSpline,
        body: scipy.interpolate.CubicSpline,
        end: float,
        rng: np.random.Generator,
    ) -> FloatArray:
        """Rate command that each frame leads to, deg/s."""
        camera, scene = self.camera, self.scene
        times = camera.times(end)
        watching = Watching(camera, scene.backdrop(rng), self._made_tracker(), rng)
        platform = Platform(lag=self.lag)
        commands, errors = np.zeros(times.size), np.zeros(times.size)
        shots: list[Shot | None] = []
        targets, bodies = sight(times), body(times)
        last = 0.0
        for k, time in enumerate(times.tolist()):
            turned = platform.angle(time) + self.coupling * float(bodies[k])
            errors[k] = targets[k] - turned
            shot = watching.take(float(errors[k]))
            shots.append(shot)
            if shot is not None and shot.point is not None:
                seen = scene.pixel * (shot.point[0] - scene.middle[0])
                last = self.track_gain * seen
            commands[k] = last
            platform.command(last, at=time + camera.latency)
        self._seen[:] = kept_frames(shots, times, errors, scene)
        self._counts.clear()
        self._counts.update(watching.counts)
        return commands

    def _made_tracker(self) -> Tracker:
        if self.reset is not None:
            self.reset()
        if not isinstance(self.tracker, str):
            return self.tracker
        size = (self.scene.target_width, self.scene.target_height)
        return make_tracker(self.tracker, at=self.scene.middle, size=size)
