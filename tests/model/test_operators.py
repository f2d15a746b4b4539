"""What is not linear, against the same computed sample by sample."""

import numpy as np
import pytest

from hmpim.model import operators
from hmpim.model.operators import power_of, rate_limited


def one_by_one(x, step):
    out = x.copy()
    for k in range(1, x.size):
        out[k] = np.clip(x[k], out[k - 1] - step, out[k - 1] + step)
    return out


T = np.arange(4000) / 4000
SIGNALS = {
    "sweep": np.sin(2 * np.pi * (T + 20 * T**2)),
    "jumps": np.repeat([0.0, 1.0, -1.0, -0.9, 3.0], 800),
    "noise": np.random.default_rng(0).standard_normal(4000),
    "walk": np.cumsum(np.random.default_rng(1).standard_normal(4000)),
}


@pytest.mark.parametrize("share", [0.02, 0.2, 0.5, 0.95])
@pytest.mark.parametrize("kind", SIGNALS)
def test_a_limited_speed_is_followed_ramp_by_ramp_as_sample_by_sample(kind, share, monkeypatch):
    x = SIGNALS[kind]
    step = share * float(np.max(np.abs(np.diff(x))))
    expected = one_by_one(x, step)
    for smooth in (0, np.inf):  # ramp by ramp, sample by sample
        monkeypatch.setattr(operators, "_SMOOTH", smooth)
        assert rate_limited(x, step) == pytest.approx(expected, abs=1e-10)


def test_a_signal_that_is_never_too_fast_is_followed():
    assert rate_limited(T, 1.0).tolist() == T.tolist()


@pytest.mark.parametrize("power", [2, 3])
def test_a_power_keeps_the_largest_deflection(power):
    assert power_of(np.array([-2.0, 0.5]), power, 2.0) == pytest.approx(
        [2.0 * (-1.0) ** power, 2.0 * 0.25**power]
    )
