"""The trade table for the system of the paper's Fig. 17: what each stimulus moves, and tells.

Prints the table of docs/gentlest.md; with --write puts it there, and the pictures beside it.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hmpim.optimal import Accuracy, Gentlest, RoughModel, gentlest, predict_errors, trade
from hmpim.stimulus import Limits, Stimulus, design

PAGE = Path(__file__).parents[1] / "docs" / "gentlest.md"
BEGIN, END = "<!-- trade table -->\n", "<!-- end of trade table -->\n"
FIG_17 = RoughModel(delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
NOISE, FS = 0.1, 200.0
BAND = (0.1, 20.0)
PAPERS_PEAKS = Limits(position=10, velocity=66, acceleration=8060, unit="deg")
HEAD = (
    "| stimulus | record s | ° | °/s | °/s² | delay ± ms | natural frequency ± % | "
    "damping ± | scale ± % |\n| --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
)


def row(name: str, stimulus: Stimulus) -> str:
    errors = predict_errors(stimulus, model=FIG_17, noise_std=NOISE)
    peaks = stimulus.peaks
    cells = [
        name,
        f"{stimulus.duration:.4g}",
        f"{peaks.position:.3g}",
        f"{peaks.velocity:.3g}",
        f"{float(f'{peaks.acceleration:.3g}'):g}",
        f"{1e3 * errors.ci95('delay'):.2g}",
        f"{10.0 * errors.ci95('natural_frequency'):.2g}",  # per cent of 10 Hz
        f"{errors.ci95('damping_ratio'):.2g}",
        f"{100.0 * errors.ci95('scale_factor'):.2g}",
    ]
    return "| " + " | ".join(cells) + " |\n"


def given_rows() -> list[str]:
    """Stimuli that take the paper's peaks in full; of repeated sweeps also a short record."""
    wide = Limits(position=10, unit="deg")
    printed = design(band=BAND, duration=10, fs=FS, limits=wide, extinction=1.0, lead=0)
    rows = [row("HMPIM as printed, n = 1", printed)]
    for name, kind, length in (
        ("HMPIM, n solved", "hmpim", 9.0),
        ("exponential sweep", "exponential", 8.0),
        ("Schroeder multisine", "schroeder", 9.0),
        ("repeated sweeps of 0.6 s", "repeated", 9.0),
        ("three sweeps of 0.6 s", "repeated", 1.8),
    ):
        stimulus = design(band=BAND, duration=length, fs=FS, limits=PAPERS_PEAKS, kind=kind)
        if stimulus.extinction is not None:
            name = f"{name}, n = {stimulus.extinction:.2f}"
        rows.append(row(name, stimulus))
    return rows


def search(limits: Limits, what: str, family: str | None = None) -> Gentlest:
    return gentlest(
        accuracy=Accuracy(),
        model=FIG_17,
        noise_std=NOISE,
        limits=limits,
        fs=FS,
        gentle=what,
        families=("sweep", "exponential", "multisine") if family is None else (family,),
    )


def found_rows(family: str) -> list[str]:
    """The gentlest of one family in 10 s, and the shortest at the paper's peaks."""
    named = {"sweep": "linear sweep", "exponential": "exponential sweep"}.get(family, family)
    inside = Limits(position=10, unit="deg")
    return [
        row(f"gentlest {named}", search(inside, "peak_acceleration", family).stimulus),
        row(f"shortest {named}", search(PAPERS_PEAKS, "duration", family).stimulus),
    ]


def table() -> str:
    rows = given_rows()
    for family in ("sweep", "exponential", "multisine"):
        print(f"{family} …", file=sys.stderr)
        rows += found_rows(family)
    return HEAD + "".join(rows)


def pictures() -> None:
    from hmpim.plots import time_histories
    from hmpim.plots.condition import input_condition_plot
    from hmpim.plots.trade import trade_plot
    from hmpim.stimulus.axes import AxisPlan, design_axes, input_condition

    found = search(Limits(position=10, unit="deg"), "peak_acceleration")
    folder = PAGE.parent / "images"
    folder.mkdir(exist_ok=True)
    trade_plot(found, trade(found)).savefig(folder / "gentlest-trade.png", dpi=110)
    time_histories(found.stimulus).savefig(folder / "gentlest-histories.png", dpi=110)
    limits = Limits(position=10, velocity=200, acceleration=8000, unit="deg")
    plans = [AxisPlan(axis=a, limits=limits, band=(0.5, 20)) for a in ("roll", "pitch", "yaw")]
    apart = input_condition(design_axes(plans, duration=10, fs=FS), band=(0.7, 19))
    input_condition_plot(apart).savefig(folder / "gentlest-condition.png", dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="put it into docs/gentlest.md")
    arguments = parser.parse_args()
    made = table()
    print(made, end="")
    if arguments.write:
        text = PAGE.read_text(encoding="utf-8")
        before, rest = text.split(BEGIN)
        PAGE.write_text(before + BEGIN + made + END + rest.split(END)[1], encoding="utf-8")
        pictures()


if __name__ == "__main__":
    main()
