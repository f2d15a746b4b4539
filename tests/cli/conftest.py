"""Records as files: a good one, and each of the ways in which one can be bad."""

import numpy as np
import pytest

N = 600
RATE = 100.0


def good_columns():
    rng = np.random.default_rng(2)
    t = np.arange(N) / RATE
    u = np.sin(2 * np.pi * (0.2 * t + 0.6 * t**2))
    late = np.interp(t - 0.1, t, u, left=0.0)
    return {"time": t, "u": u, "y": 2.0 * late + 0.5 + 0.01 * rng.standard_normal(N)}


def as_csv(columns):
    names = ",".join(columns)
    rows = zip(*columns.values(), strict=True)
    return (
        names + "\n" + "".join(",".join(f"{v!r}" for v in map(float, row)) + "\n" for row in rows)
    )


@pytest.fixture
def good(tmp_path):
    path = tmp_path / "good.csv"
    path.write_text(as_csv(good_columns()))
    return path


def unequal():
    lines = as_csv(good_columns()).splitlines()
    lines[200] = lines[200].rpartition(",")[0]  # one value short
    return "\n".join(lines)


def with_values(name, change):
    columns = good_columns()
    columns[name] = change(columns[name])
    return as_csv(columns)


def without(name):
    return as_csv({k: v for k, v in good_columns().items() if k != name})


def start_again(time):
    return np.concatenate((time[:300], time[:300]))


BAD_FILES = {
    "unequal_lengths": lambda: unequal().encode(),
    "three_samples": lambda: "\n".join(as_csv(good_columns()).splitlines()[:4]).encode(),
    "constant_output": lambda: with_values("y", np.ones_like).encode(),
    "missing_column": lambda: as_csv(
        {k: v for k, v in good_columns().items() if k != "y"}
    ).encode(),
    "time_starts_again": lambda: with_values("time", start_again).encode(),
    "empty": lambda: b"",
    "binary": lambda: bytes(range(256)) * 40,
}


@pytest.fixture(params=[*BAD_FILES, "absent", "folder"])
def bad(request, tmp_path):
    """Name of what is wrong, and the file."""
    path = tmp_path / f"{request.param}.csv"
    if request.param == "folder":
        path.mkdir()
    elif request.param != "absent":
        path.write_bytes(BAD_FILES[request.param]())
    return request.param, path
