"""Draw, identify, score; many of them, by several processes."""

from __future__ import annotations

import inspect
import signal
import time
import warnings
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, ProcessPoolExecutor
from types import FrameType
from typing import Any

import numpy as np

import hmpim
from families.catalogue import FAMILIES, Family
from families.kinds import set_samples
from families.scoring import Score, score
from families.take import Draw

__all__ = ["draw_of", "explained", "identified", "run"]

PATIENCE = 120
"""Seconds of processor time after which a draw counts as failed."""

SEED = 1


def draw_of(family: Family, seed: int, index: int) -> Draw:
    """The draw that (family, seed, index) determine, and nothing else."""
    rng = np.random.default_rng([zlib.crc32(family.name.encode()), seed, index])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return family.draw(rng)


def record_of(draw: Draw) -> hmpim.Record:
    """The package's record of a draw."""

    def channels(named: dict) -> tuple[hmpim.Channel, ...]:
        return tuple(
            hmpim.Channel(
                name=name,
                time=np.arange(values.size) / draw.fs if stamps is None else stamps,
                values=values,
            )
            for name, (stamps, values) in named.items()
        )

    extra = {}
    if draw.references and "references" in hmpim.Record.__dataclass_fields__:
        extra["references"] = channels(draw.references)
    return hmpim.Record(
        inputs=channels(draw.inputs),
        outputs=channels(draw.outputs),
        fs=draw.fs,
        intersample=draw.intersample,
        **extra,
    )


def identified(draw: Draw, *, options: bool = True) -> Any:
    """What `hmpim.identify` says, told only what it can be told."""
    taken = inspect.signature(hmpim.identify).parameters
    given = {k: v for k, v in draw.options.items() if k in taken} if options else {}
    if given.get("intersample") == "sampled" and not _knows_sampled():
        del given["intersample"]
    return hmpim.identify(record_of(draw), **given)


def _knows_sampled() -> bool:
    from typing import get_args

    from hmpim.record import Intersample

    return "sampled" in get_args(Intersample)


def model_response(pair: Any, frequency: np.ndarray) -> np.ndarray | None:
    """Response of the model that a result stands for; None where it gives none."""
    if pair.verdict == "not_identifiable":
        return None
    try:
        return hmpim.frequency_response(hmpim.to_model(pair), frequency)
    except hmpim.HmpimError:  # a model that cannot be simulated has its coefficients all the same
        p = pair.parameters
    if p.scale_factor is None or not len(pair.denominator):
        return None
    s = 2j * np.pi * frequency
    late = 0.0 if p.delay is None else p.delay.value
    top, below = np.polyval(pair.numerator, s), np.polyval(pair.denominator, s)
    return p.scale_factor.value * top / below * np.exp(-s * late)


def one(name: str, seed: int, index: int, options: bool, samples: int | None = None) -> Score:
    """Draw one record, identify it and hold the result against the truth."""
    set_samples(samples)  # here, since a worker need not have what its parent was told
    draw = draw_of(FAMILIES[name], seed, index)

    def late(_signal: int, _frame: FrameType | None) -> None:
        raise TimeoutError(f"more than {PATIENCE} s")

    before = signal.signal(signal.SIGVTALRM, late)
    signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
    begin = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            result = identified(draw, options=options)
            pair = result.pairs[0]
        spent = time.process_time() - begin
        response = None
        if draw.response is not None:
            response = model_response(pair, draw.response.frequency)
        found = score(draw, pair, response)
    except hmpim.HmpimError as error:
        spent = time.process_time() - begin
        found = Score(cell="no_answer", verdict="refused", failure=f"refused: {error}")
    except Exception as error:
        spent = time.process_time() - begin
        found = Score(cell="no_answer", verdict="crash", failure=f"{type(error).__name__}: {error}")
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, before)
    if not found.figures:
        found.figures = _unanswered(draw)
    found.seconds = spent
    return found


def _unanswered(draw: Draw) -> dict:
    from families.scoring import score_figure

    return {name: score_figure(None, truth, "") for name, truth in draw.figures.items()}


def explained(name: str, seed: int, index: int, *, options: bool = True) -> list[str]:
    """One draw, figure by figure: the truth, its bound, and what was said."""
    draw = draw_of(FAMILIES[name], seed, index)
    pair = identified(draw, options=options).pairs[0]
    response = None
    if draw.response is not None:
        response = model_response(pair, draw.response.frequency)
    found = score(draw, pair, response)
    samples = next(iter(draw.outputs.values()))[1].size
    lines = [
        f"{name}, seed {seed}, draw {index}: {samples} samples at {draw.fs:g} Hz; "
        f"{pair.structure}, {pair.intersample}, {pair.verdict}: {found.cell}",
    ]
    for key, truth in draw.figures.items():
        estimate, scored = getattr(pair.parameters, key, None), found.figures[key]
        said = "–" if estimate is None else f"{estimate.value:.7g} in {estimate.ci95}"
        lines.append(
            f"  {key:32s}{truth.value:14.7g} ± {truth.bound:8.2g}"
            f"{'  ' if truth.tellable else ' ?'} {scored.cell:13s}{said}"
        )
    if found.response is not None:
        lines.append(f"  response off by {100 * found.response:.2f} % at most")
    lines.append(f"  measured response beyond its errors: {found.measured_off}")
    return [*lines, *(f"  {w.code}: {w.message}" for w in pair.warnings)]


def run(
    names: Sequence[str],
    *,
    draws: int,
    seed: int = SEED,
    jobs: int = 2,
    options: bool = True,
    samples: int | None = None,
    tell: Callable[[str, list[Score]], None] | None = None,
) -> dict[str, list[Score]]:
    """All draws of the families named; `tell` is called as each family is done.

    `samples` is the length of each record, except in families about record length.
    """
    counts = {name: min(draws, FAMILIES[name].most or draws) for name in names}
    tasks = [
        (name, seed, k, options, samples) for name, count in counts.items() for k in range(count)
    ]
    found: dict[str, list[Score]] = {name: [] for name in names}
    scores = (one(*task) for task in tasks) if jobs == 1 else _in_processes(tasks, jobs)
    for (name, *_), score_ in zip(tasks, scores, strict=True):
        found[name].append(score_)
        if tell and len(found[name]) == counts[name]:
            tell(name, found[name])
    return found


Task = tuple[str, int, int, bool, int | None]


def _in_processes(tasks: Sequence[Task], jobs: int) -> Iterator[Score]:
    """Scores in order; a draw that takes its process down is a crash like any other."""
    done = 0
    while done < len(tasks):
        with ProcessPoolExecutor(max_workers=jobs) as pool:
            try:
                for found in pool.map(one, *zip(*tasks[done:], strict=True)):
                    yield found
                    done += 1
            except BrokenExecutor:  # by which draw is not known: the next one is tried alone
                yield _alone(tasks[done])
                done += 1


def _alone(task: Task) -> Score:
    with ProcessPoolExecutor(max_workers=1) as pool:
        try:
            return pool.submit(one, *task).result()
        except BrokenExecutor:
            return _died(*task)


def _died(name: str, seed: int, index: int, _options: bool, _samples: int | None) -> Score:
    figures = _unanswered(draw_of(FAMILIES[name], seed, index))
    return Score(cell="no_answer", verdict="crash", failure="its process died", figures=figures)
