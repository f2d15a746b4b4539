"""Software under test: fed as it is in service, and its failures told by sample."""

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RigError, UnitError
from hmpim.experiment import run
from hmpim.rigs import FunctionRig, Rig
from hmpim.stimulus import Ramp, Sine, Stimulus

STIMULUS = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=50.0, unit="deg")


def play(rig, stimulus=STIMULUS):
    return run(rig, stimulus)


class Smoother:
    """y[k] = 0.9 y[k-1] + 0.1 u[k], an algorithm with a memory."""

    def __init__(self):
        self.reset()

    def reset(self):
        self.y = 0.0

    def __call__(self, u):
        self.y = 0.9 * self.y + 0.1 * u
        return self.y


def test_an_algorithm_with_a_memory_is_fed_in_order():
    record = play(FunctionRig(function=Smoother(), mode="sample"))
    n = STIMULUS.samples
    weights = 0.1 * 0.9 ** np.arange(n)
    truth = np.convolve(weights, STIMULUS.position)[:n]
    assert np.allclose(record.outputs[0].values, truth, rtol=0, atol=1e-12)


def test_reset_makes_each_run_the_same():
    smoother = Smoother()
    rig = FunctionRig(function=smoother, mode="sample", reset=smoother.reset)
    assert play(rig).sha256 == play(rig).sha256
    without = FunctionRig(function=smoother, mode="sample")
    assert play(without).sha256 != play(rig).sha256  # it goes on from where it stood


def test_both_modes_agree_on_a_function_without_memory():
    whole = play(FunctionRig(function=np.tanh))
    single = play(FunctionRig(function=np.tanh, mode="sample"))
    assert np.allclose(whole.outputs[0].values, single.outputs[0].values, rtol=1e-15)


def test_a_function_cannot_spoil_the_recorded_input():
    def rude(u):
        u[:] = 0.0
        return u

    assert np.array_equal(play(FunctionRig(function=rude)).inputs[0].values, STIMULUS.position)


def test_the_record_says_what_was_fed():
    rig = FunctionRig(function=np.negative, measures="velocity", output_unit="V", name="tracker")
    record = play(rig)
    assert np.array_equal(record.outputs[0].values, -STIMULUS.velocity)
    assert (record.inputs[0].unit, record.outputs[0].unit) == ("deg/s", "V")
    assert (record.source, record.intersample) == ("function tracker", None)
    assert isinstance(rig, Rig)


def fails_at_three(u):
    if u > 0.29:
        raise KeyError("lost track")
    return u


@pytest.mark.parametrize(
    ("rig", "words"),
    [
        (
            FunctionRig(function=fails_at_three, mode="sample"),
            "'function' failed at sample 3, for the input 0.3: KeyError: 'lost track'",
        ),
        (FunctionRig(function=fails_at_three), "'function' failed: ValueError"),
        (FunctionRig(function=lambda u: u[:-1]), r"returned shape \(9,\) for .* shape \(10,\)"),
        (FunctionRig(function=lambda u: None), "'function' failed: TypeError|returned shape"),
        (FunctionRig(function=lambda u: u / 0 if u > 0.45 else u, mode="sample"), "at sample 5"),
        (
            FunctionRig(function=lambda u: np.where(u > 0.45, np.nan, u)),
            r"returned nan at sample 5, for the input 0.5 \(5 in all\)",
        ),
        (FunctionRig(function=lambda u: "a", mode="sample"), "failed at sample 0"),
        (FunctionRig(function=lambda u: None, mode="sample"), "sample 0.*it returned None"),
        (FunctionRig(function=lambda u: np.complex128(u), mode="sample"), "sample 0.*not a real"),
        (FunctionRig(function=lambda u: 1j * u), "it returned 0j, which is not a real number"),
        (FunctionRig(function=lambda u: [None] * u.size), "it returned None, which is not a real"),
    ],
)
def test_failures_are_told_with_their_place(rig, words):
    ramp = Stimulus(waveform=Ramp(duration=1.0), fs=10.0)
    with pytest.raises(RigError, match=words):
        play(rig, ramp)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"function": 3}, "function = 3 is not a function"),
        ({"function": abs, "mode": "block"}, "mode = 'block' is not one of 'array', 'sample'"),
        ({"function": abs, "measures": "jerk"}, "measures = 'jerk' is not one of 'position'"),
    ],
)
def test_what_cannot_be_is_refused(wrong, words):
    with pytest.raises(ArgumentError, match=words):
        FunctionRig(**wrong)


def test_an_unknown_unit_is_refused():
    with pytest.raises(UnitError, match="furlongz"):
        FunctionRig(function=abs, output_unit="furlongz")
