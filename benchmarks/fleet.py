"""Many records: rate, growth with workers, memory, and the gain of doing one stimulus together.

`python benchmarks/fleet.py --records 5000` on an idle machine; 100 000 for the figures of
docs/batch.md. One Parquet file of records of 10 s at 200 Hz, second order, every unit its own
parameters; those of `shared` have one stimulus, those of `unrelated` a chirp each. The times of
one `identify` are processor times, from the same run.
"""

from __future__ import annotations

import argparse
import json
import resource
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


def run(path: Path, out: Path, *, keep: str, workers: int) -> dict[str, float]:
    marks: list[tuple[float, int]] = []
    begin = time.perf_counter()
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
    return {
        "workers": workers,
        "records": len(table),
        "whole_s": end - begin,
        "rate": (last - first) / (by - at) if by > at else float("nan"),
        "processor_ms": 1e3 * float(np.nanmedian(seconds)),
        "driver_peak_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=5000)
    parser.add_argument("--turns", type=int, default=1)
    parser.add_argument("--only", default="", help="shared-parameters, shared-results, unrelated")
    parser.add_argument("--workers", default="1,2")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    kinds = {
        "shared-parameters": (True, "parameters"),
        "shared-results": (True, "results"),
        "unrelated": (False, "results"),
    }
    chosen = [k for k in kinds if not options.only or k in options.only.split(",")]
    rows = []
    with TemporaryDirectory() as folder:
        for kind in chosen:
            shared, keep = kinds[kind]
            path = Path(folder) / f"{kind}.parquet"
            write_fleet(path, options.records, shared=shared)
            for turn in range(options.turns):
                for workers in map(int, options.workers.split(",")):
                    out = Path(folder) / f"{kind}-{turn}-{workers}"
                    row = {"kind": kind, **run(path, out, keep=keep, workers=workers)}
                    rows.append(row)
                    print(json.dumps(row), flush=True)
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
