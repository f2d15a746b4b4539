"""Many records: rate, growth with workers, memory, and the gain of doing one stimulus together.

One Parquet file of records of 10 s at 200 Hz, second order, every unit its own parameters; those
of `shared` have one stimulus, those of `unrelated` a chirp each. Before each kind one `identify`
after the other is timed in this process, so that a rate stands beside workers ÷ that time; times of
one are processor times, rates are by the clock. The memory of the process that gives out the work,
and of its workers, is sampled twice a second throughout. `--table FILE` writes all as
docs/performance.md has it, `--plot FILE` draws rate and memory over the number of records. With
`--folder DIR` records and results stay: the same command goes on where it was stopped. Progress
goes to the terminal. On an idle machine of two cores, with the time that each takes there:

    python benchmarks/fleet.py --records 2000 --turns 3                                   # 6 min
    python benchmarks/fleet.py --records 20000 --only unrelated --workers 2               # 4 min
    python benchmarks/fleet.py --records 100000 --only shared-parameters --workers 2      # 3 min
    python benchmarks/fleet.py --records 100000 --only unrelated --workers 2 --folder DIR # 18 min
    python benchmarks/fleet.py --growth 1,10,100,1000,10000 --only shared-parameters
"""

from __future__ import annotations

import argparse
import json
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


def chirp(last: float) -> np.ndarray:
    at = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.1 * at + (last - 0.1) / 20 * at**2))


def write_fleet(path: Path, count: int, *, shared: bool) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    rng = np.random.default_rng(0)
    common = chirp(20.0)
    cells = pa.list_(pa.float64())
    schema = pa.schema([("u", cells), ("y", cells), ("fs", pa.float64())])
    half = path.with_suffix(".half")
    with parquet.ParquetWriter(half, schema) as writer:
        for start in range(0, count, ROWS):
            some = range(start, min(start + ROWS, count))
            inputs, outputs = [], []
            for _ in some:
                omega = 2 * np.pi * 10 * (1 + 0.05 * rng.standard_normal())
                model = hmpim.Model(
                    delay=0.02 * (1 + 0.05 * rng.standard_normal()),
                    scale_factor=1.0,
                    denominator=(omega**-2, 0.8 / omega, 1.0),
                    bias=0.6,
                )
                u = common if shared else chirp(rng.uniform(15.0, 20.0))
                y = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
                inputs.append(u)
                outputs.append(y + 0.1 * rng.standard_normal(SAMPLES))
            table = {"u": inputs, "y": outputs, "fs": [FS] * len(some)}
            writer.write_table(pa.table(table, schema=schema))
    half.rename(path)


def one_identify(path: Path, count: int = 40) -> float:
    """Processor time in ms of one `identify`, median over the first records of a file."""
    from pyarrow import parquet

    some = parquet.ParquetFile(path).read_row_group(0).slice(0, count)
    spent = []
    for k in range(some.num_rows):
        u, y = (some.column(name)[k].values.to_numpy() for name in ("u", "y"))
        record = hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)
        begin = time.process_time()
        hmpim.identify(record)
        spent.append(time.process_time() - begin)
    return 1e3 * float(np.median(spent))


class Watch:
    """Resident memory of this process and of its workers, in MB, sampled while they work."""

    def __init__(self) -> None:
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self.samples: list[tuple[float, float, float]] = []

    def __enter__(self) -> Watch:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._done.set()
        self._thread.join()

    def _sample(self) -> None:
        while not self._done.wait(0.5):
            workers = [resident(pid) for pid in children(os.getpid())]
            here = resident(os.getpid())
            self.samples.append((time.perf_counter(), here, max(workers, default=0.0)))

    def quarter(self, k: int) -> tuple[float, float]:
        """Largest memory here, and of any worker, in the k-th quarter of the time."""
        n = len(self.samples)
        some = self.samples[k * n // 4 : (k + 1) * n // 4] or self.samples
        return max((s[1] for s in some), default=0.0), max((s[2] for s in some), default=0.0)


def resident(pid: int) -> float:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


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
    second, fourth = watch.quarter(1), watch.quarter(3)
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
        "giving_out_ms": 1e3 * own / len(table),
        "here_mb": second[0],
        "here_at_the_end_mb": fourth[0],
        "worker_mb": second[1],
        "worker_at_the_end_mb": fourth[1],
        "samples_of_memory": len(watch.samples),
    }


