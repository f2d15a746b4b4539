"""The public interface given nonsense: it works, or an `HmpimError` says what is wrong."""

import inspect
import math
import warnings
from collections.abc import Sequence
from typing import Literal

import numpy as np
import pytest

import hmpim
from hmpim.arguments import checked, fits, generator, numbers_of, shown, size_of
from hmpim.errors import ArgumentError, RecordError
from hmpim.optimal import Accuracy, ModelRange, RoughModel
from hmpim.stimulus.axes import AxisPlan
from tests_support import search_coarsely

NONSENSE = [
    *(None, "x", "200", b"x", (), [], {}, -1, 0, 1e300, math.nan, math.inf, -math.inf, True, 1j),
    *((5, 1), (math.nan, 1.0), (1, 2, 3), [None], ["x"], {"x": None}, {1: 2}, object()),
    *(np.zeros(0), np.zeros((2, 2)), np.array(["a"]), np.array([1 + 1j, 2.0]), np.float64(3)),
    *(np.ma.masked_array([1.0, 2.0], mask=[0, 1]), "no/such/x.csv", "x.docx"),
]
FS = 100.0
STATIC = ("static",)
LIMITS = hmpim.Limits(position=1, unit="deg")
SWEEP = hmpim.Sweep(band=(1, 10), duration=1.0)
STIMULUS = hmpim.Stimulus(waveform=SWEEP, fs=FS, unit="deg")
MODEL = hmpim.Model(delay=0.01, scale_factor=2.0)


def arrays(size=1.0, seed=1):
    t = np.arange(60) / FS
    u = size * np.sin(2 * np.pi * (1 * t + 5 * t**2))
    return u, 2.0 * u + 0.1 + 0.01 * np.random.default_rng(seed).standard_normal(t.size)


def recorded(size=1.0, seed=1):
    u, y = arrays(size, seed)
    return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)


@pytest.fixture(scope="module")
def result():
    return hmpim.identify(recorded(), structures=STATIC)


