"""Noise whose level changes: how loud it is, and that quiet samples count for more."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.noise.level import level_of, steadiness

N, FS = 2000, 200.0
T = np.arange(N) / N
LEVEL = np.where(T > 0.6, 4.0, 1.0)
SWEEP = np.sin(2 * np.pi * (0.2 + 0.5 * T) * N / FS * T)


def test_the_level_is_that_of_the_noise_wherever_it_is_told():
    noise = LEVEL * np.random.default_rng(0).standard_normal(N)
    noise[300:340] = 0.0  # samples that do not count
    level = level_of(noise)
    ratio = level / LEVEL
    inside = np.abs(T - 0.6) > 0.03
    assert np.std(ratio[inside]) < 0.15 * np.mean(ratio[inside])
    assert np.mean(np.log(level[noise != 0.0])) == pytest.approx(0.0, abs=1e-12)


def test_no_level_is_less_than_a_fifth_of_all():
    noise = np.random.default_rng(0).standard_normal(N) * np.where(T > 0.5, 1.0, 1e-6)
    level = level_of(noise)
    assert level.min() / level.max() == pytest.approx(0.2 / np.sqrt(2), rel=0.2)


def test_steady_noise_and_few_samples_have_no_level():
    noise = np.random.default_rng(0).standard_normal(N)
    assert level_of(noise) is None
    assert level_of((LEVEL * noise)[1150:1250]) is None


def test_estimates_are_at_the_bound_of_the_noise_as_it_is():
    """Known weights give the least scatter; without any it is 1.5 times as large."""
    rows = np.stack([SWEEP, np.ones(N)])
    weighed, known = rows / LEVEL, np.linalg.inv(rows @ rows.T)
    bound = np.sqrt(np.diag(np.linalg.inv(weighed @ weighed.T)))
    plain = np.sqrt(np.diag(known @ (rows * LEVEL**2) @ rows.T @ known))
    errors, held = [], 0
    for seed in range(60):
        noise = 0.05 * LEVEL * np.random.default_rng(seed).standard_normal(N)
        record = hmpim.Record.from_arrays({"u": SWEEP}, {"y": 1.0 + SWEEP + noise}, fs=FS)
        found = hmpim.identify(record, intersample="bandlimited", structures=("static",))
        estimate = found["y", "u"].scale_factor, found["y", "u"].bias
        errors.append([one.value - 1.0 for one in estimate])
        held += sum(one.ci95[0] <= 1.0 <= one.ci95[1] for one in estimate)
    scatter = np.sqrt(np.mean(np.square(errors), axis=0)) / 0.05
    assert (plain > 1.4 * bound).all()
    assert scatter == pytest.approx(bound, rel=0.2)
    assert held >= 107  # of 120 at 95 %; fewer in one of a thousand


@pytest.mark.parametrize(
    "level",
    [LEVEL, np.where((20 * T) % 1 < 0.2, 6.0, 1.0), 0.2 + np.abs(np.sin(2 * np.pi * 10 * T))],
    ids=["late", "bursts", "speed"],
)
def test_the_power_of_changing_noise_scatters_as_said(level):
    powers, shares = [], []
    for seed in range(400):
        noise = level * np.random.default_rng(seed).standard_normal(N)
        powers.append(np.mean(noise**2))
        shares.append(steadiness(noise))
    scatter = np.std(powers) / np.mean(powers)
    assert np.sqrt(2 / (N * np.mean(shares))) == pytest.approx(scatter, rel=0.1)
