"""Small files that unpack to far more: one sentence, and the stated memory is kept."""

import h5py
import numpy as np
import pytest

import bombs
import hmpim
from hmpim.errors import FormatError
from hmpim.formats.readers import Layout, reader_for
from hmpim.formats.readers.worker import pool

LIMIT = 0.5  # GiB; each bomb unpacks to a quarter more
TOO_LARGE = r"needs more than the 0.5 GiB that reading a file may take.*HMPIM_READER_MEMORY"
# What says by itself how much it holds is found to be damaged, not to be large.
OTHERS = {"hdf5-chunk": "is damaged", "sqlite-view": "is damaged.*missing tables"}
# Those that take seconds to unpack; the others go the same ways.
SLOW = ("hdf5-chunk", "mcap-zstd", "rosbag1-bz2", "rosbag2-messages")


def everything(reader, path):
    contents = reader.channels(path, Layout())
    return reader.read(path, [c.name for c in contents.channels], Layout())


@pytest.mark.parametrize(
    "kind",
    [pytest.param(k, marks=pytest.mark.study) if k in SLOW else k for k in bombs.KINDS],
)
def test_a_bomb_is_stopped(kind, tmp_path, monkeypatch):
    monkeypatch.setenv("HMPIM_READER_MEMORY", str(LIMIT))
    path = tmp_path / "bomb"
    bombs.KINDS[kind](path)
    packed = sum(f.stat().st_size for f in ([path] if path.is_file() else path.iterdir()))
    assert packed < 0.01 * bombs.SIZE
    reader = reader_for(path)
    with pytest.raises(FormatError, match=OTHERS.get(kind, TOO_LARGE)) as caught:
        everything(reader, path)
    assert "\n" not in str(caught.value)
    worker = pool._STATE["worker"]
    assert worker.peak < LIMIT * 2**30
    # What was unpacked to a temporary file is gone again.
    left = [f.stat().st_size for f in pool.Path(worker.scratch.name).rglob("*") if f.is_file()]
    assert sum(left) < 2**20


def test_a_record_of_our_own_may_not_promise_more_than_it_holds(tmp_path):
    """Our own files are read in this process: what they state is held against their size."""
    path = tmp_path / "run.h5"
    time = np.arange(1000) / 100.0
    hmpim.save(hmpim.Record.from_arrays({"u": time}, {"y": time}, fs=100.0), path)
    with h5py.File(path, "a") as file:
        (group,) = file["outputs"].values()
        about = dict(group["values"].attrs)
        del group["values"]
        values = group.create_dataset("values", (10**10,), dtype="f8", chunks=(2**20,))
        values.attrs.update(about)
    with pytest.raises(FormatError, match=r"states 10000000000 .* more than .* bytes can hold"):
        hmpim.load(path)
    with pytest.raises(FormatError, match="more than"):
        hmpim.read(path)
