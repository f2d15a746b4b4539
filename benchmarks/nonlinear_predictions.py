"""Errors of predictions of units that are not linear: the table of docs/nonlinearity.md."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
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

PAGE = Path(__file__).parents[1] / "docs" / "nonlinearity.md"
BEGIN, END = "<!-- predictions -->\n", "<!-- end of predictions -->"


def driven_by(source) -> Drive:
    return Drive(source=source, between="smooth", band=(0.1, 15.0), fs=FS, samples=SAMPLES)


def chirp(most: float = 1.0) -> Drive:
    """A chirp to 15 Hz."""

    def source(t):
        inside = np.clip(t, 0.0, SAMPLES / FS)
        return most * np.sin(2 * np.pi * (0.1 * inside + 0.6 * inside**2))

    return driven_by(source)


def binary(seed: int, most: float = 0.7) -> Drive:
    """A binary sequence with smooth edges, which no sample misses."""
    rng = np.random.default_rng(seed)
    edges = np.cumsum(0.04 * rng.integers(1, 8, size=100))
    levels = most * np.diff(rng.choice([-1.0, 1.0], edges.size), prepend=0.0)

    def source(t):
        return ndtr((np.asarray(t)[:, None] - edges) / 0.01) @ levels

    return driven_by(source)


def moved(kind: str, drive: Drive) -> np.ndarray:
    """Output of the unit without noise; of its linear part for any other kind."""
    size, fine = SIZES.get(kind, 0.0), finely(drive)
    if kind == "backlash":
        return backlash(UNIT, drive, size)
    if kind == "friction":
        return friction(UNIT, drive, size)
    if kind in ("hardening", "softening"):
        return spring(UNIT, drive, size if kind == "hardening" else -size)
    if kind == "dead_zone":
        fine = dead_zone(fine, size)
    if kind == "rate_limit":
        fine = slew_limited(fine, size / (FS * FINE))
    return through(UNIT, drive, fine)[::FINE]


def recorded(drive: Drive, y: np.ndarray, seed: int) -> hmpim.Record:
    """A record of the unit, with noise."""
    y = y + NOISE * np.random.default_rng(seed).standard_normal(y.size)
    return hmpim.Record.from_arrays(
        {"u": drive.sampled()}, {"y": y}, fs=FS, intersample="bandlimited"
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


def table(count: int) -> str:
    """The table of the page."""
    lines = ["| unit | with the nonlinear part | linear part alone |", "| --- | --- | --- |"]
    for kind in SIZES:
        found, linear = errors(kind, count)
        lines.append(f"| `{kind}` | {found:.4f} | {linear:.4f} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=5, help="inputs for each unit")
    text = PAGE.read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    PAGE.write_text(
        head + BEGIN + table(parser.parse_args().count) + END + rest.partition(END)[2],
        encoding="utf-8",
    )
