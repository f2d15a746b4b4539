"""Fig. 22: the bandwidth of the pitch axis by level, with friction and with a weak supply.

    python benchmarks/paper_fig22.py [--write]

Prints the table of docs/paper.md; with --write puts it, and the picture, into the page.
"""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from hmpim.identify import paper_analysis
from hmpim.plots.description import Axis, Curve, Dashes, Figure, Item, Marker, Panel, Rule
from hmpim.plots.style import Colour
from hmpim.rigs.table import AXES, FIG_4, MotionTable, exact_bandwidth
from hmpim.rigs.table.simulate import History
from hmpim.stimulus import Stimulus, design

DOCS = Path(__file__).parents[1] / "docs"
PICTURE = DOCS / "images" / "fig22.svg"
BEGIN, END = "<!-- levels -->\n", "<!-- end of levels -->"
LEVELS = (1000.0, 2150.0, 4300.0, 8600.0, 12_000.0)  # deg/s²
SHOWN = 8600.0  # the level at which the paper sees the change
FS = 1000.0
WEAK = 0.13  # of the rated torque
PITCH = AXES.index("pitch")
LOOKS: tuple[tuple[Colour, Dashes, Marker], ...] = (("input", "-", "o"), ("output", "--", "s"))
TABLES = {
    "friction, full supply": MotionTable(),
    f"friction, {100 * WEAK:.0f} % of the rated torque": MotionTable(supply=WEAK),
}


def sweep(level: float) -> Stimulus:
    """Ten seconds to 40 Hz, the acceleration at its limit as long as it can be."""
    limits = replace(MotionTable().limits_of("pitch", travel=5.0), acceleration=level)
    return design(band=(0.1, 40.0), duration=10.0, fs=FS, limits=limits, axis="pitch")


def play(table: MotionTable, stimulus: Stimulus) -> History:
    return table.simulate(stimulus, rng=np.random.default_rng(1))


def bandwidth(history: History) -> float:
    """-90° of samples over samples, by the paper's steps, Hz."""
    u, y = history.command[:, PITCH], history.encoder[:, PITCH]
    found = paper_analysis(u, y, FS, band=(0.1, 40.0)).estimates.bandwidth_phase90
    if found is None:
        raise SystemExit("no -90° in the band")
    return found


def study(levels: tuple[float, ...] = LEVELS) -> dict[str, dict[float, History]]:
    sweeps = {level: sweep(level) for level in levels}
    return {
        name: {level: play(table, stimulus) for level, stimulus in sweeps.items()}
        for name, table in TABLES.items()
    }


def markdown(runs: dict[str, dict[float, History]]) -> str:
    levels = list(next(iter(runs.values())))
    exact = exact_bandwidth(MotionTable(), axis="pitch", fs=FS, hold="included")
    lines = [
        f"| −90° of pitch (Hz) at | {' | '.join(f'{level:g} deg/s²' for level in levels)} |",
        f"| {' | '.join(['---'] * (len(levels) + 1))} |",
        *(
            f"| {name} | {' | '.join(f'{bandwidth(each[level]):.1f}' for level in levels)} |"
            for name, each in runs.items()
        ),
        f"| neither, exact | {' | '.join([f'{exact:.1f}'] * len(levels))} |",
    ]
    return "\n".join(lines) + "\n"


def picture(runs: dict[str, dict[float, History]]) -> Figure:
    trends = Panel(
        x=Axis(label="Peak acceleration (deg/s²)", scale="log"),
        y=Axis(label="−90° of pitch (Hz)"),
        items=tuple(
            Curve(
                x=np.array(list(each)),
                y=np.array([bandwidth(history) for history in each.values()]),
                label=name,
                colour=colour,
                dashes=dashes,
                marker=marker,
            )
            for (name, each), (colour, dashes, marker) in zip(runs.items(), LOOKS, strict=True)
        ),
        columns=2,
    )
    stimulus = sweep(SHOWN)
    end = 0.5 * (stimulus.duration + stimulus.sweep_duration)
    crossing = end - stimulus.sweep_duration * (1.0 - 18.0 / 40.0)
    windows = (
        (f"{SHOWN:g} deg/s²: half a second about 18 Hz", crossing - 0.25),
        ("The sweep's last half second", end - 0.5),
    )
    panels = [trends]
    for column, (title, start) in enumerate(windows):
        panels += half_second(
            {name: each[SHOWN] for name, each in runs.items()}, start, title, column
        )
    return Figure(
        panels=tuple(panels),
        alt="Bandwidth of pitch over the level, rising with friction and falling with a weak "
        "supply; command, motion and torque about 18 Hz and in the sweep's last half second.",
        heights=(2.3, 1.9, 1.9),
        columns=2,
        share_x=False,
    )


def half_second(
    runs: dict[str, History], start: float, title: str, column: int
) -> tuple[Panel, Panel]:
    """Motion and torque of both tables, over half a second from `start`."""
    moved: list[Item] = []
    torques: list[Item] = []
    for history, (colour, dashes, _) in zip(runs.values(), LOOKS, strict=True):
        seen = (history.time >= start) & (history.time <= start + 0.5)
        time = history.time[seen]
        if not moved:
            command = history.command[seen, PITCH]
            moved.append(Curve(x=time, y=command, label="command", colour="muted", width=0.8))
        motion, torque = history.position[seen, PITCH], history.torque[seen, PITCH]
        moved.append(Curve(x=time, y=motion, colour=colour, dashes=dashes))
        torques.append(Curve(x=time, y=torque, colour=colour, dashes=dashes))
    limit = WEAK * FIG_4[PITCH].torque_limit
    torques += [
        Rule(at=at, axis="y", label="limit of the weak supply" if at > 0 else "")
        for at in (-limit, limit)
    ]
    reach = 1.1 * max(float(np.max(np.abs(h.torque[:, PITCH]))) for h in runs.values())
    return (
        Panel(
            x=Axis(numbered=False),
            y=Axis(label="" if column else "Pitch (deg)"),
            items=tuple(moved),
            title=title,
            row=1,
            column=column,
            legend=False,
        ),
        Panel(
            x=Axis(label="Time (s)"),
            y=Axis(label="" if column else "Torque (N·m)", low=-reach, high=reach),
            items=tuple(torques),
            row=2,
            column=column,
            legend=not column,
        ),
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--write", action="store_true", help="into docs/paper.md")
    write = parser.parse_args().write
    runs = study()
    table = markdown(runs)
    print(table)
    if write:
        page = DOCS / "paper.md"
        before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
        page.write_text(before + BEGIN + table + END + rest.partition(END)[2], encoding="utf-8")
        picture(runs).savefig(PICTURE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
