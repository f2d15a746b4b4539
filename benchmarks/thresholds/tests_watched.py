"""A plugin of pytest that notes which constants the tests reach and which decide there.

PYTHONPATH=benchmarks NOTES=notes python -m pytest -p thresholds.tests_watched tests/identify
"""

from __future__ import annotations

import json
import os
from collections import Counter
from pathlib import Path

from thresholds.watch import install

NOTES = install()
REACHED: Counter[str] = Counter()
MOVED: Counter[str] = Counter()


def pytest_runtest_setup() -> None:
    NOTES.clear()


def pytest_runtest_teardown() -> None:
    REACHED.update(NOTES.reached)
    MOVED.update(NOTES.moved)


def pytest_sessionfinish() -> None:
    folder = Path(os.environ["NOTES"])
    folder.mkdir(exist_ok=True, parents=True)
    seen = {"reached": dict(REACHED), "moved": dict(MOVED)}
    (folder / f"{os.getpid()}.json").write_text(json.dumps(seen))