def calls(result):
    """Each public name with a call that works, as keywords."""
    record = recorded()
    u, y = arrays()
    (pair,) = result.pairs
    channel, other = record.channels
    intersample = {"intersample": "zoh", "structures": STATIC}
    band = {"band": (1, 10), "duration": 1.0}
    return {
        "Channel": (hmpim.Channel, {"name": "u", "time": [0, 1], "values": [1, 2], "unit": "V"}),
        "Record": (
            hmpim.Record,
            {"inputs": (channel,), "outputs": (other,), "fs": FS, "band": (1, 2), "source": "s"}
            | {"intersample": "zoh", "findings": (), "references": (), "auxiliary": ()},
        ),
        "Record.from_arrays": (
            hmpim.Record.from_arrays,
            {"inputs": {"u": u}, "outputs": {"y": y}, "fs": FS, "units": {"u": "V"}}
            | {"time": None, "band": (1, 2), "intersample": None}
            | {"references": None, "auxiliary": None},
        ),
        "Record.channel": (record.channel, {"name": "u"}),
        "Record.between": (record.between, {"start": 0.0, "stop": 1.0}),
        "Limits": (
            hmpim.Limits,
            {"position": 1.0, "velocity": 1.0, "acceleration": 1.0, "jerk": 1.0, "unit": "deg"},
        ),
        "Limits.to": (LIMITS.to, {"unit": "rad"}),
        "Sweep": (hmpim.Sweep, {**band, "gain": 1.0, "extinction": 0.0}),
        "Chirp": (hmpim.Chirp, {**band, "amplitude": 1.0}),
        "Ramp": (hmpim.Ramp, {"rate": 1.0, "duration": 1.0, "start": 0.0}),
        "Step": (hmpim.Step, {"amplitude": 1.0, "duration": 1.0, "start": 0.0}),
        "Sine": (hmpim.Sine, {"amplitude": 1.0, "duration": 1.0, "frequency": 1.0}),
        "SumOfSines": (
            hmpim.SumOfSines,
            {"amplitudes": (1.0,), "frequencies": (1.0,), "phases": (0.0,), "duration": 1.0},
        ),
        "Stimulus": (
            hmpim.Stimulus,
            {"waveform": SWEEP, "fs": FS, "unit": "", "limits": None, "axis": "", "tail": 0.0}
            | {"resolution": 0.0},
        ),
        "design": (
            hmpim.design,
            {**band, "fs": 40.0, "limits": LIMITS, "kind": "random_phase", "rng": 1}
            | {"extinction": "auto", "lead": "auto", "tail": "auto", "axis": "", "resolution": 0.0}
            | {"wanted_snr": None, "noise": None},
        ),
        "AxisPlan": (AxisPlan, {"axis": "a", "band": (1, 10), "limits": LIMITS}),
        "design_axes": (
            hmpim.design_axes,
            {"plans": [AxisPlan(axis="a", band=(1, 10), limits=LIMITS)], "duration": 1.0}
            | {"fs": 40.0, "method": "multisines", "tail": 0.5},
        ),
        "Sensor": (
            hmpim.Sensor,
            {"delay": 0.1, "hold_period": 0.05, "hold_phase": 0.0, "natural_frequency": 5.0}
            | {"damping_ratio": 0.5, "time_constant": None, "scale_factor": 1.0, "bias": 0.0}
            | {"noise_std": 0.0, "noise_colour": 0.0, "saturation_low": -1.0, "name": "s"}
            | {"saturation_high": 1.0, "quantization_step": 0.1, "output_unit": "deg"}
            | {"measures": "position", "command": "continuous", "input_name": "u"}
            | {"output_name": "y", "limits": None},
        ),
        "FunctionRig": (
            hmpim.FunctionRig,
            {"function": lambda x: x, "mode": "array", "reset": None, "measures": "position"}
            | {"output_unit": None, "intersample": None, "name": "f", "input_name": "u"}
            | {"output_name": "y", "limits": None},
        ),
        "run": (
            hmpim.run,
            {"rig": hmpim.Sensor(), "stimulus": STIMULUS, "rng": 1, "limits": None}
            | {"subscribers": (), "log": None, "options": None, "path": None, "until": None},
        ),
        "Model": (
            hmpim.Model,
            {"delay": 0.1, "scale_factor": 1.0, "numerator": (1.0,), "denominator": (0.1, 1.0)}
            | {"bias": 0.0, "noise_std": 0.0, "input": "u", "output": "y", "input_unit": ""}
            | {"output_unit": "", "saturation_low": None, "saturation_high": None}
            | {"hold_period": None, "hold_phase": 0.0, "quantization_step": None}
            | {"intersample": "zoh", "fs": None, "band": None, "spread": None},
        ),
        "frequency_response": (hmpim.frequency_response, {"model": MODEL, "frequency": [1.0]}),
        "simulate": (
            hmpim.simulate,
            {"model": MODEL, "u": u, "fs": FS, "intersample": "zoh", "rng": None},
        ),
        "draw_models": (
            hmpim.draw_models,
            {"model": hmpim.to_model(pair), "count": 2, "rng": 1},
        ),
        "identify": (hmpim.identify, {"record": record, **intersample}),
        "compress": (
            hmpim.compress,
            {"record": record, "lags": 20, "channels": ("u", "y"), "knots": (0.0, 1.0)}
            | {"bias": "own"},
        ),
        "identify_levels": (
            hmpim.identify_levels,
            {"records": [record, recorded(2.0, 2)], "amplitudes": None, **intersample},
        ),
        "identify_repeats": (
            hmpim.identify_repeats,
            {"records": [record, recorded(1.0, 2)], **intersample},
        ),
        "paper_analysis": (
            hmpim.paper_analysis,
            {"u": u, "y": y, "fs": FS, "band": (1, 10), "window": "gaussian", "alpha": 1.5}
            | {"pad": None, "remove_mean": True},
        ),
        "predict": (hmpim.predict, {"pair": pair, "record": record, "start": None}),
        "to_model": (hmpim.to_model, {"pair": pair, "fs": None}),
        "Accuracy": (
            Accuracy,
            {"delay": 0.1, "natural_frequency": 0.1, "scale_factor": 0.1, "damping_ratio": 0.1},
        ),
        "RoughModel": (
            RoughModel,
            {"delay": 0.1, "natural_frequency": 0.1, "scale_factor": 0.1, "damping_ratio": 0.1},
        ),
        "ModelRange": (
            ModelRange,
            {"delay": (0.1, 0.2), "natural_frequency": (1, 2), "damping_ratio": (0.1, 0.2)},
        ),
        "gentlest": (
            hmpim.gentlest,
            {"accuracy": Accuracy(), "model": RoughModel(natural_frequency=10, damping_ratio=0.4)}
            | {"noise_std": 0.1, "limits": LIMITS, "fs": FS, "gentle": "peak_acceleration"}
            | {"duration": 0.2, "model_range": None, "families": ("multisine",), "progress": None},
        ),
        "read": (
            hmpim.read,
            {"path": "r.csv", "inputs": ["u"], "outputs": ["y"], "fs": None, "time": None}
            | {"units": None, "references": None, "auxiliary": None},
        ),
        "save": (hmpim.save, {"thing": record, "path": "x.csv"}),
        "load": (hmpim.load, {"path": "r.csv"}),
        "report": (
            hmpim.report,
            {"result": result, "path": "no/x.html", "stimulus": None, "notes": ()},
        ),
        "export": (
            hmpim.export,
            {"result": result, "to": "json", "path": "e.json", "pair": ("y", "u"), "fs": None}
            | {"intersample": None, "pade": None},
        ),
    }


