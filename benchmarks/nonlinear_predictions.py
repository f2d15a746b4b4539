"""Errors of predictions of units that are not linear, as docs/nonlinearity.md gives them."""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from families import kinds
from families.drive import Drive
from families.nonlinear import (
    FINE,
    backlash,
    dead_zone,
    finely,
    friction,
    slew_limited,
    spring,
    through,
)
from families.system import System
from scipy.special import ndtr

import hmpim

FS, SAMPLES, NOISE = 200.0, 2400, 0.01
UNIT = System(delay=0.03, gain=1.5, bias=0.2, pairs=((8.0, 0.4),))
SIZES = {
    "backlash": 0.06,
    "dead_zone": 0.08,
    "friction": 0.04,
    "hardening": 0.06,
    "softening": 0.03,
    "rate_limit": 60.0,
}
"""Half gap, half width, force over stiffness, cubic share at a deflection of 1, speed."""

WIDE = 0.09
"""Seconds beyond which an edge is over, or has not begun, to the last digit."""

PAGE = Path(__file__).parents[1] / "docs" / "nonlinearity.md"
BEGIN, END = "<!-- predictions -->\n", "<!-- end of predictions -->"
RANDOM, RANDOM_END = "<!-- random units -->\n", "<!-- end of random units -->"


def driven_by(source) -> Drive:
    return Drive(source=source, between="smooth", band=(0.1, 15.0), fs=FS, samples=SAMPLES)


@cache
def chirp(most: float = 1.0) -> Drive:
    """A chirp to 15 Hz."""

    def source(t):
        inside = np.clip(t, 0.0, SAMPLES / FS)
        return most * np.sin(2 * np.pi * (0.1 * inside + 0.6 * inside**2))

    return driven_by(source)


@cache
def binary(seed: int, most: float = 0.7) -> Drive:
    """A binary sequence with smooth edges, which no sample misses."""
    rng = np.random.default_rng(seed)
    edges = np.cumsum(0.04 * rng.integers(1, 8, size=100))
    levels = most * np.diff(rng.choice([-1.0, 1.0], edges.size), prepend=0.0)
    passed = np.concatenate([[0.0], np.cumsum(levels)])

    def source(t):
        t = np.asarray(t)
        first, last = (np.searchsorted(edges, t + reach) for reach in (-WIDE, WIDE))
        x = passed[first]
        for near in range(int((last - first).max(initial=0))):
            k = np.minimum(first + near, edges.size - 1)
            part = levels[k] * ndtr((t - edges[k]) / 0.01)
            x = x + np.where(first + near < last, part, 0.0)
        return x

    return driven_by(source)


def output_of(kind: str, size: float, unit: System, drive: Drive) -> np.ndarray:
    """Output of a unit without noise; of its linear part for any other kind."""
    fine = finely(drive)
    if kind == "backlash":
        return backlash(unit, drive, size)
    if kind == "friction":
        return friction(unit, drive, size)
    if kind in ("hardening", "softening"):
        return spring(unit, drive, size if kind == "hardening" else -size)
    if kind == "dead_zone":
        fine = dead_zone(fine, size)
    if kind == "rate_limit":
        fine = slew_limited(fine, size / (drive.fs * FINE))
    return through(unit, drive, fine)[::FINE]


@cache
def moved(kind: str, drive: Drive) -> np.ndarray:
    """Output of the unit of the table; it is kept, and must not be changed."""
    y = output_of(kind, SIZES.get(kind, 0.0), UNIT, drive)
    y.setflags(write=False)
    return y


def recorded(drive: Drive, y: np.ndarray, seed: int, noise: float = NOISE) -> hmpim.Record:
    """A record of the unit, with noise."""
    y = y + noise * np.random.default_rng(seed).standard_normal(y.size)
    return hmpim.Record.from_arrays(
        {"u": drive.sampled()}, {"y": y}, fs=drive.fs, intersample="bandlimited"
    )


def errors(kind: str, count: int) -> tuple[float, float]:
    """R.m.s. error of the prediction of other inputs, with the nonlinear part and without."""
    pair = hmpim.identify(recorded(chirp(), moved(kind, chirp()), 1))["y", "u"]
    linear = replace(pair, nonlinear_part=None)
    squares = np.zeros(2)
    for seed in range(count):
        drive = binary(seed, 1.1 if kind == "rate_limit" else 0.7)
        clean = moved(kind, drive)
        record = recorded(drive, clean, 100 + seed)
        scored = hmpim.predict(pair, record).scored
        for i, one in enumerate((pair, linear)):
            wrong = hmpim.predict(one, record).predicted - clean
            squares[i] += np.mean(wrong[scored] ** 2) / count
    with_part, without = np.sqrt(squares)
    return float(with_part), float(without)


