"""From a record to the result: contracts, refusals, measured hardware, what never is `ok`."""

import json
from itertools import product

import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError, FormatError, RecordError
from hmpim.identify import Identification
from hmpim.identify.identify import identify
from hmpim.record import Channel
from tests_support import field_chirp, in_studies, second_order_lag

FS = 200.0


def record(u, y, **options) -> hmpim.Record:
    return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS, **options)


@pytest.fixture(scope="module")
def result(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    return hmpim.identify(record(u, noisy, units={"u": "deg", "y": "V"}, intersample="bandlimited"))


def test_every_figure_of_the_field_record(result):
    pair = result["y", "u"]
    truth = {
        "delay": (0.15, "s"),
        "delay_low_frequency": (0.15 + 0.8 / (20 * np.pi), "s"),
        "scale_factor": (1.0, "V/deg"),
        "bias": (0.6, "V"),
        "noise_std": (0.1, "V"),
        "natural_frequency": (10.0, "Hz"),
        "damping_ratio": (0.4, ""),
        "bandwidth_phase90": (1.5340, "Hz"),
        "bandwidth_phase90_without_delay": (10.0, "Hz"),
        "bandwidth_3db": (13.7446, "Hz"),
        "peak_gain_db": (2.6954, "dB"),
    }
    for name, (value, unit) in truth.items():
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 4 * estimate.std, name
        assert estimate.ci95[0] < estimate.value < estimate.ci95[1]
        assert estimate.unit == unit, name
    assert pair.structure == "second_order"
    assert pair.verdict == result.verdict == "ok"
    assert pair.time_constant is None
    assert pair.hold_period is None


def test_the_paper_stands_beside_it(result):
    """The literal steps find delay plus what the dynamics add, and spoil bias and noise."""
    paper = result["y", "u"].paper
    assert paper.delay == pytest.approx(0.1725, abs=0.0026)
    assert paper.bias > 0.64
    assert paper.noise_std > 0.25


def test_json_keeps_the_contract(result, tmp_path):
    hmpim.save(result, tmp_path / "r.json")
    data = json.loads((tmp_path / "r.json").read_text())
    assert data["schema"] == "hmpim/identification/2"
    assert set(data["record"]) >= {"fs", "samples", "sha256"}
    pair = data["pairs"][0]
    assert set(pair) >= {
        "input", "output", "structure", "fit_percent", "parameters", "paper",
        "frequency_response", "verdict", "warnings", "stopping",
    }  # fmt: skip
    assert set(pair["parameters"]) == {
        "delay", "delay_correlation", "delay_low_frequency", "scale_factor", "bias", "noise_std",
        "natural_frequency", "damping_ratio", "time_constant", "bandwidth_phase90",
        "bandwidth_phase90_without_delay", "bandwidth_3db", "peak_gain_db", "hold_period",
        "saturation_low", "saturation_high", "quantization_step",
    }  # fmt: skip
    assert set(pair["parameters"]["delay"]) == {"value", "std", "ci95", "unit", "verdict"}
    assert pair["parameters"]["hold_period"] is None
    assert set(pair["paper"]) >= {
        "delay", "bias", "noise_std", "natural_frequency", "bandwidth_phase90",
    }  # fmt: skip
    lengths = {len(pair["frequency_response"][k]) for k in ("frequency", "real", "imag", "std")}
    assert len(lengths) == 1
    assert pair["frequency_response"]["coherence"] is None
    assert Identification.from_dict(data).to_dict() == result.to_dict()


def test_another_schema_is_refused(result):
    with pytest.raises(FormatError, match="schema is 'other/1'"):
        Identification.from_dict({**result.to_dict(), "schema": "other/1"})


def test_unknown_pairs_and_names_are_refused(result):
    with pytest.raises(RecordError, match=r"no pair \('u', 'y'\)"):
        result["u", "y"]
    with pytest.raises(AttributeError, match="no attribute 'dealy'"):
        _ = result["y", "u"].dealy


def test_the_response_holds_the_truth_within_its_bars(result):
    response = result["y", "u"].frequency_response
    s = 2j * np.pi * response.frequency
    w = 20 * np.pi
    truth = np.exp(-0.15 * s) / ((s / w) ** 2 + 0.8 * s / w + 1)
    distance = np.abs(response.response - truth) / response.std
    assert np.sqrt(np.mean(distance**2)) == pytest.approx(1.0, abs=0.35)
    assert np.median(np.abs(response.response / truth - 1)) < 0.02


def test_a_constant_output_is_refused(field_record):
    _, u, _ = field_record
    with pytest.raises(RecordError, match="output 'y' is constant at 3"):
        identify(record(u, np.full(u.size, 3.0)))


def test_a_constant_input_is_refused(field_record):
    _, _, y = field_record
    with pytest.raises(RecordError, match="input 'u' is constant"):
        identify(record(np.zeros(y.size), y))


def test_three_samples_are_refused():
    with pytest.raises(RecordError, match="has 3 samples; at least 50"):
        identify(record([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]))


def test_unknown_options_are_refused(field_record):
    _, u, y = field_record
    with pytest.raises(ArgumentError, match="intersample 'cubic' is not known"):
        identify(record(u, y), intersample="cubic")
    with pytest.raises(ArgumentError, match="structure 'fifth' is not known; choose one of"):
        identify(record(u, y), structures=["fifth"])


UNTOLD = {
    "unrelated": lambda u, seed: np.random.default_rng(seed).standard_normal(u.size),
    "unrelated sine": lambda u, seed: np.sin(2 * np.pi * 3 * np.arange(u.size) / FS + seed),
    "rectifying": lambda u, seed: (
        np.abs(u) + 0.01 * np.random.default_rng(seed).standard_normal(u.size)
    ),
}


@pytest.mark.parametrize(
    ("name", "seed"),
    [("rectifying", 0), ("unrelated", 0), *in_studies(*product(UNTOLD, range(1, 20)))],
)
def test_what_the_record_cannot_tell_is_never_ok(field_record, name, seed):
    _, u, _ = field_record
    assert identify(record(u, UNTOLD[name](u, seed))).verdict == "not_identifiable"


def test_one_dead_channel_of_two_is_named_and_the_other_identified(field_record):
    _, u, y = field_record
    noisy = y + 0.05 * np.random.default_rng(1).standard_normal(y.size)
    both = hmpim.Record.from_arrays({"u": u}, {"y": noisy, "dead": np.ones(u.size)}, fs=FS)
    result = identify(both)
    assert result["y", "u"].verdict == "ok"
    dead = result["dead", "u"]
    assert dead.verdict == "not_identifiable"
    assert [w.code for w in dead.warnings] == ["dead_channel"]
    assert dead.delay is None


def test_a_gap_is_said_and_does_no_harm(field_record):
    time, u, y = field_record
    noisy = y + 0.05 * np.random.default_rng(1).standard_normal(y.size)
    keep = (time < 4.0) | (time > 4.4)
    gapped = hmpim.Record.from_arrays(
        {"u": u[keep]}, {"y": noisy[keep]}, time=time[keep], intersample="bandlimited"
    )
    pair = identify(gapped)["y", "u"]
    assert "gaps" in [w.code for w in pair.warnings]
    for name, value in (("delay", 0.15), ("natural_frequency", 10.0), ("bias", 0.6)):
        estimate = getattr(pair, name)
        assert abs(estimate.value - value) < 5 * estimate.std, name


def test_the_measured_response_is_right_where_the_output_has_a_gap(field_record):
    """What is filled in between the ends of a gap is no answer to the input."""
    time, u, y = field_record
    noisy = y + 0.02 * np.random.default_rng(1).standard_normal(y.size)
    told = (time < 3.0) | (time >= 3.2)
    record = hmpim.Record(
        inputs=(Channel(name="u", time=time, values=u),),
        outputs=(Channel(name="y", time=time[told], values=noisy[told]),),
        fs=FS,
        intersample="bandlimited",
    )
    pair = identify(record)["y", "u"]
    assert pair.verdict == "ok"
    seen = pair.frequency_response
    s = 2j * np.pi * seen.frequency
    omega = 2 * np.pi * 10.0
    truth = pair.scale_factor.value * np.exp(-0.15 * s) / ((s / omega) ** 2 + 0.8 * s / omega + 1)
    assert np.mean(np.abs(seen.response - truth) > 3 * seen.std) < 0.02


def test_jitter_is_said_and_does_no_harm():
    rng = np.random.default_rng(1)
    fine = np.arange(20000) / 2000.0
    response = second_order_lag(
        fine, field_chirp, delay=0.15, natural_frequency=10.0, damping_ratio=0.4, steps=2
    )
    at = np.arange(2000) * 10 + rng.integers(-3, 4, 2000)
    at = np.clip(at, 0, fine.size - 1)
    jittered = hmpim.Record.from_arrays(
        {"u": field_chirp(fine[at])},
        {"y": response[at] + 0.6 + 0.05 * rng.standard_normal(2000)},
        time=fine[at] + np.arange(2000) * 1e-12,
    )
    pair = identify(jittered)["y", "u"]
    assert "jitter" in [w.code for w in pair.warnings]
    assert pair.delay.value == pytest.approx(0.15, abs=5e-4)
    assert pair.natural_frequency.value == pytest.approx(10.0, abs=0.15)


def test_a_late_input_column_shows_as_a_negative_delay(field_record):
    _, u, _ = field_record
    noisy = u[2:] + 0.01 * np.random.default_rng(1).standard_normal(u.size - 2)
    pair = identify(record(u[:-2], noisy))["y", "u"]
    assert pair.delay.value == pytest.approx(-0.01, abs=1e-3)
    assert pair.verdict == "doubtful"
    assert "negative_delay" in [w.code for w in pair.warnings]


def test_the_model_predicts_what_it_has_not_seen(result, field_record):
    _, u, y = field_record
    prediction = hmpim.predict(result["y", "u"], record(u[::-1].copy(), y))
    assert prediction.fit_percent < 50  # another input: the output does not follow it
    good = hmpim.predict(result["y", "u"], record(u, y))
    assert good.fit_percent > 99


ASKED = ["reported", *in_studies("modelled")]
"""A nonlinear part takes most of the time, and is not looked for in what hardly has one."""


@pytest.fixture(scope="module", params=ASKED)
def circuit(measured, request):
    """The record of a real circuit behind a held input, and what its first quarter tells."""
    whole = hmpim.read(measured / "rcrc" / "prbs.csv")
    quarter = whole.between(0.0, whole.duration / 4)
    return whole, hmpim.identify(quarter, nonlinear=request.param)["output", "input"]


@pytest.mark.real_data
def test_a_held_input_through_a_real_circuit(circuit):
    """One pole near 28.6 Hz, delay 1.28 ms beyond the hold, the three quarters it has not seen."""
    whole, pair = circuit
    assert pair.intersample == "zoh"
    assert pair.structure == "first_order"
    assert pair.scale_factor.value == pytest.approx(0.985, abs=0.01)
    assert 1 / (2 * np.pi * pair.time_constant.value) == pytest.approx(28.6, rel=0.03)
    assert pair.delay.value == pytest.approx(1.28e-3, abs=0.1e-3)
    assert hmpim.predict(pair, whole, start=whole.duration / 4).fit_percent > 98
    assert pair.delay.verdict == pair.time_constant.verdict == "doubtful"  # a second stage hides
    assert pair.scale_factor.verdict == pair.bandwidth_3db.verdict == "ok"
    assert "other_dynamics" in {finding.code for finding in pair.warnings}


@pytest.mark.real_data
def test_converters_that_bend_by_a_per_cent_are_no_doubt(circuit):
    found = circuit[1].nonlinearity
    assert found.share < 0.02
    assert found.odd == 0.0


@pytest.mark.real_data
def test_an_input_column_one_sample_late_takes_one_sample_off_the_delay(measured, circuit):
    late = hmpim.read(measured / "rcrc" / "square_step.csv").between(0.0, 4.0)
    found = hmpim.identify(late, nonlinear="reported")["output", "input"].delay.value
    assert circuit[1].delay.value - found == pytest.approx(1.00e-3, abs=0.02e-3)


@pytest.mark.real_data
@pytest.mark.parametrize("nonlinear", ASKED)
def test_a_position_loop_from_reference_to_position(measured, nonlinear):
    """emps: 21.25 Hz, damping 0.363, delay 1.10 ms, scale 1.0000, relative error 0.0045 %."""
    data = np.load(measured / "emps" / "emps.npz")
    loop = hmpim.Record.from_arrays({"qg": data["qg"]}, {"qm": data["qm"]}, time=data["t"])
    pair = hmpim.identify(loop, nonlinear=nonlinear)["qm", "qg"]
    assert pair.structure == "second_order"
    assert pair.natural_frequency.value == pytest.approx(21.25, rel=0.01)
    assert pair.damping_ratio.value == pytest.approx(0.363, rel=0.03)
    assert pair.delay.value == pytest.approx(1.10e-3, abs=0.1e-3)
    assert pair.scale_factor.value == pytest.approx(1.0, abs=1e-4)
    relative = np.linalg.norm(pair.residual) / np.linalg.norm(data["qm"])
    assert relative < 6e-5


@pytest.mark.parametrize("seed", [0, *in_studies(*range(1, 20))])
def test_a_level_behind_the_noise_is_not_taken_for_a_drift(field_record, seed):
    _, u, ideal = field_record
    level = float(np.quantile(ideal, 2 / 3))
    noise = 0.05 * np.random.default_rng([3, seed]).standard_normal(u.size)
    y = np.minimum(ideal, level) + noise
    pair = hmpim.identify(
        hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=200.0, intersample="bandlimited")
    )["y", "u"]
    assert pair.saturation_high.value == pytest.approx(level, abs=4 * pair.saturation_high.std)
    for name, truth in (("scale_factor", 1.0), ("bias", 0.6), ("natural_frequency", 10.0)):
        found = getattr(pair, name)
        assert found.value == pytest.approx(truth, abs=4 * found.std), name
    assert "drift" not in {warning.code for warning in pair.warnings}
