"""A rig without a watchdog, and a run of it as a program of its own: ``carriage.py TRACE RECORD``.

What the carriage does is written to TRACE line by line: time in the run, position, velocity.
"""

import multiprocessing
import sys
import time
from pathlib import Path

import numpy as np

from hmpim.experiment import OutlivingRig, outliving, run
from hmpim.rigs import ChannelSpec, Layout, Samples
from hmpim.rigs.brake import Brake
from hmpim.stimulus import Limits, design

FS = 200.0
LIMITS = Limits(position=20, velocity=100, acceleration=400, unit="deg")
INSIDE = Limits(position=8, velocity=90, acceleration=390, unit="deg")
SWEEP = design(band=(0.3, 8), duration=6, fs=FS, limits=INSIDE)


class Carriage:
    """Follows each command with a lag of 50 ms; brakes smoothly when it is told to stop."""

    name, axes, limits, moves = "carriage", (), LIMITS, True

    def __init__(self, trace):
        self.trace = Path(trace)

    def __enter__(self):
        if multiprocessing.parent_process() is not None:
            outliving._SILENCE = 60.0  # what is tested is a run that is gone, not a slow one
        self.file = self.trace.open("w", buffering=1)
        self.at, self.rate, self.moved, self.now = 0.0, 0.0, False, 0.0
        self.lagged, self.rng = 0.0, np.random.default_rng(0)
        return self

    def __exit__(self, *_):
        self.file.close()

    def prepare(self, stimulus):
        return Layout(
            channels=(
                ChannelSpec(name="u", role="input", unit="deg"),
                ChannelSpec(name="y", role="output", unit="deg"),
            ),
            intersample="zoh",
        )  # fmt: skip

    def play(self, block):
        read = []
        for k in block.due():
            self.at, self.rate = float(block.position[k, 0]), float(block.velocity[k, 0])
            self.moved, self.now = True, float(block.time[k])
            read.append(self.lagged + 0.02 * self.rng.standard_normal())
            self.lagged += (1 - np.exp(-1 / FS / 0.05)) * (self.at - self.lagged)
            self.file.write(f"{self.now:.6f} {self.at:.6f} {self.rate:.6f}\n")
        return {
            "u": Samples(time=block.time, values=block.position[:, 0]),
            "y": Samples(time=block.time, values=np.array(read)),
        }

    def stop(self):
        brake = Brake(
            position=np.array([self.at]), velocity=np.array([self.rate]),
            acceleration=np.array([LIMITS.acceleration]),
        )  # fmt: skip
        begun = time.perf_counter()
        while self.moved:  # the command of its end is the last one, however late
            since = min(time.perf_counter() - begun, brake.duration)
            at, rate, _ = brake.at(since)
            self.file.write(f"{self.now + since:.6f} {at[0]:.6f} {rate[0]:.6f}\n")
            self.moved = since < brake.duration
            time.sleep(0.005)
        self.file.write("rest\n")


if __name__ == "__main__":
    run(OutlivingRig(Carriage, sys.argv[1]), SWEEP, path=sys.argv[2])
