"""C and Python give the numbers that the model gives."""

import runpy
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from hmpim.errors import ArgumentError, RecordError
from hmpim.formats.models import export
from hmpim.identify import Identification, Parameters
from hmpim.model import Model, frequency_response
from hmpim.record import Finding
from tests_support import few_of

from .conftest import FS, compiled_c, result_of

T = np.arange(500) / FS
SECOND = Model(
    delay=0.15,
    scale_factor=2.0,
    denominator=(2.5330295910584444e-4, 0.012732395447351628, 1.0),
    bias=0.6,
    noise_std=0.1,
    output_unit="deg",
    band=20.0,
)
MODELS = {
    "static": Model(delay=0.0, scale_factor=-1.5, bias=0.3, noise_std=0.1),
    "second": SECOND,
    "held": replace(
        SECOND,
        delay=0.0314,
        hold_period=0.0171,
        saturation_low=-3.0,
        saturation_high=4.0,
        quantization_step=0.05,
    ),
    "held twice a sample": replace(SECOND, delay=0.001, hold_period=0.0021),
    "half open": replace(SECOND, delay=0.0025, saturation_high=1.5),
    "zero": Model(
        delay=0.0123, scale_factor=1.0, numerator=(0.02, 1.0), denominator=(4e-4, 0.02, 1.0),
        noise_std=0.1,
    ),
    "feedforward": Model(
        delay=0.0123, scale_factor=1.0, numerator=(1e-4, 0.02, 1.0),
        denominator=(1e-6, 5e-4, 0.03, 1.0), noise_std=0.1, intersample="feedforward", band=15.0,
    ),
    "integrator": Model(
        delay=0.007, scale_factor=3.0, denominator=(0.03, 1.0, 0.0), noise_std=0.1, bias=-1.0
    ),
    "integrator alone": Model(delay=0.0, scale_factor=3.0, denominator=(1.0, 0.0), noise_std=0.1),
    "fourth": Model(
        delay=0.9, scale_factor=1.0,
        denominator=tuple(np.polymul(SECOND.denominator, (1e-5, 1e-3, 1))),
        noise_std=0.1,
    ),
}  # fmt: skip


HELD = ("feedforward", "half open", "held", "integrator", "zero")
"""Models whose programs are run with a held input as well."""
PROGRAMS = [(name, "bandlimited") for name in sorted(MODELS)] + [(name, "zoh") for name in HELD]
BETWEEN = ("foh", "zoh", "bandlimited")


def walk(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).standard_normal(T.size).cumsum() / 5 + 1.0


@pytest.mark.usefixtures("needs_cc")
@pytest.mark.parametrize(("name", "intersample"), few_of(PROGRAMS, sorted(MODELS), BETWEEN))
def test_programs_give_what_the_model_gives(name, intersample, tmp_path):
    model = replace(MODELS[name], intersample=intersample, band=20.0)
    result, u = result_of(model), walk(1)
    truth = model.simulate(u, T)
    export(result, to="c", path=tmp_path / "lag")
    assert compiled_c(tmp_path / "lag")(u) == pytest.approx(truth, abs=1e-9)
    (file,) = export(result, to="python", path=tmp_path / "lag.py")
    assert runpy.run_path(str(file))["simulate"](u) == pytest.approx(truth, abs=1e-9)


@pytest.mark.usefixtures("needs_cc")
def test_a_step_through_c_is_the_closed_form_to_1e_6(tmp_path):
    model = replace(SECOND, delay=0.0317, intersample="zoh", bias=0.0)
    export(result_of(model), to="c", path=tmp_path / "c")
    y = compiled_c(tmp_path / "c")(np.concatenate([[0.0], np.ones(T.size - 1)]))
    t = np.maximum(T - 1 / FS - model.delay, 0.0)
    omega, zeta = 2 * np.pi * 10.0, 0.4
    damped = omega * np.sqrt(1 - zeta**2)
    decay = np.exp(-zeta * omega * t)
    exact = 1 - decay * (np.cos(damped * t) + zeta * omega / damped * np.sin(damped * t))
    assert y == pytest.approx(2.0 * exact, abs=1e-6)