def table_of(rows: list[dict]) -> str:
    """Medians over the turns, as a table of docs/performance.md."""
    head = ("records", "workers", "a second", "workers ÷ one `identify`", "whole, s",
            "a record, ms of processor", "giving out, MB: second quarter, last",
            "worker, MB: second quarter, last")  # fmt: skip
    lines = [f"| | {' | '.join(head)} |", f"| {' | '.join(['---'] * 9)} |"]
    for key in dict.fromkeys((r["kind"], r["records"], r["workers"]) for r in rows):
        some = [r for r in rows if (r["kind"], r["records"], r["workers"]) == key]

        def middle(name: str, some: list[dict] = some) -> float:
            return float(np.median([r[name] for r in some]))

        lines.append(
            f"| {key[0]} | {key[1]} | {key[2]} | {middle('rate'):.3g} | {middle('bound'):.3g} | "
            f"{middle('whole_s'):.1f} | "
            f"{middle('processor_ms'):.2f} | "
            f"{middle('here_mb'):.0f}, {middle('here_at_the_end_mb'):.0f} | "
            f"{middle('worker_mb'):.0f}, {middle('worker_at_the_end_mb'):.0f} |"
        )
    return "\n".join(lines + gains_of(rows)) + "\n"


def gains_of(rows: list[dict]) -> list[str]:
    """What more workers gain over one: median over the turns of the ratio within a turn."""
    lines = []
    for kind, records, workers in dict.fromkeys(
        (r["kind"], r["records"], r["workers"]) for r in rows if r["workers"] > 1
    ):
        ratios = [
            r["rate"] / one["rate"]
            for r in rows
            for one in rows
            if (r["kind"], r["records"], r["workers"]) == (kind, records, workers)
            and (one["kind"], one["records"], one["workers"], one["turn"])
            == (kind, records, 1, r["turn"])
        ]
        if ratios:
            times = ", ".join(f"{ratio:.2f}" for ratio in ratios)
            lines += ["", f"{kind}, {records} records: {workers} workers do "
                      f"{np.median(ratios):.2f} times what one does ({times})."]  # fmt: skip
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
    parser.add_argument("--only", default="", help="shared-parameters, shared-results, unrelated")
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--table", type=Path)
    parser.add_argument("--plot", type=Path)
    parser.add_argument("--folder", type=Path, help="where records and results stay")
    options = parser.parse_args()
    kinds = {
        "shared-parameters": (True, "parameters"),
        "shared-results": (True, "results"),
        "unrelated": (False, "results"),
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
    path, rows = folder / f"{kind}-{count}.parquet", []
    if not path.exists():
        print(f"{path.stem}: making the records", file=sys.stderr, flush=True)
        write_fleet(path, count, shared=shared)
    one_ms = one_identify(path)
    for turn in range(options.turns):
        for workers in map(int, options.workers.split(",")):
            out = folder / f"{path.stem}-{turn}-{workers}"
            kept = out.with_suffix(".json")
            if not kept.exists():
                found = run(path, out, keep=keep, workers=workers, one_ms=one_ms)
                told = {"kind": kind, "turn": turn, **found}
                kept.write_text(json.dumps(told) + "\n")
                shutil.rmtree(out)
            rows.append(json.loads(kept.read_text()))
            print(json.dumps(rows[-1]), flush=True)
    return rows


if __name__ == "__main__":
    main()
