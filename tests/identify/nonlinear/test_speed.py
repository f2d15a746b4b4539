"""A command that is followed at no more than a fixed speed."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hmpim
from hmpim.identify.nonlinear.speed import limited_command
from hmpim.model.operators import rate_limited

FS, FINE = 200.0, 20


def swept(limit: float, *, noise: float, seed: int = 0, late: float = 0.1) -> hmpim.Record:
    """A second-order unit behind a servo of limited speed, stepped in fine steps, exactly held."""
    t = np.arange(2000 * FINE) / (FS * FINE)
    u = np.sin(2 * np.pi * (0.1 * t + 0.4 * t**2))
    followed = rate_limited(u, limit / (FS * FINE))
    omega, zeta = 2 * np.pi * 10.0, 0.4
    # The exact answer to what is linear between the fine steps.
    model = hmpim.Model(
        delay=late, scale_factor=1.5, denominator=(omega**-2, 2 * zeta / omega, 1.0), bias=0.2
    )
    y = hmpim.simulate(model, followed, fs=FS * FINE, intersample="foh")[::FINE]
    y += noise * np.random.default_rng(seed).standard_normal(y.size)
    return hmpim.Record.from_arrays({"u": u[::FINE]}, {"y": y}, fs=FS, intersample="bandlimited")


@pytest.fixture(scope="module")
def pair():
    return hmpim.identify(swept(30.0, noise=0.01))["y", "u"]


def test_the_linear_part_is_found_behind_a_limit_of_speed(pair):
    assert pair.structure == "second_order"
    assert pair.verdict == "ok"
    for name, truth in (
        ("delay", 0.1),
        ("scale_factor", 1.5),
        ("natural_frequency", 10.0),
        ("damping_ratio", 0.4),
        ("bias", 0.2),
    ):
        figure = getattr(pair.parameters, name)
        assert abs(figure.value - truth) < 4 * figure.std
        assert figure.std < 0.01 * abs(figure.value) + 0.002


def test_the_limit_itself_is_stated_with_its_error(pair):
    (said,) = [w for w in pair.warnings if w.code == "rate_limit"]
    assert said.severity == "info"
    words = said.message.split()
    limit, std = float(words[words.index("±") - 1]), float(words[words.index("±") + 1])
    assert abs(limit - 30.0) < 4 * std
    assert std < 0.3


def test_the_paper_s_figures_are_those_of_the_command(pair):
    record = swept(30.0, noise=0.01)
    free = hmpim.identify(record, structures=["static"])["y", "u"]
    assert pair.paper.delay == free.paper.delay


@pytest.mark.few(3)
def test_the_error_of_the_limit_is_in_the_error_bars(seeds):
    errors = []
    for seed in range(seeds):
        record = swept(30.0, noise=0.03, seed=seed)
        plain = ["second_order", "third_order"]
        found = hmpim.identify(record, structures=plain)["y", "u"].parameters
        errors += [
            (getattr(found, name).value - truth) / getattr(found, name).std
            for name, truth in (("delay", 0.1), ("natural_frequency", 10.0), ("damping_ratio", 0.4))
        ]
    assert 0.7 < float(np.sqrt(np.mean(np.square(errors)))) < 1.35


def test_a_unit_that_follows_every_speed_has_no_limit():
    record = swept(1e6, noise=0.01)
    assert "rate_limit" not in {w.code for w in hmpim.identify(record)["y", "u"].warnings}


def test_a_third_order_unit_is_not_taken_for_one_of_limited_speed():
    t = np.arange(2000) / FS
    u = np.sin(2 * np.pi * (0.1 * t + 0.9 * t**2))
    model = hmpim.Model(delay=0.03, scale_factor=1.0, denominator=(2e-6, 4e-4, 0.03, 1.0), bias=0.0)
    y = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
    y += 0.003 * np.random.default_rng(3).standard_normal(y.size)
    pair = hmpim.identify(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))["y", "u"]
    assert "rate_limit" not in {w.code for w in pair.warnings}


def test_a_plain_fit_that_leaves_noise_asks_for_nothing():
    from hmpim.identify.fitting.joint import joint_fit

    record = swept(1e6, noise=0.01)
    u, y = record.inputs[0].values, record.outputs[0].values
    assert limited_command(u, joint_fit(u, y, structures=("second_order",))) is None


@given(st.floats(0.05, 2.0), st.integers(0, 100))
def test_what_is_followed_keeps_its_speed_and_stays_where_the_command_is_slower(step, seed):
    x = np.cumsum(np.random.default_rng(seed).standard_normal(50))
    followed = rate_limited(x, step)
    assert (
        np.max(np.abs(np.diff(followed))) <= step * (1 + 1e-9) or step >= np.abs(np.diff(x)).max()
    )
