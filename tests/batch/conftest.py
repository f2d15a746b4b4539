"""Small fleets of records as files."""

from dataclasses import replace

import pytest

import hmpim
from batch_support import gain_record, write_rows
from hmpim.batch import work


@pytest.fixture
def folder_of_records(tmp_path):
    """Five record files, gains 1 to 5."""
    place = tmp_path / "records"
    place.mkdir()
    for k in range(1, 6):
        hmpim.save(gain_record(k, seed=k), place / f"unit{k}.h5")
    return place


@pytest.fixture
def rows_file(tmp_path):
    """Eight records in one Parquet file, as `write_rows` makes it."""
    path = tmp_path / "fleet.parquet"
    write_rows(path)
    return path


@pytest.fixture(scope="session")
def first_unit():
    """What is identified of the unit of gain 1, once."""
    return hmpim.identify(gain_record(1))


@pytest.fixture
def gain_alone(monkeypatch, first_unit):
    """For tests whose subject is not identification: the first unit's result, with each one's gain.

    Gives the records that it was asked for.
    """
    pair, reference = first_unit.pairs[0], gain_record(1).outputs[0].values
    asked = []

    def told(record, **options):
        asked.append(record)
        gain = float(record.outputs[0].values @ reference / (reference @ reference))
        scale = replace(pair.parameters.scale_factor, value=gain, ci95=(gain, gain))
        parameters = replace(pair.parameters, scale_factor=scale)
        return replace(first_unit, pairs=(replace(pair, parameters=parameters),))

    monkeypatch.setattr(work, "identify", told)
    return asked
