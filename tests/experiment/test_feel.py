"""Feel before you push: how far an unknown rig is moved, and why no further."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RigError
from hmpim.experiment import Feel, RunLog, RunOptions, run
from hmpim.formats.recording import read_recording
from hmpim.rigs import ChannelSpec, Layout, ManualClock
from hmpim.rigs.wire import WireRig
from hmpim.stimulus import Limits, design, scaled_stimulus
from wire_support import Lag, Network

LIMITS = Limits(position=5, velocity=150, acceleration=3500, unit="deg")
WIDE = Limits(position=50, velocity=1e4, acceleration=1e6, unit="deg")
SWEEP = design(band=(0.5, 10), duration=3, fs=200, limits=LIMITS)


class Arm:
    """Answers with what `answer` makes of a second-order response; remembers how far it went."""

    name, axes, limits, moves = "arm", (), LIMITS, True

    def __init__(self, answer=lambda y: y, noise_std=0.0, frequency=4.0, damping=0.4):
        self.answer, self.peaks, self.stops = answer, [], 0
        self.omega, self.zeta = 2 * np.pi * frequency, damping
        self.rng, self.noise_std = np.random.default_rng(0), noise_std

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def prepare(self, stimulus):
        self.state, self.rate = 0.0, 0.0
        self.peaks.append(stimulus.peaks.position)

    def play(self, block):
        omega, zeta, dt, out = self.omega, self.zeta, 1 / 200, []
        for u in block.position[:, 0]:
            self.rate += dt * (omega**2 * (u - self.state) - 2 * zeta * omega * self.rate)
            self.state += dt * self.rate
            out.append(self.state)
        return self.answer(np.array(out)) + self.noise_std * self.rng.normal(size=len(out))

    def stop(self):
        self.stops += 1


def felt(rig, how=None, limits=LIMITS, **kwargs):
    """Record and the finding."""
    rig.limits = limits
    feel = Feel() if how is None else how
    options = RunOptions(feel=feel)
    record = run(rig, SWEEP, options=options, **kwargs)
    (said,) = [f for f in record.findings if f.code == "felt"]
    return record, said


def test_a_linear_rig_is_moved_in_steps_to_all_of_it():
    rig = Arm(lambda y: 0.5 * y, noise_std=0.002)
    record, said = felt(rig)
    assert np.allclose(np.array(rig.peaks) / SWEEP.peaks.position, [0.05, 0.2, 0.5, 1.0])
    assert rig.stops == 4
    assert said.message == (
        "The rig was first moved at 5 %, 20 %, 50 % of the amplitude; it stayed linear and inside "
        "its limits."
    )
    assert np.array_equal(record.inputs[0].values, SWEEP.position)


def test_a_resonance_is_kept_inside_the_limit_on_what_is_measured():
    whole = run(Arm(frequency=2.5, damping=0.15), SWEEP)
    assert np.abs(whole.outputs[0].values).max() > 1.2 * LIMITS.position
    rig = Arm(frequency=2.5, damping=0.15)
    record, said = felt(rig)
    reached = np.abs(record.outputs[0].values).max()
    assert 0.9 * LIMITS.position < reached < 0.97 * LIMITS.position
    assert "would bring it to" in said.message
    assert rig.peaks[-1] < 0.8 * SWEEP.peaks.position


def test_the_limit_of_the_only_axis_counts_whatever_its_channel_is_called():
    class Lever(Arm):
        axes = ("lever",)

        def prepare(self, stimulus):
            super().prepare(stimulus)
            u, y = (ChannelSpec(name=name, role=role, unit="deg", axis="lever", quantity="position",
                                commanded=role == "input")
                    for name, role in (("u", "input"), ("y", "output")))  # fmt: skip
            return Layout(channels=(u, y))

        def play(self, block):
            return {"y": super().play(block)}

    rig = Lever(frequency=2.5, damping=0.15)
    record = run(rig, replace(SWEEP, axis="lever"), options=RunOptions(feel=Feel()))
    assert "would bring it to" in str(record.findings)
    assert np.abs(record.outputs[0].values).max() < 0.97 * LIMITS.position


def test_what_ends_to_be_linear_is_pushed_no_further():
    rig = Arm(lambda y: np.clip(y, -0.35, 0.35))  # clips between 5 % and 20 %
    record, said = felt(rig, limits=WIDE)
    assert "departs from proportion by" in said.message
    assert np.abs(record.inputs[0].values).max() == pytest.approx(0.25, rel=1e-3)


def test_noise_that_hides_the_smallest_motion_is_no_departure():
    rig = Arm(lambda y: 0.5 * y, noise_std=0.3)
    _, said = felt(rig, limits=WIDE)
    assert said.message.endswith("inside its limits.")


def test_a_rig_that_does_not_answer_is_not_pushed():
    rig = Arm(lambda y: 0 * y)
    with pytest.raises(
        RigError, match="y did not change when the rig was moved a little; is it swi"
    ):
        felt(rig)
    assert len(rig.peaks) == 1


def test_the_steps_are_checked_and_logged_and_the_last_is_what_is_kept(tmp_path):
    log = RunLog()
    record, _ = felt(Arm(lambda y: 0.5 * y), log=log, path=tmp_path / "r.h5")
    assert read_recording(tmp_path / "r.h5").record == record
    assert [e.kind for e in log.events].count("arm") == 4
    checks = [e.message for e in log.events if e.kind == "check"]
    assert "position 0.25 of 5 deg" in checks[1]


def test_what_breaks_while_it_is_felt_is_kept(tmp_path):
    class Breaking(Arm):
        def play(self, block):
            if len(self.peaks) == 2 and block.time[0] > 2.0:
                raise OSError("cable")
            return super().play(block)

    with pytest.raises(RigError, match="cable"):
        felt(Breaking(), path=tmp_path / "r.h5")
    kept = read_recording(tmp_path / "r.h5")
    assert not kept.complete
    assert np.abs(kept.record.inputs[0].values).max() == pytest.approx(1.0, rel=1e-3)


def test_over_a_wire_each_step_begins_anew():
    clock = ManualClock()
    network = Network(clock, plant=Lag(2, 500.0, late=3, time_constant=0.01, noise_std=1e-4))
    sweep = design(band=(0.5, 10), duration=2, fs=500, axis="roll", limits=LIMITS)
    options = RunOptions(clock=clock, feel=Feel(shares=(0.1, 0.4)))
    record = run(WireRig(transport=network, clock=clock), sweep, options=options)
    assert max(abs(o.position[0]) for o in network.orders) == pytest.approx(5.0, rel=1e-3)
    assert np.abs(record.inputs[0].values).max() == pytest.approx(5.0, rel=1e-3)
    assert record.samples >= 1000
    assert {f.code for f in record.findings} == {"felt", "timing", "clocks"}


@pytest.mark.parametrize("shares", [(), (0.0,), (0.5, 0.2), (0.5, 1.0)])
def test_steps_that_do_not_rise(shares):
    with pytest.raises(ArgumentError, match="must rise, between 0 and 1"):
        Feel(shares=shares)


def test_a_scaled_stimulus_keeps_everything_but_its_size():
    small = scaled_stimulus(SWEEP, 0.25)
    assert np.allclose(small.position, 0.25 * SWEEP.position)
    assert (small.fs, small.samples, small.limits, small.band) == (
        *(SWEEP.fs, SWEEP.samples, SWEEP.limits, SWEEP.band),
    )


def test_a_rig_is_unknown_if_the_person_alone_states_its_limits():
    rig = Arm(lambda y: 0.5 * y)
    assert not [f for f in run(rig, SWEEP).findings if f.code == "felt"]
    rig.limits = None
    assert [f for f in run(rig, SWEEP, limits=LIMITS).findings if f.code == "felt"]
    at_once = run(rig, SWEEP, limits=LIMITS, options=RunOptions(feel=None))
    assert not [f for f in at_once.findings if f.code == "felt"]
