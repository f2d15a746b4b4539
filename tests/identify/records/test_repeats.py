from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hmpim.errors import RecordError
from hmpim.identify import Estimate, Parameters
from hmpim.identify.records.alike import check_channels
from hmpim.identify.records.repeated import Repeats
from hmpim.identify.records.repeats import _doubts, _parameter, identify_repeats
from hmpim.record import Record
from tests_support import assert_share, room

FS = 100.0
T = np.arange(1000) / FS
U = np.sin(2 * np.pi * (0.1 * T + 0.9 * T**2))
STRUCTURES = ("static", "first_order")


def lagged(gain: float = 2.0, time_constant: float = 0.05, delay: int = 5) -> np.ndarray:
    """First-order lag of the held input, exactly, and a delay of whole samples."""
    a = np.exp(-1 / (FS * time_constant))
    y = np.zeros(T.size)
    for k in range(1, T.size):
        y[k] = a * y[k - 1] + (1 - a) * gain * U[k - 1]
    return np.concatenate((np.zeros(delay), y[: y.size - delay]))


def record(y: np.ndarray, u: np.ndarray = U) -> Record:
    return Record.from_arrays({"u": u}, {"y": y}, fs=FS, intersample="zoh", units={"y": "deg"})


def repeats(
    count: int, *, noise: float, seed: int = 0, drift: float = 0.0, left: float = 0.0
) -> Repeats:
    rng = np.random.default_rng(seed)
    records = []
    for _ in range(count):
        clean = lagged(gain=2.0 * (1 + drift * rng.standard_normal()))
        records.append(
            record(clean + left * (U**2 - 0.5) + noise * rng.standard_normal(T.size) + 0.3)
        )
    return identify_repeats(records, structures=STRUCTURES)


@pytest.fixture(scope="module")
def eight() -> Repeats:
    return repeats(8, noise=0.05)


def test_averages_are_right_and_better_than_one_record(eight: Repeats) -> None:
    pair = eight["y", "u"]
    for name, true in (
        ("scale_factor", 2.0),
        ("time_constant", 0.05),
        ("delay", 0.05),
        ("bias", 0.3),
    ):
        parameter = pair[name]
        each = [getattr(result["y", "u"], name).std for result in eight.results]
        single = float(np.sqrt(np.mean(np.square(each))))
        assert abs(parameter.mean.value - true) < 4 * parameter.mean.std
        assert parameter.mean.std == pytest.approx(single / np.sqrt(8), rel=0.1)
        assert parameter.repeatability == pytest.approx(single, rel=0.8)
        assert parameter.agree
    assert pair["bias"].mean.unit == "deg"
    assert pair.findings == ()


def told(low: float, high: float, *, value: float = 30.0, std: float | None = None) -> Any:
    """A pair that states its delay with this interval."""
    delay = Estimate(value=value, std=std, ci95=(low, high), unit="ms")
    return SimpleNamespace(parameters=Parameters(delay=delay))


def test_a_second_model_moves_all_repeats_alike_and_is_no_scatter() -> None:
    """Errors of 0.02 about 30, and an interval that reaches to another model's 27.5."""
    values = (29.98, 30.01, 30.02, 29.99)
    wide = [told(27.5, v + 0.0392, value=v) for v in values]
    every = _parameter("delay", tuple(wide))
    assert every is not None
    assert every.agree
    assert every.chi_squared == pytest.approx(0.001 / 0.02**2, rel=0.01)
    low, high = every.mean.ci95
    assert low == pytest.approx(27.52, abs=0.05)  # the mean of many knows no better
    assert high == pytest.approx(30.02, abs=0.001)
    one = told(29.96, 30.0392, value=30.0, std=0.02)  # one repeat excludes the other model
    some = _parameter("delay", (*wide, one))
    assert some is not None
    assert some.mean.ci95[0] == pytest.approx(30.0 - 1.96 * 0.02 / 5**0.5, abs=0.001)


def test_noise_is_what_differs_from_repeat_to_repeat(eight: Repeats) -> None:
    pair = eight["y", "u"]
    assert pair.noise_std is not None
    assert pair.noise_std.value == pytest.approx(0.05, rel=0.03)
    assert abs(pair.noise_std.value - 0.05) < 4 * pair.noise_std.std
    assert pair.unmodelled_probability is not None
    assert pair.unmodelled_probability > 0.005


