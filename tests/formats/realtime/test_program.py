"""A stimulus as C99: the target's samples are ours, and a stop is the package's own brake."""

import subprocess

import numpy as np
import pytest

from hmpim.errors import ArgumentError
from hmpim.formats.realtime import program_of, save_stimulus_program
from hmpim.formats.stimulus import stimulus_columns
from hmpim.formats.stimulus_files import read_stimulus, save_stimulus
from hmpim.rigs.brake import Brake
from hmpim.stimulus import (
    KINDS,
    Chirp,
    Limits,
    Multisine,
    Ramp,
    Reversed,
    SampledMotion,
    Sine,
    Step,
    Stimulus,
    SumOfSines,
    Sweep,
    design,
)
from tests_support import c_compiler

LIMITS = Limits(position=10, velocity=500, acceleration=40000, unit="deg")
FLAGS = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
SIGNALS = ("position", "velocity", "acceleration")
BAND = (1.0, 40.0)


@pytest.fixture(scope="module")
def every_stimulus():
    """One of each waveform that has a formula, each an axis of its own."""
    wish = {"band": BAND, "duration": 1.0, "fs": 200.0, "limits": LIMITS, "rng": 4}
    made = [
        design(**wish, kind=kind, lead=lead, axis=f"{kind} {lead}")
        for kind in KINDS
        for lead in ("auto", 0)
    ]
    made += [
        design(**wish, extinction=n, lead=lead, axis=f"n {n} {lead}")
        for n, lead in ((0.0, 0), (0.4, 0), (1.0, 0.5), (1.0, 0), (2.0, 0))
    ]
    made.append(design(**wish, resolution=1e-3, axis="rounded"))
    classical = {
        "chirp": Chirp(band=BAND, duration=1.0, amplitude=3.0),
        "backwards": Reversed(waveform=Sweep(band=BAND, duration=1.0, extinction=0.6)),
        "ramp": Ramp(rate=-0.1, duration=2.0, start=0.3),
        "sine": Sine(frequency=1 / 3, duration=2.0),
        "step": Step(amplitude=0.7, duration=2.0, start=0.3),
        "sines": SumOfSines(amplitudes=(0.1, 0.7), frequencies=(1.0, 2.0), duration=2.0),
        "uneven": Multisine(
            frequencies=(1.0, 2.0, 3.5), amplitudes=(1.0, 0.5, 0.2), phases=(0.1, 2.0, -1.0),
            duration=3.0,
        ),
    }  # fmt: skip
    return made + [
        Stimulus(waveform=waveform, fs=200.0, unit="deg", axis=axis)
        for axis, waveform in classical.items()
    ]


