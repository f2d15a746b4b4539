"""Software, trackers and the seeker under test, found against true: the tables of docs/software.md.

python benchmarks/software_accuracy.py [tracker | seeker | software]
"""

import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

import hmpim
from hmpim.identify import Estimate, paper_analysis
from hmpim.rigs import FunctionRig
from hmpim.rigs.seeker import SeekerRig
from hmpim.rigs.tracker import Camera, Scene, TrackerRig

LATE = 2 / 60


def said(estimate: Estimate | None, scale: float = 1.0) -> str:
    """An estimate in a cell, doubtful ones marked."""
    if estimate is None:
        return "–"
    std = "" if estimate.std is None else f" ± {scale * estimate.std:.2g}"
    return f"{scale * estimate.value:.5g}{std}{'' if estimate.verdict == 'ok' else ' (doubtful)'}"


def brightness(frame: np.ndarray) -> tuple[float, float]:
    """A tracker that errs by the noise alone: centre of all that is above the background."""
    above = np.clip(frame.astype(float) - 90.0, 0.0, None)
    return float(above.sum(axis=0) @ (np.arange(frame.shape[1]) + 0.5) / above.sum()), 60.0


def trackers() -> Iterator[str]:
    """OpenCV's trackers, and frames lost: delay, hold, scale, bias, noise."""
    limits = hmpim.Limits(position=2, velocity=30, unit="deg")
    sweep = hmpim.design(band=(0.1, 5), duration=8, fs=480, limits=limits)
    rigs = {
        "sum of all brightness, no clutter": TrackerRig(
            tracker=brightness, camera=Camera(latency=LATE), scene=Scene(clutter_std=0.0)
        ),
        "centroid": TrackerRig(camera=Camera(latency=LATE)),
        "template": TrackerRig(tracker="template", camera=Camera(latency=LATE)),
        "CSRT": TrackerRig(tracker="csrt", camera=Camera(latency=LATE)),
        "centroid, scale 1.1, boresight 0.5 deg": TrackerRig(
            camera=Camera(latency=LATE), scale_factor=1.1, boresight=0.5
        ),
        "centroid, 10 % of the frames dropped": TrackerRig(
            camera=Camera(latency=LATE, dropped=0.1)
        ),
        "centroid, 10 % repeated": TrackerRig(camera=Camera(latency=LATE, repeated=0.1)),
    }
    yield "| tracker | delay, frames | hold, ms | scale factor | bias, deg | noise, deg | verdict |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for name, rig in rigs.items():
        pair = hmpim.identify(hmpim.run(rig, sweep, rng=1)).pairs[0]
        p = pair.parameters
        yield (
            f"| {name} | {said(p.delay, 60)} | {said(p.hold_period, 1e3)} | "
            f"{said(p.scale_factor)} | {said(p.bias)} | {said(p.noise_std)} | {pair.verdict} |"
        )


def seeker() -> Iterator[str]:
    """-90 degrees of the seeker on the table, against the closed form."""
    limits = hmpim.Limits(position=3, velocity=15, acceleration=700, unit="deg")
    sweep = hmpim.design(band=(0.1, 6), duration=20, fs=500, limits=limits, axis="azimuth")
    yield "| track gain, latency | −90°, paper's steps | closed form | −90°, fit | closed form |"
    yield "| --- | --- | --- | --- | --- |"
    for gain, latency in ((5.0, 0.03), (4.0, 0.05)):
        rig = SeekerRig(track_gain=gain, camera=Camera(latency=latency))
        record = hmpim.run(rig, sweep, rng=1)
        u, y = record.inputs[0].values, record.outputs[0].values
        found = paper_analysis(u, y, record.fs, band=record.band).estimates.bandwidth_phase90
        pair = hmpim.identify(record).pairs[0]
        yield (
            f"| {gain:g} /s, {1e3 * latency:g} ms | {found:.4g} Hz | {rig.bandwidth():.4g} Hz | "
            f"{said(pair.parameters.bandwidth_phase90)} Hz | "
            f"{rig.bandwidth(hold='removed'):.4g} Hz |"
        )


