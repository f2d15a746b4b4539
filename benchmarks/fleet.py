"""Many records: rate, growth with workers, memory, and the gain of doing one stimulus together.

One Parquet file of records of 10 s at 200 Hz, second order, every unit its own parameters; those
of `shared` have one stimulus (5 000 units, measured again with new noise), those of `unrelated` a
chirp each, and those of `unrelated-csv` a file each. In each turn one `identify`
after the other is timed in this process, so that a rate stands beside workers ÷ that time; times of
one are processor times, rates are by the clock. Beside unrelated records stands what as many plain
processes do in the same turn, each of which only calls `identify` in a loop: what two of them do
over one is all that the computer has to give. Memory of the process that gives out the work and of
its workers, and the workers' processor time, are sampled twice a second throughout. `--table FILE`
writes all as a table, `--plot FILE` draws rate and memory over the number of records. With
`--folder DIR` records and results stay: the same command goes on where it was stopped. Progress
goes to the terminal. On an idle machine of two cores, with the time that each takes there:

    python benchmarks/fleet.py --records 1500 --turns 3 --only unrelated                   # 10 min
    python benchmarks/fleet.py --records 100000 --only shared-parameters --workers 2       # 5 min
    python benchmarks/fleet.py --records 20000 --turns 3 --only shared-parameters          # 5 min
    python benchmarks/fleet.py --records 20000 --only shared-results --workers 2           # 2 min
    python benchmarks/fleet.py --records 5000 --only shared-results --odd 0.05 --workers 2 # 1 min
    python benchmarks/fleet.py --records 2000 --only shared-results --odd 0.5 --workers 2  # 1 min
    python benchmarks/fleet.py --records 100000 --only unrelated --workers 2 --folder DIR  # 45 min
    python benchmarks/fleet.py --records 1000 --only unrelated,unrelated-csv --workers 2   # 2 min
    python benchmarks/fleet.py --growth 1,10,100,1000,10000,100000 --only shared-parameters \\
        --plot docs/images/fleet.svg --table FILE                                          # 7 min
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import shutil
import sys
import threading
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import hmpim
from hmpim.batch import Request
from hmpim.batch.run import Cluster

FS, SAMPLES, ROWS = 200.0, 2000, 100
UNITS = 5000
"""Units of a shared stimulus at most; beyond, each is measured again with noise of its own."""

LEARNT = 16
"""Records from which a worker learns what a fleet shares."""


def chirp(last: float) -> np.ndarray:
    at = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.1 * at + (last - 0.1) / 20 * at**2))


def answer(u: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What a unit of its own makes of a stimulus."""
    omega = 2 * np.pi * 10 * (1 + 0.05 * rng.standard_normal())
    model = hmpim.Model(
        delay=0.02 * (1 + 0.05 * rng.standard_normal()),
        scale_factor=1.0,
        denominator=(omega**-2, 0.8 / omega, 1.0),
        bias=0.6,
    )
    return hmpim.simulate(model, u, fs=FS, intersample="bandlimited")


def write_fleet(path: Path, count: int, *, shared: bool, odd: float = 0.0) -> None:
    """Write records; of those behind the first 16, a share is clipped, and so not as the others."""
    import pyarrow as pa
    from pyarrow import parquet

    rng = np.random.default_rng(0)
    common = chirp(20.0)
    cells = pa.list_(pa.float64())
    schema = pa.schema([("u", cells), ("y", cells), ("fs", pa.float64())])
    units = [answer(common, rng) for _ in range(min(count, UNITS) if shared else 0)]
    half = path.with_suffix(".half")
    with parquet.ParquetWriter(half, schema) as writer:
        for start in range(0, count, ROWS):
            some = range(start, min(start + ROWS, count))
            if shared:
                inputs, outputs = [common for _ in some], [units[k % UNITS] for k in some]
            else:
                inputs = [chirp(rng.uniform(15.0, 20.0)) for _ in some]
                outputs = [answer(u, rng) for u in inputs]
            measured = np.stack(outputs) + 0.1 * rng.standard_normal((len(some), SAMPLES))
            for k in np.flatnonzero(rng.random(len(some)) < odd) if odd else ():
                if some[k] >= LEARNT:
                    measured[k] = np.minimum(measured[k], 1.2)
            edges = np.arange(len(some) + 1, dtype=np.int32) * SAMPLES
            columns = [
                pa.ListArray.from_arrays(edges, np.ravel(values)) for values in (inputs, measured)
            ]
            writer.write_table(pa.table([*columns, [FS] * len(some)], schema=schema))
    half.rename(path)


