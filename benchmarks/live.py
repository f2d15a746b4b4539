"""Runs in real time: regularity over a wire, five axes from run to page, the estimate so far.

``live.py timing`` sends 1000 commands a second over loopback for 10 s and says how regularly they
went. ``live.py five`` plays five axes at once on the served table, writes the page, says what each
stage took, and holds the bandwidths against those of the local table. ``live.py updates`` feeds
`hmpim.LiveEstimator` block by block and says what each update takes. All want an idle machine with
two cores, and print the tables of docs/performance.md. Run by `make bench`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from far_end import far_end

import hmpim
from hmpim.formats.recording import read_recording
from hmpim.formats.stimulus_files import save_stimulus
from hmpim.rigs import MotionTable
from hmpim.rigs.table import exact_bandwidth
from hmpim.stimulus.axes import AxisPlan

Real = np.ndarray[Any, np.dtype[np.float64]]

HMPIM = [sys.executable, "-m", "hmpim.cli.main"]
RATE = 1000.0
PLAYS = 7
BANDS = {"roll": 90.0, "yaw": 60.0, "pitch": 50.0, "azimuth": 24.0, "elevation": 18.0}
TRAVEL = {"roll": 5.0, "yaw": 5.0, "pitch": 5.0, "azimuth": 3.0, "elevation": 3.0}


def processor_time() -> float:
    """Seconds of processor time of all children that have ended."""
    spent = os.times()
    return spent.children_user + spent.children_system


def timing() -> list[str]:
    """1000 Hz over loopback for 10 s, one axis."""
    limits = MotionTable().limits_of("yaw", travel=2.0, share=0.5)
    sweep = hmpim.design(band=(0.5, 50), duration=10, fs=RATE, limits=limits, axis="yaw")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_stimulus(sweep, folder / "s.csv")
        with far_end("--rate", f"{RATE:g}") as (_, port):
            subprocess.run(
                [*HMPIM, "run", "--rig", f"udp://127.0.0.1:{port}", "s.csv", "-o", "r.h5",
                 "--log", "run.log", "--quiet"],
                cwd=folder, check=True, stdout=subprocess.DEVNULL,
            )  # fmt: skip
        record = read_recording(folder / "r.h5").record
        log = (folder / "run.log").read_text()
    told = finding_of(record, "timing")
    off = re.search(r"within (\S+) ms .*99.9 %: (\S+) ms; worst: (\S+) ms", told)
    right = re.search(r"([\d.]+) % of the periods", told)
    missed = re.search(r"(\d+) of (\d+) commands were a period or more late", told)
    if not (off and right and missed):
        raise SystemExit(f"the run does not state its timing: {told!r}")
    scheduling = re.search(r"(real-time|ordinary) scheduling[^\n]*", log)
    away, noticed = unlike(record, sweep)
    share = float(right[1])
    return [
        f"| {RATE:g} commands a second, one axis, {record.duration:.1f} s | | goal |",
        "| --- | --- | --- |",
        f"| error of their times: median, 99.9 %, worst "
        f"| {off[1]} ms, {off[2]} ms, {off[3]} ms | |",
        f"| periods right to half a period | {share:g} % | {verdict(share >= 98)}: 98 % |",
        f"| a period or more late | {missed[1]} of {missed[2]} | |",
        f"| ticks without their command or sample | {away} | |",
        f"| of these noticed and counted | {noticed} | {verdict(away == noticed)}: all |",
        f"| scheduling | {scheduling[0] if scheduling else 'not known'} | |",
    ]


def finding_of(record: hmpim.Record, code: str) -> str:
    """What a run says under a code; empty if nothing."""
    return " ".join(f.message for f in record.findings if f.code == code)


def verdict(kept: bool) -> str:
    """Whether what is asked for was kept."""
    return "met" if kept else "NOT MET"


def unlike(record: hmpim.Record, sweep: hmpim.Stimulus) -> tuple[int, int]:
    """Ticks at which not the command of that tick was in force, or no sample came; those told.

    The far end says what it followed at each tick. What it should have followed is the stimulus.
    """
    (command,) = record.inputs
    tick = np.rint((command.time - command.time[0]) * RATE).astype(int)
    wanted = sweep.position
    followed = np.full(wanted.size, np.nan)
    followed[tick] = command.values
    away = np.count_nonzero(~(np.abs(followed - wanted) <= 1e-9 * np.abs(wanted).max()))
    told = finding_of(record, "datagrams") + finding_of(record, "cut_short")
    noticed = re.findall(r"(\d+) of \d+ (?:commands|samples)|the last (\d+) of", told)
    return int(away), sum(int(a or b) for a, b in noticed)


def five() -> list[str]:
    """Five axes at once, from the run to the page."""
    table = MotionTable()
    plans = [
        AxisPlan(
            axis=axis,
            limits=table.limits_of(axis, travel=TRAVEL[axis], share=0.5),
            band=(0.3, top),
        )
        for axis, top in BANDS.items()
    ]
    stimuli = hmpim.design_axes(plans, duration=10.0, fs=RATE)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_stimulus(stimuli, folder / "s.csv")
        before = processor_time()
        with far_end("--rate", f"{RATE:g}") as (_, port):
            begun, spent = time.perf_counter(), processor_time()
            done = subprocess.run(
                [*HMPIM, "run", "--rig", f"udp://127.0.0.1:{port}", "s.csv", "-o", "r.h5",
                 "--json", "r.json", "--report", "r.html", "--log", "run.log", "--quiet"],
                cwd=folder, check=True, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            wall, spent = time.perf_counter() - begun, processor_time() - spent
        serving = processor_time() - before - spent
        over = bandwidths(folder / "r.json")
        record = read_recording(folder / "r.h5").record
        page = (folder / "r.html").stat().st_size
    local = hmpim.run(table, stimuli, rng=0)
    result = hmpim.identify(local)
    rows = []
    for axis, (value, std) in over.items():
        one = result[f"{axis}.position", f"{axis}.command"].parameters.bandwidth_phase90
        truth = exact_bandwidth(table, axis=axis, fs=RATE)
        alone = "–" if one is None or one.std is None else f"{one.value:.2f} ± {one.std:.2f}"
        rows.append(f"| {axis} | {value:.2f} ± {std:.2f} | {alone} | {truth:.2f} |")
    return [
        *stages(done.stdout, wall=wall, spent=spent, serving=serving),
        "",
        f"Run of {record.duration:.1f} s, page of {page / 1e6:.1f} MB, {os.cpu_count()} cores. "
        f"{verdict(wall < 60).capitalize()}: under 60 s from the command to the page.",
        *(said for code in ("timing", "datagrams", "lag") if (said := finding_of(record, code))),
        "",
        "| axis | over UDP, Hz | local table, Hz | friction off, exact, Hz |",
        "| --- | --- | --- | --- |",
        *rows,
    ]


def updates() -> list[str]:
    """What an update of the live estimate takes, at two rates, a block every 0.05 s."""
    runs = [updated(fs, seconds) for fs in (200.0, 1000.0) for seconds in (4.8, 19.2)]
    slowest = max(float(np.quantile(run[1], 0.99)) for run in runs)
    return [
        "| ms | "
        + " | ".join(f"{fs:g} Hz, {seconds:g} s" for (fs, seconds), *_ in runs)
        + " | goal |",
        "| --- |" + " --- |" * (len(runs) + 1),
        _row("ordinary update: median", [np.median(run[1]) for run in runs]),
        _row("99 %", [np.quantile(run[1], 0.99) for run in runs], f"{verdict(slowest <= 5)}: 5"),
        _row("longest", [run[1].max() for run in runs]),
        _row("median of the first quarter", [np.median(_part(run[1], 0)) for run in runs]),
        _row("median of the last quarter", [np.median(_part(run[1], 3)) for run in runs]),
        _row("new start: longest", [run[2].max() for run in runs]),
        _row("new starts", [run[2].size for run in runs], shape="d"),
        _row("data kept of the run, kB", [run[3] / 1e3 for run in runs], shape=".0f"),
    ]


def updated(fs: float, seconds: float) -> tuple[tuple[float, float], Real, Real, int]:
    """Milliseconds of ordinary updates and of new starts, and bytes kept, of one run.

    Each the least of several plays of the same samples.
    """
    limits = hmpim.Limits(position=1.0)
    plan = {"band": (0.1, 20.0), "fs": fs, "limits": limits, "kind": "repeated", "sweep": 0.6}
    stimulus = hmpim.design(duration=seconds, **plan)
    sensor = hmpim.Sensor(
        delay=0.15, natural_frequency=10.0, damping_ratio=0.4, bias=0.6, noise_std=0.1
    )
    record = hmpim.run(sensor, stimulus, rng=0)
    u, y = record.inputs[0].values, record.outputs[0].values
    size = round(0.05 * fs)
    fed(stimulus, u[: 30 * size], y[: 30 * size], size)  # what is loaded at first use, is loaded
    # Every play does the same; of each update the least time is its own, the rest the computer's.
    plays = [fed(stimulus, u, y, size) for _ in range(PLAYS)]
    ordinary, anew = (np.min([play[i] for play in plays], axis=0) for i in (0, 1))
    return (fs, seconds), ordinary, anew, plays[0][2]


def fed(stimulus: hmpim.Stimulus, u: Real, y: Real, size: int) -> tuple[Real, Real, int]:
    """Feed a run, block by block; milliseconds of each update, those that start anew apart."""
    live = hmpim.LiveEstimator(stimulus)
    ordinary, anew = [], []
    for first in range(0, u.size, size):
        block, starts = slice(first, first + size), live.starts
        begun = time.perf_counter()
        look = live.update(u[block], y[block])
        took = 1e3 * (time.perf_counter() - begun)
        if look is not None:
            (ordinary if live.starts == starts else anew).append(took)
    return np.array(ordinary), np.array(anew), live.statistics.nbytes


def _part(times: Real, quarter: int) -> Real:
    """One quarter of a run's updates."""
    return np.array_split(times, 4)[quarter]


