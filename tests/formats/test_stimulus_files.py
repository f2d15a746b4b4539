"""Stimuli out to the rig and back: the same bits through every format, whole files only."""

import os
import subprocess
import sys

import numpy as np
import pytest
import scipy.io

from hmpim import Record, save
from hmpim.errors import ArgumentError, FormatError, LimitsError
from hmpim.formats.stimulus import save_stimulus_csv, save_stimulus_json
from hmpim.formats.stimulus_files import STIMULUS_SUFFIXES, read_stimulus, save_stimulus
from hmpim.formats.stimulus_spec import read_stimulus_toml, save_stimulus_toml, stimulus_to_toml
from hmpim.stimulus import (
    KINDS,
    Chirp,
    Limits,
    Ramp,
    Sine,
    Step,
    Stimulus,
    SumOfSines,
    design,
)
from tests_support import c_compiler

LIMITS = Limits(position=10, velocity=500, jerk=1e7, unit="deg")
WISH = {"band": (0.3, 15.0), "duration": 4.0, "fs": 100.0, "limits": LIMITS}
SIGNALS = ("time", "position", "velocity", "acceleration")
SAMPLED = [suffix for suffix in STIMULUS_SUFFIXES if suffix not in (".toml", ".c")]


def same_bits(one, other):
    return all(getattr(one, s).tobytes() == getattr(other, s).tobytes() for s in SIGNALS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("lead", ["auto", 1.0])
def test_specification_makes_the_same_samples_bit_for_bit(tmp_path, kind, lead):
    stimulus = design(**WISH, kind=kind, rng=4, lead=lead, axis="roll", resolution=1e-6)
    save_stimulus_toml(stimulus, tmp_path / "s.toml")
    [back] = read_stimulus_toml(tmp_path / "s.toml")
    assert same_bits(back, stimulus)
    assert back.waveform == stimulus.waveform
    assert (back.limits, back.peaks, back.tail) == (stimulus.limits, stimulus.peaks, stimulus.tail)
    assert (back.axis, back.unit, back.resolution) == ("roll", "deg", 1e-6)
    assert stimulus_to_toml(back) == stimulus_to_toml(stimulus)


@pytest.mark.parametrize(
    "waveform",
    [
        Chirp(band=(0.1, 3.0), duration=2.0),
        Ramp(rate=-0.1, duration=2.0, start=0.5),
        Sine(frequency=1 / 3, duration=2.0),
        Step(amplitude=1e-7, duration=2.0),
        SumOfSines(amplitudes=(0.1, 0.7), frequencies=(1.0, 2.0), duration=2.0),
    ],
    ids=lambda waveform: type(waveform).__name__,
)
def test_classical_waveforms_come_back_the_same(tmp_path, waveform):
    save_stimulus(Stimulus(waveform=waveform, fs=1e3 / 7), tmp_path / "s.toml")
    [back] = read_stimulus(tmp_path / "s.toml")
    assert back.waveform == waveform
    assert back.fs == 1e3 / 7


def test_a_wish_written_by_hand_is_designed_the_same_in_another_process(tmp_path):
    (tmp_path / "w.toml").write_text(
        "[[design]]\nkind = 'random_phase'\nseed = 7\nband = [0.3, 15]\nduration = 4\nfs = 100\n"
        "limits = {position = 10, velocity = 500, jerk = 1e7, unit = 'deg'}\n"
    )
    [here] = read_stimulus(tmp_path / "w.toml")
    assert same_bits(here, design(**WISH, kind="random_phase", rng=7))
    script = (
        "import sys; from hmpim.formats.stimulus_files import read_stimulus\n"
        "sys.stdout.buffer.write(read_stimulus(sys.argv[1])[0].position.tobytes())"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "w.toml")]
    there = subprocess.run(command, capture_output=True, check=True)
    assert there.stdout == here.position.tobytes()


