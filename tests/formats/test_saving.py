"""What is saved comes back equal."""

import json
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from scipy.signal import lfilter

import hmpim
from hmpim.errors import ArgumentError, FormatError
from hmpim.record import Finding, Record
from hmpim.stimulus.kinds import Kind

FS = 100.0
TIME = np.arange(400) / FS
LIMITS = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")


@pytest.fixture(scope="module")
def result(field_record):
    _, u, y = field_record
    noisy = y + 0.1 * np.random.default_rng(0).standard_normal(y.size)
    return hmpim.identify(Record.from_arrays({"u": u}, {"y": noisy}, fs=200.0, units={"u": "deg"}))


def test_a_result(result, tmp_path):
    hmpim.save(result, tmp_path / "r.json")
    again = hmpim.load(tmp_path / "r.json")
    assert again == result
    assert hash(again) == hash(result)
    assert again["y", "u"].delay == result["y", "u"].delay
    changed = json.loads((tmp_path / "r.json").read_text())
    changed["pairs"][0]["frequency_response"]["std"][3] *= 1.0 + 1e-15
    (tmp_path / "r.json").write_text(json.dumps(changed))
    assert hmpim.load(tmp_path / "r.json") != result


def lag(u, pole=0.8):
    return lfilter([1.0 - pole], [1.0, -pole], u)