def as_csv(path: Path) -> Path:
    """The same records as CSV, one a file, in a folder beside it."""
    from pyarrow import parquet

    folder = path.with_suffix("")
    folder.mkdir(exist_ok=True)
    at = np.arange(SAMPLES) / FS
    table = parquet.read_table(path)
    for k in range(table.num_rows):
        columns = (at, *(table.column(name)[k].values.to_numpy() for name in ("u", "y")))
        np.savetxt(
            folder / f"{k:06d}.csv",
            np.column_stack(columns),
            fmt="%.9g",
            delimiter=",",
            header="time,u,y",
            comments="",
        )
    return folder


def one_identify(path: Path, count: int = 100) -> float:
    """Processor time in ms of one `identify`, mean over the first records of a file.

    One record in ten takes half as long again as others, since it asks for one more pole: what all
    take together is told by the mean.
    """
    from pyarrow import parquet

    some = parquet.ParquetFile(path).read_row_group(0).slice(0, count)
    spent = []
    for k in range(some.num_rows):
        u, y = (some.column(name)[k].values.to_numpy() for name in ("u", "y"))
        record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)
        begin = time.process_time()
        hmpim.identify(record)
        spent.append(time.process_time() - begin)
    return 1e3 * float(np.mean(spent[1:]))  # the first one imports


def plain_loop(path: str, seconds: float, ready, begin, back) -> None:
    """Identify the first records of a file over and over, for so long."""
    from pyarrow import parquet

    some = parquet.ParquetFile(path).read_row_group(0).slice(0, 40)
    records = []
    for k in range(some.num_rows):
        u, y = (some.column(name)[k].values.to_numpy() for name in ("u", "y"))
        records.append(hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS))
    hmpim.identify(records[0])
    ready.put(None)
    begin.wait()
    count, start = 0, time.perf_counter()
    while time.perf_counter() - start < seconds:
        hmpim.identify(records[count % len(records)])
        count += 1
    back.put(count / (time.perf_counter() - start))


def plain_rate(path: Path, processes: int, seconds: float = 8.0) -> float:
    """Records a second of so many processes that do nothing but identify."""
    spawn = multiprocessing.get_context("spawn")
    ready, back, begin = spawn.Queue(), spawn.Queue(), spawn.Event()
    told = (str(path), seconds, ready, begin, back)
    crew = [spawn.Process(target=plain_loop, args=told) for _ in range(processes)]
    for process in crew:
        process.start()
    for _ in crew:
        ready.get(timeout=120)
    begin.set()
    rate = sum(back.get(timeout=120) for _ in crew)
    for process in crew:
        process.join()
    return rate


