"""False alarms and detections of nonlinearity, end to end: a section of docs/accuracy.md.

Linear systems with everything that could pass for nonlinear; and friction, backlash, a rate
limit, hard and soft springs, each stepped in time.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from rich.progress import track
from scipy.signal import lfilter

import hmpim
from hmpim.model.nonlinear import KIND_WORDS
from hmpim.model.operators import play, rate_limited

FS = 200.0
TIME = np.arange(2000) / FS
SUBSTEPS = 16

LINEAR = (
    "white",
    "AR(1), 0.9",
    "1/f",
    "60 Hz line",
    "saturation",
    "data hold",
    "quantisation",
    "dynamics beyond the catalogue",
    "drift of the bias",
)

SIZES = {
    "friction": (0.003, 0.01, 0.03),
    "backlash": (0.003, 0.01, 0.03),
    "rate_limit": (0.9, 0.7, 0.5),
    "hardening": (0.02, 0.05, 0.15),
    "softening": (0.02, 0.05, 0.15),
}
"""Friction's band and half the play over the amplitude; speed limit over the fastest that the
linear system gets; cubic force over the linear one at the command's amplitude."""

NOISES = (0.002, 0.01, 0.05)


def stimulus(extinction: float) -> hmpim.Stimulus:
    """The paper's sweep 0.1 to 20 Hz of amplitude 1, sampled as printed."""
    sweep = hmpim.Sweep(band=(0.1, 20.0), duration=10.0, gain=1.0, extinction=extinction)
    height = float(np.max(np.abs(sweep.motion(TIME).position)))
    sweep = hmpim.Sweep(band=(0.1, 20.0), duration=10.0, gain=1 / height, extinction=extinction)
    return hmpim.Stimulus(waveform=sweep, fs=FS)


def linear_record(kind: str, seed: int) -> hmpim.Record:
    """A linear system drawn at random, with one thing that could pass for nonlinear."""
    rng = np.random.default_rng([11, seed])
    noise = float(np.exp(rng.uniform(np.log(0.002), np.log(0.1))))
    system = {
        "delay": float(rng.uniform(0, 0.2)),
        "natural_frequency": float(rng.uniform(3, 15)),
        "damping_ratio": float(rng.uniform(0.2, 1.2)),
        "bias": float(rng.uniform(-1, 1)),
    }
    extra: dict[str, float] = {}
    if kind == "saturation":
        extra["saturation_high"] = system["bias"] + float(rng.uniform(0.5, 0.9))
    if kind == "data hold":
        extra["hold_period"] = float(rng.uniform(0.011, 0.03))
    if kind == "quantisation":
        extra["quantization_step"] = float(np.exp(rng.uniform(np.log(0.005), np.log(0.1))))
    colour = 0.9 if kind == "AR(1), 0.9" else 0.0
    sensor = hmpim.Sensor(**system, **extra, noise_std=noise, noise_colour=colour)
    record = hmpim.run(sensor, stimulus(float(rng.choice([0.0, 1.0]))), rng=seed)
    u, y = record.inputs[0].values, record.outputs[0].values
    if kind == "1/f":
        frequency = np.fft.rfftfreq(y.size)
        frequency[0] = frequency[1]
        pink = np.fft.irfft(np.fft.rfft(rng.standard_normal(y.size)) / np.sqrt(frequency), y.size)
        y = y + 3 * noise * pink / pink.std()
    if kind == "60 Hz line":
        y = y + 3 * noise * np.sin(2 * np.pi * 60 * TIME + rng.uniform(0, 6))
    if kind == "dynamics beyond the catalogue":
        # Three resonances behind the first, and a lag.
        for resonance in rng.uniform(4, 40, 3):
            root = np.exp((-rng.uniform(0.02, 0.3) + 1j) * 2 * np.pi * resonance / FS)
            denominator = np.array([1.0, -2 * root.real, abs(root) ** 2])
            y = y + 0.3 * lfilter([denominator.sum()], denominator, y - system["bias"])
    if kind == "drift of the bias":
        y = y + rng.uniform(0.1, 1.0) * np.sqrt(TIME / 10)
    return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)


def one_linear(kind: str, seed: int) -> tuple[bool, bool]:
    """Whether it was called nonlinear, and whether that alone made it doubtful."""
    pair = hmpim.identify(linear_record(kind, seed))["y", "u"]
    alarm = any(w.code in ("nonlinear", "rate_limit") for w in pair.warnings)
    return alarm, alarm and pair.verdict == "doubtful"


