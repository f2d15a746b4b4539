"""What spoils a record on its way: each takes a `Take` and changes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline

from families.kinds import first_order, lines, log_uniform, second_order, sequence
from families.simulate import linear_output
from families.system import System
from families.take import Figure, Take

Condition = Callable[[Take], None]


def another_input(low: float, high: float) -> Condition:
    """One more input, held or smooth, that moves the output by so much of what the first does.

    It knows nothing of the others and has a first- or second-order response of its own; it moves
    before the record begins, or from 2 % of it on.
    """

    def spoil(take: Take) -> None:
        rng, fs, samples = take.rng, take.drive.fs, take.u.size
        makes = (
            lines("flat", rates=(fs,), samples=samples),
            sequence("prbs", rates=(fs,), samples=samples),
        )
        drive = makes[rng.integers(2)](rng)
        unit = (first_order, second_order(), second_order())[rng.integers(3)](rng, drive)
        alone = linear_output(replace(unit, bias=0.0), drive)
        share = log_uniform(rng, low, high) * take.motion / float(np.std(alone))
        take.y = take.y + share * alone
        take.others[f"u{len(take.others) + 2}"] = drive.sampled()

    return spoil


def feedforward(take: Take) -> None:
    """The zeros act on a sweep before it is held: velocity and acceleration are commanded too."""
    drive = take.drive
    step = 1e-3 / drive.band[1]
    waves = [
        lambda t: drive.source(t),
        lambda t: (drive.source(t + step) - drive.source(t - step)) / (2 * step),
        lambda t: (drive.source(t + step) - 2 * drive.source(t) + drive.source(t - step)) / step**2,
    ]

    def simulate(system: System) -> np.ndarray:
        weights = np.polynomial.polynomial.polyfromroots([-1.0 / t for t in system.leads])
        weights = weights / weights[0]

        def commanded(time: np.ndarray) -> np.ndarray:
            every = zip(weights, waves, strict=False)
            return np.asarray(sum(weight * wave(time) for weight, wave in every))

        return linear_output(
            replace(system, leads=()), replace(drive, source=commanded), start=take.start
        )

    clean = simulate(take.system)
    take.y = take.y + clean - take.clean
    take.clean, take.simulate, take.fed_forward = clean, simulate, True


def operating_point(*, both: bool) -> Condition:
    """Output, or input and output, around 10⁷."""

    def spoil(take: Take) -> None:
        take.y += 1e7
        take.clean += 1e7
        take.system = take.system.moved(_with_bias(take, 1e7))
        if both:
            take.u = take.u + 1e7
            take.u_offset = 1e7

    return spoil


def _with_bias(take: Take, shift: float) -> np.ndarray:
    vector = take.system.vector()
    vector[-1] += shift
    return vector


def mains(take: Take) -> None:
    """50 or 60 Hz hum as strong as the noise or ten times as strong."""
    rng, std = take.rng, np.sqrt(take.noise.variance)
    line = float(rng.choice([50.0, 60.0]))
    turn = 2 * np.pi * line * take.time
    take.y += std * float(rng.uniform(1, 10)) * np.sin(turn + rng.uniform(0, 6.3))
    take.nuisances += [np.sin(turn), np.cos(turn)]
    take.absent.add("noise_std")


def louder(take: Take) -> None:
    """More noise over a fifth to half of the record, or the faster the output moves."""
    rng, n, std = take.rng, take.y.size, np.sqrt(take.noise.variance)
    if rng.uniform() < 0.5:
        long = int(rng.uniform(0.2, 0.5) * n)
        first = int(rng.integers(0, n - long + 1))
        level = np.zeros(n)
        level[first : first + long] = rng.uniform(2, 6)
    else:
        rate = np.abs(np.gradient(take.clean))
        level = rng.uniform(1, 3) * rate / float(np.sqrt(np.mean(rate**2)))
    added = std * level * rng.standard_normal(n)
    take.y = take.y + added
    take.noise = take.noise.plus(float(np.mean((std * level) ** 2)))
    take.absent.add("noise_std")


def spikes(take: Take) -> None:
    """A loose contact: one sample in two hundred far out."""
    rng = take.rng
    lost = rng.uniform(size=take.y.size) < 0.005
    size = rng.uniform(1.0, 5.0, lost.sum()) * 3 * take.motion
    take.y[lost] += size * rng.choice([-1, 1], lost.sum())
    take.lose(lost)


def missing(take: Take) -> None:
    """One row in twenty was not written, here and there."""
    kept = take.rng.uniform(size=take.y.size) > 0.05
    kept[0] = True
    take.rows = kept
    take.lose(~kept)


def at_instants(take: Take, time: np.ndarray) -> np.ndarray:
    """What the system puts out at any times, by a cubic through 32 points a sample."""
    drive = take.drive
    fine = replace(drive, fs=32 * drive.fs, samples=32 * (drive.samples + 2))
    first = take.start - 1 / drive.fs
    y = linear_output(take.system, fine, start=first)
    return CubicSpline(first + np.arange(y.size) / fine.fs, y)(time)


def jitter(take: Take) -> None:
    """Both channels are sampled when the computer gets round to it; the stamps say when."""
    step = 1 / take.drive.fs
    off = np.clip(take.rng.standard_normal(take.y.size) * 0.05, -0.4, 0.4) * step
    take.stamps = take.time + off
    moved = at_instants(take, take.stamps)
    take.y = take.y + moved - take.clean
    take.clean = moved
    take.u = take.drive.source(take.stamps)


def arrival(take: Take) -> None:
    """Samples are even; the stamps say when each arrived: late by 0.05 to 1 interval on average."""
    late = float(np.exp(take.rng.uniform(np.log(0.05), 0.0))) / take.drive.fs
    stamps = take.time + late * (take.rng.exponential(size=take.y.size) - 1.0)
    take.stamps = np.maximum.accumulate(stamps) + 1e-6 * late * np.arange(take.y.size)


def drift(kind: str) -> Condition:
    """The bias drifts: steadily, warming up, or as a slow wander."""

    def spoil(take: Take) -> None:
        rng, t = take.rng, np.arange(take.y.size) / take.y.size
        size = take.motion * float(rng.uniform(0.3, 3)) * float(rng.choice([-1, 1]))
        if kind == "steady":
            curve, shapes = t, [t - t.mean()]
        else:
            rate = float(rng.uniform(2, 8))
            curve = 1 - np.exp(-rate * t)
            shapes = [curve - curve.mean(), t * np.exp(-rate * t)]
            shapes[1] = shapes[1] - shapes[1].mean()
        take.y += size * curve
        take.clean += size * curve
        take.nuisances += shapes
        mean = size * float(curve.mean())
        take.system = take.system.moved(_with_bias(take, mean))
        take.clean -= size * curve - mean  # the bias is its mean over the record

    return spoil


def input_noise(take: Take) -> None:
    """The input is measured, with noise of 0.3 to 3 % of its motion."""
    std = float(np.std(take.u)) * float(np.exp(take.rng.uniform(np.log(0.003), np.log(0.03))))
    take.u = take.u + std * take.rng.standard_normal(take.u.size)
    f = np.linspace(0, take.drive.fs / 2, 400)[1:]
    passed = std**2 * float(np.mean(np.abs(take.system.response(f)) ** 2))
    take.noise = take.noise.plus(passed)
    take.absent.add("noise_std")


def repeated_frames(take: Take) -> None:
    """One output sample in thirty is a copy of the one before: the frame was dropped."""
    lost = take.rng.uniform(size=take.y.size) < 0.03
    lost[0] = False
    for k in np.flatnonzero(lost):
        take.y[k] = take.y[k - 1]
    take.lose(lost)


def late_frames(take: Take) -> None:
    """The delay jitters from frame to frame by a tenth of a sample; its mean is the truth."""
    off = 0.1 * take.rng.standard_normal(take.y.size).clip(-4, 4) / take.drive.fs
    moved = at_instants(take, take.time - off) - take.clean
    take.y = take.y + moved
    take.noise = take.noise.plus(float(np.var(moved)))
    take.absent.add("noise_std")


def quantised(take: Take) -> None:
    """Rounded to 0.3 to 4 times the noise, or 1/30 to 1/300 of the motion."""
    std = float(np.sqrt(take.noise.variance))
    step = max(std * float(np.exp(take.rng.uniform(np.log(0.3), np.log(4)))), take.motion / 300)
    step = min(step, take.motion / 10)
    take.y = step * np.rint(take.y / step)
    take.noise = take.noise.plus(step**2 / 12)
    take.absent.add("noise_std")
    take.extras["quantization_step"] = Figure(
        value=step, bound=0.0, widest=np.inf, tolerance=0.02 * step, tellable=False
    )


def clipped(*, both: bool) -> Condition:
    """The output's range ends where 5 to 30 % of the samples lie beyond it."""

    def spoil(take: Take) -> None:
        share = float(take.rng.uniform(0.05, 0.3))
        high = float(np.quantile(take.clean, 1 - share))
        low = float(np.quantile(take.clean, share)) if both else -np.inf
        margin = 3 * float(np.sqrt(take.noise.variance))
        lost = (take.clean > high - margin) | (take.clean < low + margin)
        take.y = np.clip(take.y, low, high)
        take.lose(lost)
        for name, level in (("saturation_low", low), ("saturation_high", high)):
            if np.isfinite(level):
                take.extras[name] = Figure(
                    value=level,
                    bound=0.0,
                    widest=np.inf,
                    tolerance=0.02 * take.motion,
                    tellable=False,
                )

    return spoil