@pytest.mark.parametrize("suffix", SAMPLED)
@pytest.mark.parametrize("axes", [("",), ("roll", "outer yaw")])
def test_samples_come_back_bit_for_bit(tmp_path, suffix, axes):
    stimuli = [
        design(**{**WISH, "duration": 3.0 + k}, kind=kind, axis=axis)
        for k, (axis, kind) in enumerate(zip(axes, ("hmpim", "prbs"), strict=False))
    ]
    save_stimulus(stimuli, tmp_path / f"s{suffix}")
    back = read_stimulus(tmp_path / f"s{suffix}")
    assert len(back) == len(stimuli)
    longest = max(s.samples for s in stimuli)
    played = {b.axis.replace(" ", "_"): b for b in back}
    for stimulus in stimuli:
        found = played[stimulus.axis.replace(" ", "_")]
        n = stimulus.samples
        assert found.time.size == longest
        for name in SIGNALS:
            assert getattr(found, name)[:n].tobytes() == getattr(stimulus, name).tobytes(), name
        assert not found.velocity[n:].any()
        assert (found.unit, found.fs) == ("deg", 100.0)


@pytest.mark.parametrize("suffix", SAMPLED)
def test_positions_are_sent_rounded(tmp_path, suffix):
    stimulus = design(**WISH, resolution=0.001)
    save_stimulus(stimulus, tmp_path / f"s{suffix}")
    [back] = read_stimulus(tmp_path / f"s{suffix}")
    assert np.array_equal(back.position, stimulus.commanded().position)
    assert not np.array_equal(back.position, stimulus.position)


def test_c_header_is_what_a_compiler_reads(tmp_path):
    stimulus = design(**WISH, axis="2nd axis")
    save_stimulus(stimulus, tmp_path / "play-this.h")
    text = (tmp_path / "play-this.h").read_text()
    assert text.startswith("/* hmpim stimulus */\n#ifndef HMPIM_PLAY_THIS_H\n")
    assert f"#define AXIS_2ND_AXIS_SAMPLES {stimulus.samples}\n" in text
    assert f"static const double axis_2nd_axis_position[{stimulus.samples}] = {{\n" in text
    compiler = c_compiler()
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "play-this.h"\nint main(void) {\n'
        "  fwrite(axis_2nd_axis_velocity, sizeof(double), AXIS_2ND_AXIS_SAMPLES, stdout);\n"
        "  return AXIS_2ND_AXIS_RATE_HZ == 100.0 ? 0 : 1;\n}\n"
    )
    program = str(tmp_path / "main")
    source = str(tmp_path / "main.c")
    subprocess.run([compiler, "-std=c99", "-o", program, source], check=True)
    out = subprocess.run([program], capture_output=True, check=True).stdout
    assert out == stimulus.velocity.tobytes()


def test_two_axes_of_one_identifier_are_kept_apart_in_mat_and_c(tmp_path):
    stimuli = [
        Stimulus(waveform=Sine(amplitude=a, frequency=1.0, duration=1.0), fs=8.0, axis=axis)
        for a, axis in ((1.0, "yaw 1"), (2.0, "yaw_1"))
    ]
    for name in ("s.mat", "s.h"):
        save_stimulus(stimuli, tmp_path / name)
        tops = [float(np.abs(b.position).max()) for b in read_stimulus(tmp_path / name)]
        assert tops == [1.0, 2.0]


@pytest.mark.parametrize("suffix", STIMULUS_SUFFIXES)
def test_a_failure_leaves_the_old_file_and_no_rubbish(tmp_path, suffix, monkeypatch):
    path = tmp_path / f"s{suffix}"
    path.write_bytes(b"old")
    stimulus = design(**WISH)

    def full(self, target):
        raise OSError("no space left on device")

    monkeypatch.setattr("pathlib.Path.replace", full)
    with pytest.raises(ArgumentError, match="cannot be written: no space left"):
        save_stimulus(stimulus, path)
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_files_have_the_usual_rights_and_links_stay(tmp_path):
    mask = os.umask(0o027)
    try:
        save_stimulus_csv(design(**WISH), tmp_path / "real.csv")
    finally:
        os.umask(mask)
    assert (tmp_path / "real.csv").stat().st_mode & 0o777 == 0o640
    (tmp_path / "link.json").symlink_to(tmp_path / "real.json")
    save_stimulus_json(design(**WISH), tmp_path / "link.json")
    assert (tmp_path / "link.json").is_symlink()
    assert (tmp_path / "real.json").read_text().startswith("{")


