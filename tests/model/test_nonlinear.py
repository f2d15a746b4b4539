"""The nonlinear part of a model: its equations against independent ones, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
import scipy

from hmpim.errors import ArgumentError
from hmpim.model import Model, NonlinearPart, draw_models, simulate
from hmpim.model.driven import driven
from hmpim.model.fine import FINE
from hmpim.model.nonlinear import forced
from hmpim.model.operators import power_of, pushed
from hmpim.model.sampled import prepare_input
from hmpim.model.spread import Spread

FS = 200.0
T = np.arange(1200) / FS
OMEGA, ZETA = 2 * np.pi * 6.0, 0.3
LAG = 0.004
"""Between the command and the force of a unit of third order, s."""
UNIT = Model(
    delay=0.02,
    scale_factor=1.5,
    denominator=(OMEGA**-2, 2 * ZETA / OMEGA, 1.0),
    bias=0.4,
    intersample="foh",
)


def wave(t: np.ndarray) -> np.ndarray:
    return 0.3 + np.sin(2 * np.pi * (0.2 * t + 0.8 * t**2))


def part(kind: str, at: str, size: float, **changes: object) -> NonlinearPart:
    given = {"kind": kind, "at": at, "size": size, "std": 0.01, "reach": 2.0, "between": "foh"}
    return NonlinearPart(**(given | changes))


@pytest.mark.parametrize(("kind", "size", "power"), [("hardening", 0.2, 3), ("asymmetry", -0.1, 2)])
def test_a_force_is_that_of_the_equation_of_motion(kind, size, power):
    """Against an integrator of ordinary differential equations, from the rest at 0.3."""
    model = replace(UNIT, nonlinear=part(kind, "force", size), delay=0.0)
    u = wave(T)

    def rest(z: float) -> float:
        return z + size * 2.0 * (z / 2.0) ** power - 1.5 * u[0]

    def rates(t, state):
        z, v = state
        pull = 1.5 * np.interp(t, T, u) - z - size * 2.0 * (z / 2.0) ** power
        return [v, OMEGA**2 * pull - 2 * ZETA * OMEGA * v]

    start = scipy.optimize.brentq(rest, 0.0, 1.0)
    solved = scipy.integrate.solve_ivp(
        rates, (0.0, T[-1]), [start, 0.0], t_eval=T, max_step=0.5 / FS, rtol=1e-9, atol=1e-11
    )
    found = simulate(model, u, fs=FS, intersample="foh")
    assert found == pytest.approx(solved.y[0] + 0.4, abs=1e-4)


@pytest.mark.parametrize("denominator", [UNIT.denominator, (0.03, 1.0), (1.0,)])
def test_step_by_step_a_force_is_the_fixed_point_of_its_row(denominator):
    """The row that identification fits, made from what it explains, is that again."""
    model = replace(UNIT, denominator=denominator)
    source = prepare_input(wave(T), "foh")
    parts = [driven(model.system, source, FS, early=k / FINE) for k in range(FINE)]
    x = np.stack(parts, axis=1).ravel()[: 1 - FINE]
    below = model.system.denominator * FS ** np.arange(len(denominator))
    slower = below * FINE ** np.arange(len(denominator))
    bend = part("hardening", "force", 0.1)
    z = x.copy()
    for _ in range(200):  # a fixed point by small steps
        z += 0.3 * (x - 0.1 * pushed(power_of(z, 3, 2.0), slower) - z)
    assert forced(bend, below, x) == pytest.approx((z - x)[::FINE], abs=1e-7)


def test_a_held_record_of_another_assumption_is_followed_as_such():
    """The command of a dead zone is held where that is asked, and not as it was identified."""
    model = replace(UNIT, nonlinear=part("dead_zone", "command", 0.2), denominator=(0.02, 1.0))
    u = np.repeat([0.0, 1.0, -0.5, 0.15, 0.7], 60)
    alive = np.sign(u) * np.maximum(np.abs(u) - 0.2, 0.0)
    found = simulate(model, u, fs=FS, intersample="zoh")
    exact = simulate(replace(model, nonlinear=None), alive, fs=FS, intersample="zoh")
    held = replace(model, nonlinear=replace(model.nonlinear, between="zoh"), intersample="zoh")
    assert found.tolist() == simulate(held, u, fs=FS, intersample="zoh").tolist()
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.02


@pytest.mark.parametrize("size", [0.1, 0.4])
@pytest.mark.parametrize(
    ("denominator", "lag"),
    [
        pytest.param(UNIT.denominator, 0.0, id="second order"),
        pytest.param((LAG * OMEGA**-2, *UNIT.denominator), LAG, id="lag in the loop"),
        pytest.param(tuple(np.polymul(UNIT.denominator, (LAG, 1.0))), LAG, id="lag of the command"),
    ],
)
def test_friction_step_by_step_is_that_in_closed_form(denominator, lag, size):
    rubs = part("friction", "force", size, lag=lag)
    model, u = replace(UNIT, denominator=denominator, nonlinear=rubs), wave(T)
    linear = replace(model, nonlinear=None)
    closed, plain = (simulate(one, u, fs=FS, intersample="foh") for one in (model, linear))
    effect = closed - plain
    stepped = model.simulate(u, T) - linear.simulate(u, T)
    assert np.std(stepped - effect) < 0.01 * np.std(effect)
    assert np.std(effect) > 0.3 * size


def test_friction_that_cannot_act_is_not_stepped():
    rubs = part("friction", "force", 0.1, lag=LAG)
    with pytest.raises(ArgumentError, match="it must be positive in a unit of third order, and 0"):
        replace(UNIT, nonlinear=rubs).simulate(wave(T), T)
    zero = replace(UNIT, numerator=(0.01, 1.0), nonlinear=part("friction", "force", 0.1))
    with pytest.raises(ArgumentError, match="without zeros; the numerator here is of degree 1"):
        zero.simulate(wave(T), T)


def test_draws_have_sizes_of_their_own():
    spread = Spread(covariance=np.diag([1e-12, 1e-12, 1e-16, 1e-14]).tolist(), bias=1e-3)
    model = replace(UNIT, nonlinear=part("backlash", "output", 0.1), spread=spread)
    sizes = [one.nonlinear.size for one in draw_models(model, 400, rng=1)]
    assert np.std(sizes) == pytest.approx(0.01, rel=0.15)
    assert np.mean(sizes) == pytest.approx(0.1, abs=0.002)


def test_what_cannot_be_is_refused():
    with pytest.raises(ArgumentError, match=r"size = -0\.1 of backlash must be more than 0"):
        part("backlash", "output", -0.1)
    with pytest.raises(ArgumentError, match="kind = 'saturation' is not a nonlinearity"):
        part("saturation", "output", 0.1)
    with pytest.raises(ArgumentError, match="reach = 0"):
        part("curvature", "output", 0.1, reach=0.0)
    u = wave(T)
    first = replace(UNIT, denominator=(0.02, 1.0), nonlinear=part("friction", "force", 0.1))
    with pytest.raises(ArgumentError, match="the denominator here is of degree 1"):
        simulate(first, u, fs=FS, intersample="foh")
    integrator = replace(
        UNIT, denominator=(0.02, 1.0, 0.0), nonlinear=part("hardening", "force", 0.1)
    )
    with pytest.raises(ArgumentError, match="needs a restoring force, which an integrator lacks"):
        simulate(integrator, u, fs=FS, intersample="foh")
    soft = replace(UNIT, nonlinear=part("softening", "force", 0.2))
    with pytest.raises(ArgumentError, match="a softening spring, known up to a deflection of 2"):
        simulate(soft, 5.0 * u, fs=FS, intersample="foh")
    held = replace(UNIT, nonlinear=part("backlash", "output", 0.1), hold_period=0.02)
    with pytest.raises(
        ArgumentError, match="backlash and a held output cannot be stepped together"
    ):
        held.simulate(u, T)
