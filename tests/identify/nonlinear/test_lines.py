"""Lines that a multisine leaves out: distortion told from noise, even from odd."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hmpim.identify.nonlinear.lines import detection_lines, find_period
from tests_support import assert_share, examples

N = 1024
EXCITED = np.array([k for k in range(1, 120, 2) if k % 8 != 5])
"""Odd lines, one in four of them left out."""


def multisine(periods: int, seed: int = 0) -> np.ndarray:
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, EXCITED.size)
    t = np.arange(N) / N
    one = np.cos(2 * np.pi * EXCITED[:, None] * t + phase[:, None]).sum(axis=0)
    return np.tile(one / np.std(one), periods)


@examples(12)
@given(period=st.integers(20, 400), times=st.floats(2.1, 6.0), seed=st.integers(0, 50))
def test_the_period_of_whatever_repeats(period, times, seed):
    one = np.random.default_rng(seed).standard_normal(period)
    u = np.resize(one, int(period * times))
    assert find_period(u) == period
    assert find_period(u + 1e-3 * np.random.default_rng(1).standard_normal(u.size)) == period


def test_no_period_where_there_is_none():
    t = np.arange(2000) / 200
    assert find_period(np.sin(2 * np.pi * (0.1 * t + t**2))) is None
    assert find_period(np.random.default_rng(0).standard_normal(500)) is None
    assert find_period(np.ones(500)) is None


@pytest.mark.parametrize(
    ("shape", "expected"),
    [
        (lambda x: x + 0.01 * x**2, ["even"]),
        (lambda x: x + 0.01 * x**3, ["odd"]),
        (lambda x: x + 0.01 * x**2 + 0.01 * x**3, ["even", "odd"]),
        (lambda x: x, []),
    ],
)
def test_even_and_odd(shape, expected):
    u = multisine(6)
    y = shape(u) + 0.02 * np.random.default_rng(1).standard_normal(u.size)
    found = detection_lines(u, y, period=N)
    assert [level.parity for level in found] == ["even", "odd"]
    assert [lv.parity for lv in found if lv.probability < 1e-4] == expected


def test_the_share_is_that_of_the_clean_distortion():
    u = multisine(4)
    y = u + 0.05 * u**2
    clean = detection_lines(u, y, period=N)
    noisy = detection_lines(
        u, y + 0.05 * np.random.default_rng(0).standard_normal(u.size), period=N
    )
    assert noisy[0].rms == pytest.approx(clean[0].rms, rel=0.1)
    spectrum = np.abs(np.fft.rfft(u[:N] ** 2)) * 0.05 * 2 / N
    even = spectrum[2:119:2]
    assert clean[0].rms == pytest.approx(np.sqrt(np.mean(even**2)), rel=0.05)


def test_the_chance_is_uniform_without_distortion():
    u = multisine(4)
    chances = []
    for seed in range(150):
        y = u + 0.1 * np.random.default_rng(seed).standard_normal(u.size)
        chances.append([lv.probability for lv in detection_lines(u, y, period=N)])
    assert_share(np.array(chances) < 0.05, at_least=0.05, at_most=0.05)


@pytest.mark.parametrize("period", [4, N])
def test_a_full_comb_says_nothing(period):
    full = np.tile(np.random.default_rng(0).standard_normal(period), 3)
    assert detection_lines(full, full, period=period) == ()