CHIRP = np.sin(2 * np.pi * (0.5 * TIME + 2.0 * TIME**2))
OTHER = np.sign(np.random.default_rng(5).standard_normal(TIME.size // 10)).repeat(10)
SENSOR = hmpim.Sensor(delay=0.02, noise_std=0.01, hold_period=0.05, saturation_high=0.7)
RESULTS = {
    "static": ({"u": CHIRP}, {"y": 2.0 * CHIRP + 0.1}),
    "clipped and held": ({"u": CHIRP}, {"y": SENSOR.respond(CHIRP, fs=FS, rng=1)}),
    "rounded": ({"u": CHIRP}, {"y": np.round(lag(CHIRP), 1)}),
    "no relation": ({"u": CHIRP}, {"y": np.random.default_rng(2).standard_normal(TIME.size)}),
    "rising": ({"u": CHIRP}, {"y": np.cumsum(CHIRP) / FS}),
    "nonlinear": ({"u": CHIRP}, {"y": lag(CHIRP) + 0.2 * CHIRP**3}),
    "two inputs": ({"u": CHIRP, "ö": OTHER}, {"y": 2.0 * CHIRP + 0.3 * OTHER}),
}
FEW = {"rising": ["integrator"], "nonlinear": ["first_order"], "two inputs": ["static"]}
"""What is fitted where all structures would take a second: what is saved is of the same kind."""


@pytest.mark.parametrize("kind", RESULTS)
def test_a_result_of_every_kind(kind, tmp_path):
    inputs, outputs = RESULTS[kind]
    rng = np.random.default_rng(3)
    noisy = {name: y + 1e-3 * rng.standard_normal(y.size) for name, y in outputs.items()}
    if kind in ("rounded", "clipped and held"):
        noisy = outputs
    record = Record.from_arrays(inputs, noisy, fs=FS, band=(0.5, 8.0))
    result = hmpim.identify(record, structures=FEW.get(kind))
    hmpim.save(result, tmp_path / "r.json")
    again = hmpim.load(tmp_path / "r.json")
    assert again == result
    assert [p.verdict for p in again] == [p.verdict for p in result]
    hmpim.save(again, tmp_path / "again.json")
    assert (tmp_path / "again.json").read_bytes() == (tmp_path / "r.json").read_bytes()


@pytest.mark.parametrize(
    "waveform",
    [
        hmpim.Chirp(band=(0.1, 3.0), duration=2.0),
        hmpim.Ramp(rate=-0.1, duration=2.0, start=0.5),
        hmpim.Sine(frequency=1 / 3, duration=2.0),
        hmpim.Step(amplitude=1e-7, duration=2.0),
        hmpim.SumOfSines(amplitudes=(0.1, 0.7), frequencies=(1.0, 2.0), duration=2.0),
        hmpim.Sweep(band=(0.1, 3.0), duration=2.0, gain=0.3, extinction=0.5),
    ],
    ids=lambda waveform: type(waveform).__name__,
)
def test_a_stimulus_of_every_waveform(waveform, tmp_path):
    stimulus = hmpim.Stimulus(waveform=waveform, fs=50.0, unit="deg", axis="yaw", tail=0.1)
    hmpim.save(stimulus, tmp_path / "s.toml")
    assert hmpim.load(tmp_path / "s.toml") == stimulus


def test_a_record_of_every_role_in_either_form(tmp_path):
    record = Record.from_arrays(
        {"u": CHIRP},
        {"y": lag(CHIRP)},
        fs=FS,
        references={"r": 2.0 * CHIRP},
        auxiliary={"heat [°C]": TIME / 3.0, "u.velocity": np.gradient(CHIRP)},
        units={"u": "deg", "heat [°C]": "degC"},
        band=(0.5, 8.0),
    )
    findings = (Finding(code="gaps", message="2 missing", severity="info", parameters=()),)
    record = replace(record, findings=findings, source="bench 2")
    for name in ("r.h5", "r.csv"):
        hmpim.save(record, tmp_path / name)
        assert hmpim.load(tmp_path / name) == record, name


@pytest.mark.parametrize("kind", get_args(Kind))
def test_a_stimulus_of_every_kind(kind, tmp_path):
    stimulus = hmpim.design(kind=kind, band=(0.5, 5), duration=4, fs=100, limits=LIMITS, rng=3)
    hmpim.save(stimulus, tmp_path / "s.toml")
    again = hmpim.load(tmp_path / "s.toml")
    assert again == stimulus
    assert again.acceleration.tobytes() == stimulus.acceleration.tobytes()
    other = hmpim.design(
        kind=kind, band=(0.5, 5), duration=4, fs=100, limits=LIMITS, rng=3, axis="roll"
    )
    assert other != stimulus


@pytest.mark.parametrize("suffix", [".csv", ".h5", ".h"])
def test_the_samples_of_a_stimulus_are_not_the_stimulus(suffix, tmp_path):
    stimulus = hmpim.Stimulus(waveform=hmpim.Chirp(band=(1.0, 9.0), duration=2.0), fs=50.0)
    path = tmp_path / f"s{suffix}"
    hmpim.save(stimulus, path)
    with pytest.raises(FormatError, match=r"holds the samples of a stimulus.*save it as .toml"):
        hmpim.load(path)


def test_a_record_on_one_clock_as_a_table(tmp_path):
    record = Record.from_arrays({"u": [0, 1 / 3]}, {"y": [1e300, 2]}, fs=10.0, band=(0.1, 2.0))
    hmpim.save(record, tmp_path / "r.csv")
    assert hmpim.load(tmp_path / "r.csv") == record


def test_what_cannot_be_saved_or_loaded(result, tmp_path):
    with pytest.raises(ArgumentError, match=r"a result cannot be saved as '.*r.docx'; name"):
        hmpim.save(result, tmp_path / "r.docx")
    with pytest.raises(ArgumentError, match=r"thing = \{\} is not a Record or a Stimulus or"):
        hmpim.save({}, tmp_path / "r.json")
    with pytest.raises(ArgumentError, match="does not exist; make it first"):
        hmpim.save(result, tmp_path / "no" / "r.json")
    for content, words in (
        ("{", "cannot be read as JSON"),
        ("[]", "holds nothing that hmpim.save writes"),
        ('{"schema": "x/1"}', "schema is 'x/1'"),
        (
            '{"schema": "hmpim/repeats/1"}',
            "holds what repeats have in common, and the result of one",
        ),
        ('{"schema": "hmpim/model/1"}', "holds an exported model, and the result of one record is"),
        ('{"schema": "hmpim/identification/2"}', "not a complete result: 'pairs' is missing"),
    ):
        (tmp_path / "r.json").write_text(content)
        with pytest.raises(FormatError, match=words):
            hmpim.load(tmp_path / "r.json")
    with pytest.raises(FormatError, match="there is no file"):
        hmpim.load(tmp_path / "r.docx")


@pytest.mark.parametrize(
    ("place", "value", "told"),
    [
        (("input",), None, r"result.pairs\[0\].input = None is not a text"),
        (("verdict",), "good", r"pairs\[0\].verdict = 'good' is not one of 'ok'"),
        (
            ("parameters", "delay", "value"),
            "fast",
            r"parameters.delay.value = 'fast' is not a number",
        ),
        (("dynamics", "covariance"), [[None]], "not a square matrix of finite numbers"),
    ],
)
def test_a_result_that_was_edited_is_refused_when_it_is_read(result, tmp_path, place, value, told):
    """Not later, by a TypeError of whatever uses it."""
    path = tmp_path / "r.json"
    hmpim.save(result, path)
    data = json.loads(path.read_text())
    spot = data["pairs"][0]
    for name in place[:-1]:
        spot = spot[name]
    spot[place[-1]] = value
    path.write_text(json.dumps(data))
    with pytest.raises(FormatError, match=told):
        hmpim.load(path)
