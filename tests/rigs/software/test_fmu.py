"""FMUs under test: both versions of FMI, co-simulation and model exchange."""

import subprocess
import sys

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.signal import lfilter

from hmpim.errors import ArgumentError, RigError
from hmpim.experiment import run
from hmpim.rigs.catalogue import describe, find_rig
from hmpim.rigs.software import FmuRig
from hmpim.stimulus import Chirp, Ramp, Stimulus

pytest.importorskip("fmpy")

STIMULUS = Stimulus(waveform=Chirp(band=(0.5, 5), duration=2.0), fs=100.0, unit="deg")


def test_co_simulation_is_the_filter_sample_by_sample(fmu):
    rig = find_rig(f"fmu:{fmu}").rig
    record = run(rig, STIMULUS)
    late = np.concatenate([np.zeros(3), STIMULUS.position[:-3]])
    truth = lfilter([0.3], [1.0, -0.7], late)
    assert record.outputs[0].values == pytest.approx(truth, abs=1e-14)
    assert (record.intersample, record.outputs[0].unit) == (None, "deg")
    assert record.source == "FMU unit.fmu, y from u, co-simulation"
    assert run(rig, STIMULUS).sha256 == record.sha256  # set up anew


def test_model_exchange_is_the_lag_in_closed_form(fmu):
    lag, step = 0.08, 0.01
    found = find_rig(
        f"fmu:{fmu}",
        description=describe({"options": {"interface": "exchange", "start": {"T": lag}}}),
    )
    ramp = Stimulus(waveform=Ramp(duration=1.0), fs=1 / step, unit="deg")
    record = run(found.rig, ramp)
    slope = ramp.position[1] / step
    t = np.arange(ramp.samples) * step
    truth = slope * (t - lag * (1 - np.exp(-t / lag)))
    assert record.outputs[0].values == pytest.approx(truth, abs=1e-6 * slope)
    assert record.intersample == "foh"


def test_what_does_not_fit_is_refused(fmu):
    radians = Stimulus(waveform=Ramp(duration=1.0), fs=100.0, unit="rad")
    with pytest.raises(RigError, match="takes u in deg, and the stimulus is in rad"):
        run(FmuRig(path=str(fmu)), radians)
    with pytest.raises(RigError, match="no real output 'z'; name one with the option output: y"):
        run(FmuRig(path=str(fmu), output="z"), STIMULUS)
    with pytest.raises(RigError, match="has no variable 'Q' to start from"):
        run(FmuRig(path=str(fmu), start={"Q": 1.0}), STIMULUS)
    with pytest.raises(ArgumentError, match="interface = 'me' is not one of"):
        FmuRig(path=str(fmu), interface="me")
    with pytest.raises(ArgumentError, match=r"tolerance = 2.0"):
        FmuRig(path=str(fmu), tolerance=2.0)


def test_an_event_between_samples_is_found_where_it_is(fmu):
    lag, level = 0.08, 0.5
    ramp = Stimulus(waveform=Ramp(duration=1.0), fs=100.0, unit="deg")
    start = {"T": lag, "level": level}
    y = run(FmuRig(path=str(fmu), interface="exchange", start=start), ramp).outputs[0].values
    t = np.arange(ramp.samples) / 100.0
    slope = ramp.position[1] * 100.0

    def rising(time):
        return slope * (time - lag * (1 - np.exp(-time / lag)))

    at = brentq(lambda time: rising(time) - level, 0.0, 1.0)
    truth = np.where(t < at, rising(t), level * np.exp(-(t - at) / lag))
    assert y == pytest.approx(truth, abs=1e-6)


def test_an_fmu_that_fails_is_told(fmu):
    still = FmuRig(path=str(fmu), interface="exchange", start={"T": 0.0})
    with pytest.raises(RigError, match=r"unit\.fmu' (failed|returned nan at sample)"):
        run(still, STIMULUS)


def test_what_is_no_fmu_is_told(tmp_path):
    with pytest.raises(RigError, match=r"there is no FMU 'nowhere\.fmu'"):
        run(FmuRig(path="nowhere.fmu"), STIMULUS)
    (tmp_path / "x.fmu").write_bytes(b"PK no")
    with pytest.raises(RigError, match="is not an FMU that FMPy reads"):
        run(FmuRig(path=str(tmp_path / "x.fmu")), STIMULUS)


SPEAKS = """
import gc, sys
from fmpy.fmi2 import defaultCallbacks
from hmpim.experiment import run
from hmpim.rigs.software import FmuRig
from hmpim.stimulus import Chirp, Stimulus

run(FmuRig(path=sys.argv[1]), Stimulus(waveform=Chirp(band=(1, 5), duration=2), fs=100, unit="deg"))
gc.collect()
later = [FmuRig(path=f"{k}.fmu") for k in range(1000)]
defaultCallbacks.logger(None, b"unit", 3, b"error", b"another FMU speaks")
print("alive")
"""


def test_what_another_fmu_says_after_a_run_takes_nothing_down(fmu):
    done = subprocess.run(
        [sys.executable, "-c", SPEAKS, str(fmu)], capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines()[-1:] == ["alive"], done.stderr
