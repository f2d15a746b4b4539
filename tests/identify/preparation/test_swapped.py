"""Swapped columns are recognised and said, at once; a unit in its right order is not accused."""

from importlib import import_module

import numpy as np
import pytest

import hmpim
from hmpim.identify.preparation.swapped import is_swapped
from tests_support import assert_share, few_of, in_studies

FS = 200.0
T = np.arange(2000) / FS
DYNAMICS = (
    {},
    {"natural_frequency": 10.0, "damping_ratio": 0.4},
    {"natural_frequency": 3.0, "damping_ratio": 0.1},
    {"time_constant": 0.1},
    {"time_constant": 3.0},
)


def inputs(seed):
    rng = np.random.default_rng(seed)
    lines = np.arange(0.5, 20, 0.5)
    return {
        "chirp": np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T**2)),
        "binary": np.sign(rng.standard_normal(250)).repeat(8),
        "noise": np.convolve(rng.standard_normal(2007), np.ones(8) / 8, "valid"),
        "steps": rng.standard_normal(20).repeat(100),
        "sine": np.sin(2 * np.pi * 3 * T),
        "multisine": np.sin(
            2 * np.pi * np.outer(T, lines) + rng.uniform(0, 2 * np.pi, lines.size)
        ).sum(axis=1),
    }


def answered(u, name, seed, **sensor):
    held = "zoh" if name in ("binary", "steps") else "bandlimited"
    return hmpim.Sensor(**sensor).respond(u, fs=FS, rng=seed, intersample=held)


DELAYS, NOISES = (0.0, 0.01, 0.05, 0.15, 1.0), (0.0, 0.003, 0.03, 0.3)
FEW = [(0.0, 0.003), (0.05, 0.3)]


@pytest.mark.parametrize(("delay", "noise"), few_of(FEW, DELAYS, NOISES))
def test_what_is_in_order_is_never_accused(delay, noise):
    told = np.ones(T.size, dtype=bool)
    for name, u in inputs(1).items():
        for dynamics in DYNAMICS:
            y = answered(u, name, 2, delay=delay, noise_std=noise, **dynamics)
            assert not is_swapped(u, y, told), (name, dynamics)
            assert not is_swapped(u, np.cumsum(y) / FS, told), (name, dynamics)
            assert not is_swapped(u, np.gradient(y) * FS, told), (name, dynamics)


@pytest.mark.few(4)
@pytest.mark.parametrize("kind", ["chirp", "binary", "noise", "steps", "multisine"])
def test_swapped_columns_of_a_lagging_unit_are_seen(kind, seeds):
    told = np.ones(T.size, dtype=bool)
    told[700:720] = False
    seen = []
    for seed in range(seeds):
        u = inputs(seed)[kind]
        y = answered(
            u, kind, seed, delay=0.05, natural_frequency=10.0, damping_ratio=0.4, noise_std=0.02
        )
        seen.append(is_swapped(y, u, told))
    assert_share(seen, at_least=0.99)


GRID = (
    *({"natural_frequency": f, "damping_ratio": d} for f, d in ((10, 0.4), (3, 0.1), (30, 0.7))),
    {"natural_frequency": 8.0, "damping_ratio": 0.02},
    {"time_constant": 0.1},
    {"time_constant": 0.01},
)


@pytest.mark.parametrize("noise", [0.05, *in_studies(0.01, 0.1, 0.3)])
@pytest.mark.parametrize("delay", [0.02, *in_studies(0.0, 0.005, 0.1, 0.3)])
def test_most_of_a_grid_of_units_is_seen_and_none_accused_with_noise_on_both(delay, noise):
    """Without noise on the input, and with; the noise is a share of the channel."""
    told, rng, seen = np.ones(T.size, dtype=bool), np.random.default_rng(3), []
    white = rng.standard_normal(T.size)
    for name, u in {**inputs(3), "white": white}.items():
        for dynamics in GRID:
            clean = answered(u, name, 4, delay=delay, **dynamics)
            y = clean + noise * clean.std() * rng.standard_normal(T.size)
            heard = u + noise * u.std() * rng.standard_normal(T.size)
            assert not is_swapped(u, y, told), (name, dynamics)
            assert not is_swapped(heard, y, told), (name, dynamics)
            if name != "sine":
                seen.append(is_swapped(y, u, told))
    assert np.mean(seen) >= (0.5 if delay < 0.01 or noise == 0.3 else 0.8)


def test_it_is_said_first_and_nothing_is_ok(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    pair = hmpim.identify(hmpim.Record.from_arrays(noisy, u, fs=200.0))["y"]
    assert pair.warnings[0].code == "swapped"
    assert "Input 'u' follows output 'y'" in pair.warnings[0].message
    assert "a constant explains it" not in "".join(w.message for w in pair.warnings)
    assert pair.verdict != "ok"
    for name in ("delay", "scale_factor", "bias"):
        estimate = getattr(pair, name)
        assert estimate is None or estimate.verdict == "doubtful"


def test_swapped_columns_cost_no_richer_fits(field_record, monkeypatch):
    """Said at once: only the plain structures are tried, and no drift."""
    module = import_module("hmpim.identify.fits")
    asked = []
    fit = module.fit_together

    def counted(*args, **options):
        asked.append(options["structures"])
        return fit(*args, **options)

    monkeypatch.setattr(module, "fit_together", counted)
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    hmpim.identify(hmpim.Record.from_arrays(noisy, u, fs=200.0))
    assert asked
    assert set(asked) == {("static", "first_order", "second_order")}
    assert len(asked) <= 3
