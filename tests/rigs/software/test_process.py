"""Programs under test, over standard input and output."""

import re
import shlex
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from hmpim.errors import ArgumentError, RigError
from hmpim.experiment import run
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.software import ProcessRig
from hmpim.stimulus import Sine, Stimulus
from tests_support import c_compiler

STIMULUS = Stimulus(waveform=Sine(frequency=1.0, duration=2.0), fs=50.0, unit="deg")
EXAMPLES = Path(__file__).parents[3] / "examples" / "software"
START = "import sys, time\ngreeting = input()\n"
READY = START + "print('ready', flush=True)\n"
ECHO = "for line in iter(input, 'end'):\n    print(line, flush=True)\n"


def program(code, *, answer=60.0):
    return ProcessRig(command=shlex.join([sys.executable, "-c", code]), answer=answer)


def test_the_example_in_python_is_the_same_as_program_class_and_function():
    path = EXAMPLES / "smoother.py"
    late = np.concatenate([[0.0, 0.0], STIMULUS.position[:-2]])
    truth = lfilter([0.2], [1.0, -0.8], late)
    command = shlex.join([sys.executable, str(path)])
    for text in (f"process:{command}", f"python:{path}:Smoother", f"python:{path}:smooth"):
        values = run(find_rig(text).rig, STIMULUS).outputs[0].values
        assert values == pytest.approx(truth, abs=1e-14), text


def test_the_example_in_c_is_an_alpha_beta_filter(tmp_path):
    binary = tmp_path / "alpha beta"
    subprocess.run(
        [c_compiler(), "-std=c99", "-Wall", "-Wextra", "-Werror", "-o", binary,
         EXAMPLES / "alpha_beta.c"],
        check=True,
    )  # fmt: skip
    record = run(find_rig(f"process:{shlex.quote(str(binary))}").rig, STIMULUS)
    x = v = 0.0
    truth = []
    for u in STIMULUS.position:
        x, gap = x + v / 50, u - x - v / 50
        x, v = x + 0.5 * gap, v + 5.0 * gap
        truth.append(x)
    assert record.outputs[0].values == pytest.approx(truth, abs=1e-12)


def test_every_double_goes_there_and_back_and_the_unit_is_taken():
    code = START + "print('ready unit=V', flush=True)\n" + ECHO
    record = run(program(code), STIMULUS)
    assert np.array_equal(record.outputs[0].values, STIMULUS.position)
    assert (record.inputs[0].unit, record.outputs[0].unit) == ("deg", "V")


def test_the_greeting_says_what_comes():
    code = START + "print('error', greeting, flush=True)\n"
    with pytest.raises(RigError, match=r"hmpim 1 rate=50.0 samples=100 unit=deg quantity=position"):
        run(program(code), STIMULUS)


@pytest.mark.parametrize(
    ("code", "words"),
    [
        (READY + "input(); sys.exit(3)", r"ended with exit code 3 at sample 0, for the input 0"),
        (READY + "1 / 0", "ZeroDivisionError"),
        (READY + "input(); print('error lost', flush=True)", "failed at sample 0.*: lost"),
        (READY + "input(); print('1 2', flush=True)", "answered '1 2' at sample 0"),
        (READY + "input(); print('nan', flush=True)", "answered 'nan' at sample 0"),
        (START + "print('hello', flush=True)", "answered 'hello' to the greeting"),
        (START + "print('ready speed=3', flush=True)", "says 'speed', which is not known"),
        ("import sys; sys.exit('no licence')", "exit code 1 at the greeting; it said: no licence"),
        (
            READY + "input(); import os, signal; os.kill(os.getpid(), signal.SIGKILL)",
            "was killed by signal 9 at sample 0",
        ),
        (
            READY + "input(); import os; os.close(1); time.sleep(60)",
            "closed its standard output at sample 0",
        ),
        (
            READY + "for line in iter(input, 'end'):\n    print('1\\n2', flush=True)\n",
            "wrote '[12]' (before|after).* without being asked, so its answers do not belong",
        ),
        (READY + ECHO + "print('done', flush=True)", "wrote 'done' after the last sample"),
        ("while True: print('ready')", "wrote 'ready' before|did not answer|answered 'ready'"),
        ("while True: print('x' * 9999, end='')", "answered 'xxx.*' to the greeting"),
    ],
)
def test_what_goes_wrong_is_told_and_the_program_ended(code, words):
    check_failure(program(code), words)


def test_a_program_that_is_silent_is_not_waited_for():
    silent = program(READY + "input(); time.sleep(60)", answer=0.2)
    check_failure(silent, "did not answer sample 0.*within 0.2 s; it must flush")


def check_failure(rig, words):
    before = threading.active_count()
    with pytest.raises(RigError, match=words):
        run(rig, STIMULUS)
    assert threading.active_count() == before


def test_a_program_that_will_not_end_is_made_to(monkeypatch):
    from hmpim.rigs.software import process

    monkeypatch.setattr(process, "_PATIENCE", 0.1)
    started = []
    popen = subprocess.Popen
    monkeypatch.setattr(
        process.subprocess, "Popen", lambda *a, **k: started.append(popen(*a, **k)) or started[-1]
    )
    stubborn = "import signal\nsignal.signal(signal.SIGTERM, signal.SIG_IGN)\n"
    code = stubborn + READY + ECHO + "time.sleep(60)\n"
    run(program(code), STIMULUS)
    assert started[0].returncode == -9


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"command": ""}, "the command of the program is empty"),
        ({"command": "a 'b"}, "cannot be split into words"),
        ({"command": "a", "answer": 0.0}, "answer = 0.0 s must be a positive"),
        ({"command": "a", "measures": "jerk"}, "measures = 'jerk' is not one of"),
    ],
)
def test_what_cannot_be_is_refused(wrong, words):
    with pytest.raises(ArgumentError, match=words):
        ProcessRig(**wrong)


def test_a_program_that_is_not_there_is_told():
    with pytest.raises(RigError, match=r"'\./no-such' cannot be started"):
        run(ProcessRig(command="./no-such"), STIMULUS)


def test_options_come_from_the_description():
    rig = find_rig("process:./x", description=describe({"options": {"measures": "velocity"}})).rig
    assert rig.measures == "velocity"


@pytest.mark.parametrize(
    ("at_the_end", "words"),
    [
        ("print('disk full', file=sys.stderr); sys.exit(3)", r"ended with exit code 3.*disk full"),
        ("import os; os.kill(os.getpid(), 9)", "was killed by signal 9"),
        ("time.sleep(60)", "did not end within 2 s and was stopped"),
    ],
)
def test_a_program_that_does_not_end_well_is_remarked_and_its_record_kept(at_the_end, words):
    record = run(program(READY + ECHO + at_the_end), STIMULUS)
    assert record.outputs[0].values == pytest.approx(STIMULUS.position)
    (finding,) = record.findings
    assert (finding.code, finding.severity) == ("program_end", "info")
    assert re.search(f"After the last sample 'process' {words}", finding.message)


def test_a_program_that_ends_well_leaves_no_remark():
    rig = program(READY + ECHO)
    assert run(rig, STIMULUS).findings == ()