def reversed_in_time(drive: Drive) -> Drive:
    """The same sweep from its end to its beginning, a tenth smaller, from rest."""

    def source(t):
        t = np.asarray(t, dtype=float)
        begun = np.clip(t / (0.05 * drive.duration), 0.0, 1.0)
        back = np.clip(drive.duration - t[::-1], 0.0, drive.duration)  # sources take rising times
        return 0.9 * begun**3 * (10 - 15 * begun + 6 * begun**2) * drive.source(back)[::-1]

    return replace(drive, source=source)


def random_unit(kind: str, seed: int) -> tuple[System, Drive, float]:
    """A second-order unit, a sweep, and a size as in the families study."""
    rng = np.random.default_rng([5, seed])
    drive = kinds.sweep()(rng)
    unit = kinds.second_order()(rng, drive)
    fine, fs = finely(drive), drive.fs * FINE
    moving = replace(unit, bias=0.0, delay=0.0, gain=1.0)
    largest = float(np.max(np.abs(output_of("linear", 0.0, moving, drive))))
    size = {
        "backlash": kinds.log_uniform(rng, 0.01, 0.1) * largest * abs(unit.gain),
        "dead_zone": kinds.log_uniform(rng, 0.01, 0.1) * float(np.max(np.abs(fine))),
        "friction": kinds.log_uniform(rng, 0.005, 0.05) * float(np.max(np.abs(fine))),
        "hardening": kinds.log_uniform(rng, 0.02, 0.2) / largest**2,
        "softening": kinds.log_uniform(rng, 0.01, 0.08) / largest**2,
        "rate_limit": float(rng.uniform(0.5, 0.9)) * float(np.max(np.abs(np.diff(fine)))) * fs,
    }[kind]
    return unit, drive, size


def random_errors(count: int) -> str:
    """The sentence of the page about random units."""
    shares, straight, valid = [], [], 0
    for kind in SIZES:
        for seed in range(count):
            unit, drive, size = random_unit(kind, seed)
            clean, other = output_of(kind, size, unit, drive), reversed_in_time(drive)
            noise = float(np.std(clean)) * 10 ** (-np.random.default_rng(seed).uniform(1.5, 3.0))
            result = hmpim.identify(recorded(drive, clean, 1, noise))
            pair = result["y", "u"]
            if pair.nonlinear_part is None:
                continue
            truth = output_of(kind, size, unit, other)
            record = recorded(other, truth, 2, noise)
            found = hmpim.predict(pair, record)
            linear = hmpim.predict(replace(pair, nonlinear_part=None), record).predicted
            for into, predicted in ((shares, found.predicted), (straight, linear)):
                wrong = (predicted - truth)[found.scored]
                into.append(float(np.sqrt(np.mean(wrong**2))) / noise)
            valid += hmpim.validate(result, record).passed
    low, middle, high = np.quantile(shares, [0.0, 0.5, 1.0])
    return (
        f"Of {count * len(SIZES)} random second-order units, {count} of each kind, identified on "
        f"a sweep, {len(shares)} models included the nonlinearity. On the sweep reversed in time "
        f"their error was {low:.2f} to {high:.2f} of the noise, {middle:.2f} in the median; that "
        f"of the linear part alone {min(straight):.2f} to {max(straight):.0f}, "
        f"{np.median(straight):.1f} in the median. {valid} of the {len(shares)} were valid "
        "there.\n"
    )


def table(count: int) -> str:
    """The table of the page."""
    lines = ["| unit | with the nonlinear part | linear part alone |", "| --- | --- | --- |"]
    for kind in SIZES:
        found, linear = errors(kind, count)
        lines.append(f"| `{kind}` | {found:.4f} | {linear:.4f} |")
    return "\n".join(lines) + "\n"


def written(text: str, begin: str, end: str, made: str) -> str:
    """The page with what stands between two marks made again."""
    head, _, rest = text.partition(begin)
    return head + begin + made + end + rest.partition(end)[2]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5, help="inputs for each unit")
    parser.add_argument("--random", type=int, default=12, help="random units of each kind")
    given = parser.parse_args()
    text = written(PAGE.read_text(encoding="utf-8"), BEGIN, END, table(given.count))
    text = written(text, RANDOM, RANDOM_END, random_errors(given.random))
    PAGE.write_text(text, encoding="utf-8")
