"""Runs that end when they are sure: when they end, and whether their intervals hold there.

``stopping.py RULE FIRST LAST --out FILE`` plays one system (second order 10 Hz, ζ 0.4, delay
150 ms, bias 0.6, noise 0.1; 0.1 to 20 Hz, 200 Hz, amplitude 1) for each seed, and adds a
line of JSON to FILE. ``stopping.py table FILE`` makes the table of docs/live.md of it. Rules:

repeated    sweeps of 0.6 s up and down, as `hmpim.run(until=...)` ends them
beyond      the same with a mode of 35 Hz
slow        one sweep of 10 s, ended at the first look at which the bars look small
wire        as repeated, played in real time over UDP to a process that serves the system

Seeds that FILE holds are not played again.

``stopping.py exact DRAWS`` asks what ending itself does to intervals, without the estimator: the
model is linear in its parameters about the truth, and its errors are those of least squares.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from far_end import far_end

import hmpim
from hmpim.experiment.collect import Played
from hmpim.experiment.sure import Sure
from hmpim.record import uniform
from hmpim.rigs import ChannelSpec, Layout, Samples
from hmpim.rigs.stimuli import commands_of
from hmpim.rigs.wire import UdpClient, WireRig

TRUTH = {
    "delay": 0.15,
    "natural_frequency": 10.0,
    "damping_ratio": 0.4,
    "scale_factor": 1.0,
    "bias": 0.6,
}
TARGETS = {"delay": 4e-4, "natural_frequency": 0.1}
FS, BAND, NOISE = 200.0, (0.1, 20.0), 0.1
LIMITS = hmpim.Limits(position=1.0)
BLOCK = 4  # commands: 0.02 s, as hmpim.run hands them over
LAYOUT = Layout(
    channels=(ChannelSpec(name="u", role="input"), ChannelSpec(name="y", role="output")),
    intersample="bandlimited",
)


def sensor(**other: float) -> hmpim.Sensor:
    """The system of the study, or one like it."""
    return hmpim.Sensor(**{**TRUTH, "noise_std": NOISE, **other})


@cache
def repeated(*, duration: float = 6.0, sweep: float = 0.6) -> hmpim.Stimulus:
    """Short sweeps, up and down."""
    wish: dict[str, Any] = {"band": BAND, "fs": FS, "limits": LIMITS}
    return hmpim.design(**wish, duration=duration, kind="repeated", sweep=sweep)


def blocks(stimulus: hmpim.Stimulus, rig: hmpim.Sensor, seed: int) -> Iterator[Played]:
    """The run, block by block."""
    record = hmpim.run(rig, stimulus, rng=seed)
    channels = {"u": record.inputs[0], "y": record.outputs[0]}
    for block in commands_of({"": stimulus}).blocks(BLOCK):
        part = slice(block.start, block.stop)
        samples = {
            name: Samples(time=c.time[part], values=c.values[part]) for name, c in channels.items()
        }
        yield Played(block=block, layout=LAYOUT, samples=samples, seconds=stimulus.duration)


def ended(
    stimulus: hmpim.Stimulus, rig: hmpim.Sensor, seed: int, until: hmpim.Until
) -> dict[str, Any]:
    """When `hmpim.run` would have ended, after how many looks, and errors in deviations."""
    sure = Sure(until, {"": stimulus}, {"": LIMITS}, LAYOUT)
    for played in blocks(stimulus, rig, seed):
        leave = sure(played)
        if leave is not None:
            short = leave.stimuli[""]
            return {
                "seed": seed,
                "time": leave.after / FS,
                "looks": leave.looks,
                "rest": float(np.abs(short.position[leave.after :]).max()),
                "z": errors(leave.look.parameters),
            }
    return {"seed": seed, "time": None, "looks": None, "rest": None, "z": None}


def slow(seed: int) -> dict[str, Any]:
    """One slow sweep, ended as soon as the bars look small, whatever has been swept."""
    stimulus = hmpim.Stimulus(waveform=hmpim.Chirp(band=BAND, duration=10.0), fs=FS)
    live = hmpim.LiveEstimator(stimulus)
    record = hmpim.run(sensor(), stimulus, rng=seed)
    u, y = record.inputs[0].values, record.outputs[0].values
    for first in range(0, u.size, 20):
        look = live.update(u[first : first + 20], y[first : first + 20])
        if look is None:
            continue
        found = {name: getattr(look.parameters, name) for name in TARGETS}
        if all(e is not None and e.std <= TARGETS[name] for name, e in found.items()):
            return {
                "seed": seed,
                "time": look.time,
                "looks": 1,
                "rest": None,
                "z": errors(look.parameters),
            }
    return {"seed": seed, "time": None, "looks": None, "rest": None, "z": None}


RIG_FILE = """rig = "sensor"
[limits]
position = 3
velocity = 130
acceleration = 17000
[options]
"""


@contextmanager
def served(*, seed: int) -> Iterator[tuple[str, int]]:
    """The system in a process of its own, in real time; yields its address."""
    with tempfile.NamedTemporaryFile("w", suffix=".toml") as unit:
        values = {**TRUTH, "noise_std": NOISE}
        unit.write(RIG_FILE + "".join(f"{name} = {v}\n" for name, v in values.items()))
        unit.flush()
        options = f"--rate {FS:g} --sensor {unit.name} --seed {seed}".split()
        with far_end(*options) as address:
            yield address


def wired(address: tuple[str, int], seed: int) -> dict[str, Any]:
    """One run in real time, ended by the same rule, and the live estimate where it was left."""
    stimulus, until = repeated(duration=4.8), hmpim.Until(**TARGETS)
    record = hmpim.run(WireRig(transport=UdpClient(*address)), stimulus, until=until)
    said = {finding.code: finding.message for finding in record.findings}
    row = {"seed": seed, "time": None, "looks": None, "rest": None, "z": None,
           "said": said.get("datagrams", "")}  # fmt: skip
    if record.stopping is None:
        return row
    even, live = uniform(record), hmpim.LiveEstimator(stimulus)
    known = slice(round(record.stopping.time * FS))
    live.read(even.inputs[0].values[known], even.outputs[0].values[known])
    look = live.look()
    assert look is not None
    short = record.inputs[0].values
    row |= {"time": record.stopping.time, "looks": record.stopping.looks,
            "rest": float(np.abs(short[known.stop :]).max()),
            "z": errors(look.parameters)}  # fmt: skip
    return row


def errors(parameters: Any) -> dict[str, float]:
    """Errors in standard deviations, of what was estimated."""
    found = {name: getattr(parameters, name) for name in TRUTH}
    return {n: (e.value - TRUTH[n]) / e.std for n, e in found.items() if e is not None and e.std}


def table(rows: list[dict[str, Any]]) -> list[str]:
    """What the lines of one rule come to."""
    done = [row for row in rows if row["time"] is not None]
    lines = [f"{len(rows)} seeds, {len(rows) - len(done)} played to the end"]
    if not done:
        return lines
    times = np.array([row["time"] for row in done])
    low, middle, high = np.quantile(times, [0.05, 0.5, 0.95])
    lines.append(
        f"ended after {middle:.3g} s in the median, {low:.3g} to {high:.3g} s in nine of ten, "
        f"{times.min():.3g} s at the earliest, {times.max():.3g} s at the latest, after "
        f"{np.median([row['looks'] for row in done]):.0f} looks"
    )
    lines += ["", "| parameter | 95 % intervals that hold, % | mean, σ | r.m.s., σ | largest, σ |",
              "| --- | --- | --- | --- | --- |"]  # fmt: skip
    pooled = []
    for name in TRUTH:
        z = np.array([row["z"][name] for row in done if name in row["z"]])
        if not z.size:
            continue
        pooled.append(z)
        lines.append(_line(name.replace("_", " "), z))
    lines.append(_line("all together", np.concatenate(pooled)))
    return lines


def _line(name: str, z: Any) -> str:
    held = 100.0 * float(np.mean(np.abs(z) < 1.96))
    rms = float(np.sqrt(np.mean(z**2)))
    return f"| {name} | {held:.1f} | {z.mean():+.2f} | {rms:.2f} | {np.abs(z).max():.1f} |"


def exact(draws: int) -> list[str]:
    """Ends of a linear model, by how many looks in a row are asked for and how far apart."""
    slopes = _slopes(repeated(duration=4.8))[:480]
    noise = NOISE * np.random.default_rng(1).standard_normal((draws, 480))
    lines = ["| looks in a row | every, s | median end, s | " + " | ".join(TRUTH) + " | all |",
             "| --- " * (4 + len(TRUTH)) + "|"]  # fmt: skip
    for step in (4, 10, 20):
        for needed in (1, 3):
            ends, z = linear_ends(slopes, noise, step=step, needed=needed)
            held = [100.0 * float(np.mean(np.abs(row) < 1.96)) for row in z.T]
            cells = [needed, f"{step / FS:g}", f"{np.median(ends):.3g}"]
            cells += [f"{share:.1f}" for share in (*held, np.mean(held))]
            lines.append("| " + " | ".join(map(str, cells)) + " |")
    return lines


def _slopes(stimulus: hmpim.Stimulus) -> Any:
    """Derivatives of the output by each parameter, shape (n, 5)."""

    def answer(name: str, by: float) -> Any:
        other = {name: TRUTH[name] + by, "noise_std": 0.0}
        return hmpim.run(sensor(**other), stimulus).outputs[0].values

    step = 1e-4
    columns = [(answer(name, step) - answer(name, -step)) / (2 * step) for name in TRUTH]
    return np.column_stack(columns)


def linear_ends(slopes: Any, noise: Any, *, step: int, needed: int) -> tuple[Any, Any]:
    """Time of each end, and errors there in standard deviations."""
    targets = np.array([TARGETS.get(name, np.inf) for name in TRUTH])
    ends, z = np.full(len(noise), np.nan), np.full((len(noise), len(TRUTH)), np.nan)
    row = np.zeros(len(noise), dtype=int)
    for count in range(140, slopes.shape[0] + 1, step):
        known = slopes[:count]
        inverse = np.linalg.inv(known.T @ known)
        error = noise[:, :count] @ known @ inverse
        left = np.sum(noise[:, :count] ** 2, axis=1)
        left -= np.einsum("mi,ij,mj->m", error, known.T @ known, error)
        std = np.sqrt(np.outer(left / (count - len(TRUTH)), np.diag(inverse)))
        row = np.where(np.all(std <= targets, axis=1), row + 1, 0)
        now = (row >= needed) & np.isnan(ends)
        ends[now], z[now] = count / FS, (error / std)[now]
    done = ~np.isnan(ends)
    return ends[done], z[done]


def played(rule: str, seed: int) -> dict[str, Any]:
    """One seed of one rule."""
    if rule == "slow":
        return slow(seed)
    until = hmpim.Until(**TARGETS)
    if rule == "beyond":
        return ended(repeated(duration=3.0), sensor(natural_frequency=35.0), seed, until)
    return ended(repeated(duration=4.8), sensor(), seed, until)


def main() -> None:
    """Play seeds, or print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rule", choices=("repeated", "beyond", "slow", "wire", "exact", "table"))
    parser.add_argument("seeds", nargs="*", help="FIRST LAST, or the file to make a table of")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    if given.rule == "table":
        rows = [json.loads(line) for line in Path(given.seeds[0]).read_text().splitlines()]
        print("\n".join(table(rows)))
        return
    if given.rule == "exact":
        print("\n".join(exact(int(given.seeds[0]))))
        return
    first, last = map(int, given.seeds)
    known = set()
    if given.out is not None and given.out.exists():
        known = {json.loads(line)["seed"] for line in given.out.read_text().splitlines()}
    seeds = [seed for seed in range(first, last) if seed not in known]
    with ExitStack() as stack:
        play = partial(played, given.rule)
        if given.rule == "wire":
            play = partial(wired, stack.enter_context(served(seed=first)))
        for seed in seeds:
            line = json.dumps(play(seed))
            if given.out is None:
                print(line, flush=True)
            else:
                with given.out.open("a") as out:
                    out.write(line + "\n")


if __name__ == "__main__":
    main()
