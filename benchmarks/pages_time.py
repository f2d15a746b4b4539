"""Processor time from limits to pages, by stage: one axis, and five axes with couplings.

Run `python benchmarks/pages_time.py`; `make bench` does.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import hmpim
from hmpim.rigs import MotionTable
from hmpim.stimulus.axes import AxisPlan

FS = 1000.0
BANDS = {"roll": 60.0, "yaw": 40.0, "pitch": 30.0, "azimuth": 15.0, "elevation": 12.0}
T = TypeVar("T")


def spent(stages: dict[str, float], name: str, work: Callable[[], T]) -> T:
    began = time.process_time()
    out = work()
    stages[name] = time.process_time() - began
    return out


def one_axis(folder: Path) -> dict[str, float]:
    stages: dict[str, float] = {}
    limits = hmpim.Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    sensor = hmpim.Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
    stimulus = spent(
        stages, "design", lambda: hmpim.design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    )
    record = spent(stages, "play", lambda: hmpim.run(sensor, stimulus, rng=1))
    result = spent(stages, "identify", lambda: hmpim.identify(record))
    spent(stages, "page", lambda: hmpim.report(result, folder / "one.html", stimulus=stimulus))
    return stages


def five_axes(folder: Path) -> dict[str, float]:
    stages: dict[str, float] = {}
    limits = hmpim.Limits(position=2.0, velocity=60.0, acceleration=900.0, unit="deg")
    plans = [AxisPlan(axis=a, limits=limits, band=(0.2, top)) for a, top in BANDS.items()]
    stimuli = spent(stages, "design", lambda: hmpim.design_axes(plans, duration=10.0, fs=FS))
    record = spent(stages, "play", lambda: hmpim.run(MotionTable(), stimuli, rng=1))
    result = spent(stages, "identify", lambda: hmpim.identify(record))
    spent(stages, "page", lambda: hmpim.report(result, folder / "five.html"))
    size = (folder / "five.html").stat().st_size / 1e6
    print(f"{len(result.pairs)} pairs, page of {size:.1f} MB")
    return stages


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        for title, make in (("one axis", one_axis), ("five axes", five_axes)):
            stages = make(Path(name))
            words = ", ".join(f"{stage} {seconds:.2f} s" for stage, seconds in stages.items())
            print(f"{title}: {words}; {sum(stages.values()):.2f} s in all")


if __name__ == "__main__":
    main()
