"""docs/nonlinearity.md: its lines run, on a spring that hardens."""

import numpy as np
import pytest

import hmpim
from docs_following import snippet

FS = 200.0
TIME = np.arange(1200) / FS
SWEEP = np.sin(2 * np.pi * (0.2 * TIME + 19.8 / 12 * TIME**2))


def record(gain):
    """A reading that rises by the cube as well, 3 % of it at a deflection of 1."""
    u = gain * SWEEP
    noise = 0.002 * np.random.default_rng(round(10 * gain)).standard_normal(u.size)
    return hmpim.Record.from_arrays({"u": u}, {"y": u + 0.03 * u**3 + noise}, fs=FS)


def test_the_lines_run():
    code = snippet("nonlinearity.md", "pair = ")
    space = {"hmpim": hmpim, "record": record(2.0)}
    space |= {"gentle": record(0.2), "middle": record(1.0), "strong": record(2.0)}
    exec(compile(code, "nonlinearity.md", "exec"), space)
    found = space["pair"].nonlinearity
    assert found.kinds == ("curvature",)
    # 3 % of (2 sin)³ is a third harmonic of 0.06 beside a first one of 2.18.
    assert found.share == pytest.approx(0.06 / 2.18, rel=0.1)
    levels = space["levels"]["y", "u"]
    assert levels.findings[0].code == "nonlinear"
    assert levels.linear_up_to == pytest.approx(0.2, rel=1e-3)
    gain = next(trend for trend in levels.trends if trend.name == "scale_factor")
    assert gain.values[-1] == pytest.approx(1 + 0.75 * 0.03 * 4, rel=0.02)
