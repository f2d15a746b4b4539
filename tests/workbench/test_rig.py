"""The one rig that is armed: one window holds it, and a run that goes on is the only one."""

import multiprocessing
import threading
import time

import pytest

from hmpim.errors import RigError
from hmpim.stimulus import Chirp, Stimulus
from hmpim.workbench import rig
from hmpim.workbench.settings import Settings
from hmpim.workbench.work.driving import Ended, Order

STIMULI = (Stimulus(waveform=Chirp(band=(0.5, 20.0), duration=3.0), fs=200.0),)


def test_a_second_start_and_a_second_owner_are_refused_while_a_run_goes_on(tmp_path, monkeypatch):
    here, there = multiprocessing.Pipe()
    process = threading.Thread(target=lambda: None)
    process.start()
    monkeypatch.setattr(rig, "_spawned", lambda: (here, process))
    bench = rig.RigBench(Settings(runs=tmp_path), present=lambda desk: True)
    with pytest.raises(RigError, match="has not armed the rig"):
        bench.start("one", STIMULI)
    bench.arm("one", rig.DEMO)
    with pytest.raises(RigError, match="another window has armed"):
        bench.arm("two", rig.DEMO)
    with pytest.raises(RigError, match="has not armed the rig"):
        bench.start("two", STIMULI)
    bench.start("one", STIMULI)
    assert isinstance(there.recv(), Order)
    for desk in ("one", "two"):
        with pytest.raises(RigError, match="a second one is not started"):
            bench.start(desk, STIMULI)
    bench.disarm("one")
    assert bench.state == "running"  # a rig that moves is given back by nobody
    bench.stop("stopped by hand")
    assert there.recv() == "stopped by hand"
    monkeypatch.setattr(bench, "prepare", lambda: None)
    there.send(Ended(fault="", reason="stopped by hand", kept=False))
    end = time.monotonic() + 30.0
    while bench.state == "running" and time.monotonic() < end:
        time.sleep(0.01)
    assert bench.state == "armed"
    assert len(list(tmp_path.iterdir())) == 1