def wrapped(take: Take) -> None:
    """An angle in degrees around zero, recorded between 0 and 360."""
    rng = take.rng
    shift = float(rng.uniform(-0.5, 0.5)) * take.motion - take.system.bias
    take.y = np.mod(take.y + shift, 360.0)
    take.clean = take.clean + shift
    take.system = take.system.moved(_with_bias(take, shift))


def input_glitch(take: Take) -> None:
    """One recorded sample of the input is off by 3 to 100 times the input's standard deviation."""
    rng = take.rng
    place = int(rng.uniform(0.1, 0.9) * take.u.size)
    size = float(rng.choice([-1, 1])) * float(rng.uniform(3, 100))
    take.u = take.u.copy()
    take.u[place] += size * float(np.std(take.u))


def input_repeated(take: Take) -> None:
    """One input sample in thirty repeats the previous one."""
    lost = take.rng.uniform(size=take.u.size) < 0.03
    lost[0] = False
    take.u = take.u.copy()
    for k in np.flatnonzero(lost):
        take.u[k] = take.u[k - 1]
    take.lose(lost)


def input_frozen(take: Take) -> None:
    """The record of the input is frozen over 2 to 10 % of its length."""
    n = take.u.size
    first, long = int(take.rng.uniform(0.2, 0.8) * n), int(take.rng.uniform(0.02, 0.1) * n)
    lost = (np.arange(n) > first) & (np.arange(n) < first + long)
    take.u = np.where(lost, take.u[first], take.u)
    take.lose(lost)


def fixed_words(take: Take) -> None:
    """Three stretches of 4 to 20 output samples hold a word that means "no value"."""
    rng, n = take.rng, take.y.size
    lost = np.zeros(n, bool)
    for first in rng.uniform(0.1, 0.9, 3) * n:
        lost[int(first) : int(first) + int(rng.integers(4, 21))] = True
    take.y = np.where(lost, float(rng.choice([-9999.0, 32767.0])), take.y)
    take.lose(lost)


def slow_recorder(take: Take) -> None:
    """The input is recorded at every second to fourth sample, and moves smoothly between."""
    most = int(0.4 * take.drive.fs / take.drive.band[1])
    every = int(take.rng.integers(2, max(min(most, 4), 2) + 1))
    take.u = take.u[np.arange(take.u.size) // every * every]
    take.absent.add("noise_std")


def stated(take: Take) -> None:
    """The record says what its input does between the samples."""
    words = {"smooth": "bandlimited", "zoh": "zoh", "foh": "foh"}
    take.intersample = "feedforward" if take.fed_forward else words[take.drive.between]