@dataclass(slots=True)
class Filter:
    """y[k] = pole y[k-1] + (1 - pole) u[k - late]."""

    late: int
    pole: float
    y: float = 0.0
    waiting: tuple[float, ...] = ()

    def __call__(self, u: float) -> float:
        line = (*(self.waiting or (0.0,) * self.late), u)
        self.y = self.pole * self.y + (1 - self.pole) * line[0]
        self.waiting = line[1:]
        return self.y


@dataclass(slots=True)
class AlphaBeta:
    """Position and rate, corrected by the gap."""

    x: float = 0.0
    v: float = 0.0

    def __call__(self, u: float) -> float:
        ahead = self.x + self.v
        gap = u - ahead
        self.x, self.v = ahead + 0.5 * gap, self.v + 0.1 * gap
        return self.x


@dataclass(slots=True)
class Median:
    """Median of five: not linear."""

    last: tuple[float, ...] = (0.0,) * 5

    def __call__(self, u: float) -> float:
        self.last = (*self.last[1:], u)
        return float(np.median(self.last))


class Kalman:
    """Position and rate at constant rate, by the gain of its steady state."""

    def __init__(self) -> None:
        step, noise = np.array([[1.0, 1.0], [0.0, 1.0]]), 0.05
        drive = noise * np.array([[0.25, 0.5], [0.5, 1.0]])
        spread = 10.0 * np.eye(2)
        for _ in range(500):
            spread = step @ spread @ step.T + drive
            gain = spread[:, 0] / (spread[0, 0] + 1.0)
            spread = spread - np.outer(gain, spread[0])
        self.gain, self.step, self.x = gain, step, np.zeros(2)

    def __call__(self, u: float) -> float:
        ahead = self.step @ self.x
        self.x = ahead + self.gain * (u - ahead[0])
        return float(self.x[0])


ALGORITHMS: dict[str, tuple[Callable[[], Callable[[float], float]], int]] = {
    "z⁻³": (lambda: Filter(3, 0.0), 3),
    "IIR, pole 0.8": (lambda: Filter(0, 0.8), 0),
    "IIR, pole 0.8, behind z⁻⁴": (lambda: Filter(4, 0.8), 4),
    "α-β, 0.5 and 0.1": (AlphaBeta, 0),
    "Kalman filter, constant rate": (Kalman, 0),
    "median of 5": (Median, 2),
}


def software() -> Iterator[str]:
    """Delay in samples as it is found, and the gain's error."""
    heads = "algorithm", "true delay", "rate, length", "delay found, samples", "gain", "verdict"
    yield f"| {' | '.join(heads)} | remarks |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for name, (make, late) in ALGORITHMS.items():
        for fs, seconds in ((50.0, 5.0), (50.0, 10.0), (200.0, 5.0), (200.0, 10.0), (1000.0, 5.0)):
            limits = hmpim.Limits(position=10, unit="deg")
            sweep = hmpim.design(band=(0.1, fs / 10), duration=seconds, fs=fs, limits=limits)
            record = hmpim.run(FunctionRig(function=make(), mode="sample"), sweep)
            pair = hmpim.identify(record).pairs[0]
            remarks = ", ".join(dict.fromkeys(w.code for w in pair.warnings))
            yield (
                f"| {name} | {late} | {fs:g} Hz, {seconds:g} s | "
                f"{said(pair.parameters.delay, fs)} | {said(pair.parameters.scale_factor)} | "
                f"{pair.verdict} | {remarks or '–'} |"
            )


if __name__ == "__main__":
    parts = {"tracker": trackers, "seeker": seeker, "software": software}
    for wanted in sys.argv[1:] or list(parts):
        print(f"<!-- {wanted} -->", *parts[wanted](), f"<!-- end of {wanted} -->", sep="\n")