def compiled(folder, source, *flags):
    program = folder / "program"
    done = subprocess.run(
        [c_compiler(), *FLAGS, *flags, "-o", str(program), str(source), "-lm"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return subprocess.run([str(program)], capture_output=True, text=True, check=True).stdout


def test_every_waveform_is_the_target_s_to_1e_12(tmp_path, every_stimulus):
    stimuli = every_stimulus
    save_stimulus(stimuli, tmp_path / "s.c")
    heads, *rows = compiled(tmp_path, tmp_path / "s.c", "-DHMPIM_PRINT").splitlines()
    printed = np.array([np.fromstring(row, sep=",") for row in rows])
    columns = dict(zip(heads.split(","), printed.T, strict=True))
    assert len(columns) == 3 * len(stimuli) + 1
    for stimulus in stimuli:
        ours = stimulus_columns(stimulus, stimuli)
        assert np.array_equal(columns["time"], ours["time"])
        for name in SIGNALS:
            theirs = columns[f"{stimulus.axis}.{name}"]
            most = max(float(np.abs(ours[name]).max()), 1e-300)
            n = stimulus.samples
            apart = np.abs(theirs - ours[name])[:n].max()
            assert apart <= 1e-12 * most, (stimulus.axis, name)
            still = 0.0 if name != "position" else ours[name][-1]
            assert np.allclose(theirs[n:], still, rtol=0, atol=1e-12 * most), stimulus.axis


def test_a_stop_is_the_package_s_brake_and_holds(tmp_path):
    limits = Limits(position=10, velocity=500, acceleration=5000, unit="deg")
    stimulus = design(band=(1.0, 10.0), duration=2.0, fs=500.0, limits=limits)
    save_stimulus_program(stimulus, tmp_path / "s.c")
    stopped = int(np.argmax(np.abs(stimulus.velocity)))
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#define HMPIM_DECLARATIONS\n#include "s.c"\n'
        "static hmpim_player player;\n"
        "int main(void) {\n  long k; hmpim_motion m; int going;\n"
        f"  for (k = 0; k < {stopped} + 60; k++) {{\n"
        f"    if (k == {stopped} + 1) {{ stimulus_stop(&player); stimulus_stop(&player); }}\n"
        "    going = stimulus_step(&player, &m);\n"
        '    printf("%.17g,%.17g,%.17g,%d\\n", m.position, m.velocity, m.acceleration, going);\n'
        "  }\n  return 0;\n}\n"
    )
    subprocess.run(
        [c_compiler(), *FLAGS, "-c", "-o", str(tmp_path / "s.o"), str(tmp_path / "s.c")], check=True
    )
    out = compiled(tmp_path, tmp_path / "main.c", str(tmp_path / "s.o")).splitlines()
    rows = np.array([np.fromstring(row, sep=",") for row in out])
    brake = Brake(
        position=stimulus.position[[stopped]],
        velocity=stimulus.velocity[[stopped]],
        acceleration=np.array([limits.acceleration]),
    )
    assert brake.duration > 4 / 500  # else nothing is braked here
    for k, row in enumerate(rows[stopped + 1 :], start=1):
        wanted = [float(part[0]) for part in brake.at(k / 500.0)]
        assert row[:3] == pytest.approx(wanted, rel=1e-12, abs=1e-12)
        assert row[3] == (k / 500.0 < brake.duration)
    assert np.allclose(rows[: stopped + 1, 0], stimulus.position[: stopped + 1], atol=1e-12)


def test_nothing_is_asked_of_the_target_but_mathematics(tmp_path, every_stimulus):
    save_stimulus(every_stimulus, tmp_path / "s.c")
    command = [c_compiler(), *FLAGS, "-c", "-o", str(tmp_path / "s.o"), str(tmp_path / "s.c")]
    subprocess.run(command, check=True)
    listed = subprocess.run(
        ["nm", str(tmp_path / "s.o")], capture_output=True, text=True, check=True
    ).stdout.split("\n")
    wanted = {line.split()[-1] for line in listed if " U " in line}
    assert wanted <= {"sin", "cos", "sincos", "pow", "exp", "expm1", "floor", "rint", "fabs",
                      "_GLOBAL_OFFSET_TABLE_", "__stack_chk_fail"}  # fmt: skip
    assert not [line for line in listed if line[17:18] in {*"bBdD"}]  # no memory that is written


def test_it_says_how_far_a_stop_may_go():
    sine = Stimulus(
        waveform=Sine(frequency=1.0, duration=2.0), fs=100.0,
        limits=Limits(position=1.0, acceleration=40.0),
    )  # fmt: skip
    text = program_of(sine)
    assert "a stop takes it to 1 from the middle at most (deceleration 40 units/s^2)." in text
    # it ends at its limit, moving: one unit/s² takes 2 s and 2 more units
    ramp = Stimulus(waveform=Ramp(rate=2.0, duration=1.0), fs=100.0, limits=Limits(position=2.0))
    assert "to 3.98 from the middle at most, BEYOND ITS POSITION LIMIT" in program_of(ramp)


def test_samples_alone_are_refused(tmp_path):
    save_stimulus(design(band=BAND, duration=1.0, fs=200.0, limits=LIMITS), tmp_path / "s.h")
    [played] = read_stimulus(tmp_path / "s.h")
    motion = SampledMotion(
        fs=played.fs, position=played.position, velocity=played.velocity,
        acceleration=played.acceleration,
    )  # fmt: skip
    with pytest.raises(ArgumentError, match=r"samples alone has no formula .* as \.h"):
        save_stimulus(Stimulus(waveform=motion, fs=200.0), tmp_path / "s.c")
    assert not (tmp_path / "s.c").exists()


def test_a_program_is_not_read_back(tmp_path):
    save_stimulus(design(band=BAND, duration=1.0, fs=200.0, limits=LIMITS), tmp_path / "s.c")
    with pytest.raises(ArgumentError, match=r"no stimulus can be read from .*s\.c"):
        read_stimulus(tmp_path / "s.c")
