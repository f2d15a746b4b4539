"""A seeker on the table: its loop against the closed form, frames and all."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import hmpim
from hmpim.errors import ArgumentError, LimitsError
from hmpim.identify import paper_analysis
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.seeker import SeekerRig, seeker_bandwidth, seeker_response
from hmpim.rigs.seeker.platform import Platform
from hmpim.rigs.tracker import Camera, Scene
from hmpim.stimulus import Limits, Sine, Stimulus, design

CLEAN = Scene(clutter_std=0.0, noise_std=1.0)


def exact(frame):
    """A tracker that knows the pixels."""
    above = np.clip(frame.astype(float) - 90.0, 0.0, None)
    return (above.sum(axis=0) @ (np.arange(frame.shape[1]) + 0.5)) / above.sum(), 60.0


@pytest.mark.parametrize(("frequency", "latency"), [(0.5, 0.03), (1.8, 0.03), (4.0, 0.01)])
def test_the_loop_answers_as_its_closed_form(frequency, latency):
    camera = Camera(latency=latency)
    rig = SeekerRig(tracker=exact, scene=CLEAN, camera=camera)
    fine, seconds, omega = 6000, 8, 2 * np.pi * frequency
    t = np.arange(seconds * 500 + 1) / 500
    commands = rig._followed(
        CubicSpline(t, np.sin(omega * t)), CubicSpline(t, 0 * t), t[-1], np.random.default_rng(0)
    )
    t = np.arange(seconds * fine) / fine
    index = np.floor((t - latency) * camera.frame_rate + 1e-9).astype(int)
    y = np.where(index < 0, 0.0, commands[np.clip(index, 0, None)])
    whole = slice(t.size - round(np.floor(4 * frequency) / frequency * fine), None)
    found = 2 * np.mean(y[whole] * np.exp(-1j * omega * t[whole])) / omega
    truth = seeker_response([frequency], gain=5.0, lag=0.01, latency=latency, frame_rate=60.0)[0]
    assert abs(found - truth) < 0.01 * abs(truth)


def test_the_platform_is_a_lag():
    platform = Platform(lag=0.05)
    platform.command(3.0, at=0.1)
    platform.command(-1.0, at=0.2)
    t = np.linspace(0.0, 0.6, 6001)
    found = [platform.angle(time) for time in t.tolist()]
    wanted = np.where(t < 0.1, 0.0, np.where(t < 0.2, 3.0, -1.0))
    rate, angle, truth = 0.0, 0.0, []
    for want in wanted:
        truth.append(angle)
        angle += 1e-4 * rate
        rate += 1e-4 * (want - rate) / 0.05
    assert found == pytest.approx(truth, abs=1e-3)


def test_its_bandwidth_is_a_quarter_turn():
    for hold in ("included", "removed"):
        facts = {"gain": 5.0, "lag": 0.01, "latency": 0.03, "frame_rate": 60.0, "hold": hold}
        at = seeker_response([seeker_bandwidth(**facts)], **facts)[0]
        assert np.degrees(np.angle(at)) == pytest.approx(-90.0, abs=1e-5)
    with pytest.raises(ArgumentError, match="half the frame rate, 30 Hz"):
        seeker_response([40.0], gain=5.0, lag=0.01, latency=0.03, frame_rate=60.0)


@pytest.fixture(scope="module")
def run():
    pytest.importorskip("mujoco")
    pytest.importorskip("cv2")
    limits = Limits(position=3, velocity=15, acceleration=700, unit="deg")
    sweep = design(band=(0.1, 6), duration=6, fs=500, limits=limits, axis="azimuth")
    rig = SeekerRig()
    return rig, hmpim.run(rig, sweep, rng=1)


def test_the_quarter_turn_is_found_on_the_table(run):
    rig, record = run
    u, y = record.inputs[0].values, record.outputs[0].values
    found = paper_analysis(u, y, record.fs, band=record.band).estimates.bandwidth_phase90
    assert found == pytest.approx(rig.bandwidth(), rel=0.05)
    pair = hmpim.identify(record).pairs[0]
    behind = pair.parameters.bandwidth_phase90
    assert behind.value == pytest.approx(rig.bandwidth(hold="removed"), rel=0.03)
    assert pair.parameters.hold_period.value == pytest.approx(1 / 60, rel=1e-3)
    assert pair.parameters.scale_factor.value == pytest.approx(1.0, abs=0.02)
    assert not [f for f in record.findings if f.code == "frames_lost"]


def test_frames_show_the_target_near_the_axis(run):
    rig, _ = run
    assert len(rig.frames) == 6
    for frame in rig.frames:
        assert abs(frame.target[0] - 80.0) < 35.0
        assert abs(frame.point[0] - frame.target[0]) < 1.0


def test_the_bodys_motion_comes_through_as_coupled():
    pytest.importorskip("mujoco")
    shake = Stimulus(waveform=Sine(frequency=1.0, amplitude=3.0, duration=4.0), fs=500, unit="deg")
    rig = SeekerRig(tracker=exact, scene=CLEAN, coupling=0.1)
    record = hmpim.run(rig, {"yaw": shake}, rng=2)
    assert [c.name for c in record.inputs] == ["body rate"]
    late = record.inputs[0].time >= 2.0
    turn = np.exp(-2j * np.pi * record.inputs[0].time[late])
    body, command = (c.values[late] @ turn for c in (record.inputs[0], record.outputs[0]))
    truth = -0.1 * seeker_response([1.0], gain=5.0, lag=0.01, latency=0.03, frame_rate=60.0)[0]
    assert abs(command / body - truth) < 0.04 * abs(truth)


def test_what_cannot_be_is_refused():
    pytest.importorskip("mujoco")
    with pytest.raises(ArgumentError, match=r"track_gain = 0\.0 must be positive"):
        SeekerRig(track_gain=0.0)
    with pytest.raises(ArgumentError, match="tracker = 'eye' is not one of"):
        SeekerRig(tracker="eye")
    far = Stimulus(waveform=Sine(frequency=5.0, amplitude=20.0, duration=1.0), fs=500, unit="deg")
    with pytest.raises(LimitsError, match="azimuth"):
        hmpim.run(SeekerRig(), {"azimuth": far})


def test_it_is_found_by_name():
    pytest.importorskip("mujoco")
    options = {"camera": {"frame_rate": 100.0}, "table": {"friction": False}}
    rig = find_rig("seeker", description=describe({"options": options})).rig
    assert (rig.camera.frame_rate, rig.table.friction, rig.table.mode) == (100.0, False, "PVA")
