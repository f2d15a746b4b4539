"""A run in real time over a wire: its regularity, and five axes at once from the run to the page.

``live.py timing`` sends 1000 commands a second over loopback for 10 s and says how regularly they
went. ``live.py five`` plays five axes at once on the served table, writes the page, says what each
stage took, and holds the bandwidths against those of the local table. Both want an idle machine
with two cores. Run by `make bench`.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import hmpim
from hmpim.formats.recording import read_recording
from hmpim.formats.stimulus_files import save_stimulus
from hmpim.rigs import MotionTable
from hmpim.rigs.table import exact_bandwidth
from hmpim.stimulus.axes import AxisPlan

HMPIM = [sys.executable, "-m", "hmpim.cli.main"]
RATE = 1000.0
BANDS = {"roll": 90.0, "yaw": 60.0, "pitch": 50.0, "azimuth": 24.0, "elevation": 18.0}
TRAVEL = {"roll": 5.0, "yaw": 5.0, "pitch": 5.0, "azimuth": 3.0, "elevation": 3.0}
OPTIONS = "[options]\nfriction = false\n"


@contextlib.contextmanager
def served(folder: Path) -> Iterator[int]:
    """Serve the table; yields its port."""
    said = folder / "table.txt"
    with said.open("w") as out:
        process = subprocess.Popen(
            [*HMPIM, "table", "--udp", "127.0.0.1:0", "--rate", f"{RATE:g}"],
            stdout=out,
            env=os.environ | {"PYTHONUNBUFFERED": "1"},
        )
    try:
        while "udp://" not in said.read_text():
            time.sleep(0.05)
        yield int(said.read_text().split("udp://127.0.0.1:")[1].split(",")[0])
    finally:
        process.send_signal(signal.SIGINT)
        process.wait()


def processor_time() -> float:
    """Seconds of processor time of all children that have ended."""
    spent = os.times()
    return spent.children_user + spent.children_system


def timing() -> list[str]:
    """1000 Hz over loopback for 10 s."""
    limits = MotionTable().limits_of("yaw", travel=2.0, share=0.5)
    sweep = hmpim.design(band=(0.5, 50), duration=10, fs=RATE, limits=limits, axis="yaw")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_stimulus(sweep, folder / "s.csv")
        with served(folder) as port:
            subprocess.run(
                [*HMPIM, "run", "--rig", f"udp://127.0.0.1:{port}", "s.csv", "-o", "r.h5",
                 "--log", "run.log"],
                cwd=folder, check=True, stdout=subprocess.DEVNULL,
            )  # fmt: skip
        record = read_recording(folder / "r.h5").record
        log = (folder / "run.log").read_text()
    said = {finding.code: finding.message for finding in record.findings}
    (share,) = re.findall(r"([\d.]+) % of the periods", said["timing"])
    within = float(share)
    scheduling = re.search(r"(real-time|ordinary) scheduling[^\n]*", log)
    return [
        said["timing"],
        said.get("datagrams", "No datagram was lost, late, doubled or swapped."),
        f"It had {scheduling[0] if scheduling else 'no note of its scheduling'}.",
        f"{'met' if within >= 98.0 else 'NOT MET'}: at least 98 % of periods within half a period.",
    ]


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
    seconds = max(s.samples for s in stimuli) / RATE
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        save_stimulus(stimuli, folder / "s.csv")
        with served(folder) as port:
            begun, spent = time.perf_counter(), processor_time()
            done = subprocess.run(
                [*HMPIM, "run", "--rig", f"udp://127.0.0.1:{port}", "s.csv", "-o", "r.h5",
                 "--json", "r.json", "--report", "r.html", "--log", "run.log", "--quiet"],
                cwd=folder, check=True, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            wall, spent = time.perf_counter() - begun, processor_time() - spent
        over = bandwidths(folder / "r.json")
        record = read_recording(folder / "r.h5").record
        local = hmpim.run(table, stimuli, rng=0)
        result = hmpim.identify(local)
        page = (folder / "r.html").stat().st_size
    rows = []
    for axis, (value, std) in over.items():
        one = result[f"{axis}.position", f"{axis}.command"].parameters.bandwidth_phase90
        truth = exact_bandwidth(table, axis=axis, fs=RATE)
        alone = "–" if one is None or one.std is None else f"{one.value:.2f} ± {one.std:.2f}"
        rows.append(f"| {axis} | {value:.2f} ± {std:.2f} | {alone} | {truth:.2f} |")
    notes = [f.message for f in record.findings if f.code in ("timing", "datagrams", "lag")]
    return [
        "| axis | over UDP, Hz | local table, Hz | friction off, exact, Hz |",
        "| --- | --- | --- | --- |",
        *rows,
        "",
        f"Run of {seconds:.1f} s, page of {page / 1e6:.1f} MB. From the command to the page "
        f"{wall:.1f} s on the wall and {spent:.1f} s of processor time ({os.cpu_count()} cores). "
        f"{'Met' if wall < 60 else 'NOT MET'}: under 60 s.",
        *stages(done.stdout),
        *notes,
    ]


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


def stages(text: str) -> list[str]:
    """What `hmpim run` says of its own stages."""
    return [line for line in text.splitlines() if line.startswith("Time:")]


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("what", nargs="?", choices=("timing", "five", "both"), default="both")
    what = parser.parse_args().what
    for wanted, make in (("timing", timing), ("five", five)):
        if what in (wanted, "both"):
            print(f"## {wanted}\n")
            print("\n".join(make()), flush=True)
            print()
