"""Kinds told by harmonics alone: sizes that neither linear misfit nor the linear fit disturbs."""

import numpy as np
import pytest

from hmpim.identify.nonlinear.harmonics import any_harmonics, sweep_harmonics
from hmpim.identify.nonlinear.mechanisms import compare_harmonics, hypotheses
from hmpim.identify.nonlinear.sweep_phase import sweep_phase
from hmpim.model.operators import play, rate_limited
from hmpim.model.sampled import delayed_response, prepare_input
from tests_support import assert_share

FS = 200.0
T = np.arange(2000) / FS
X = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T * T)) / (1 + 0.2 * T)
LAG = np.array([1.0, 0.8 / (2 * np.pi * 10) * FS, (FS / (2 * np.pi * 10)) ** 2])
"""1 + 2ζ s/ω + s²/ω², time in samples."""


def through(force):
    source = prepare_input(force, "foh")
    return delayed_response(source, delay=0.0, denominator=LAG)[0] + source.first


EFFECTS = {
    "hardening": (lambda a: -through(a * X**3), 0.1),
    "softening": (lambda a: through(a * X**3), 0.1),
    "friction": (lambda a: -through(a * np.sign(np.gradient(X))), 0.02),
    "backlash": (lambda a: play(X, a) - X, 0.02),
    "rate_limit": (lambda a: rate_limited(X, a / FS) - X, 35.0),
    "saturation": (lambda a: np.clip(X, -a, a) - X, 0.6),
    "curvature": (lambda a: a * X**3, 0.1),
    "asymmetry": (lambda a: a * X**2, 0.1),
}


def compared(e, seed=0):
    noise = 0.002 * np.random.default_rng(seed).standard_normal(T.size)
    regression = sweep_harmonics(e + noise, sweep_phase(X, FS), FS).regression
    return compare_harmonics(regression, X, LAG, fs=FS), regression


@pytest.mark.parametrize("kind", EFFECTS)
def test_each_kind_is_first_and_of_its_size(kind):
    effect, size = EFFECTS[kind]
    found, regression = compared(effect(size))
    assert found[0].kind == kind
    assert found[0].likelihood > found[1].likelihood + 20
    # Shares are those at the largest deflection.
    powers = {"hardening": 2, "softening": 2, "curvature": 2, "asymmetry": 1}
    truth = size * np.max(np.abs(X)) ** powers.get(kind, 0)
    assert found[0].size == pytest.approx(truth, abs=max(0.1 * truth, 1.5 * found[0].size_std))
    assert found[0].gain > 0.9 * regression.evidence
    if kind not in ("rate_limit", "saturation"):  # of a list, to its spacing only
        assert found[0].effect == pytest.approx(float(np.std(effect(size))), rel=0.25)


@pytest.mark.parametrize("kind", EFFECTS)
def test_what_is_linear_in_the_residual_changes_nothing(kind):
    effect, size = EFFECTS[kind]
    clean, _ = compared(effect(size))
    # Ten times the nonlinearity's own size, of every phase, and none of it a harmonic.
    linear = 0.1 * X + 0.05 * through(X) + 0.3 * np.gradient(X)
    bent, _ = compared(effect(size) + linear)
    assert bent[0].kind == kind
    assert bent[0].size == pytest.approx(clean[0].size, rel=0.03)


def test_noise_and_linear_misfit_gain_little_for_any_kind():
    gains = []
    for seed in range(15):
        found, _ = compared(0.1 * through(X), seed)
        gains.append(max(m.gain for m in found))
    # Of some thirty traces the best, each χ² of one degree: 7 once in ten thousand records each.
    assert np.median(gains) < 4
    assert max(gains) < 12


def test_every_value_tried_has_the_sign_and_size_of_its_kind():
    tried = list(hypotheses(X, LAG, FS))
    assert {one.kind for one in tried} == set(EFFECTS)
    limits = [one for one in tried if one.kind == "rate_limit"]
    for one in limits:
        speed = np.max(np.abs(np.diff(one.trace + X))) * FS
        assert speed == pytest.approx(one.size, rel=1e-9)
    for one in tried:
        if one.kind == "saturation":
            assert np.max(np.abs(one.trace + X)) == pytest.approx(one.size)


def test_the_quick_look_gives_honest_chances_in_white_noise():
    sweep = sweep_phase(X, FS)
    noise = np.stack([np.random.default_rng(k).standard_normal(T.size) for k in range(400)])
    chances = any_harmonics(noise, sweep, FS, delay=0.0)
    assert_share(chances < 0.05, at_most=0.05)
    assert np.mean(chances < 0.05) > 0.005
    assert min(chances) > 1e-5
    assert any_harmonics(np.zeros((1, T.size)), sweep, FS, delay=0.0) == 1.0


@pytest.mark.parametrize("kind", ["smooth", "noisy", "steps"])
def test_backlash_moves_as_it_does_sample_by_sample(kind):
    rng = np.random.default_rng(4)
    noise = np.cumsum(rng.standard_normal(500))
    x = {"smooth": 8 * np.sin(np.arange(500) ** 1.5 / 300), "noisy": noise, "steps": noise.round()}
    for half_gap in (0.3, 1.0, 4.0):
        now, expected = x[kind][0], []
        for value in x[kind]:
            now = min(max(now, value - half_gap), value + half_gap)
            expected.append(now)
        assert play(x[kind], half_gap).tolist() == expected


@pytest.mark.parametrize("level", [0.0, 3.0])
def test_an_output_that_stands_still_shows_no_kind(level):
    assert not list(hypotheses(np.full(50, level), np.array([1.0, 2.0]), FS))
