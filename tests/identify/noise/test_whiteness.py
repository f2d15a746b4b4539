"""Whether noise is white, and whether its level is the same throughout."""

import numpy as np
import pytest

from hmpim.identify.noise.whiteness import effective_share, is_steady, is_white

N = 2000
SAMPLES = 10_000
T = np.arange(N) / N
LEVELS = {
    "louder at the end": np.where(T > 0.8, 5.0, 1.0),
    "louder in bursts": np.where((20 * T) % 1 < 0.2, 6.0, 1.0),
    "the faster it moves": 0.2 + np.abs(np.sin(2 * np.pi * 10 * T)),
}
COUNTED = {
    "first": np.arange(SAMPLES) < 1600,
    "every sixth": np.arange(SAMPLES) % 6 == 0,
    "one in six": np.random.default_rng(0).random(SAMPLES) < 1 / 6,
}


@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_white_noise_is_white_whatever_its_level_does(level):
    drawn = [level * np.random.default_rng(seed).standard_normal(N) for seed in range(300)]
    assert sum(not is_white(noise) for noise in drawn) <= 2
    assert sum(is_steady(noise) for noise in drawn) <= 30


def test_steady_noise_is_steady_with_samples_lost_or_without():
    rng = np.random.default_rng(0)
    drawn = rng.standard_normal((500, N))
    drawn[250:, 500:900] = 0.0
    assert sum(not is_steady(noise) for noise in drawn) <= 2


@pytest.mark.parametrize("level", LEVELS.values(), ids=LEVELS)
def test_coloured_noise_is_not_white_whatever_its_level_does(level):
    noise = level * np.random.default_rng(1).standard_normal(N)
    assert not is_white(noise + 0.4 * np.roll(noise, 1))


def test_a_swing_over_a_twentieth_of_the_record_is_not_white():
    noise = 0.1 * np.random.default_rng(2).standard_normal(N)
    noise[1000:1100] += np.sin(0.5 * np.arange(100))
    assert not is_white(noise)


@pytest.mark.parametrize("which", COUNTED)
def test_white_noise_is_white_however_many_samples_do_not_count(which, seeds):
    for seed in range(seeds):
        noise = np.random.default_rng(seed).standard_normal(SAMPLES) * COUNTED[which]
        assert is_white(noise)
        assert effective_share(noise) == 1.0


def test_coloured_noise_is_coloured_where_few_samples_count(seeds):
    for seed in range(seeds):
        noise = np.random.default_rng(seed).standard_normal(SAMPLES + 1)
        coloured = (noise[1:] + 0.5 * noise[:-1]) * COUNTED["first"]
        assert not is_white(coloured)
        assert effective_share(coloured) < 0.9
