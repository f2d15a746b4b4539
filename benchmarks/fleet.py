"""Many records: rate, growth with workers, memory, and the gain of doing one stimulus together.

One Parquet file of records of 10 s at 200 Hz, second order, every unit its own parameters; those
of `shared` have one stimulus, those of `unrelated` a chirp each. The times of one `identify` are
processor times, from the same run. The memory of the process that gives out the work, and of its
workers, is sampled twice a second throughout; `--table FILE` writes all as docs/performance.md has
it. On an idle machine:

    python benchmarks/fleet.py --records 10000 --turns 3
    python benchmarks/fleet.py --records 100000 --only shared-parameters --workers 2
    python benchmarks/fleet.py --records 100000 --only unrelated --workers 2 --table fleet.md
    python benchmarks/fleet.py --growth 1,10,100,1000,10000 --only shared-parameters
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
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
    with parquet.ParquetWriter(path, schema) as writer:
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


def run(path: Path, out: Path, *, keep: str, workers: int) -> dict[str, float]:
    marks: list[tuple[float, int]] = []
    begin = time.perf_counter()
    with Watch() as watch:
        table = hmpim.batch(
            path,
            out=out,
            request=Request(keep=keep),
            cluster=Cluster(workers=workers),
            progress=lambda state: marks.append((time.perf_counter(), state.records)),
        )
    end = time.perf_counter()
    # The rate once all workers are at work, by the middle half of the marks.
    inner = marks[len(marks) // 4 : max(3 * len(marks) // 4, len(marks) // 4 + 2)]
    (at, first), (by, last) = inner[0], inner[-1]
    seconds = table.to_arrow(["seconds"]).column(0).to_numpy()
    second, fourth = watch.quarter(1), watch.quarter(3)
    return {
        "workers": workers,
        "records": len(table),
        "failed": sum(r is not None for r in table.to_arrow(["reason"]).column(0).to_pylist()),
        "whole_s": end - begin,
        "rate": (last - first) / (by - at) if by > at else float("nan"),
        "processor_ms": 1e3 * float(np.nanmedian(seconds)),
        "here_mb": second[0],
        "here_at_the_end_mb": fourth[0],
        "worker_mb": second[1],
        "worker_at_the_end_mb": fourth[1],
        "samples_of_memory": len(watch.samples),
    }


def table_of(rows: list[dict]) -> str:
    """Medians over the turns, as a table of docs/performance.md."""
    head = ("records", "workers", "a second", "whole, s", "one, ms of processor",
            "giving out, MB: second quarter, last", "worker, MB: second quarter, last")  # fmt: skip
    lines = [f"| | {' | '.join(head)} |", f"| {' | '.join(['---'] * 8)} |"]
    for key in dict.fromkeys((r["kind"], r["records"], r["workers"]) for r in rows):
        some = [r for r in rows if (r["kind"], r["records"], r["workers"]) == key]

        def middle(name: str, some: list[dict] = some) -> float:
            return float(np.median([r[name] for r in some]))

        lines.append(
            f"| {key[0]} | {key[1]} | {key[2]} | {middle('rate'):.0f} | {middle('whole_s'):.1f} | "
            f"{middle('processor_ms'):.2f} | "
            f"{middle('here_mb'):.0f}, {middle('here_at_the_end_mb'):.0f} | "
            f"{middle('worker_mb'):.0f}, {middle('worker_at_the_end_mb'):.0f} |"
        )
    return "\n".join(lines) + "\n"


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
                rows += turns_of(Path(folder), kind, kinds[kind], count, options)
    print(table_of(rows))
    if options.table:
        options.table.write_text(table_of(rows))
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


def turns_of(
    folder: Path, kind: str, asked: tuple[bool, str], count: int, options: argparse.Namespace
) -> list[dict]:
    """Turns over one file of records, workers in turn, so that a busy machine slows all."""
    shared, keep = asked
    path, rows = folder / f"{kind}.parquet", []
    write_fleet(path, count, shared=shared)
    for turn in range(options.turns):
        for workers in map(int, options.workers.split(",")):
            out = folder / f"{turn}-{workers}"
            rows.append({"kind": kind, **run(path, out, keep=keep, workers=workers)})
            print(json.dumps(rows[-1]), flush=True)
            shutil.rmtree(out)
    return rows


if __name__ == "__main__":
    main()
