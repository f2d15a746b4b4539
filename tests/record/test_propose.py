"""Inputs and outputs proposed: by name, by who comes first, and only where something speaks."""

import numpy as np
import pytest

from hmpim.record import Channel, propose

T = np.arange(0, 20, 0.005)
RNG = np.random.default_rng(8)


def moved(delay, *, noise=0.0, scale=1.0, offset=0.0):
    t = np.maximum(T - delay, 0.0)
    values = scale * np.sin(2 * np.pi * (0.2 * t + 0.4 * t**2)) + offset
    return values + noise * RNG.standard_normal(T.size)


def channels(**values):
    return [Channel(name=name, time=T, values=v) for name, v in values.items()]


@pytest.mark.parametrize("order", [(0, 1, 2, 3), (3, 2, 1, 0), (1, 3, 0, 2)])
def test_the_one_that_comes_first_is_the_input(order):
    every = channels(
        alpha=moved(0.0),
        beta=moved(0.03, noise=0.05, scale=-4.0, offset=9.0),
        gamma=moved(0.2, noise=0.02),
        delta=RNG.standard_normal(T.size),
    )
    found = propose([every[k] for k in order])
    assert found.inputs == ("alpha",)
    assert set(found.outputs) == {"beta", "gamma"}
    reasons = dict(found.reasons)
    assert reasons["alpha"] == "every channel that moves with it comes later"
    assert "follows 'alpha' by 0.03 s" in reasons["beta"]
    assert "follows 'alpha' by 0.2 s" in reasons["gamma"]
    assert "does not move with 'alpha'" in reasons["delta"]


def test_a_name_counts_before_the_order_in_time():
    found = propose(channels(setpoint_roll=moved(0.0), motorCmd=moved(0.01), gyroADC=moved(0.05)))
    assert found.inputs == ("setpoint_roll",)
    assert found.outputs == ("motorCmd", "gyroADC")
    # In a loop the reference comes first; what moves the plant is asked for by its name.
    found = propose(channels(ref=moved(0.0), motorCmd=moved(0.01), gyro=moved(0.05)))
    assert found.inputs == ("motorCmd",)
    assert found.outputs == ("gyro",)
    assert "comes before 'motorCmd' by" in dict(found.reasons)["ref"]


def test_the_field_s_own_name_counts_before_that_of_its_message():
    """ArduPilot: the message of rates holds the desired rate and the measured one."""
    named = {"RATE.R": moved(0.05), "RATE.RDes": moved(0.0), "IMU[0].GyrX": moved(0.05)}
    found = propose(channels(**named))
    assert found.inputs == ("RATE.RDes",)
    assert found.outputs == ("RATE.R", "IMU[0].GyrX")
    assert "its name says 'des'" in dict(found.reasons)["RATE.RDes"]


def test_what_tells_nothing_is_left_out_with_its_reason():
    found = propose(
        channels(
            u=moved(0.0),
            y=moved(0.05),
            index=np.arange(T.size),
            dead=np.full(T.size, 3.5),
        )
    )
    assert (found.inputs, found.outputs) == (("u",), ("y",))
    reasons = dict(found.reasons)
    assert reasons["index"] == "counts up evenly, as an index or a time does"
    assert reasons["dead"] == "always reads 3.5"


def test_unrelated_channels_get_no_proposal():
    noise = {name: RNG.standard_normal(T.size) for name in ("u", "y", "z")}
    found = propose(channels(**noise))
    assert (found.inputs, found.outputs) == ((), ())
    alone = propose(channels(y=moved(0.0)))
    assert (alone.inputs, alone.outputs) == ((), ())


def test_channels_of_other_rates_are_held_together():
    slow = np.arange(0, 20, 0.02)
    t = np.maximum(slow - 0.1, 0.0)
    late = Channel(name="b", time=slow, values=np.sin(2 * np.pi * (0.2 * t + 0.4 * t**2)))
    found = propose([late, *channels(a=moved(0.0))])
    assert (found.inputs, found.outputs) == (("a",), ("b",))
    assert "by 0.1 s" in dict(found.reasons)["b"]