@pytest.mark.usefixtures("needs_cc")
@pytest.mark.parametrize("frequency", [0.5, 7.0, 19.5])
def test_a_sine_through_c_has_the_response_of_the_model_to_1e_6(frequency, tmp_path):
    for number, delay in enumerate((0.0, 0.0123, 0.15)):
        model = replace(SECOND, delay=delay, bias=0.0)
        export(result_of(model), to="c", path=tmp_path / str(number))
        t = np.arange(800) / FS
        wave = np.exp(2j * np.pi * frequency * t)
        run = compiled_c(tmp_path / str(number))
        y = run(wave.real) + 1j * run(wave.imag)
        truth = frequency_response(model, np.array([frequency]))[0]
        assert y[500:] / wave[500:] == pytest.approx(np.full(300, truth), abs=1e-6 * 2.0)


def test_python_runs_as_a_program(tmp_path):
    model = replace(SECOND, delay=0.004)
    (file,) = export(result_of(model), to="python", path=tmp_path / "lag.py")
    u = walk(2)
    done = subprocess.run(
        [sys.executable, file],
        input="\n".join(map(repr, u.tolist())),
        capture_output=True,
        text=True,
        check=True,
    )
    shown = [float(line) for line in done.stdout.split()]
    assert shown == pytest.approx(model.simulate(u, T), abs=1e-9)


def test_programs_say_errors_units_and_where_they_come_from(tmp_path):
    result = result_of(replace(SECOND, hold_period=0.02))
    files = [
        *export(result, to="c", path=tmp_path / "c"),
        *export(result, to="python", path=tmp_path / "p.py"),
    ]
    for file in files:
        text = file.read_text(encoding="utf-8")
        assert "0123abcd" * 8 in text
        assert "2000 samples at 200 Hz (bench 3)" in text
        assert "delay: 0.15 +- 0.00015 [0.149706, 0.150294] s" in text
        assert "natural_frequency: 10 +- 0.01" in text
        assert "hold_period: 0.02" in text
        assert "Warning (odd)" in text
        assert "verdict ok" in text
    loaded = runpy.run_path(str(files[-1]))
    assert loaded["PARAMETERS"]["delay"]["unit"] == "s"
    assert loaded["COVARIANCE"][0][0] == pytest.approx((0.15e-3) ** 2)
    assert loaded["NOISE_STD"] == pytest.approx(0.1)


def test_numbers_of_any_kind_are_written_plainly(tmp_path):
    result = result_of(replace(SECOND, bias=np.float64(0.25)))
    for target in ("python", "scipy"):
        (file,) = export(result, to=target, path=tmp_path / "m.py")
        assert "np.float64" not in file.read_text(encoding="utf-8")
        assert runpy.run_path(str(file))["PARAMETERS"]["bias"]["value"] == 0.25


def test_another_rate_is_exact_too(tmp_path):
    model = replace(SECOND, intersample="foh", delay=0.0123)
    (file,) = export(result_of(model), to="python", path=tmp_path / "fast.py", fs=1000.0)
    t = np.arange(800) / 1000.0
    u = np.sin(20 * t)
    found = runpy.run_path(str(file))
    assert found["FS"] == 1000.0
    assert found["simulate"](u) == pytest.approx(model.simulate(u, t), abs=1e-9)


@pytest.mark.parametrize("target", ["python", "scipy", "control", "isaac"])
def test_names_that_python_would_read_otherwise_stand_in_its_text(target, tmp_path, monkeypatch):
    """A backslash and a triple quote in the names of the channels: the file still compiles."""
    monkeypatch.setattr("hmpim.formats.models.isaac._DRAWS", 20)
    whole = result_of(SECOND)
    odd = replace(whole.pairs[0], input='u """ \\N{x}', output='C:\\new "y"""')
    step = {"timestep": 0.005} if target == "isaac" else {}
    result = replace(whole, pairs=(odd,))
    (file,) = export(result, to=target, path=tmp_path / "m.py", **step)
    compile(file.read_text(), file, "exec")


