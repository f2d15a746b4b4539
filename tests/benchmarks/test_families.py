"""The measure itself: its simulator, its bound, its rules."""

from types import SimpleNamespace

import numpy as np
import pytest
from families.bound import derivatives, information
from families.catalogue import FAMILIES
from families.drive import Drive, Lines, Samples
from families.noise import Noise, pink, white
from families.scoring import score_figure
from families.simulate import linear_output
from families.study import draw_of
from families.system import System, figures
from families.table import at_least, at_most
from families.take import Figure

FS = 100.0


def held(values, **more):
    source = Samples(np.asarray(values, float), FS)
    given = {"between": "zoh", "band": (0.1, 40.0), "fs": FS, "samples": 400, **more}
    return Drive(source=source, **given)


def sine(frequency, **more):
    """Going since long ago."""
    return Drive(
        source=lambda t: np.sin(2 * np.pi * frequency * t),
        between="smooth",
        band=(frequency, frequency),
        fs=FS,
        samples=400,
        quiet=False,
        **more,
    )


SYSTEMS = {
    "first": System(delay=0.0234, gain=-2.0, bias=0.7, lags=(0.11,)),
    "second": System(delay=-0.031, gain=1.5, pairs=((4.0, 0.05),)),
    "zeros": System(delay=0.01, pairs=((4.0, 0.4),), leads=(-0.05,), lags=(0.3,)),
    "dip": System(delay=0.01, pairs=((3.0, 0.2), (7.0, 0.1)), zero_pairs=((5.0, 0.1),)),
    "washout": System(delay=0.013, gain=0.4, lags=(0.4,), washouts=1),
    "modes": System(delay=0.013, modes=((1.0, 3.0, 0.1), (-0.4, 6.0, 0.05), (0.3, 9.0, 0.2))),
    "static": System(delay=0.013, gain=3.0),
}


@pytest.mark.parametrize("name", SYSTEMS)
def test_a_sine_comes_out_as_the_response_says(name):
    system, f = SYSTEMS[name], 3.7
    t = np.arange(400) / FS
    expected = (system.response(np.array([f]))[0] * np.exp(2j * np.pi * f * t)).imag + system.bias
    assert linear_output(system, sine(f)) == pytest.approx(expected, abs=1e-8)


def test_a_held_step_of_first_order_is_an_exponential():
    values = np.r_[np.zeros(20), np.ones(380)]
    system = System(delay=0.1234, gain=2.0, bias=0.5, lags=(0.2,))
    t = np.arange(400) / FS - 0.2 - 0.1234
    expected = 0.5 + 2.0 * np.where(t > 0, -np.expm1(-t / 0.2), 0.0)
    assert linear_output(system, held(values)) == pytest.approx(expected, abs=1e-12)


def test_a_ramp_between_samples_through_an_integrator_is_a_parabola():
    values = np.r_[np.zeros(20), np.arange(380)] / FS
    system = System(delay=0.055, gain=3.0, integrators=1)
    t = np.maximum(np.arange(400) / FS - 0.2 - 0.055, 0.0)
    y = linear_output(system, held(values, between="foh"))
    assert y == pytest.approx(1.5 * t**2, abs=1e-12)


def test_band_limited_lines_pass_through_their_samples_and_between_them():
    t = np.arange(200) / FS
    through = Lines.through(np.cos(2 * np.pi * 2 * t + 0.3), FS)
    assert through(t + 0.0037) == pytest.approx(np.cos(2 * np.pi * 2 * (t + 0.0037) + 0.3))


