"""Nothing moves beyond a limit; what a rig does wrong is told as its own error."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hmpim.errors import ArgumentError, LimitsError, RigError, UnitError
from hmpim.experiment import run
from hmpim.record import Record
from hmpim.rigs import Sensor
from hmpim.stimulus import Limits, Sine, Step, Stimulus, design

SINE = Stimulus(waveform=Sine(amplitude=2.0, frequency=1.0, duration=2.0), fs=100.0, unit="deg")
RATE, ACCELERATION = 4 * np.pi, 8 * np.pi**2  # peaks of SINE


@dataclass
class Spy:
    """A rig that remembers whether it moved."""

    limits: Limits | None = None
    name: str = "pitch"
    fault: Exception | None = None
    returns: object = None
    moved: list[Stimulus] = field(default_factory=list)

    def play(self, stimulus, *, rng):
        self.moved.append(stimulus)
        if self.fault is not None:
            raise self.fault
        if self.returns is not None:
            return self.returns
        return Sensor().play(stimulus, rng=rng)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (Limits(position=1.0, unit="deg"), "peak position 2 deg is beyond the limit 1 deg of 'p"),
        (Limits(velocity=6.0, unit="deg"), "peak velocity 12.5664 deg/s is beyond the limit 6 deg"),
        (
            Limits(acceleration=7.9, unit="deg"),
            "peak acceleration 78.9568 deg/s² .* of 'pitch'; scale the stimulus by 0.1,",
        ),
        (Limits(position=0.02, unit="rad"), "peak position 0.0349066 rad is beyond the limit 0.02"),
        (Limits(position=1.9, velocity=2.0, unit="deg"), "peak velocity"),  # the worst of the two
    ],
)
def test_a_limit_is_checked_before_anything_moves(limits, words):
    spy = Spy(limits=limits)
    with pytest.raises(LimitsError, match=words):
        run(spy, SINE)
    assert spy.moved == []


def test_a_jerk_limit_is_checked_where_there_is_one():
    wide = Limits(position=1.0, velocity=20.0, acceleration=200.0, unit="deg")
    gentle = design(band=(0.5, 5.0), duration=2.0, fs=200.0, limits=wide)
    jerk = gentle.peaks.jerk
    assert np.isfinite(jerk)
    run(Spy(limits=Limits(jerk=1.001 * jerk, unit="deg")), gentle)
    spy = Spy(limits=Limits(jerk=0.5 * jerk, unit="deg"))
    with pytest.raises(LimitsError, match=r"peak jerk .* deg/s³ is beyond .* scale .* by 0\.5,"):
        run(spy, gentle)
    with pytest.raises(LimitsError, match=r"peak jerk inf deg/s³ .*; it jumps, so take one that"):
        run(spy, SINE)
    assert spy.moved == []


@settings(max_examples=64, deadline=None)
@given(
    share=st.floats(0.5, 2.0).filter(lambda s: abs(s - 1) > 1e-6),
    which=st.sampled_from(["position", "velocity", "acceleration"]),
    unit=st.sampled_from(["deg", "rad", "mrad"]),
)
def test_played_if_and_only_if_every_limit_is_kept_in_any_unit(share, which, unit):
    peaks = {"position": 2.0, "velocity": RATE, "acceleration": ACCELERATION}
    spy = Spy(limits=Limits(**{which: share * peaks[which]}, unit="deg").to(unit))
    if share < 1:
        with pytest.raises(LimitsError, match=f"peak {which}"):
            run(spy, SINE)
    else:
        run(spy, SINE)
    assert len(spy.moved) == (share > 1)


@settings(max_examples=64, deadline=None)
@given(limit=st.floats(1e-6, 78.0))
def test_the_advice_of_the_message_does(limit):
    spy = Spy(limits=Limits(acceleration=limit, unit="deg"))
    with pytest.raises(LimitsError, match="scale the stimulus by") as caught:
        run(spy, SINE)
    scale = float(str(caught.value).split("scale the stimulus by ")[1].split(",")[0])
    assert scale == pytest.approx(limit / ACCELERATION, rel=2e-3)
    waveform = Sine(amplitude=2.0 * scale, frequency=1.0, duration=2.0)
    run(spy, Stimulus(waveform=waveform, fs=100.0, unit="deg"))
    assert len(spy.moved) == 1


def test_peaks_between_samples_count():
    # Sampled at its zero crossings, the sine looks like rest.
    waveform = Sine(amplitude=2.0, frequency=1.0, duration=2.0)
    blind = Stimulus(waveform=waveform, fs=2.0, unit="deg")
    assert np.abs(blind.position).max() < 1e-12
    with pytest.raises(LimitsError, match="peak position 2 deg"):
        run(Spy(limits=Limits(position=1.0, unit="deg")), blind)


@pytest.mark.parametrize("start", [0.0, 0.503])
def test_a_jump_is_beyond_any_limit_of_velocity_or_acceleration(start):
    step = Stimulus(waveform=Step(duration=1.0, start=start), fs=100.0, unit="deg")
    with pytest.raises(LimitsError, match="peak velocity 100 deg/s"):
        run(Spy(limits=Limits(velocity=99.0, unit="deg")), step)
    spy = Spy(limits=Limits(position=1.0, unit="deg"))
    run(spy, step)  # nothing bounds the velocity
    assert len(spy.moved) == 1


@pytest.mark.parametrize("lead", [0.0, "auto"])
@pytest.mark.parametrize("extinction", [0.0, 0.3, 0.83, 1.1])
@pytest.mark.parametrize("fs", [100.0, 5000.0])
def test_what_is_designed_inside_limits_never_counts_as_a_jump(lead, extinction, fs):
    limits = Limits(position=10, velocity=300, acceleration=5000, unit="deg")
    stimulus = design(
        band=(0.1, 20), duration=4, fs=fs, limits=limits, lead=lead, extinction=extinction
    )
    spy = Spy(limits=limits)
    run(spy, stimulus)
    assert len(spy.moved) == 1


def test_a_stimulus_designed_onto_the_limits_of_a_rig_is_played_by_it():
    limits = Limits(position=10, velocity=500, acceleration=8000, unit="deg")
    stimulus = design(band=(0.1, 20), duration=5, fs=200, limits=limits)
    for unit in ("deg", "rad", "arcsec"):
        spy = Spy(limits=limits.to(unit))
        run(spy, stimulus)
        assert len(spy.moved) == 1


@pytest.mark.parametrize(
    ("unit", "limits_unit", "words"),
    [
        ("", "deg", "stimulus is in no unit and the limits of 'pitch' are in 'deg'; state"),
        ("deg", "", "stimulus is in 'deg' and the limits of 'pitch' are in no unit; state"),
        ("m", "deg", "'m' cannot be turned into 'deg'"),
    ],
)
def test_limits_in_a_unit_that_cannot_be_compared_stop_the_run(unit, limits_unit, words):
    spy = Spy(limits=Limits(position=1e9, unit=limits_unit))
    with pytest.raises(UnitError, match=words):
        run(spy, Stimulus(waveform=SINE.waveform, fs=100.0, unit=unit))
    assert spy.moved == []


def test_a_failing_driver_is_told_as_the_rigs_own_error():
    fault = OSError("port closed")
    with pytest.raises(RigError, match="rig 'pitch' failed: OSError: port closed") as caught:
        run(Spy(fault=fault), SINE)
    assert caught.value.__cause__ is fault


def test_an_error_of_ours_passes_unchanged():
    stop = RigError("stopped by hand")
    with pytest.raises(RigError) as caught:
        run(Spy(fault=stop), SINE)
    assert caught.value is stop


def test_an_interrupt_is_not_swallowed():
    class Interrupted(Spy):
        def play(self, stimulus, *, rng):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run(Interrupted(), SINE)


def test_a_rig_must_return_a_record():
    with pytest.raises(RigError, match="rig 'pitch' returned list; it must be a Record"):
        run(Spy(returns=[1, 2]), SINE)


@pytest.mark.parametrize("rig", [None, abs, "sensor"])
def test_what_is_no_rig(rig):
    with pytest.raises(ArgumentError, match=r"is no rig; .* FunctionRig\(function=\.\.\.\)"):
        run(rig, SINE)


def test_what_is_no_stimulus():
    with pytest.raises(ArgumentError, match=r"is no Stimulus; make one with design"):
        run(Spy(), SINE.waveform)


def test_a_seed_makes_the_run_repeatable():
    rig = Sensor(noise_std=0.1)
    assert run(rig, SINE, rng=7).sha256 == run(rig, SINE, rng=7).sha256
    assert run(rig, SINE, rng=np.random.default_rng(7)).sha256 == run(rig, SINE, rng=7).sha256
    assert run(rig, SINE).sha256 != run(rig, SINE).sha256
    assert isinstance(run(rig, SINE), Record)