def test_files_are_named_as_asked(tmp_path):
    result = result_of(SECOND)
    assert export(result, to="python", path=tmp_path)[0] == tmp_path / "y_from_u.py"
    written = export(result, to="c", path=f"{tmp_path}/2nd axis/")
    assert [p.name for p in written] == ["m2nd_axis.h", "m2nd_axis.c"]


def test_a_delay_of_no_more_than_its_error_below_zero_counts_as_none(tmp_path):
    ahead = result_of(replace(SECOND, delay=-1e-6))
    delay = replace(ahead.pairs[0].delay, std=1e-5)
    pair = replace(ahead.pairs[0], parameters=replace(ahead.pairs[0].parameters, delay=delay))
    (file,) = export(replace(ahead, pairs=(pair,)), to="python", path=tmp_path / "m.py")
    said = "The delay of -1e-06 s cannot be stepped and is taken as 0: outputs come 1e-06 s late."
    assert said in file.read_text()
    (kept,) = export(replace(ahead, pairs=(pair,)), to="csv", path=tmp_path / "m.csv")
    assert "is taken as 0" not in kept.read_text()
    u = walk(3)
    none = replace(SECOND, delay=0.0)
    assert runpy.run_path(str(file))["simulate"](u) == pytest.approx(none.simulate(u, T))
    with pytest.raises(ArgumentError, match=r"is -0.1 s, so the output is ahead"):
        export(result_of(replace(SECOND, delay=-0.1)), to="c", path=tmp_path / "c")


@pytest.mark.parametrize("share", [0.5, 0.2, 0.95])
def test_a_held_input_that_moves_before_its_sample_is_stepped_exactly(share, tmp_path):
    """A lag driven at t_n - d by what is sampled at t_n: its step response, from before t_n on."""
    lag, d = 0.03, share / FS
    model = Model(delay=-d, scale_factor=2.0, denominator=(lag, 1.0), intersample="zoh")
    result = result_of(model)  # the delay is 500 standard deviations from 0
    u = np.repeat([0.0, 1.0, -0.5], 40)
    n = np.arange(u.size)
    truth = np.zeros(u.size)
    for at, rise in ((40, 1.0), (80, -1.5)):
        since = np.maximum((n - at) / FS + d, 0.0)
        truth += 2.0 * rise * (1.0 - np.exp(-since / lag)) * (n >= at)
    (file,) = export(result, to="python", path=tmp_path / "m.py")
    assert f"is kept: the held input moves {d:.6g} s before" in file.read_text()
    assert runpy.run_path(str(file))["simulate"](u) == pytest.approx(truth, abs=1e-12)
    (header, _) = export(result, to="c", path=tmp_path / "c")
    assert "is kept" in header.read_text()
    with pytest.raises(ArgumentError, match=r"export to c, python, fmu, json, csv or uff58"):
        export(result, to="scipy", path=tmp_path / "s.py")
    with pytest.raises(ArgumentError, match=r"export to json, csv or uff58"):
        export(result, to="c", path=tmp_path / "d", fs=FS / share)  # a whole sample ahead there
    pair = result.pairs[0]
    unsure = replace(pair, parameters=replace(pair.parameters, delay=replace(pair.delay, std=d)))
    (file,) = export(replace(result, pairs=(unsure,)), to="scipy", path=tmp_path / "s.py")
    assert f"exact for an input that is moved {d:.6g} s before its samples" in file.read_text()
    assert compiled_c(tmp_path / "c")(u) == pytest.approx(truth, abs=1e-12)


