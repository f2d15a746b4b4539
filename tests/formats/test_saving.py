"""What is saved comes back equal."""

import json
from typing import get_args

import numpy as np
import pytest

import hmpim
from hmpim.errors import ArgumentError, FormatError
from hmpim.record import Record
from hmpim.stimulus.kinds import Kind

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
        ('{"schema": "hmpim/identification/2"}', "is not a whole result"),
    ):
        (tmp_path / "r.json").write_text(content)
        with pytest.raises(FormatError, match=words):
            hmpim.load(tmp_path / "r.json")
    with pytest.raises(FormatError, match="there is no file"):
        hmpim.load(tmp_path / "r.docx")
