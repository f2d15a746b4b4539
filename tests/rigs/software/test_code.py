"""Functions and classes of a file under test."""

import numpy as np
import pytest

from hmpim.errors import HmpimError, RigError
from hmpim.experiment import run
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.software import load_code
from hmpim.stimulus import Sine, Stimulus

STIMULUS = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=50.0, unit="deg")
CODE = """
import beside

class Late:
    def __init__(self):
        self.kept = [0.0, 0.0]
    def __call__(self, u):
        self.kept.append(u)
        return self.kept.pop(0) * beside.GAIN

def late(u):
    return [0.0, 0.0, *(beside.GAIN * u[:-2])]

def double(u):
    return 2 * u if u > 0 else u + u

NUMBER = 3
"""


@pytest.fixture
def file(tmp_path):
    (tmp_path / "beside.py").write_text("GAIN = 2.0\n")
    path = tmp_path / "mine.py"
    path.write_text(CODE)
    return path


def outputs(text, **described):
    return run(find_rig(text, description=describe(described)).rig, STIMULUS).outputs[0].values


def test_a_class_and_a_function_give_the_same(file):
    truth = 2 * np.concatenate([[0.0, 0.0], STIMULUS.position[:-2]])
    rig = find_rig(f"python:{file}:Late").rig
    assert np.array_equal(run(rig, STIMULUS).outputs[0].values, truth)
    assert np.array_equal(run(rig, STIMULUS).outputs[0].values, truth)  # a new object each time
    assert np.array_equal(outputs(f"python:{file}:late"), truth)


def test_a_function_may_be_called_by_the_sample(file):
    truth = 2 * STIMULUS.position
    assert np.array_equal(outputs(f"python:{file}:double:sample"), truth)
    assert np.array_equal(outputs(f"python:{file}:double", options={"mode": "sample"}), truth)
    with pytest.raises(RigError, match="'double' failed: ValueError"):
        outputs(f"python:{file}:double")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("python:{}:missing", "has no function 'missing'; it has Late, double, late"),
        ("python:{}:NUMBER", "has no function 'NUMBER'"),
        ("python:nowhere.py:f", "there is no file 'nowhere.py'"),
        ("python:{}", "names no function; write python:FILE:FUNCTION"),
    ],
)
def test_what_is_not_there_is_told(file, text, words):
    with pytest.raises(HmpimError, match=words):
        find_rig(text.format(file))


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("1 / 0", "does not run: ZeroDivisionError"),
        ("raise SystemExit(3)", "does not run: SystemExit: 3"),
        ("def f(:", "does not run: SyntaxError"),
        ("class f:\n    def __init__(self, n): pass", r"f\(\) failed: TypeError"),
        ("class f: pass", "objects of f cannot be called"),
    ],
)
def test_a_file_that_does_not_run_is_told(tmp_path, code, words):
    path = tmp_path / "bad.py"
    path.write_text(code)
    with pytest.raises(RigError, match=words):
        load_code(str(path), "f")
