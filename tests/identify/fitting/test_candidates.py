"""Fits of every structure: no start is followed twice."""

from collections import Counter

import numpy as np
import pytest

from hmpim.identify.fitting import candidates
from hmpim.identify.fitting.candidates import fit_plain
from hmpim.identify.fitting.rows import Problem
from hmpim.identify.fitting.start import rough_response
from hmpim.model.sampled import prepare_input


def test_a_lag_at_which_the_output_stands_still_is_none():
    u = np.sin(0.01 * np.arange(1000) ** 1.2)
    y = np.minimum(np.arange(1000), 400.0)
    rough = rough_response(u, y, longest_delay=850, lag=500)
    assert rough.lag == 0
    assert np.abs(rough.response).max() > 0.0


def test_a_start_is_followed_once_where_no_structure_leaves_white_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    rng = np.random.default_rng(3)
    u = np.cumsum(rng.standard_normal(1500))
    y = np.tanh(np.convolve(u, np.ones(9) / 9)[: u.size] / 5) + np.cumsum(
        0.02 * rng.standard_normal(u.size)
    )
    problem = Problem(source=prepare_input(u, "zoh"), y=y, valid=None, longest_delay=100.0)
    followed: Counter[tuple[str, bytes, object]] = Counter()
    climbed = candidates.fit_structure

    def counted(problem, structure, theta, **kwargs):
        followed[structure.name, theta.tobytes(), kwargs.get("iterations")] += 1
        return climbed(problem, structure, theta, **kwargs)

    monkeypatch.setattr(candidates, "fit_structure", counted)
    rough = rough_response(u, y, longest_delay=100)
    fit_plain(problem, rough, ("static", "first_order", "second_order"))
    assert len(followed) > 3
    assert max(followed.values()) == 1
