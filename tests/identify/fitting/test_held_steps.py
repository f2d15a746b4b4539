"""A held input that steps through: what of a sample it is late, and the numerator, are one."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.fitting.fit import Problem, bounded_for
from hmpim.identify.fitting.held_steps import at_ends, kept_in_sample, steps_through
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.model import STRUCTURES, prepare_input
from tests_support import in_studies

FS = 1000.0
RNG = np.random.default_rng(0)
HELD = np.repeat(RNG.standard_normal(100), 3)


@pytest.mark.parametrize(
    ("name", "linear"),
    [
        ("first_order_zero", [1.2, 0.7, 0.1]),
        ("second_order_zeros", [1.2, 0.7, 2.0, 0.1]),
        ("washout", [2.0, 0.1]),
    ],
)
def test_either_end_of_the_sample_gives_the_same_samples(name, linear):
    structure = STRUCTURES[name]
    theta, linear = np.array([4.3, 1.1, 0.4])[: 1 + structure.order], np.array(linear)
    problem = Problem(
        source=prepare_input(HELD, "zoh"), y=0.0 * HELD, valid=None, longest_delay=50.0
    )
    here = part_of(problem, structure, theta).driven(linear[:-1])
    early, late = at_ends(structure, theta, linear)
    assert (early[0][0], late[0][0]) == pytest.approx((4.01, 4.99))
    for there, weights in (early, late):
        answer = part_of(problem, structure, there).driven(weights[:-1])
        assert answer == pytest.approx(here, abs=1e-12)


def test_a_pole_that_forgets_within_the_sample_gives_the_same_samples_too():
    structure, linear = STRUCTURES["second_order_zeros"], np.array([1.2, 0.7, 2.0, 0.1])
    theta = np.array([4.3, -6.0, 300.0])  # forgotten within a thousandth of a sample
    problem = Problem(
        source=prepare_input(HELD, "zoh"), y=0.0 * HELD, valid=None, longest_delay=50.0
    )
    here = part_of(problem, structure, theta).driven(linear[:-1])
    for there, weights in at_ends(structure, theta, linear):
        answer = part_of(problem, structure, there).driven(weights[:-1])
        assert answer == pytest.approx(here, abs=1e-9 * np.abs(here).max())


def test_only_a_held_input_of_proper_dynamics_steps_through():
    jumps = {name for name, one in STRUCTURES.items() if steps_through(one, held=True)}
    assert {"first_order_zero", "second_order_zeros", "washout"} <= jumps
    assert not jumps & {"static", "first_order", "second_order", "second_order_zero", "two_modes"}
    assert not any(steps_through(one, held=False) for one in STRUCTURES.values())


@pytest.mark.parametrize("late", [0.05, 0.95, *in_studies(0.45)])
def test_a_lead_lag_behind_a_converter_is_found(late):
    """The delay is somewhere in its sample, and all that hangs on it as wide."""
    model = hmpim.Model(
        delay=(5.0 + late) / FS,
        scale_factor=-1.2,
        numerator=(6e-5, 0.016, 1.0),
        denominator=(8.35e-5, 0.0256, 1.0),
    )
    u = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 400), 5)
    answer = model.simulate(u, np.arange(u.size) / FS, intersample="zoh")
    y = answer + 0.015 * np.random.default_rng(4).standard_normal(u.size)
    record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="zoh")
    pair = hmpim.identify(record)["y", "u"]
    assert pair.structure == "second_order_zeros"
    low, high = pair.delay.ci95
    assert (low, high) == pytest.approx((5e-3, 6e-3), abs=3e-5)
    assert low - 1e-5 <= model.delay <= high + 1e-5
    truth = {"scale_factor": -1.2, "natural_frequency": 1 / (2 * np.pi * 8.35e-5**0.5)}
    for name, value in truth.items():
        figure = getattr(pair, name)
        assert figure.ci95[0] <= value <= figure.ci95[1], name


@pytest.mark.parametrize("delay", [0.0123, 0.0, *in_studies(0.01)])
def test_a_high_pass_behind_a_converter_has_a_known_fraction_of_a_sample(delay):
    """One gain cannot imitate it, as the three coefficients of a lead-lag can."""
    natural = 2 * np.pi * 4.0
    model = hmpim.Model(
        delay=delay,
        scale_factor=2.0 / natural**2,
        numerator=(1.0, 0.0, 0.0),
        denominator=(1.0 / natural**2, 1.2 / natural, 1.0),
    )
    u = np.repeat(np.random.default_rng(3).choice([-1.0, 1.0], 400), 5)
    answer = model.simulate(u, np.arange(u.size) / 200.0, intersample="zoh")
    y = answer + 0.02 * np.random.default_rng(4).standard_normal(u.size)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0))["y", "u"]
    assert (pair.structure, pair.verdict) == ("second_order_high_pass", "ok")
    assert pair.scale_factor.unit == "s^2"
    assert pair.delay.std < 1e-4
    truth = {"delay": delay, "scale_factor": 2.0 / natural**2}
    for name, value in truth.items():
        figure = getattr(pair, name)
        assert abs(figure.value - value) < 4.0 * figure.std, name


def test_a_start_far_outside_the_record_is_brought_inside():
    """Of a washout that a numerator without weight put two thousand million samples ahead."""
    u = np.sign(np.sin(0.1 * np.arange(300)))
    problem = Problem(source=prepare_input(u, "zoh"), y=u, valid=None, longest_delay=50.0)
    kept = kept_in_sample(problem, STRUCTURES["washout"], np.array([-2e9, 3.0]))
    assert kept.shortest_delay == kept.longest_delay == np.floor(problem.shortest_delay) + 0.5


@pytest.mark.parametrize(("mode", "kept"), [("zoh", False), ("bandlimited", True)])
def test_a_mode_that_samples_of_a_held_response_show_as_its_alias_is_slower(mode, kept):
    structure, fast = STRUCTURES["second_order"], np.array([4.3, np.log(0.05), 10.0])
    source = prepare_input(HELD, mode)
    problem = Problem(source=source, y=0.0 * HELD, valid=None, longest_delay=50.0)
    bounded = bounded_for(problem, structure, fast.copy())
    lag, shape = np.exp(bounded[1]), bounded[2]
    poles = np.roots([shape * lag**2, lag, 1.0])
    assert np.array_equal(bounded, fast) == kept
    assert (np.abs(poles.imag).max() <= np.pi + 1e-9) != kept