def test_targets_that_cannot_be_written(tmp_path):
    with pytest.raises(ArgumentError, match="is a folder; name a file in it"):
        save_stimulus_csv(design(**WISH), tmp_path)
    with pytest.raises(ArgumentError, match="does not exist; make it first"):
        save_stimulus_csv(design(**WISH), tmp_path / "no" / "s.csv")


BAD = {
    "empty.toml": b"",
    "binary.toml": bytes(range(256)),
    "other.toml": b"format = 'hmpim/stimulus/9'",
    "kind.toml": b"[[stimulus]]\nfs=1.0\n[stimulus.waveform]\ntype='os.system'\n",
    "field.toml": b"[[stimulus]]\nfs=1.0\n[stimulus.waveform]\ntype='Sine'\nwings=2\n",
    "bare.toml": b"stimulus = [3]",
    "wish.toml": b"[[design]]\nbond=[0.1, 10]\n",
    "part.toml": b"[[design]]\nband=[0.1, 10]\n",
    "empty.csv": b"",
    "text.csv": b"# hmpim stimulus; fs = 4.0 Hz, unit = m\ntime,position\n0.0,x\n",
    "binary.h5": bytes(range(256)),
    "binary.mat": bytes(range(256)) * 2,
    "empty.h": b"",
    "part.h": b"static const double s_position[1] = {0x1p0,};",
}


@pytest.mark.parametrize("name", [*BAD, "absent.toml", "absent.csv", "absent.h5", "absent.mat"])
def test_bad_files_are_refused_by_name(tmp_path, name):
    if name in BAD:
        (tmp_path / name).write_bytes(BAD[name])
    with pytest.raises(FormatError, match=name.replace(".", r"\.") + "|os.system"):
        read_stimulus(tmp_path / name)


@pytest.mark.parametrize("kept", [0.5, 0.999])
def test_a_table_that_is_cut_short_is_refused(tmp_path, kept):
    """Its motion would end before it comes to rest."""
    stimulus = design(**WISH, axis="roll")
    save_stimulus_csv(stimulus, tmp_path / "s.csv")
    lines = (tmp_path / "s.csv").read_text().splitlines(keepends=True)
    whole = lines[: int(len(lines) * kept)]
    for text in ("".join(whole), "".join(whole) + "1.5,0."):
        (tmp_path / "cut.csv").write_text(text)
        words = rf"{len(whole) - 2} of its {stimulus.samples} samples are complete; copy it again"
        with pytest.raises(FormatError, match=words):
            read_stimulus(tmp_path / "cut.csv")


def test_what_holds_no_stimulus_says_what_to_do(tmp_path):
    record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0)
    save(record, tmp_path / "r.h5")
    scipy.io.savemat(tmp_path / "r.mat", {"u": [0, 1, 0], "log": {"y": [0, 0, 1]}})
    for name in ("r.h5", "r.mat"):
        with pytest.raises(FormatError, match=f"{name}' holds no stimulus; make one with hmpim"):
            read_stimulus(tmp_path / name)


def test_a_specification_beyond_its_limits_is_refused(tmp_path):
    text = stimulus_to_toml(design(**WISH)).replace("velocity = 500.0", "velocity = 50.0")
    (tmp_path / "s.toml").write_text(text)
    with pytest.raises(LimitsError, match="peak velocity"):
        read_stimulus(tmp_path / "s.toml")


def test_unknown_suffixes_and_waveforms():
    with pytest.raises(ArgumentError, match=r"cannot be written to 's.xls'; name a file that ends"):
        save_stimulus(design(**WISH), "s.xls")

    class Mine(Sine):
        pass

    with pytest.raises(ArgumentError, match="a Mine is not a waveform of this package"):
        stimulus_to_toml(Stimulus(waveform=Mine(frequency=1.0, duration=1.0), fs=8.0))