def refusal(call, keywords):
    """What a call raises: nothing, an HmpimError's text, or a defect."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            call(**keywords)
    except hmpim.HmpimError as error:
        return str(error)
    return None


def check(name, call, keywords, of):
    for nonsense in NONSENSE:
        said = refusal(call, {**keywords, of: nonsense})
        where = f"{name}({of}={shown(nonsense)})"
        assert said is None or 10 < len(said) < 400, f"{where}: {said}"
        assert said is None or "\n" not in said, where


@pytest.fixture
def files(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    hmpim.save(recorded(), "r.csv")


TABLE = (
    "Channel",
    "Record",
    "Record.from_arrays",
    "Record.channel",
    "Record.between",
    "Limits",
    "Limits.to",
    "Sweep",
    "Chirp",
    "Ramp",
    "Step",
    "Sine",
    "SumOfSines",
    "Stimulus",
    "design",
    "AxisPlan",
    "design_axes",
    "Sensor",
    "FunctionRig",
    "run",
    "Model",
    "frequency_response",
    "simulate",
    "draw_models",
    "identify",
    "compress",
    "identify_levels",
    "identify_repeats",
    "paper_analysis",
    "predict",
    "to_model",
    "Accuracy",
    "RoughModel",
    "ModelRange",
    "gentlest",
    "read",
    "save",
    "load",
    "report",
    "export",
)


@pytest.mark.parametrize("name", TABLE)
def test_nonsense_is_refused_or_works(name, result, files, monkeypatch):
    search_coarsely(monkeypatch)
    call, keywords = calls(result)[name]
    for of in keywords:
        check(name, call, keywords, of)


def test_each_call_of_the_table_works_as_it_stands(result, files):
    every = calls(result)
    assert tuple(every) == TABLE
    for name, (call, keywords) in every.items():
        said = refusal(call, keywords)
        assert said is None or name in ("report", "gentlest"), f"{name}: {said}"


def test_names_that_the_table_lacks_refuse_nonsense_too():
    made_by_hmpim = {"Estimate", "Identification", "HmpimError"}
    for name in sorted(set(hmpim.__all__) - set(TABLE) - made_by_hmpim):
        call = getattr(hmpim, name)
        needed = [
            p.name
            for p in inspect.signature(call).parameters.values()
            if p.default is p.empty and p.kind in (p.POSITIONAL_OR_KEYWORD, p.KEYWORD_ONLY)
        ]
        for of in needed:
            check(name, call, dict.fromkeys(needed, object()), of)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: hmpim.identify(None), "record = None is not a Record or a Statistics; read a fil"),
        (lambda: hmpim.identify("x.csv"), "record = 'x.csv' is not a Record or a Statistics; read"),
        (lambda: recorded().between(2.0, 1.0), "fewer than 2 samples between 2 s and 1 s"),
        (
            lambda: hmpim.Record.from_arrays([0, 1], [1, 2], fs="200"),
            "fs = '200' is not a number",
        ),
        (
            lambda: hmpim.Record.from_arrays([0, 1], [1, 2], fs=1.0, intersample="foo"),
            "intersample = 'foo' is not one of 'zoh', 'foh', 'bandlimited', 'feedforward', "
            "'sampled' or None",
        ),
        (
            lambda: hmpim.Record.from_arrays([0, 1], [1, 2], fs=1.0, band=(5, 1)),
            "band = (5, 1) Hz is not a band; give the lower frequency first, such as (0.1, 20)",
        ),
        (lambda: hmpim.Record.from_arrays([0, 1j], [1, 2], fs=1.0), "channel 'u' is complex"),
        (lambda: hmpim.paper_analysis(np.ones(9) * 1j, np.ones(9), 1.0), "u is complex"),
        (lambda: hmpim.design(band=(1, 5), duration=1e9, fs=20, limits=LIMITS), "2e+10 samples"),
        (lambda: hmpim.design(band=(1, 5), duration=9, fs=1e12, limits=LIMITS), "9e+12 samples"),
        (lambda: hmpim.run(hmpim.Sensor(), STIMULUS, rng=-1), "rng = -1 is not a seed"),
    ],
)
def test_what_is_said(call, words):
    with pytest.raises(hmpim.HmpimError) as refused:
        call()
    assert words in str(refused.value)


@pytest.mark.parametrize(("path", "words"), [("x.docx", "docx"), ("no/such/x.html", "no/such")])
def test_a_report_says_what_a_page_is_before_it_is_drawn(result, files, path, words):
    with pytest.raises(hmpim.HmpimError, match=words):
        hmpim.report(result, path)


def test_bare_arrays_are_called_u_and_y():
    u, y = arrays()
    record = hmpim.Record.from_arrays(u, y, fs=FS)
    assert record == recorded()
    assert hmpim.Record.from_arrays(u.tolist(), {"measured": y}, fs=FS).channels[1].name == (
        "measured"
    )


def test_lists_become_tuples_so_that_a_record_stays_a_value():
    channel, other = recorded().channels
    record = hmpim.Record(inputs=[channel], outputs=[other], fs=FS, band=[1, 2])
    assert (record.inputs, record.band) == ((channel,), (1.0, 2.0))
    hash(record)


def test_what_fits_an_annotation():
    assert fits(np.int64(3), float)
    assert fits(np.array(3.0), float)
    assert not fits("3", float)
    assert not fits(np.True_, float)
    assert fits([1, 2], tuple[float, float])
    assert not fits([1, 2, 3], tuple[float, float])
    assert fits(["a"], Sequence[str])
    assert not fits("a", Sequence[str])
    assert fits(None, Literal["a"] | None)
    assert not fits(1, Literal[True])


def test_a_wrong_number_of_arguments_stays_pythons_own_error():
    @checked
    def one(length: float) -> float:
        return length

    with pytest.raises(TypeError, match="unexpected keyword") as raised:
        one(width=1)
    assert raised.value.__context__ is None  # one error, not one during another
    assert one(length=2) == 2


def test_sizes_seeds_and_numbers():
    assert size_of(0.1, 100.0) == 10
    with pytest.raises(ArgumentError, match=r"1e\+08 samples are made at once"):
        size_of(math.inf, 1.0)
    with pytest.raises(ArgumentError, match=r"rng = 1\.5 is not a seed"):
        generator(1.5)
    with pytest.raises(ArgumentError, match="u holds nan at place 1"):
        numbers_of("u", [0.0, math.nan])
    with pytest.raises(RecordError, match="is complex"):
        hmpim.Channel(name="u", time=[0, 1], values=[1j, 2])


def test_a_table_of_numbers_is_not_told_that_they_are_not_real():
    with pytest.raises(
        ArgumentError, match=r"y = an array of shape \(3, 2\) is not one row of num"
    ):
        numbers_of("y", np.zeros((3, 2)))
