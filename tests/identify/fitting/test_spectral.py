"""The rough response as what structures are compared on: exact systems come out exactly."""

import numpy as np
import pytest

from hmpim.identify.fitting import spectral
from hmpim.identify.fitting.spectral import condensed, fitted_roughly, reweighted
from hmpim.identify.fitting.start import RoughResponse
from hmpim.model.dynamics import STRUCTURES, theta_of

OMEGA = 2 * np.pi * np.arange(1, 400) / 4096
DELAY, COEFFICIENTS = 7.3, np.array([6.0, 40.0])
ANSWER = np.exp(-1j * OMEGA * DELAY) / (1 + 6j * OMEGA - 40 * OMEGA**2)
TRUE = np.append(DELAY, theta_of(STRUCTURES["second_order"], COEFFICIENTS))


def rough(response, lag=0):
    """A rough response with the coarse delay taken off."""
    return RoughResponse(
        lag=lag,
        length=4096,
        bins=np.arange(1, 400),
        omega=OMEGA,
        response=response * np.exp(1j * OMEGA * lag),
        weight=np.ones(OMEGA.size),
    )


@pytest.mark.parametrize("lag", [0, 9])
def test_a_climb_ends_at_the_system_that_made_the_response(lag):
    starts = TRUE + np.array([[1.5, 0.3, -0.4], [30.0, 1.0, 0.0]])
    found = fitted_roughly(rough(2.0 * ANSWER, lag), STRUCTURES["second_order"], starts, steps=40)
    assert found.error < 1e-9
    assert found.likely[0] == pytest.approx(TRUE, rel=1e-4)


def test_starts_that_gain_nothing_more_cost_nothing_more(monkeypatch):
    """The first start is the truth, the second far behind it; the third climbs."""
    counts, errors = [], spectral._Rough.errors

    def counted(self, thetas):
        counts.append(len(thetas))
        return errors(self, thetas)

    monkeypatch.setattr(spectral._Rough, "errors", counted)
    starts = TRUE + np.array([[0.0, 0.0, 0.0], [60.0, 3.0, 0.0], [1.0, 0.2, 0.1]])
    answer = ANSWER * (1.0 + 0.1 * np.random.default_rng(0).normal(size=OMEGA.size))
    found = fitted_roughly(rough(answer), STRUCTURES["second_order"], starts)
    assert counts[0] == 3
    assert counts[-1] == 1
    assert found.likely[0] == pytest.approx(TRUE, rel=0.05)


def test_sanathanan_and_koerner_name_the_denominator_at_the_right_delay():
    errors, denominators = reweighted(
        rough(ANSWER), STRUCTURES["second_order"], np.array([DELAY - 2.0, DELAY])
    )
    assert np.argmin(errors) == 1
    scale = OMEGA[-1] ** np.arange(1, 3)
    assert denominators[1][1:] / scale == pytest.approx(COEFFICIENTS, rel=1e-4)


def test_grouped_bins_keep_weight_and_low_frequencies():
    whole = rough(ANSWER)
    fewer = condensed(whole)
    assert fewer.omega.size < whole.omega.size
    assert fewer.weight.sum() == pytest.approx(whole.weight.sum())
    assert fewer.response[:50] == pytest.approx(ANSWER[:50])


def test_a_response_of_nothing_is_no_error():
    found = fitted_roughly(rough(0.0 * ANSWER), STRUCTURES["second_order"], TRUE[None])
    assert found.error == 0.0


def test_a_numerator_that_takes_up_all_leaves_no_step_and_no_warning():
    """One frequency has two numbers, fewer than the numerator: what is left is rounding."""
    rng, modes = np.random.default_rng(0), STRUCTURES["eight_modes"]
    starts = np.column_stack([rng.uniform(0, 50, 2000), rng.uniform(-12, 12, (2000, modes.order))])
    one = RoughResponse(
        lag=0,
        length=4096,
        bins=np.arange(1, 2),
        omega=OMEGA[:1],
        response=1e9 * ANSWER[:1],
        weight=np.ones(1),
    )
    assert fitted_roughly(one, modes, starts).error < 1e-9
