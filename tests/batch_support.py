"""Small fleets of records, quickly made and quickly identified."""

import numpy as np

import hmpim

FS = 100.0
SAMPLES = 100
"""One second: a lag of second order is identified from it in a tenth of a static unit's time."""


def sweep(last: float = 20.0) -> np.ndarray:
    time = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.5 * time + (last - 0.5) / 2 * time**2))


def gain_record(gain: float, seed: int = 0) -> hmpim.Record:
    """A unit of second order: its scale factor tells which one it is."""
    omega = 2 * np.pi * 7
    model = hmpim.Model(delay=0.02, scale_factor=gain, denominator=(omega**-2, 1 / omega, 1.0))
    u = sweep()
    y = hmpim.simulate(model, u, fs=FS, intersample="bandlimited")
    y = y + 0.01 * np.random.default_rng(seed).standard_normal(SAMPLES)
    return hmpim.Record.from_arrays({"u": u}, {"y": y}, fs=FS)


def write_rows(path) -> None:
    """A Parquet file of eight records, gains 1 to 8, a bench each; row groups end within them."""
    import pyarrow as pa
    from pyarrow import parquet

    tables = []
    for k in range(1, 9):
        u, y = (channel.values for channel in gain_record(k, seed=k).channels)
        words = {"record": [f"unit{k}"], "bench": ["left" if k % 2 else "right"]}
        tables.append(
            pa.table({"u": u, "y": y, **{name: word * SAMPLES for name, word in words.items()}})
        )
    parquet.write_table(pa.concat_tables(tables), path, row_group_size=SAMPLES * 5 // 2)


def rounded(table, name: str) -> dict[str, float]:
    """Values of a parameter by record, where there is one, to one digit."""
    found = table.to_arrow(["record", name]).to_pylist()
    return {row["record"]: round(row[name], 1) for row in found if row[name] is not None}