def test_figures_in_closed_form():
    found = figures(System(delay=0.15, pairs=((10.0, 0.4),), bias=0.6), top=50.0)
    assert found["bandwidth_phase90"] == pytest.approx(1.534013130377, abs=1e-10)
    assert found["bandwidth_phase90_without_delay"] == pytest.approx(10.0)
    assert found["peak_gain_db"] == pytest.approx(-20 * np.log10(0.8 * np.sqrt(1 - 0.16)))
    assert found["delay_low_frequency"] == pytest.approx(0.15 + 0.8 / (20 * np.pi))
    one = figures(System(delay=0.0, lags=(0.1,)), top=50.0)
    assert one["bandwidth_3db"] == pytest.approx(1 / (0.2 * np.pi))
    assert one["time_constant"] == pytest.approx(0.1)
    assert "bandwidth_phase90_without_delay" not in one
    assert "scale_factor" not in figures(SYSTEMS["washout"], top=50.0)


def test_noise_has_the_covariance_it_states():
    noise = Noise(parts=((1.0, 0.9, 0.5), (0.5, 0.0, 0.0)))
    rng = np.random.default_rng(1)
    draws = np.stack([noise.draw(40, rng) for _ in range(20_000)])
    seen = draws.T @ draws / 20_000
    assert seen[10, 10:16] == pytest.approx(noise.covariance(np.arange(6)), abs=0.05)
    assert pink(1000).variance == pytest.approx(1.0)


@pytest.mark.parametrize("colour", [white(), Noise(parts=((1.0, 0.95, 0.0),))])
def test_a_fit_that_knows_the_truth_scatters_as_the_bound_says(colour):
    """Gauss and Newton from the truth, the noise's covariance known: the best there is."""
    system = System(delay=0.1, gain=1.5, bias=0.3, pairs=((3.0, 0.3),))
    drive = held(np.random.default_rng(0).standard_normal(400))
    vector = system.vector()
    steps = np.array([1e-5, 1e-5, 1e-5, 1e-5, 1.0])

    def output(v):
        return linear_output(system.moved(v), drive)

    rows = derivatives(output, vector, steps)
    noise = colour.scaled(0.02)
    covariance = information(rows, noise, valid=None)
    gain = covariance @ noise.solve(rows).T
    rng, found = np.random.default_rng(2), []
    for _ in range(150):
        y = output(vector) + noise.draw(400, rng)
        here = vector + gain @ (y - output(vector))
        found.append(here + gain @ (y - output(here)) - vector)
    z = np.array(found) / np.sqrt(np.diag(covariance))
    assert np.abs(z.mean(axis=0)).max() < 0.35
    assert z.std(axis=0) == pytest.approx(np.ones(5), abs=0.22)


def test_what_a_record_does_not_show_has_no_bound():
    rows = np.stack([np.ones(50), np.zeros(50)], axis=1)
    covariance = information(rows, white(), valid=None)
    assert covariance[0, 0] == pytest.approx(1 / 50)
    assert np.isinf(covariance[1, 1])


TRUTH = Figure(value=10.0, bound=0.01, widest=0.12, tolerance=0.2, tellable=True)


def estimate(value, std, ci95, **more):
    return SimpleNamespace(value=value, std=std, ci95=ci95, **more)


@pytest.mark.parametrize(
    ("given", "verdict", "cell", "holds"),
    [
        (None, "ok", "no_answer", None),
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


def test_clopper_and_pearson():
    assert at_least(0, 50) == 0.0
    assert at_most(0, 50) == pytest.approx(1 - 0.05 ** (1 / 50))
    assert at_least(50, 50) == pytest.approx(0.05 ** (1 / 50))


@pytest.mark.parametrize("name", ["second order", "mid-sweep", "PRBS held"])
def test_a_draw_depends_on_family_seed_and_index_alone(name):
    family = FAMILIES[name]
    first, again = draw_of(family, 3, 2), draw_of(family, 3, 2)
    other = draw_of(family, 4, 2)
    assert np.array_equal(first.outputs["y"][1], again.outputs["y"][1])
    assert {k: f.value for k, f in first.figures.items()} == {
        k: f.value for k, f in again.figures.items()
    }
    assert not np.array_equal(first.outputs["y"][1][:50], other.outputs["y"][1][:50])
