"""HDF5 files that were cut short or damaged: one sentence of ours, whatever they held."""

import h5py
import numpy as np
import pytest

import hmpim
from hmpim.errors import FormatError, HmpimError
from hmpim.formats import read
from hmpim.formats.statistics_files import holds_statistics
from hmpim.formats.stimulus_files import read_stimuli, save_stimulus
from mutations import mutated

U = np.random.default_rng(0).standard_normal(400)
RECORD = hmpim.Record.from_arrays({"u": U}, {"y": np.convolve(U, [0.5, 0.5])[:400]}, fs=100.0)


def record(path):
    hmpim.save(RECORD, path)


def statistics(path):
    hmpim.save(hmpim.compress(RECORD, lags=20), path)


def stimulus(path):
    limits = hmpim.Limits(position=2, velocity=1000, acceleration=40000, unit="deg")
    save_stimulus(hmpim.design(band=(0.5, 20), duration=1, fs=100, limits=limits), path)


def foreign(path):
    with h5py.File(path, "w") as file:
        file["u"], file["y"] = RECORD.inputs[0].values, RECORD.outputs[0].values


@pytest.mark.parametrize(
    ("make", "take"),
    [
        (record, hmpim.load),
        (statistics, hmpim.load),
        (record, read),
        (statistics, read),
        (foreign, read),
        (stimulus, read_stimuli),
    ],
)
def test_a_file_that_is_cut_short_says_how_much_is_missing(tmp_path, make, take):
    path = tmp_path / "a.h5"
    make(path)
    whole = path.read_bytes()
    path.write_bytes(whole[: 2 * len(whole) // 3])
    there = 2 * len(whole) // 3
    words = f"^'a.h5' is cut short: {there} of its {len(whole)} bytes are there; copy it again$"
    with pytest.raises(FormatError, match=words):
        take(path)


@pytest.mark.parametrize("make", [record, statistics])
def test_damage_never_ends_in_a_traceback_or_in_words_of_the_library(tmp_path, make):
    """Bytes here and there, as a bad disk leaves them; some only change a figure or a name."""
    make(tmp_path / "whole.h5")
    whole = (tmp_path / "whole.h5").read_bytes()
    path, rng, said = tmp_path / "a.h5", np.random.default_rng(3), []
    for _ in range(60):
        path.write_bytes(mutated(whole, rng))
        holds_statistics(path)
        try:
            hmpim.load(path)
        except HmpimError as error:
            said.append(str(error))
    assert not [words for words in said if "synchronously" in words]
    assert "'a.h5' is damaged, or no HDF5 file; copy it again" in said


def test_a_file_that_another_program_holds_is_not_called_damaged(tmp_path, monkeypatch):
    record(tmp_path / "a.h5")

    def locked(*_, **__):
        raise BlockingIOError(11, "Unable to synchronously open file (unable to lock file)")

    monkeypatch.setattr(h5py, "File", locked)
    with pytest.raises(FormatError, match=r"'a.h5' cannot be opened: .*no other program writes"):
        hmpim.load(tmp_path / "a.h5")
