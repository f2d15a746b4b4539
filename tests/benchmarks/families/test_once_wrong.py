"""Draws that were called ok and were wrong, one for each mechanism that mends them."""

import numpy as np
import pytest
from families.catalogue import BESIDE_ANOTHER, FAMILIES
from families.kinds import lagging_integrator, sequence, set_samples
from families.study import draw_of, identified, one
from families.take import finish, shoot

from tests_support import in_studies


@pytest.mark.parametrize(
    ("family", "seed", "index"),
    [
        ("first order, held sweep", 403, 0),  # a second pole stands in for a held input
        ("non-minimum phase", 403, 13),  # the plainer structure is almost as likely
        ("3-2-1-1", 222, 5),
        ("second order with a zero", 403, 11),  # a held input hides that a zero is missing
        ("thermal", 404, 0),  # a slow pole stands for the drift, and is not the axis's
        ("50 to 120 samples", 404, 4),  # as many polynomials as cycles are no drift
        ("clean", 222, 8),  # a spline rings for long at the end of a sweep
        ("spikes", 404, 26),  # a spike beside motion as fast as it is high
        ("ramp", 404, 5),  # a second order is asked for, but not for the price of its poles
        ("by chance", 406, 24),  # a zero that hardly shows moves the delay
        ("by chance, more", 408, 67),  # a lead-lag steps through: the likelihood jumps
        ("noisy", 404, 9),  # a pole that would not show moves the -3 dB bandwidth too
        ("two inputs, mid-sweep", 883, 38),  # a drift stands for what the record begins with
        ("two inputs, missing", 883, 9),  # few samples are known, and early ones
        ("two inputs, missing", 1013, 41),  # few samples that answer known input tell less than all
        ("by chance", 1001, 36),  # and zeros do
        ("by chance", 1003, 22),  # a sequence went to and fro in a gap
        *in_studies(
            ("Bessel", 403, 2),  # a linear input stands in for a fifth pole
            ("slew", 404, 29),  # two modes stand in for a limit of speed
            ("1/f", 404, 2),  # what the noise does below its lowest bins moves the bias
            ("noisy", 404, 28),
            ("by chance", 406, 79),  # a spike that is clipped is none of the plateau
            ("two inputs, drift", 881, 35),  # a free response begins as a warm-up does
            ("by chance, two inputs", 1021, 28),  # plain dynamics and a drift stand for a washout
            ("two inputs, drift", 881, 49),  # another input's poles stand for a drift
            ("by chance, more", 1021, 66),  # the plain fit forgets sooner than the washout does
            ("by chance", 1001, 24),  # a fifth pole stands for a linear input
            ("by chance, more", 1001, 56),  # what is left of a drift counts as noise
            ("by chance, two inputs", 1021, 72),  # and for the free response that it begins with
            ("Bessel", 222, 0),  # a linear input stands in for a third pole
            ("Bessel", 404, 6),  # a sixth pole would not show, and takes of the delay
            ("spikes", 404, 45),
            ("1/f", 404, 23),
            ("ramp", 404, 26),
            ("by chance, more", 408, 101),  # the likelihood jumps under the other assumption too
        ),
    ],
)
def test_a_draw_that_was_wrong_and_ok_is_not(family, seed, index):
    assert one(family, seed, index, True).cell != "wrong_ok"


def test_the_plainer_structure_that_is_almost_as_likely_is_named_and_covered():
    draw = draw_of(FAMILIES["non-minimum phase"], 403, 13)
    pair = identified(draw).pairs[0]
    low, high = pair.parameters.delay.ci95
    assert low < draw.figures["delay"].value < high
    said = [w.message for w in pair.warnings if w.code == "structure"]
    assert any("barely distinguishes" in text and "with a zero" in text for text in said)


def test_what_the_fit_leaves_over_and_would_be_doubted_for_is_explained():
    draw = draw_of(FAMILIES["second order with a zero"], 403, 11)
    pair = identified(draw).pairs[0]
    assert pair.structure == "second_order_zero"
    assert pair.verdict == "ok"


@pytest.mark.parametrize(
    ("family", "seed", "index"),
    [
        ("by chance", 1003, 87),  # a slow pole stood for a drift beside a zero
        ("by chance, more", 1003, 36),  # an integrator that explains nothing left white noise
        # Many poles had to leave white noise beside another input.
        *in_studies(("two inputs, modes", 1, 0)),
    ],
)
def test_a_draw_that_was_doubted_and_wrong_is_right(family, seed, index):
    assert one(family, seed, index, True).cell == "right_ok"


@pytest.fixture
def usual_length_afterwards():
    """Records drawn after the test are as long as usual."""
    yield
    set_samples(None)


@pytest.mark.parametrize(
    "index",
    [
        5,  # two zeros did for a fourth pole
        6,  # backlash did for a third and a fourth
        *in_studies(0),  # a linear input stood in for a fifth
    ],
)
def test_a_long_record_shows_all_poles(index, usual_length_afterwards):
    assert one("Bessel", 1183, index, True, samples=10_000).cell == "right_ok"


@pytest.mark.study
def test_white_noise_is_kept_where_another_turn_of_two_inputs_leaves_more(
    usual_length_afterwards,
):
    assert one("by chance, two inputs", 78, 0, True, samples=10_000).cell == "right_ok"


def test_two_modes_are_grown_where_a_clipped_record_begins_in_motion():
    assert one("by chance", 404, 9, True).cell == "right_ok"


@pytest.mark.parametrize("index", [7, 31])
def test_the_scale_of_a_record_of_120_db_holds(index):
    # The window that interpolated the input was off at DC by more than the noise is.
    draw = draw_of(FAMILIES["clean"], 404, index)
    low, high = identified(draw).pairs[0].parameters.scale_factor.ci95
    assert low < draw.figures["scale_factor"].value < high


def test_an_integrator_is_found_beside_another_input():
    """A sum correlates little with its input, and its pole is as slow as the record, as a drift."""
    rng = np.random.default_rng(3)
    drive = sequence("fast_prbs")(rng)
    take = shoot(rng, lagging_integrator(rng, drive), drive, snr_db=40.0)
    BESIDE_ANOTHER(take)
    draw = finish(take)
    pair = identified(draw).pairs[0]
    truth = draw.figures["scale_factor"].value
    assert pair.structure.startswith("integrator")
    assert pair.scale_factor.value == pytest.approx(truth, rel=0.02)
