"""Pitch of the table with friction, with and without a base motion: the table of docs/table.md.

``base_motion.py PEAK…`` prints a line for each peak acceleration in deg/s²; without one it prints
the whole table. With bracket and projector, position commands at 500 Hz, 10 s from 0.5 to 40 Hz.
"""

from __future__ import annotations

import sys

import hmpim
from hmpim.campaign.crossing import samples_bandwidth
from hmpim.rigs import MotionTable
from hmpim.rigs.table import exact_bandwidth

FS = 500.0
PEAKS = (700.0, 1400.0, 2150.0, 4300.0)
LOAD = {"uut_load": "bracket", "target_load": "projector"}


def bandwidth(*, friction: bool, base: bool, peak: float) -> str:
    """Of samples over samples, off the measured response, Hz."""
    table = MotionTable(friction=friction, **LOAD)
    whole = table.limits_of("pitch")
    limits = hmpim.Limits(
        position=whole.position if base else 2.0,
        velocity=whole.velocity,
        acceleration=peak,
        unit="deg",
    )
    sweep = hmpim.design(
        band=(0.5, 40.0),
        duration=10.0,
        fs=FS,
        limits=limits,
        axis="pitch",
        base="auto" if base else None,
    )
    pair = hmpim.identify(hmpim.run(table, sweep, rng=1), nonlinear="reported").pairs[0]
    near = pair.bandwidth_phase90
    if near is None:
        return "–"
    found = samples_bandwidth(pair.to_dict()["frequency_response"], near=near.value)
    return "–" if found is None else f"{found:.2f}"


def row(peak: float) -> str:
    """A line of the table."""
    cells = [
        bandwidth(friction=friction, base=base, peak=peak)
        for friction, base in ((True, False), (True, True), (False, False), (False, True))
    ]
    return f"| {peak:g} | {' | '.join(cells)} |"


def main() -> None:
    """Print the table, or lines of it."""
    asked = [float(text) for text in sys.argv[1:]]
    if not asked:
        exact = exact_bandwidth(MotionTable(**LOAD), axis="pitch", fs=FS, hold="included")
        print(f"Exact, without friction: {exact:.2f} Hz at every level.\n")
        print("| peak acceleration, deg/s² | friction | friction, base | none | none, base |")
        print("| --- | --- | --- | --- | --- |")
    for peak in asked or PEAKS:
        print(row(peak), flush=True)


if __name__ == "__main__":
    main()