def _row(name: str, values: list[Any], asked: str = "", *, shape: str = ".1f") -> str:
    return f"| {name} | " + " | ".join(f"{value:{shape}}" for value in values) + f" | {asked} |"


def bandwidths(path: Path) -> dict[str, tuple[float, float]]:
    """Of each axis's own pair, value and standard deviation."""
    pairs = json.loads(path.read_text())["pairs"]
    found = {}
    for pair in pairs:
        axis = pair["input"].removesuffix(".command")
        estimate = pair["parameters"]["bandwidth_phase90"]
        if pair["output"] == f"{axis}.position" and estimate is not None:
            found[axis] = (estimate["value"], estimate["std"] or float("nan"))
    return found


def stages(text: str, *, wall: float, spent: float, serving: float) -> list[str]:
    """What `hmpim run` says of its own stages, beside the whole that was measured here."""
    (line,) = (line for line in text.splitlines() if line.startswith("Time:"))
    told = re.findall(r"(\w+) ([\d.]+) s \(([\d.]+) s of processor\)", line)
    times = {name: (float(on_wall), float(busy)) for name, on_wall, busy in told}
    starting = (wall - sum(t[0] for t in times.values()), spent - sum(t[1] for t in times.values()))
    rows = {"starting and ending": starting, **times, "**in all**": (wall, spent)}
    return [
        "| stage | wall, s | processor, s |",
        "| --- | --- | --- |",
        *(f"| {name} | {t[0]:.1f} | {t[1]:.1f} |" for name, t in rows.items()),
        f"| the served table, meanwhile | | {serving:.1f} |",
    ]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    made = {"timing": timing, "five": five, "updates": updates}
    parser.add_argument("what", nargs="?", choices=(*made, "all"), default="all")
    what = parser.parse_args().what
    for wanted, make in made.items():
        if what in (wanted, "all"):
            print(f"## {wanted}\n")
            print("\n".join(make()), flush=True)
            print()