class Watch:
    """Processor time of the workers, and resident memory of all in MB, sampled while they work."""

    def __init__(self) -> None:
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self.samples: list[tuple[float, float, float, float]] = []

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def _sample(self) -> None:
        while not self._done.wait(0.5):
            workers = children(os.getpid())
            largest = max((resident(pid) for pid in workers), default=0.0)
            spent = sum(processor(pid) for pid in workers)
            self.samples.append((time.perf_counter(), resident(os.getpid()), largest, spent))

    def quarter(self, k: int) -> tuple[float, float]:
        """Largest memory here, and of any worker, in the k-th quarter of the time."""
        n = len(self.samples)
        some = self.samples[k * n // 4 : (k + 1) * n // 4] or self.samples
        return max((s[1] for s in some), default=0.0), max((s[2] for s in some), default=0.0)

    def spent(self, marks: list[tuple[float, int]]) -> tuple[float, float]:
        """Processor time of the workers for each record in ms, and their share of the time."""
        inside = [s for s in self.samples if marks[0][0] <= s[0] <= marks[-1][0] and s[3] > 0]
        if len(inside) < 2:
            return float("nan"), float("nan")
        first, last = inside[0], inside[-1]
        seconds, span = last[3] - first[3], last[0] - first[0]
        done = np.interp([first[0], last[0]], *zip(*marks, strict=True))
        return 1e3 * seconds / max(float(np.diff(done)[0]), 1e-9), seconds / span


def resident(pid: int) -> float:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def processor(pid: int) -> float:
    """Processor time of a process since it began, in s."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    except (OSError, IndexError):
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def children(pid: int) -> list[int]:
    found = []
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            found += [int(word) for word in task.read_text().split()]
        except OSError:
            continue
    return found


class Told:
    """Progress: a line every ten seconds, and the marks that the rate is taken from."""

    def __init__(self, name: str) -> None:
        self.name, self.marks, self._last = name, [], 0.0

    def __call__(self, state) -> None:
        now = time.perf_counter()
        self.marks.append((now, state.records))
        if now - self._last > 10.0:
            self._last = now
            left = f", {state.left:.0f} s left" if np.isfinite(state.left) else ""
            print(
                f"{self.name}: {state.records} of {state.total}, {state.rate:.1f}/s{left}",
                file=sys.stderr,
                flush=True,
            )

    def rate(self) -> float:
        """Records a second from when all workers are there until the last record is done."""
        (at, first), (by, last) = self.marks[0], self.marks[-1]
        return (last - first) / (by - at) if by > at else float("nan")


def run(path: Path, out: Path, *, keep: str, workers: int, one_ms: float) -> dict[str, float]:
    told = Told(f"{path.stem}, {workers} workers")
    begin, own = time.perf_counter(), time.process_time()
    with Watch() as watch:
        table = hmpim.batch(
            path,
            out=out,
            request=Request(keep=keep),
            cluster=Cluster(workers=workers),
            progress=told,
        )
    end, own = time.perf_counter(), time.process_time() - own
    seconds = table.to_arrow(["seconds"]).column(0).to_numpy()
    first, second, fourth = (watch.quarter(k) for k in (0, 1, 3))
    spent, busy = watch.spent(told.marks)
    rate, bound = told.rate(), 1e3 * workers / one_ms
    return {
        "workers": workers,
        "records": len(table),
        "failed": sum(r is not None for r in table.to_arrow(["reason"]).column(0).to_pylist()),
        "whole_s": end - begin,
        "rate": rate,
        "one_ms": one_ms,
        "bound": bound,
        "percent_of_bound": 100 * rate / bound,
        "processor_ms": 1e3 * float(np.nanmean(seconds)),
        "together_percent": 100 * float(np.mean(1e3 * seconds < one_ms / 2)),
        "giving_out_ms": 1e3 * own / len(table),
        "worker_ms": spent,
        "workers_busy": busy / workers,
        "here_at_the_start_mb": first[0],
        "worker_at_the_start_mb": first[1],
        "here_mb": second[0],
        "here_at_the_end_mb": fourth[0],
        "worker_mb": second[1],
        "worker_at_the_end_mb": fourth[1],
        "samples_of_memory": len(watch.samples),
    }


def table_of(rows: list[dict]) -> str:
    """Medians over the turns, as a table, for docs/batch.md."""
    head = ("records", "workers", "a second", "workers ÷ one `identify`", "whole, s",
            "as many plain loops", "processor a record, ms", "a worker's share of a core",
            "done together, %", "giving out, MB: quarters 1, 2, 4",
            "worker, MB: quarters 1, 2, 4")  # fmt: skip
    lines = [f"| | {' | '.join(head)} |", f"| {' | '.join(['---'] * (len(head) + 1))} |"]
    for key in dict.fromkeys((r["kind"], r["records"], r["workers"]) for r in rows):
        some = [r for r in rows if (r["kind"], r["records"], r["workers"]) == key]

        def middle(name: str, some: list[dict] = some) -> float:
            return float(np.median([r[name] for r in some]))

        lines.append(
            f"| {key[0]} | {key[1]} | {key[2]} | {middle('rate'):.3g} | {middle('bound'):.3g} | "
            f"{middle('whole_s'):.1f} | "
            f"{told(middle('plain'))} | {middle('worker_ms'):.2f} | {middle('workers_busy'):.2f} | "
            f"{middle('together_percent'):.1f} | "
            f"{middle('here_at_the_start_mb'):.0f}, {middle('here_mb'):.0f}, "
            f"{middle('here_at_the_end_mb'):.0f} | "
            f"{middle('worker_at_the_start_mb'):.0f}, {middle('worker_mb'):.0f}, "
            f"{middle('worker_at_the_end_mb'):.0f} |"
        )
    return "\n".join(lines + gains_of(rows)) + "\n"


def told(number: float) -> str:
    return f"{number:.3g}" if np.isfinite(number) else "–"


def gains_of(rows: list[dict]) -> list[str]:
    """What more workers gain over one: median over the turns of the ratio within a turn."""
    lines = []
    for kind, records, workers in dict.fromkeys(
        (r["kind"], r["records"], r["workers"]) for r in rows if r["workers"] > 1
    ):
        pairs = [
            (r, one)
            for r in rows
            for one in rows
            if (r["kind"], r["records"], r["workers"]) == (kind, records, workers)
            and (one["kind"], one["records"], one["workers"], one["turn"])
            == (kind, records, 1, r["turn"])
        ]
        ratios = [r["rate"] / one["rate"] for r, one in pairs]
        plain = [r["plain"] / one["plain"] for r, one in pairs]
        if ratios:
            times = ", ".join(f"{ratio:.2f}" for ratio in ratios)
            beside = (
                f"; plain loops {np.median(plain):.2f} times" if np.isfinite(plain).all() else ""
            )
            gain = f"{np.median(ratios):.2f} times what one does ({times})"
            lines += ["", f"{kind}, {records} records: {workers} workers do {gain}{beside}."]
    return lines


def draw(rows: list[dict], path: Path) -> None:
    """Records a second, and memory of the largest worker, over the number of records."""
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    for kind, workers in dict.fromkeys((r["kind"], r["workers"]) for r in rows):
        some = [r for r in rows if (r["kind"], r["workers"]) == (kind, workers)]
        counts = sorted({r["records"] for r in some})
        told = f"{kind}, {workers} worker{'s' if workers > 1 else ''}"
        for axis, value in zip(
            axes,
            (lambda r: r["records"] / r["whole_s"], lambda r: r["worker_at_the_end_mb"]),
            strict=True,
        ):
            middle = [np.median([value(r) for r in some if r["records"] == n]) for n in counts]
            axis.plot(counts, middle, "o-", markersize=3, label=told)
    for axis, name in zip(axes, ("records a second, start included", "worker, MB"), strict=True):
        axis.set(xscale="log", xlabel="records", ylabel=name)
        axis.grid(alpha=0.3)
    axes[0].set_yscale("log")
    axes[1].set_ylim(bottom=0)
    axes[0].legend(frameon=False)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--records", type=int, default=5000)
    parser.add_argument("--growth", default="", help="so many records each, instead of --records")
    parser.add_argument("--turns", type=int, default=1)
    parser.add_argument(
        "--only", default="", help="shared-parameters, shared-results, unrelated, unrelated-csv"
    )
    parser.add_argument("--workers", default="1,2")
    parser.add_argument(
        "--odd", type=float, default=0.0, help="share of shared records that are clipped, 0 to 1"
    )
    parser.add_argument("--json", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--folder", type=Path, help="where records and results stay")
    options = parser.parse_args()
    kinds = {
        "shared-parameters": (True, "parameters"),
        "shared-results": (True, "results"),
        "unrelated": (False, "results"),
        "unrelated-csv": (False, "results"),
    }
    chosen = [k for k in kinds if not options.only or k in options.only.split(",")]
    rows = []
    for count in map(int, (options.growth or str(options.records)).split(",")):
        for kind in chosen:
            with TemporaryDirectory() as folder:
                place = options.folder or Path(folder)
                place.mkdir(parents=True, exist_ok=True)
                rows += turns_of(place, kind, kinds[kind], count, options)
    print(table_of(rows))
    if options.table:
        options.table.write_text(table_of(rows))
    if options.plot:
        draw(rows, options.plot)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


def turns_of(
    folder: Path, kind: str, asked: tuple[bool, str], count: int, options: argparse.Namespace
) -> list[dict]:
    """Turns over one file of records, workers in turn, so that a busy machine slows all."""
    shared, keep = asked
    name = f"{kind}-{count}" + (f"-{options.odd:g}" if options.odd else "")
    path, rows = folder / f"{name}.parquet", []
    if not path.exists():
        print(f"{path.stem}: making the records", file=sys.stderr, flush=True)
        write_fleet(path, count, shared=shared, odd=options.odd if shared else 0.0)
    source = as_csv(path) if kind == "unrelated-csv" else path
    for turn in range(options.turns):
        for workers in map(int, options.workers.split(",")):
            out = folder / f"{name}-{turn}-{workers}"
            kept = folder / f"{out.name}.json"
            if not kept.exists():
                one_ms = one_identify(path)  # in each turn: the computer's speed changes
                plain = plain_rate(path, workers) if not shared else float("nan")
                found = run(source, out, keep=keep, workers=workers, one_ms=one_ms)
                told = {"kind": kind, "turn": turn, "plain": plain, **found}
                kept.write_text(json.dumps(told) + "\n")
                shutil.rmtree(out)
            rows.append(json.loads(kept.read_text()))
            print(json.dumps(rows[-1]), flush=True)
    return rows


if __name__ == "__main__":
    main()