def nonlinear_record(kind: str, size: float, noise: float, seed: int) -> hmpim.Record:
    """Second order, 10 Hz, ζ 0.4, delay 30 ms, with one nonlinearity, by semi-implicit Euler."""
    drive = stimulus(1.0).waveform
    omega, step = 2 * np.pi * 10.0, 1 / FS / SUBSTEPS
    fine = np.arange(TIME.size * SUBSTEPS) * step - 0.03
    u = np.where(fine > 0, drive.motion(np.maximum(fine, 0.0)).position, 0.0)
    top = float(np.max(np.abs(u)))
    cubic = {"hardening": size, "softening": -size}.get(kind, 0.0) / top**2
    grip = step * omega**2 * size * top if kind == "friction" else 0.0
    y = v = 0.0
    out = np.empty(u.size)
    for k, target in enumerate(u.tolist()):
        out[k] = y
        v += step * (omega**2 * (target - y - cubic * y**3) - 0.8 * omega * v)
        v = 0.0 if abs(v) <= grip else v - np.copysign(grip, v)
        y += step * v
    if kind == "backlash":
        out = play(out, size * top)
    if kind == "rate_limit":
        out = rate_limited(out, size * float(np.max(np.abs(np.diff(out)))))
    rng = np.random.default_rng([13, seed])
    y_read = out[::SUBSTEPS] + noise * top * rng.standard_normal(TIME.size)
    u_sent = drive.motion(TIME).position
    return hmpim.Record.from_arrays({"u": u_sent}, {"y": y_read}, fs=FS)


@dataclass(frozen=True)
class Found:
    """What was said of one nonlinear record."""

    said: str  # 'named', 'among', 'nonlinear', 'wrong', 'missed'
    share: float
    verdict: str
    kinds: tuple[str, ...]


def one_nonlinear(case: tuple[str, float, float], seed: int) -> Found:
    kind, size, noise = case
    pair = hmpim.identify(nonlinear_record(kind, size, noise, seed))["y", "u"]
    found = pair.nonlinearity
    texts = [w.message for w in pair.warnings if w.code == "nonlinear"]
    codes = {w.code for w in pair.warnings if w.code == "rate_limit" or "includes" in w.message}
    modelled = codes & set(KIND_WORDS)  # found, and part of the model
    warned = bool(texts) or bool(modelled)
    named = {kind for kind, words in KIND_WORDS.items() if any(words in text for text in texts)}
    kinds = tuple(sorted(modelled or named))
    if not warned:
        said = "missed"
    elif kinds == (kind,):
        said = "named"
    elif kind in kinds:
        said = "among"
    else:
        said = "wrong" if len(kinds) == 1 else "nonlinear"
    return Found(said, 0.0 if found is None else found.share, pair.verdict, kinds)


def false_alarms(count: int, mapped: Callable) -> list[str]:
    lines = [
        "| linear system with | called nonlinear | by that made doubtful |",
        "| --- | --- | --- |",
    ]
    for kind in LINEAR:
        found = mapped(partial(one_linear, kind), range(count), f"linear, {kind}")
        alarms, doubts = (100 * np.mean([f[i] for f in found]) for i in (0, 1))
        lines.append(f"| {kind} | {alarms:.1f} % | {doubts:.1f} % |")
    return [*lines, "", f"{count} random systems each."]


def detections(count: int, mapped: Callable) -> list[str]:
    lines = [
        "| kind | size | noise | r.m.s. share | named | among those named | nonlinear only "
        "| wrong kind | not seen | `ok` |",
        "| --- |" + " --- |" * 9,
    ]
    for kind, sizes in SIZES.items():
        for size in sizes:
            for noise in NOISES:
                case = (kind, size, noise)
                found = mapped(partial(one_nonlinear, case), range(count), f"{kind} {size:g}")
                said = Counter(f.said for f in found)
                ok = sum(f.verdict == "ok" for f in found)
                share = 100 * np.median([f.share for f in found])
                cells = [said[k] for k in ("named", "among", "nonlinear", "wrong", "missed")]
                lines.append(
                    f"| {kind.replace('_', ' ')} | {size:g} | {noise:g} | {share:.2g} % | "
                    + " | ".join(str(c) for c in (*cells, ok))
                    + " |"
                )
    return [
        *lines,
        "",
        f"{count} seeds each; second order with 10 Hz, ζ 0.4 and a delay of 30 ms, integrated at "
        "16 times the sampling rate; the paper's sweep from 0.1 to 20 Hz, n = 1. Sizes are ratios: "
        "the friction band, or half the play, to the amplitude; the speed limit to the fastest "
        "motion; the cubic force to the linear one at the amplitude. Noise is relative to the "
        "amplitude. A kind that is part of the model counts as named.",
    ]


def section(count: int, mapped: Callable) -> list[str]:
    """Both tables; `count` seeds for the linear systems, a thirtieth for each nonlinear one."""
    return [
        *false_alarms(count, mapped),
        "",
        *detections(max(count // 30, 2), mapped),
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=30, help="linear systems of each kind")
    options = parser.parse_args()

    def mapped(function: Callable, items: range, label: str) -> list:
        return [function(item) for item in track(items, description=label, transient=True)]

    print("\n".join(section(options.count, mapped)))


if __name__ == "__main__":
    main()
