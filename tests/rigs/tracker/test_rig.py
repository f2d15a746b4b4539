"""A tracker as a rig: what is in its record, and what is found of it."""

import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError, HmpimError, LimitsError, RigError
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.tracker import Camera, Scene, TrackerRig
from hmpim.stimulus import Limits, Ramp, Sine, Stimulus, design

pytest.importorskip("cv2")

FS = 480.0
LIMITS = Limits(position=2, velocity=30, unit="deg")
LATE = Camera(frame_rate=60.0, latency=2 / 60)
CLEAN = Scene(clutter_std=0.0, noise_std=1.0)


@pytest.fixture(scope="module")
def sweep():
    return design(band=(0.1, 5), duration=4, fs=FS, limits=LIMITS)


def exact(frame):
    """A tracker that knows the pixels: centre of all that is brighter than the background."""
    above = np.clip(frame.astype(float) - 90.0, 0.0, None)
    x = np.arange(frame.shape[1]) + 0.5
    return (above.sum(axis=0) @ x) / above.sum(), 60.0


def test_each_answer_is_that_of_the_newest_frame_whose_answer_is_there(sweep):
    rig = TrackerRig(tracker=exact, camera=LATE, scene=CLEAN)
    record = hmpim.run(rig, sweep, rng=0)
    t = np.arange(sweep.samples) / FS
    taken = np.floor((t - 2 / 60) * 60 + 1e-9) / 60
    truth = np.where(taken < 0, 0.0, sweep.motion(np.maximum(taken, 0)).position)
    assert record.outputs[0].values == pytest.approx(truth, abs=0.02)
    assert record.intersample == "bandlimited"
    assert record.findings == ()


def test_delay_hold_scale_and_bias_are_found(sweep):
    rig = TrackerRig(camera=LATE, scene=CLEAN, scale_factor=1.1, boresight=0.5)
    found = hmpim.identify(hmpim.run(rig, sweep, rng=1))["tracked", "line of sight"].parameters
    assert found.hold_period.value == pytest.approx(1 / 60, rel=1e-3)
    # An answer that came between two samples is read at the second.
    assert abs(found.delay.value - (2 / 60 - 0.5 / FS)) < 0.5 / FS
    assert found.scale_factor.value == pytest.approx(1.1, abs=0.02)
    assert found.bias.value == pytest.approx(0.5, abs=0.02)


@pytest.mark.parametrize("fault", ["dropped", "repeated"])
def test_lost_frames_make_it_late_and_are_told(fault, sweep):
    late = {}
    for share in (0.0, 0.3):
        camera = Camera(frame_rate=60.0, latency=2 / 60, **{fault: share})
        record = hmpim.run(TrackerRig(tracker=exact, camera=camera, scene=CLEAN), sweep, rng=2)
        late[share] = lag_of(record)
        if share:
            (said,) = record.findings
            assert said.code == f"frames_{fault}"
            lost = int(said.message.split()[0])
            assert abs(lost - 0.3 * 240) < 30
    # A run of k lost frames is late by 1 + 2 + ... + k: on average p / (1 - p) of a frame.
    assert late[0.3] - late[0.0] == pytest.approx(0.3 / 0.7 / 60, rel=0.35)


def lag_of(record):
    """Lag in s that fits best, by shifting the input over the output."""
    u, y = record.inputs[0], record.outputs[0]
    shifts = np.arange(0.0, 0.1, 0.0005)
    errors = [np.var(y.values - np.interp(u.time - s, u.time, u.values)) for s in shifts]
    return shifts[int(np.argmin(errors))]


def test_frames_are_kept_for_the_page(sweep):
    rig = TrackerRig(camera=LATE)
    hmpim.run(rig, sweep, rng=3)
    assert len(rig.frames) == 6
    for frame in rig.frames:
        assert np.hypot(*np.subtract(frame.point, frame.target)) < 1.5
        x, y = (int(part) for part in frame.target)
        assert frame.image[y, x] > 130
    assert rig.frames[-1].time > 3.5


def test_a_run_is_the_same_for_the_same_seed():
    shake = Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=100.0, unit="deg")
    first, again, other = (hmpim.run(TrackerRig(), shake, rng=seed).sha256 for seed in (4, 4, 5))
    assert first == again
    assert first != other


def test_a_users_own_tracker_is_a_function_of_a_frame(tmp_path, sweep):
    path = tmp_path / "mine.py"
    path.write_text(
        "import numpy as np\n"
        "class Brightest:\n"
        "    frames = 0\n"
        "    def __call__(self, frame):\n"
        "        self.frames += 1\n"
        "        y, x = np.unravel_index(np.argmax(frame), frame.shape)\n"
        "        return None if self.frames == 3 else (x + 0.5, y + 0.5)\n"
    )
    options = {"tracker": f"{path}:Brightest", "camera": {"latency": 0.0}}
    found = find_rig("tracker", description=describe({"options": options}))
    record = hmpim.run(found.rig, sweep, rng=6)
    assert [f.code for f in record.findings] == ["frames_lost"]
    off = record.outputs[0].values - record.inputs[0].values
    assert np.abs(off).max() < 0.1 * 7 + 0.6  # within the target, and held


@pytest.mark.parametrize(
    ("tracker", "words"),
    [
        (lambda frame: 3.0, "returned 3.0 at frame 0; it must return x and y"),
        (lambda frame: (float("nan"), 0.0), r"returned \(nan, 0.0\) at frame 0"),
        (lambda frame: 1 / 0, "the tracker failed at frame 0: ZeroDivisionError"),
    ],
)
def test_a_tracker_that_fails_is_told_with_its_frame(tracker, words):
    shake = Stimulus(waveform=Sine(frequency=1.0, duration=0.5), fs=100.0, unit="deg")
    with pytest.raises(RigError, match=words):
        hmpim.run(TrackerRig(tracker=tracker), shake)


def test_what_cannot_be_is_refused():
    far = Stimulus(waveform=Ramp(duration=1.0), fs=100.0, unit="rad")
    with pytest.raises(LimitsError, match="position"):
        hmpim.run(TrackerRig(), far)
    with pytest.raises(ArgumentError, match="tracker = 'eye' is not one of"):
        TrackerRig(tracker="eye")
    for wrong, words in (
        ({"frame_rate": 0.0}, r"frame_rate = 0\.0 Hz"),
        ({"latency": -1.0}, r"latency = -1\.0 s"),
        ({"dropped": 1.0}, r"dropped = 1\.0"),
        ({"dropped": 0.6, "repeated": 0.6}, "must leave some frames"),
    ):
        with pytest.raises(ArgumentError, match=words):
            Camera(**wrong)
    for options, words in (
        ({"camera": {"rate": 1}}, r"camera\.rate is not known; known are dropped"),
        ({"scene": 3}, "'scene' must be a table"),
        ({"scene": {"width": 160.5}}, r"width = 160\.5 is not a whole number"),
        ({"camera": {"frame_rate": "fast"}}, "frame_rate = 'fast' is not a number"),
        ({"name": 3}, "name = 3 is not a text"),
        ({"input_name": 3}, "input_name = 3 is not a text"),
    ):
        with pytest.raises(HmpimError, match=words):
            find_rig("tracker", description=describe({"options": options}))
