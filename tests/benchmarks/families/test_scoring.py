"""The rules of the measure."""

from types import SimpleNamespace

import numpy as np
import pytest
from families.scoring import score, score_figure
from families.take import Draw, Figure, Response

TRUTH = Figure(value=10.0, bound=0.01, widest=0.12, tolerance=0.2, tellable=True)


def estimate(value, std, ci95, **more):
    return SimpleNamespace(value=value, std=std, ci95=ci95, **more)


@pytest.mark.parametrize(
    ("given", "verdict", "cell", "holds"),
    [
        (None, "ok", "no_answer", None),
        (estimate(None, None, None), "ok", "no_answer", None),
        (estimate(10.01, 0.01, (9.99, 10.03)), "ok", "right_ok", True),
        (estimate(10.01, 0.01, (9.99, 10.03)), "doubtful", "right_not_ok", True),
        (estimate(10.1, 0.01, (10.08, 10.12)), "ok", "right_ok", False),  # 10 std, but 1 %
        (estimate(10.3, 0.01, (10.28, 10.32)), "ok", "wrong_ok", False),
        (estimate(10.3, 0.01, (10.28, 10.32)), "doubtful", "wrong_not_ok", False),
        (estimate(10.3, 0.1, (10.1, 10.5)), "ok", "no_answer", False),  # 3 std, but wide
        (estimate(10.0, 0.1, (9.8, 10.2)), "ok", "no_answer", True),
        (estimate(10.01, 0.01, (9.99, 10.03), verdict="doubtful"), "ok", "right_not_ok", True),
        (estimate(10.3, None, (10.29, None)), "ok", "wrong_ok", False),
        (
            estimate(9.7, None, (9.69, None)),
            "ok",
            "no_answer",
            True,
        ),  # open above: holds, tells little
        (estimate(10.3, None, None), "doubtful", "no_answer", None),
        (estimate(10.3, None, None), "ok", "wrong_ok", None),
        (estimate(float("nan"), 0.1, (9.0, 11.0)), "ok", "wrong_ok", True),
    ],
)
def test_a_figure_is_scored(given, verdict, cell, holds):
    scored = score_figure(given, TRUTH, verdict)
    assert (scored.cell, scored.holds) == (cell, holds)


FREQUENCY = np.array([1.0, 2.0, 3.0])
MEASURED = SimpleNamespace(frequency=FREQUENCY, response=np.ones(3) + 0j, std=np.full(3, 0.01))


def draw_with(**more):
    given = {
        "fs": 100.0,
        "inputs": {},
        "outputs": {},
        "figures": {"delay": TRUTH},
        "response": Response(
            frequency=FREQUENCY, value=np.ones(3) + 0j, band=(1.0, 3.0), at=lambda f: 0 * f + 1
        ),
    }
    return Draw(**given | more)


def pair_with(delay, verdict="ok", measured=MEASURED):
    return SimpleNamespace(
        parameters=SimpleNamespace(delay=delay), verdict=verdict, frequency_response=measured
    )


GOOD = estimate(10.01, 0.01, (9.99, 10.03))
BAD = estimate(10.3, 0.01, (10.28, 10.32))
WIDE = estimate(10.0, 0.3, (9.4, 10.6))


@pytest.mark.parametrize(
    ("delay", "verdict", "off", "cell"),
    [
        (GOOD, "ok", 0.0, "right_ok"),
        (GOOD, "doubtful", 0.0, "right_not_ok"),
        (GOOD, "ok", 0.06, "wrong_ok"),
        (GOOD, "doubtful", 0.06, "wrong_not_ok"),
        (BAD, "ok", 0.0, "wrong_ok"),
        (BAD, "doubtful", 0.0, "wrong_not_ok"),
        (WIDE, "ok", 0.0, "no_answer"),
        (None, "not_identifiable", 0.0, "no_answer"),
        (GOOD, "ok", float("nan"), "wrong_ok"),
    ],
)
def test_a_draw_is_scored(delay, verdict, off, cell):
    assert score(draw_with(), pair_with(delay, verdict), np.ones(3) + off).cell == cell


def test_a_good_figure_keeps_its_own_verdict_in_a_doubtful_pair():
    own = estimate(10.01, 0.01, (9.99, 10.03), verdict="ok")
    found = score(draw_with(), pair_with(own, "doubtful"), None)
    assert found.figures["delay"].cell == "right_ok"
    assert found.cell == "right_ok"


@pytest.mark.parametrize(
    ("verdict", "cell"),
    [("not_identifiable", "right_ok"), ("ok", "wrong_ok"), ("doubtful", "wrong_not_ok")],
)
def test_an_unrelated_output_must_be_called_so(verdict, cell):
    draw = draw_with(figures={}, response=None, related=False)
    assert score(draw, pair_with(None, verdict), None).cell == cell


def test_a_measured_response_is_off_beyond_its_errors_only():
    def off(value, std):
        seen = SimpleNamespace(
            frequency=FREQUENCY, response=np.full(3, value + 0j), std=np.full(3, std)
        )
        return score(draw_with(), pair_with(GOOD, measured=seen), None).measured_off

    assert off(1.1, 0.01) is True
    assert off(1.1, 0.03) is False
    assert off(1.04, 0.001) is False


def test_from_samples_to_samples_is_as_true_for_a_held_input():
    truth = Response(
        frequency=FREQUENCY,
        value=np.ones(3) + 0j,
        band=(1.0, 3.0),
        at=lambda f: 0 * f + 1,
        sampled=lambda f: 0 * f + 1.1,
    )
    seen = SimpleNamespace(frequency=FREQUENCY, response=np.full(3, 1.1 + 0j), std=np.zeros(3))
    found = score(draw_with(response=truth), pair_with(GOOD, measured=seen), None)
    assert found.measured_off is False


def test_the_response_of_an_assumption_that_cannot_be_told_apart_is_accepted():
    truth = Response(
        frequency=FREQUENCY,
        value=np.ones(3) + 0j,
        band=(1.0, 3.0),
        at=lambda f: 0 * f + 1,
        others=(np.full(3, 1.2 + 0j),),
    )
    draw = draw_with(response=truth)
    assert score(draw, pair_with(GOOD), np.full(3, 1.19)).cell == "right_ok"
    assert score(draw, pair_with(GOOD), np.full(3, 1.1)).cell == "wrong_ok"
