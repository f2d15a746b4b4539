"""A slow tail is found where few bins show it, and not where there is none."""

import numpy as np
import pytest

import hmpim
from hmpim.identify.fitting.fit import Problem, fit_structure
from hmpim.identify.fitting.tail import hidden_tail, with_tail
from hmpim.model import STRUCTURES
from hmpim.model.sampled import prepare_input
from tests_support import answer_of, assert_share, in_studies

FS, FINE = 200.0, 8
T = np.arange(2000 * FINE) / (FS * FINE)
CHIRP = np.sin(2 * np.pi * (0.1 * T + 19.9 / 20 * T**2))
MODE = [1 / (2 * np.pi * 6) ** 2, 2 * 0.6 / (2 * np.pi * 6), 1.0]


def record_of(tail, seed, noise=0.005, lag=1.2, command=CHIRP):
    """Second order at 6 Hz, and a tail of so many seconds."""
    y = answer_of([lag * (1.0 + tail), 1.0], np.polymul(MODE, [lag, 1.0]), command, T)[::FINE]
    y = y + noise * np.random.default_rng(seed).standard_normal(y.size)
    return hmpim.Record.from_arrays(
        {"u": command[::FINE]}, {"y": y}, fs=FS, intersample="bandlimited"
    )


@pytest.mark.few(3)
@pytest.mark.parametrize("tail", [0.04, -0.04])
def test_a_tail_is_part_of_the_model(tail, seeds):
    for seed in range(seeds):
        pair = hmpim.identify(record_of(tail, seed))["y", "u"]
        assert pair.structure in ("third_order_zero", "third_order_zeros")
        late = pair.parameters.delay_low_frequency
        true = 0.6 / (np.pi * 6) - 1.2 * tail
        assert abs(late.value - true) < 4 * late.std < 0.1
        assert abs(pair.parameters.scale_factor.value - 1.0) < 0.01


@pytest.mark.few(5)
def test_none_is_invented(seeds):
    pairs = [hmpim.identify(record_of(0.0, seed))["y", "u"] for seed in range(seeds)]
    assert_share([pair.structure == "second_order" for pair in pairs], at_least=0.99)


@pytest.mark.parametrize(("lag", "tail"), [(1.5, -0.02), *in_studies((2.5, 0.015), (1.5, -0.03))])
def test_a_tail_is_no_drift(lag, tail):
    """The paper's sweep begins slowly and with most of its power: a tail resembles a drift."""
    sweep = hmpim.Sweep(band=(0.1, 20.0), duration=10.0, gain=1.0, extinction=1.0)
    command = sweep.motion(T).position
    command = (command - command[0]) / np.max(np.abs(command))
    pair = hmpim.identify(record_of(tail, 0, 0.001, lag, command))["y", "u"]
    assert pair.structure == "third_order_zero"
    assert not any(w.code == "drift" for w in pair.warnings)


def test_the_score_estimates_the_size():
    u = CHIRP[::FINE]
    y = record_of(0.04, 0).outputs[0].values
    source = prepare_input(u, "bandlimited")
    problem = Problem(source=source, y=y, valid=None, longest_delay=20.0)
    structure = STRUCTURES["second_order"]
    fit = fit_structure(problem, structure, np.array([0.0, np.log(6.0), 0.7]))
    tail = hidden_tail(problem, fit)
    assert 0.02 < tail.size < 0.08
    assert 80.0 < tail.lag < 720.0
    assert hidden_tail(problem, fit, share=1e-3) is None


@pytest.mark.parametrize("name", ["integrator", "washout", "three_modes"])
def test_dynamics_without_a_gain_at_dc_have_no_tail(name):
    assert with_tail(STRUCTURES[name]) is None


def test_a_tail_that_no_structure_describes_is_a_doubt():
    """Diffusion, exp(-sqrt(sT)): its tail has no single time constant."""
    count = 1 << 18
    padded = np.concatenate([CHIRP, CHIRP[-1] * np.linspace(1, 0, 1600), np.zeros(count)])[:count]
    s = 2j * np.pi * np.fft.rfftfreq(count, 1 / (FS * FINE))
    y = np.fft.irfft(np.fft.rfft(padded) * np.exp(-np.sqrt(s * 0.05)), count)[: T.size : FINE]
    y = y + 0.004 * np.random.default_rng(0).standard_normal(y.size)
    record = hmpim.Record.from_arrays({"u": CHIRP[::FINE]}, {"y": y}, fs=FS)
    pair = hmpim.identify(record)["y", "u"]
    assert pair.parameters.scale_factor.verdict == "doubtful"
    assert any(w.code == "other_dynamics" and "settles" in w.message for w in pair.warnings)