def test_what_cannot_be_exported_is_refused(tmp_path):
    result = result_of(SECOND)
    with pytest.raises(ArgumentError, match="target 'fortran' is not known"):
        export(result, to="fortran", path=tmp_path / "x")
    with pytest.raises(ArgumentError, match=r"result = 'r\.json' is not an Identification"):
        export("r.json", to="c", path=tmp_path / "x")
    two = replace(result, pairs=(*result.pairs, replace(result.pairs[0], input="v")))
    with pytest.raises(ArgumentError, match="2 models"):
        export(two, to="c", path=tmp_path / "x")
    assert export(two, to="python", path=tmp_path, pair=("y", "v"))[0].name == "y_from_v.py"
    with pytest.raises(ArgumentError, match="fs = -1"):
        export(result, to="c", path=tmp_path / "x", fs=-1.0)
    (tmp_path / "file").write_text("x")
    with pytest.raises(ArgumentError, match="needs a folder"):
        export(result, to="c", path=tmp_path / "file")
    with pytest.raises(ArgumentError, match="make it first"):
        export(result, to="python", path=tmp_path / "no" / "m.py")
    nothing = replace(result.pairs[0], parameters=Parameters())
    with pytest.raises(
        RecordError, match=r"has no model, because .* its delay, scale factor, bias"
    ):
        export(Identification(record=result.record, pairs=(nothing,)), to="c", path=tmp_path / "x")


def test_a_doubtful_pair_without_a_figure_says_which_and_why(tmp_path):
    whole = result_of(SECOND)
    doubt = Finding(
        code="weak_coupling",
        message="The coupling from 'v' to 'y' is too weak here to determine its delay.",
        severity="doubt",
        parameters=("delay",),
    )
    weak = replace(
        whole.pairs[0],
        input="v",
        verdict="doubtful",
        parameters=replace(whole.pairs[0].parameters, delay=None),
        warnings=(*whole.pairs[0].warnings, doubt),
    )
    both = replace(whole, pairs=(*whole.pairs, weak))
    assert export(both, to="python", path=tmp_path / "m.py")  # the other is the only model
    said = (
        "'y' from 'v' has no model, because the record does not determine its delay. "
        "The coupling from 'v' to 'y' is too weak here to determine its delay."
    )
    with pytest.raises(RecordError) as refused:
        export(both, to="python", path=tmp_path / "m.py", pair=("y", "v"))
    assert str(refused.value) == said


@pytest.mark.parametrize(("file", "better"), [("my axis.m", "my_axis.m"), ("end.m", "end_model.m")])
def test_a_file_that_matlab_could_not_call_is_refused(file, better, tmp_path):
    with pytest.raises(ArgumentError, match=rf"cannot be called: .*; name it {better}$"):
        export(result_of(SECOND), to="matlab", path=tmp_path / file)
    (written,) = export(result_of(SECOND), to="matlab", path=tmp_path / better)
    assert written.stem in written.read_text()


@pytest.mark.parametrize(
    ("file", "called"), [("model.mo", "model_model"), ("roll.y.mo", "roll_y"), ("m.mo", "m")]
)
def test_a_modelica_model_has_a_name_of_its_own_where_the_file_has_none(file, called, tmp_path):
    (written,) = export(result_of(SECOND), to="modelica", path=tmp_path / file)
    assert written.name == file
    assert f'model {called} "' in written.read_text()
    assert f"end {called};" in written.read_text()


def test_a_folder_gets_a_name_that_can_be_called(tmp_path):
    result = result_of(SECOND)
    pair = replace(result.pairs[0], input="roll.command", output="roll.position")
    (file,) = export(replace(result, pairs=(pair,)), to="matlab", path=f"{tmp_path}/new/")
    assert file.name == "roll_position_from_roll_command.m"


def test_software_beside_a_continuous_pair_does_not_keep_it_from_export(tmp_path):
    result = result_of(SECOND)
    other = replace(result.pairs[0], output="z", intersample="sampled")
    both = replace(result, pairs=(*result.pairs, other))
    assert export(both, to="scipy", path=tmp_path / "m.py", pair=("y", "u"))
