"""Stimuli as files: the exact bytes, numbers that read back the same, refusals."""

import csv
import json

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.stimulus import save_stimulus_csv, save_stimulus_json, stimulus_to_dict
from hmpim.stimulus import Limits, Ramp, Sine, Stimulus, design

LIMITS = Limits(position=10, velocity=500, unit="deg")


def read(path):
    lines = path.read_text(encoding="utf-8").splitlines()
    comments = [line for line in lines if line.startswith("#")]
    header, *rows = csv.reader(line for line in lines if not line.startswith("#"))
    return comments, header, np.array(rows, dtype=float)


def test_bytes_of_a_small_file(tmp_path):
    ramp = Stimulus(waveform=Ramp(rate=0.5, duration=0.75), fs=4.0, unit="m")
    save_stimulus_csv(ramp, tmp_path / "s.csv")
    assert (tmp_path / "s.csv").read_bytes() == (
        b"# hmpim stimulus; fs = 4.0 Hz, unit = m, sweep = 0.0 s + 0.75 s, samples = 3\n"
        b"time,position,velocity,acceleration\n"
        b"0.0,0.0,0.5,0.0\n0.25,0.125,0.5,0.0\n0.5,0.25,0.5,0.0\n"
    )


def test_every_number_reads_back_to_the_same_float(tmp_path):
    stimulus = design(band=(0.1, 40), duration=4, fs=500, limits=LIMITS)
    save_stimulus_csv(stimulus, tmp_path / "s.csv")
    comments, header, rows = read(tmp_path / "s.csv")
    assert header == ["time", "position", "velocity", "acceleration"]
    for column, name in enumerate(header):
        assert np.array_equal(rows[:, column], getattr(stimulus, name))
    assert f"gain = {stimulus.gain!r}, n = {stimulus.extinction!r}" in comments[0]
    assert "unit = deg, band = 0.1 40.0 Hz" in comments[0]


def test_several_axes_stand_still_to_the_end_of_the_longest(tmp_path):
    roll = design(band=(0.1, 10), duration=4, fs=100, limits=LIMITS, axis="roll")
    yaw = design(band=(0.2, 10), duration=3, fs=100, limits=LIMITS, axis="yaw", lead=0)
    save_stimulus_csv([yaw, roll], tmp_path / "s.csv")
    comments, header, rows = read(tmp_path / "s.csv")
    assert header[1:4] == ["yaw.position", "yaw.velocity", "yaw.acceleration"]
    assert header[4:] == ["roll.position", "roll.velocity", "roll.acceleration"]
    assert comments[0].startswith("# hmpim stimulus; yaw: fs = 100.0 Hz")
    assert np.array_equal(rows[:, 4], roll.position)
    assert np.array_equal(rows[:300, 1], yaw.position)
    end = yaw.motion(np.array([3.0])).position[0]
    assert set(rows[301:, 1]) == {end}
    assert not rows[301:, 2:4].any()


@pytest.mark.parametrize("lead", ["auto", 0, 1.5])
def test_json_says_what_the_stimulus_is(tmp_path, lead):
    stimulus = design(band=(0.1, 10), duration=10, fs=500, limits=LIMITS.to("rad"), lead=lead)
    save_stimulus_json(stimulus, tmp_path / "s.json")
    data = json.loads((tmp_path / "s.json").read_text(encoding="utf-8"))
    assert data == stimulus_to_dict(stimulus)
    assert data["gain"] == stimulus.gain
    assert data["extinction"] == stimulus.extinction
    assert data["peaks"]["velocity"] == stimulus.peaks.velocity
    assert data["band"] == [0.1, 10.0]
    assert data["limits"]["acceleration"] is None
    assert data["limits"]["unit"] == data["unit"] == "rad"
    parts = data["lead"] + data["sweep_duration"] + data["lead_out"] + data["tail"]
    assert data["duration"] == pytest.approx(parts, abs=1e-12)
    assert data["samples"] == round(data["duration"] * data["fs"])
    if lead == 0:
        assert (data["lead"], data["lead_out"], data["tail"]) == (0.0, 0.0, 0.0)


def test_json_of_a_waveform_without_gain_or_limits():
    data = stimulus_to_dict(Stimulus(waveform=Ramp(duration=1.0), fs=10.0))
    assert data["gain"] is data["extinction"] is data["band"] is data["limits"] is None


def sine(axis, fs=10.0):
    return Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=fs, axis=axis)


@pytest.mark.parametrize(
    ("stimuli", "message"),
    [
        ([], "there is no stimulus"),
        ([sine("a"), sine("b", fs=20.0)], "sampled at 10 Hz and 20 Hz"),
        ([sine("a"), sine("a")], r"axes \['a', 'a'\] must be different names"),
        ([sine("a"), sine("")], "must be different names"),
        ([sine("a,b"), sine("c")], "axis 'a,b' cannot head a column"),
    ],
)
def test_refusals_leave_no_file(tmp_path, stimuli, message):
    with pytest.raises(ArgumentError, match=message):
        save_stimulus_csv(stimuli, tmp_path / "s.csv")
    assert not (tmp_path / "s.csv").exists()
