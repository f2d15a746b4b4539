"""How far a nonlinearity moves a linear fit: against the linear part, and on linear records."""

import numpy as np
import pytest

from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.nonlinear.bends import bends
from hmpim.model import STRUCTURES, prepare_input
from hmpim.model.operators import rate_limited
from hmpim.model.sampled import delayed_response

FS = 200.0
T = np.arange(2000) / FS
SWEEP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T)) / (1 + 0.3 * T)
DELAY, TIME, SHAPE = 6.0, np.log(0.8 / (2 * np.pi * 10) * FS), 1 / (4 * 0.16)
TRUTH = np.array([DELAY, TIME, SHAPE, 1.0, 0.0])
AXIS = np.array([1.0, np.exp(TIME), SHAPE * np.exp(2 * TIME)])


def through(u, delay=DELAY):
    """10 Hz, ζ 0.4, of an input that is linear between its samples."""
    source = prepare_input(u, "foh")
    return delayed_response(source, delay=delay, denominator=AXIS)[0] + source.first


def hardened(u, size):
    """The same with a spring that hardens: its force once more through the axis, to rest."""
    y = through(u)
    for _ in range(20):
        y = through(u) - size * through(y**3, delay=0.0)
    return y


BENT = {
    "dead_zone": lambda u: through(u - np.clip(u, -0.03, 0.03)),
    "rate_limit": lambda u: through(rate_limited(u, 0.9 * np.max(np.abs(np.diff(u))))),
    "hardening": lambda u: hardened(u, 0.03),
}


def found(u, y, *, floor=0.0):
    data = Problem(source=prepare_input(u, "foh"), y=y, valid=None, longest_delay=90.0)
    fit = fit_structure(data, STRUCTURES["second_order"], TRUTH[:3], precision=1e-9)
    return fit, bends(u, data, fit, intersample="foh", floor=floor)


@pytest.mark.parametrize("kind", BENT)
def test_the_kind_is_named_and_what_it_moves_is_most_of_what_is_off(kind):
    noise = 0.002 * np.random.default_rng(1).standard_normal(SWEEP.size)
    fit, kinds = found(SWEEP, BENT[kind](SWEEP) + noise)
    best = kinds[0]
    assert best.kind == kind
    assert best.certain
    error = np.concatenate([fit.theta, fit.linear]) - TRUTH
    worst = int(np.argmax(np.abs(error[1:]))) + 1
    assert abs(error[worst] + best.moved[worst]) < 0.35 * abs(error[worst])
    effect = np.std(BENT[kind](SWEEP) - through(SWEEP)) / np.std(through(SWEEP))
    assert best.effect == pytest.approx(effect, rel=0.4)


@pytest.mark.few(8)
def test_a_linear_unit_is_not_accused(seeds):
    clean = through(SWEEP)
    for seed in range(seeds):
        noise = 0.01 * np.random.default_rng(seed).standard_normal(clean.size)
        _, kinds = found(SWEEP, clean + noise)
        assert not any(one.certain for one in kinds), seed


def test_a_long_record_is_looked_at_where_most_is_left_over():
    t = np.arange(50_000) / FS
    u = np.sin(2 * np.pi * (0.02 * t + 10 / 500 * t * t)) * np.where(t > 200, 1.0, 0.02)
    noise = 0.002 * np.random.default_rng(0).standard_normal(u.size)
    _, kinds = found(u, BENT["dead_zone"](u) + noise)
    assert kinds[0].kind == "dead_zone"
    assert 1.0 + kinds[0].moved[3] > 1.0


def test_what_is_smaller_than_rounding_is_not_asked():
    y = BENT["dead_zone"](SWEEP) + 0.002 * np.random.default_rng(0).standard_normal(SWEEP.size)
    assert found(SWEEP, y)[1]
    assert found(SWEEP, y, floor=0.1)[1] == ()


@pytest.mark.parametrize("last", [884, 1000])
@pytest.mark.parametrize("off", [-0.02, 0.02])
def test_a_kind_that_shows_only_where_no_sample_counts_is_not_accused(last, off):
    y = through(SWEEP) + 0.002 * np.random.default_rng(0).standard_normal(SWEEP.size)
    y[last] += off  # what follows does not count; the sweep is fast there
    counts = np.arange(y.size) <= last
    source = prepare_input(SWEEP, "bandlimited")
    data = Problem(source=source, y=y, valid=counts, longest_delay=90.0)
    fit = fit_structure(data, STRUCTURES["second_order"], TRUTH[:3])
    kinds = bends(SWEEP, data, fit, intersample="bandlimited")
    assert all(one.effect < 0.1 for one in kinds)


def test_what_bends_beyond_the_end_of_the_record_is_not_weighed():
    """The spline alone carries a trace of it back, too small for its weight to be squared."""
    u = np.where(np.arange(T.size) < 1985, np.sin(0.5 * T), 10.0)
    noise = np.random.default_rng(0).standard_normal(T.size)
    data = Problem(
        source=prepare_input(u, "bandlimited"), y=u + noise, valid=None, longest_delay=999
    )
    theta = np.array([430.0, *TRUTH[1:3]])
    fit = fit_structure(data, STRUCTURES["second_order"], theta, iterations=0)
    found = bends(u, data, fit, intersample="bandlimited", floor=0.0)
    assert all(np.isfinite(one.moved).all() for one in found)
