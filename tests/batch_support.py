"""Small fleets of records, quickly made and quickly identified."""

import numpy as np

import hmpim

FS = 100.0
SAMPLES = 300


def sweep(last: float = 20.0) -> np.ndarray:
    time = np.arange(SAMPLES) / FS
    return np.sin(2 * np.pi * (0.5 * time + (last - 0.5) / 6 * time**2))


def gain_record(gain: float, seed: int = 0) -> hmpim.Record:
    """A unit without dynamics: its scale factor tells which one it is."""
    noise = 0.01 * np.random.default_rng(seed).standard_normal(SAMPLES)
    u = sweep()
    return hmpim.Record.from_arrays({"u": u}, {"y": gain * u + noise}, fs=FS)


def rounded(table, name: str) -> dict[str, float]:
    """Values of a parameter by record, where there is one, to one digit."""
    found = table.to_arrow(["record", name]).to_pylist()
    return {row["record"]: round(row[name], 1) for row in found if row[name] is not None}
