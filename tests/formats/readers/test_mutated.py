"""Damaged files: a record or a clear error; never a crash, a hang, or more than the memory."""

import gzip
import io
import os
import zipfile

import numpy as np
import openpyxl
import pytest

import sample_logs
from hmpim.formats.readers.worker import pool
from mutations import mutated, read_or_refused

MEMORY = 2.0  # GiB

N = 200


def columns():
    t = np.arange(N) / 100.0
    u = np.sin(2 * np.pi * (0.5 * t + 1.5 * t**2))
    return t, u, np.interp(t - 0.05, t, u)


def text():
    rows = "".join(f"{a:.2f},{b:.5f},{c:.5f}\n" for a, b, c in zip(*columns(), strict=True))
    return ("# bench 2\ntime [s],u [deg],y [V]\n" + rows).encode()


def german():
    return text().replace(b",", b";").replace(b".", b",").decode().encode("utf-16")


def dated():
    form = "2026-11-21T12:00:{:06.3f}Z;{:.4f};{:.4f}\r\n"
    rows = "".join(form.format(*row) for row in zip(*columns(), strict=True))
    return ("Zeit;u;y\r\n" + rows).encode()


def scope():
    head = "Model,X\nSample Interval,1e-2\nVertical Units,V,V\n\nLabel,,\nTIME,CH1,CH2\n"
    rows = "".join(f"{a:.4e},{b:.4e},{c:.4e}\n" for a, b, c in zip(*columns(), strict=True))
    return (head + rows).encode()


def excel():
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(["time", "u", "y"])
    for row in zip(*columns(), strict=True):
        sheet.append([float(value) for value in row])
    out = io.BytesIO()
    book.save(out)
    return out.getvalue()


def repacked(data, rng):
    """A workbook whose parts are damaged inside, and packed again as if nothing were."""
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        parts = old.namelist()
        chosen = parts[int(rng.integers(len(parts)))] if rng.integers(2) else _SHEET
        for part in parts:
            inside = old.read(part)
            new.writestr(part, mutated(inside, rng) if part == chosen else inside)
    return out.getvalue()


_SHEET = "xl/worksheets/sheet1.xml"

FILES = {
    "csv": (text, {}),
    "utf-16": (german, {}),
    "dates": (dated, {}),
    "oscilloscope": (scope, {"inputs": ["CH1"], "outputs": ["CH2"]}),
    "gzip": (lambda: gzip.compress(text(), mtime=0), {}),
    "xlsx": (excel, {}),
    "xlsx-inside": (excel, {}),
}


LOGS = [kind for kind in sample_logs.KINDS if kind not in ("rosbag", "lerobot", "klipper")]


@pytest.fixture(autouse=True)
def limited(monkeypatch):
    monkeypatch.setenv("HMPIM_READER_MEMORY", str(MEMORY))
    monkeypatch.setenv("HMPIM_READER_TIME", "100")  # a busy machine is no hang


def good_file(name, tmp_path):
    """Bytes of a file that is whole, and what is asked of it."""
    if name in FILES:
        make, wanted = FILES[name]
        return make(), wanted
    _, u, y = sample_logs.KINDS[name]
    path = sample_logs.make(name, tmp_path)
    return path.read_bytes(), {"inputs": [u], "outputs": [y]}


def outcomes(name, tmp_path, seeds):
    good, wanted = good_file(name, tmp_path)
    path = tmp_path / f"good.{name}"
    path.write_bytes(good)
    assert read_or_refused(path, **wanted) == "read/read"
    found = []
    for seed in seeds:
        path = tmp_path / f"bad.{name}"
        damage = repacked if name == "xlsx-inside" else mutated
        path.write_bytes(damage(good, np.random.default_rng(seed)))
        found.append(read_or_refused(path, look=seed % 3 == 0, **wanted))
        worker = pool._STATE.get("worker")
        assert worker is None or worker.peak < MEMORY * 2**30
    return found


@pytest.mark.parametrize("name", [*FILES, *LOGS])
def test_five_damaged_files(name, tmp_path):
    found = outcomes(name, tmp_path, range(5))
    assert len(found) == 5
    # Not all are refused out of hand, and damage does not go through as if nothing were.
    assert any(outcome.startswith("refused") for outcome in found)


@pytest.mark.study
@pytest.mark.parametrize("name", [*FILES, *LOGS])
def test_a_thousand_damaged_files(name, tmp_path):
    count = int(os.environ.get("HMPIM_MUTATIONS", "1000"))
    found = outcomes(name, tmp_path, range(1000, 1000 + count))
    assert len(found) == count
