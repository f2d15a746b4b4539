"""Small fleets of records as files."""

import pytest

import hmpim
from batch_support import SAMPLES, gain_record


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
    """A Parquet file of eight records, three to a row group, gains 1 to 8, with a bench each."""
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / "fleet.parquet"
    tables = []
    for k in range(1, 9):
        record = gain_record(k, seed=k)
        tables.append(
            pa.table(
                {
                    "record": [f"unit{k}"] * SAMPLES,
                    "u": record.inputs[0].values,
                    "y": record.outputs[0].values,
                    "bench": ["left" if k % 2 else "right"] * SAMPLES,
                }
            )
        )
    parquet.write_table(pa.concat_tables(tables), path, row_group_size=SAMPLES * 5 // 2)
    return path
