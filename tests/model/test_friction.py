"""Friction: closed form between reversals against small steps of time."""

import numpy as np
import pytest
import scipy

from hmpim.errors import ArgumentError
from hmpim.model.fine import FINE
from hmpim.model.friction import Rubbing, rubbed
from tests_support import in_studies

SECOND = np.array([1.0, 4.0, 16.0])
SERVO = np.array([1.0, 8.0, 32.0, 64.0])
COMMAND_LAG = np.array([1.0, 7.0, 28.0, 48.0])  # (1 + 3 s) (1 + 4 s + 16 s²)

UNITS = [
    pytest.param(Rubbing(denominator=SECOND, lag=0.0), id="second order"),
    pytest.param(Rubbing(denominator=SERVO, lag=2.0), id="lag in the loop"),
    pytest.param(Rubbing(denominator=COMMAND_LAG, lag=3.0), id="lag of the command"),
]


def commands(kind: str) -> np.ndarray:
    t = np.arange(600 * FINE) / FINE
    if kind == "sweep":
        return np.sin(2 * np.pi * (0.002 + 4e-5 * t) * t)
    noise = np.random.default_rng(4).standard_normal(t.size)
    smooth = scipy.signal.lfilter(*scipy.signal.butter(3, 0.06, fs=FINE), noise)
    smooth[: 3 * FINE] = 0.0
    return smooth / smooth.std()


def stepped(command: np.ndarray, unit: Rubbing, force: float) -> tuple[np.ndarray, np.ndarray]:
    """Output and motion of a unit, by small steps of time, on the finer clock."""
    d, lag, fine = unit.denominator, unit.lag, 60
    inertia = d[-1] / (lag or 1.0)
    dt = 1.0 / (FINE * fine)
    y = v = w = 0.0
    out, moves = [], []
    for k in range(command.size - 1):
        out.append(y)
        moves.append(v != 0.0)
        for i in range(fine):
            wanted = command[k] + (command[k + 1] - command[k]) * (i + 0.5) / fine
            if not lag:
                w = wanted - y - d[1] * v
            stuck = v == 0.0 and abs(w) <= force
            grip = w if stuck else np.copysign(force, v if v else w)
            if lag:
                share = d[2] / inertia
                w += (wanted - y - d[1] * v - share * w - (1.0 - share) * grip) / lag * dt
            if stuck:
                continue
            faster = v + (w - grip) / inertia * dt
            v = 0.0 if faster * v < 0.0 else faster
            y += v * dt
    return np.array(out), np.array(moves)


def linear(command: np.ndarray, unit: Rubbing) -> np.ndarray:
    system = scipy.signal.cont2discrete(([1.0], unit.denominator[::-1]), 1 / FINE, method="foh")
    return scipy.signal.lfilter(system[0][0], system[1], command)


@pytest.mark.parametrize("kind", ["sweep", *in_studies("noise")])
@pytest.mark.parametrize("unit", UNITS)
def test_sliding_and_sticking_as_by_small_steps_of_time(unit, kind):
    command = commands(kind)
    x = linear(command, unit)
    effect, moves = rubbed(x, unit, 0.2)
    y, moved = stepped(command, unit, 0.2)
    assert np.std((x + effect)[:-1] - y) < 0.01 * np.std(effect)
    assert np.mean(moves[:-1] != moved) < 0.03
    assert 0.3 < np.mean(moves) < 1.0


@pytest.mark.parametrize("unit", UNITS)
def test_a_motion_smaller_than_friction_never_begins(unit):
    x = 0.05 * linear(commands("sweep"), unit)
    effect, moves = rubbed(x, unit, 0.2)
    np.testing.assert_allclose(x + effect, 0.0, atol=1e-12)
    assert not moves.any()


@pytest.mark.parametrize("unit", UNITS)
def test_friction_that_does_not_change_direction_is_a_constant(unit):
    """A record that begins in motion, and never turns."""
    x = np.arange(2000.0) / FINE
    effect, moves = rubbed(x, unit, 0.2)
    assert moves.all()
    np.testing.assert_allclose(effect[-1], -0.2, rtol=1e-4)


@pytest.mark.parametrize(
    ("denominator", "lag", "what"),
    [
        ([1.0, 2.0], 0.0, "degree 1"),
        ([0.0, 1.0, 2.0], 0.0, "returns to its command"),
        ([1.0, 2.0, 3.0], 0.5, "0 in one of second"),
        ([1.0, 2.0, 3.0, 4.0], 0.0, "positive in a unit of third"),
    ],
)
def test_dynamics_without_a_place_for_friction(denominator, lag, what):
    with pytest.raises(ArgumentError, match=what):
        Rubbing(denominator=np.array(denominator), lag=lag)
