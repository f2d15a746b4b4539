"""Phase margins with and without what stands in the loop, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.model import Model, Spread, add_to_loop

F = np.geomspace(0.05, 40.0, 4000)
LOOP = 2 * np.pi * 2.0 / (2j * np.pi * F)  # gain 1 at 2 Hz, 90 degrees


def test_a_delay_takes_its_phase_at_the_crossover():
    found = add_to_loop((F, LOOP), [Model(delay=0.02, scale_factor=1.0)])
    assert found.margin_without.value == pytest.approx(90.0, abs=1e-6)
    assert found.crossover_without.value == pytest.approx(2.0, rel=1e-5)
    assert found.margin_with.value == pytest.approx(90.0 - 360 * 2.0 * 0.02, abs=0.01)
    assert found.gain_db == pytest.approx(np.zeros(F.size), abs=1e-9)
    assert found.phase == pytest.approx(-360 * F * 0.02, abs=1e-6)  # many turns, none lost


def test_gain_moves_the_crossover_and_a_lag_does_both():
    twice = add_to_loop((F, LOOP), [Model(delay=0.01, scale_factor=2.0)])
    assert twice.crossover_with.value == pytest.approx(4.0, rel=1e-4)
    assert twice.margin_with.value == pytest.approx(90.0 - 360 * 4.0 * 0.01, abs=0.01)
    lag = Model(delay=0.0, scale_factor=1.0, denominator=(0.05, 1.0))
    found = add_to_loop((F, LOOP), [lag])
    x = (np.sqrt(0.5 * (np.sqrt(1 + 4 * (0.05 * 4 * np.pi) ** 2) - 1))) / 0.05  # rad/s
    assert found.crossover_with.value == pytest.approx(x / (2 * np.pi), rel=1e-4)
    assert found.margin_with.value == pytest.approx(90 - np.degrees(np.arctan(0.05 * x)), abs=0.01)


def test_a_held_command_adds_half_its_period():
    still = Model(delay=0.0, scale_factor=1.0)
    commanded = add_to_loop((F, LOOP), [still], command_rate=50.0)
    framed = add_to_loop((F, LOOP), [replace(still, hold_period=0.02)])
    for found in (commanded, framed):
        assert found.phase == pytest.approx(-180 * F * 0.02, abs=1e-6)
    both = add_to_loop((F, LOOP), [still, replace(still, hold_period=0.02)], command_rate=50.0)
    assert both.phase == pytest.approx(-360 * F * 0.02, abs=1e-6)


def test_the_interval_is_that_of_what_is_uncertain():
    f, std = F[::20], 1e-3
    known = Spread(covariance=((std**2, 0.0), (0.0, 1e-18)))
    table = Model(delay=0.02, scale_factor=1.0, spread=known)
    found = add_to_loop((f, LOOP[::20]), [table], draws=1000, rng=1)
    half = 1.96 * 360 * 2.0 * std
    low, high = found.margin_with.ci95
    assert low == pytest.approx(75.6 - half, abs=0.15)
    assert high == pytest.approx(75.6 + half, abs=0.15)
    assert found.margin_without.ci95 == (found.margin_without.value,) * 2
    twice = add_to_loop((f, LOOP[::20]), [table, table], draws=1000, rng=1)
    low, high = twice.margin_with.ci95
    assert high - low == pytest.approx(2 * np.sqrt(2) * half, rel=0.1)


@pytest.mark.parametrize(
    ("loop", "words"),
    [
        ((F, 0.01 * LOOP), r"does not fall through 1 between 0\.05 and 40 Hz"),
        ((F, LOOP[:-1]), r"frequencies of shape \(4000,\) and a response of shape \(3999,\)"),
        ((F[::-1], LOOP), "must rise from above 0"),
        ((F, 0 * LOOP), "is 0 somewhere"),
        ("ab", r"must be \(frequency, response\)"),
    ],
)
def test_what_is_no_loop_is_refused(loop, words):
    with pytest.raises(ArgumentError, match=words):
        add_to_loop(loop, [])