def test_the_averaged_response_is_right_within_its_error(seeds: int) -> None:
    a = np.exp(-1 / (FS * 0.05))
    errors, stds, scatter = [], [], []
    for seed in range(max(seeds // 20, 8)):
        pair = repeats(4, noise=0.05, seed=seed)["y", "u"]
        found = pair.frequency_response
        z = np.exp(2j * np.pi * found.frequency / FS)
        true = 2 * (1 - a) / (z - a) * z**-5
        # Not the last hertz: what bends there is alike in every repeat and does not average out.
        inside = found.frequency < 17
        errors.append(np.abs(found.response - true)[inside])
        stds.append(found.std[inside])
        scatter.append(pair.response_scatter)
    ratio = np.sqrt(np.mean(np.square(errors)) / np.mean(np.square(stds)))
    assert ratio == pytest.approx(1.0, abs=0.3)
    assert np.median(errors) < 0.012
    assert np.mean(scatter) == pytest.approx(1.0, abs=0.2)


@pytest.mark.few(6)
def test_right_error_bars_are_seldom_doubted(seeds: int) -> None:
    names = ("scale_factor", "time_constant", "delay", "bias")
    pairs = [repeats(4, noise=0.05, seed=100 + seed)["y", "u"] for seed in range(seeds)]
    assert_share([[pair[name].agree for name in names] for pair in pairs], at_least=0.95)
    for name in names:  # a probability is spread evenly between 0 and 1
        mean = np.mean([pair[name].probability for pair in pairs])
        assert mean == pytest.approx(0.5, abs=0.02 + room(seeds, 1 / np.sqrt(12)))


def test_what_changes_between_repeats_is_seen() -> None:
    pair = repeats(6, noise=0.01, drift=0.05)["y", "u"]
    gain = pair["scale_factor"]
    assert not gain.agree
    assert gain.repeatability == pytest.approx(0.1, rel=0.7)
    assert gain.mean.std == pytest.approx(gain.repeatability / np.sqrt(6), rel=0.1)
    assert pair["time_constant"].agree
    assert [f.code for f in pair.findings] == ["scatter"]
    assert "scale factor" in pair.findings[0].message


def test_what_scatters_is_said_once_for_all_parameters() -> None:
    found = repeats(6, noise=0.01, drift=0.05)["y", "u"].parameters
    apart = [replace(p, chi_squared=49.0 * p.freedom, probability=0.0, agree=False) for p in found]
    quiet = [replace(p, chi_squared=0.04 * p.freedom, probability=1.0, agree=False) for p in found]
    (more,) = _doubts(apart, "y")
    assert more.parameters == tuple(p.name for p in found)
    assert more.message.count("repeatability as the error") == 1
    assert "scale factor 7 times" in more.message
    more, less = _doubts([apart[0], *quiet[1:]], "y")
    assert (more.parameters, less.parameters[0]) == ((found[0].name,), found[1].name)
    assert "0.2 times the stated error" in less.message
    assert not [*_doubts([p for p in found if p.agree], "y")]


def test_copies_of_one_record_are_not_repeats() -> None:
    one = record(lagged() + 0.05 * np.random.default_rng(0).standard_normal(T.size))
    other = record(lagged() + 0.05 * np.random.default_rng(1).standard_normal(T.size))
    with pytest.raises(RecordError, match="record 0 and record 2 hold the same samples"):
        identify_repeats([one, other, one], structures=STRUCTURES)
    alike = [
        record(one.outputs[0].values + 1e-4 * np.random.default_rng(k).standard_normal(T.size))
        for k in range(3)
    ]
    pair = identify_repeats(alike, structures=STRUCTURES)["y", "u"]
    assert not pair["delay"].agree
    assert "not independent" in pair.findings[0].message


def test_what_comes_back_every_time_is_told_from_noise() -> None:
    pair = repeats(5, noise=0.05, left=0.1)["y", "u"]
    assert pair.noise_std is not None
    assert pair.noise_std.value == pytest.approx(0.05, rel=0.05)
    # u² - ½ of a sweep has the r.m.s. 1/√8
    assert pair.unmodelled == pytest.approx(0.1 / np.sqrt(8), rel=0.1)
    assert pair.unmodelled_probability is not None
    assert pair.unmodelled_probability < 1e-6
    assert "unmodelled" in [f.code for f in pair.findings]


def test_what_are_no_repeats_is_refused() -> None:
    good = record(lagged())
    with pytest.raises(RecordError, match="1 record is given"):
        identify_repeats([good])
    with pytest.raises(RecordError, match=r"input 'u' of record 1 .* by 2\d\d % \(r"):
        identify_repeats([good, record(lagged(), -U)])
    other = Record.from_arrays({"u": U}, {"z": lagged()}, fs=FS)
    with pytest.raises(RecordError, match="record 1 has channels u, z and record 0 has u, y"):
        identify_repeats([good, other])
    volts, millivolts, unstated = (
        Record.from_arrays({"u": U}, {"y": lagged() + 0.01 * k}, fs=FS, units=units)
        for k, units in enumerate(({"y": "V"}, {"y": "mV"}, {}))
    )
    with pytest.raises(RecordError, match="'y' is in 'mV' in record 1 and in 'V' in record 0"):
        identify_repeats([volts, millivolts])
    check_channels([volts, unstated], ["one", "other"])
    fast = Record.from_arrays({"u": U}, {"y": lagged()}, fs=2 * FS)
    with pytest.raises(RecordError, match="record 1 is at 200 Hz"):
        identify_repeats([good, fast])


def test_what_there_is_not_is_refused_by_name(eight: Repeats) -> None:
    with pytest.raises(RecordError, match=r"there is no pair \('z', 'u'\)"):
        eight["z", "u"]
    with pytest.raises(RecordError, match="the repeats do not determine 'saturation_low'"):
        eight["y", "u"]["saturation_low"]


def test_a_delay_that_varies_between_runs_is_seen(seeds: int) -> None:
    index = np.arange(T.size)
    seen = []
    for seed in range(max(seeds // 40, 4)):
        rng = np.random.default_rng(seed)
        records = []
        for _ in range(4):
            late = 5 + 0.1 * rng.standard_normal()  # 1 ms
            y = np.interp(index - late, index, lagged(delay=0), left=0)
            records.append(record(y + 0.05 * rng.standard_normal(T.size)))
        found = identify_repeats(records, structures=STRUCTURES)["y", "u"]["delay"]
        seen.append(found.probability < 0.05)
        assert found.repeatability == pytest.approx(0.001, rel=0.9)
    assert np.mean(seen) > 0.9
