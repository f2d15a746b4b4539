"""The draws of the families study with the constants as they are, watched, and changed."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from typing import Any

from thresholds.constants import Constant, constants
from thresholds.watch import NOTES, ends, places, set_constant

__all__ = ["Task", "changed", "draws", "plain", "traced"]

Draw = tuple[str, int]
Task = tuple[str, int, Draw]
"""A constant's key, the end (0 less, 1 more), the draw."""
SEED = 1


def draws(count: int) -> list[Draw]:
    from families.catalogue import FAMILIES

    return [(name, k) for name in FAMILIES for k in range(min(count, FAMILIES[name].most or count))]


def cells(draw: Draw) -> dict[str, Any]:
    """The class of a draw and of each figure that it can tell or that is wrong."""
    from families.study import one

    found = one(draw[0], SEED, draw[1], True)
    figures = {
        name: f.cell
        for name, f in found.figures.items()
        if f.tellable or f.cell.startswith("wrong")
    }
    return {"cell": found.cell, "figures": figures, "seconds": round(found.seconds, 2)}


def watched(draw: Draw) -> dict[str, Any]:
    NOTES.clear()
    out = cells(draw)
    return {**out, "reached": sorted(NOTES.reached), "moved": sorted(NOTES.moved)}


def _cached() -> None:
    """Keep what a draw is, so that a record is simulated once a process."""
    from functools import cache

    from families import study

    if study.draw_of is _SIMULATED.get("draw_of"):
        return
    study.draw_of = _SIMULATED["draw_of"] = cache(study.draw_of)


_SIMULATED: dict[str, Any] = {}
_FOUND: dict[str, Constant] = {}
_PLACES: dict[str, dict[str, str]] = {}


def changed(task: Task) -> dict[str, Any]:
    """A draw with one constant changed."""
    key, end, draw = task
    _cached()
    if not _FOUND:
        _FOUND.update({c.key: c for c in constants()})
        _PLACES.update(places(list(_FOUND.values())))
    one = _FOUND[key]
    kept = getattr(sys.modules[one.module], one.name)
    set_constant(one, ends(kept)[end], _PLACES)
    try:
        return cells(draw)
    finally:
        set_constant(one, kept, _PLACES)


def _start(watch: bool) -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    if watch:
        from thresholds.watch import install

        install()
    import pkgutil
    from importlib import import_module

    package = import_module("hmpim.identify")  # by its name: `hmpim.identify` is the function
    for found in pkgutil.walk_packages(package.__path__, "hmpim.identify."):
        import_module(found.name)


def _through(
    work: Any, tasks: Sequence[Any], *, jobs: int, watch: bool, seconds: float = 1e9
) -> Iterator[Any]:
    """Each task with its result, in the order in which they end, until the time is over."""
    context = get_context("spawn")
    begin = time.time()
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(watch,)) as p:
        waiting = {p.submit(work, task): task for task in tasks}
        for count, done in enumerate(as_completed(waiting)):
            yield waiting[done], done.result()
            spent = time.time() - begin
            if count % 100 == 99:
                left = spent / (count + 1) * (len(tasks) - count - 1)
                said = f"{count + 1} of {len(tasks)}, {left:.0f} s left"
                print(said, file=sys.stderr, flush=True)
            if spent > seconds:
                p.shutdown(wait=False, cancel_futures=True)
                return


def plain(some: Sequence[Draw], *, jobs: int) -> dict[Draw, dict[str, Any]]:
    """Each draw as it is."""
    return dict(_through(cells, some, jobs=jobs, watch=False))


def traced(some: Sequence[Draw], *, jobs: int) -> dict[Draw, dict[str, Any]]:
    """Each draw, and which constants it reached and which would have decided otherwise."""
    return dict(_through(watched, some, jobs=jobs, watch=True))


def perturbed(
    tasks: Sequence[Task], *, jobs: int, seconds: float
) -> Iterator[tuple[Task, dict[str, Any]]]:
    """Each draw with a constant changed, until the time is over."""
    return _through(changed, tasks, jobs=jobs, watch=False, seconds=seconds)
