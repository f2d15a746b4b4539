"""A plant in a loop, identified through the loop's reference."""

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.preparation.reference import instrument_of
from tests_support import assert_share

FS, N = 200.0, 2000
POLE, GAIN, LATE = (
    0.9,
    1.5,
    3,
)  # y_k = 0.9 y_(k-1) + 0.15 u_(k-3): a held lag of 1.5 behind 2 samples
TIME = np.arange(N) / FS
SWEEP = np.sin(2 * np.pi * (0.1 * TIME + 1.5 * TIME**2))


def looped(seed, *, noise=0.3):
    """A held command of a proportional controller, and what slow noise does to both."""
    rng = np.random.default_rng(seed)
    disturbance = lfilter([noise], [1.0, -0.95], 0.3 * rng.standard_normal(N))
    u, y, x = np.zeros(N), np.zeros(N), 0.0
    for k in range(N):
        x = POLE * x + (1 - POLE) * GAIN * (u[k - LATE] if k >= LATE else 0.0)
        y[k] = x + disturbance[k]
        u[k] = 1.5 * (SWEEP[k] - y[k])
    return hmpim.Record.from_arrays(
        {"u": u}, {"y": y}, references={"r": SWEEP}, fs=FS, intersample="zoh"
    )


TRUTH = {
    "delay": (LATE - 1) / FS,
    "scale_factor": GAIN,
    "time_constant": -1 / (FS * np.log(POLE)),
}


@pytest.mark.few(12)
def test_intervals_through_the_reference_hold(seeds):
    told = []
    for seed in range(seeds):
        record = looped(seed)
        pair = hmpim.identify(record, reference="r", structures=["first_order"])["y", "u"]
        found = {name: getattr(pair.parameters, name) for name in TRUTH}
        told.append([abs(e.value - TRUTH[name]) < 1.96 * e.spread for name, e in found.items()])
    assert_share(told, at_least=0.94, at_most=0.96)


def test_an_instrument_of_the_wrong_shape_moves_nothing():
    """The reference three samples early: the bars may grow, the figures stay."""
    record = looped(3)
    (right,) = record.references
    early = hmpim.Record.from_arrays(
        {"u": record.inputs[0].values},
        {"y": record.outputs[0].values},
        references={"r": np.roll(right.values, -3)},
        fs=FS,
        intersample="zoh",
    )
    a, b = (
        hmpim.identify(r, reference="r", structures=["first_order"])["y", "u"]
        for r in (record, early)
    )
    for name in TRUTH:
        one, other = getattr(a.parameters, name), getattr(b.parameters, name)
        assert abs(one.value - other.value) < np.ptp(one.ci95) + np.ptp(other.ci95)


def test_a_loop_without_its_reference_is_noticed_and_an_open_one_is_not():
    pair = hmpim.identify(looped(1), structures=["first_order"])["y", "u"]
    (found,) = [w for w in pair.warnings if w.code == "feedback"]
    assert found.severity == "doubt"
    assert pair.verdict == "doubtful"
    through = hmpim.identify(looped(1), reference="r", structures=["first_order"])["y", "u"]
    codes = {w.code for w in through.warnings}
    assert "through_reference" in codes
    assert "feedback" not in codes
    rng = np.random.default_rng(0)
    disturbance = lfilter([0.3], [1.0, -0.95], 0.3 * rng.standard_normal(N))
    y = lfilter([0.0] * LATE + [(1 - POLE) * GAIN], [1.0, -POLE], SWEEP) + disturbance
    open_ = hmpim.Record.from_arrays({"u": SWEEP}, {"y": y}, fs=FS, intersample="zoh")
    assert "feedback" not in {
        w.code for w in hmpim.identify(open_, structures=["first_order"])["y", "u"].warnings
    }


def test_a_stiffening_spring_under_a_multisine_is_no_loop():
    # Its third harmonic is the input's future where the input rises in frequency.
    lines = np.arange(3, 150) / 10.0
    phases = -np.pi * np.arange(lines.size) ** 2 / lines.size
    u = np.cos(2 * np.pi * TIME[:, None] * lines + phases).sum(axis=1)
    fine = 8
    command = np.interp(np.arange(N * fine) / fine, np.arange(N), u / np.abs(u).max())
    stiffness, h = (2 * np.pi * 6.0) ** 2, 1.0 / (fine * FS)
    x = v = 0.0
    y = np.zeros(command.size)
    for k, force in enumerate(command):
        v += h * (stiffness * (force - x - 0.1 * x**3) - 2 * 0.2 * 2 * np.pi * 6.0 * v)
        x += h * v
        y[k] = x
    y = y[::fine] + 0.003 * np.random.default_rng(1).standard_normal(N)
    record = hmpim.Record.from_arrays({"u": u / np.abs(u).max()}, {"y": y}, fs=FS)
    pair = hmpim.identify(record, structures=["second_order"])["y", "u"]
    codes = {w.code for w in pair.warnings}
    assert "feedback" not in codes
    assert pair.verdict == "doubtful"


def test_the_measured_response_is_the_plants():
    found = hmpim.identify(looped(2), reference="r", structures=["first_order"])["y", "u"]
    response = found.frequency_response
    z = np.exp(2j * np.pi * response.frequency / FS)
    truth = (1 - POLE) * GAIN * z**-LATE / (1 - POLE / z)
    off = np.abs(response.response - truth) / response.std
    assert np.median(off) < 2.0


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("s", "reference 's' must be a channel that is neither input nor output; there are: r"),
        ("u", "reference 'u' must be a channel that is neither"),
    ],
)
def test_a_reference_that_is_not_there_is_refused(name, words):
    with pytest.raises(ArgumentError, match=words):
        hmpim.identify(looped(1), reference=name)


def test_a_reference_that_moves_nothing_is_refused():
    with pytest.raises(RecordError, match=r"reference 'r' is constant at 1"):
        instrument_of("r", np.ones(N), SWEEP)
    noise = np.random.default_rng(1).standard_normal(N)
    with pytest.raises(RecordError, match="accounts for almost none of the input"):
        instrument_of("r", noise, SWEEP)


def test_what_has_no_reference_or_two_inputs_is_refused():
    record = looped(1)
    two = hmpim.Record.from_arrays(
        {"a": SWEEP, "b": SWEEP[::-1].copy()}, {"y": SWEEP}, references={"r": SWEEP}, fs=FS
    )
    with pytest.raises(ArgumentError, match="requires a record of one input; this one has 2"):
        hmpim.identify(two, reference="r")
    statistics = hmpim.compress(record, lags=100)
    with pytest.raises(ArgumentError, match="statistics contain no reference"):
        hmpim.identify(statistics, reference="r")


def test_a_direction_that_the_loop_leaves_open_narrows_no_error_bar():
    """Parameters of two modes differ by so many decades that some had no error at all."""
    pair = hmpim.identify(looped(2), reference="r", structures=["two_modes"])["y", "u"]
    assert pair.scale_factor.std > 0.01
