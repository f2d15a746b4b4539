"""What tests share: bounds for counts and averages, sizes of studies, physics stepped apart.

A study counts how often something happens, or averages something over seeds. What it may
claim follows from chance alone. `FALSE_ALARM` is the chance that a bound below is broken by a
package that keeps its promise: one in ten thousand for each bound, one in a hundred for a
suite that holds a hundred of them. Nothing else decides a bound.
"""

import asyncio
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from hypothesis import settings
from numpy.typing import NDArray
from scipy import signal, special

import hmpim
from hmpim import Estimate

FALSE_ALARM = 1e-4


def finished(work):
    """What a coroutine returns; in a thread of its own, since a browser's driver keeps a loop."""
    with ThreadPoolExecutor(1) as thread:
        return thread.submit(asyncio.run, work).result()


@contextmanager
def meanwhile(work):
    """Do work in a thread of its own until the block ends; it is given an event that says so."""
    over, faults = threading.Event(), []

    def far():
        try:
            work(over)
        except BaseException as error:
            faults.append(error)

    thread = threading.Thread(target=far)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()
    assert not faults


def study_size(usual: int) -> int:
    """How many seeds a study takes that usually takes so many: HMPIM_SEEDS is 200 usually."""
    return max(round(usual * int(os.environ.get("HMPIM_SEEDS", "200")) / 200), 1)


def examples(few: int) -> settings:
    """Settings of a property: few examples in `make test`, many times as many in `make studies`."""
    return settings(max_examples=few * int(os.environ.get("HMPIM_EXAMPLES", "1")))


def in_studies(*values) -> list:
    """Values of a parameter, or tuples of several, that only `make studies` takes."""
    several = [value if isinstance(value, tuple) else (value,) for value in values]
    return [pytest.param(*these, marks=pytest.mark.study) for these in several]


def few_of(few: Iterable[tuple], *grid: Iterable) -> list:
    """A few points of a grid; `make studies` takes all the others too."""
    few = list(few)
    return [*few, *in_studies(*(one for one in product(*grid) if one not in few))]


def printed_by(program: str) -> str:
    """What a program of Python prints in a process of its own, which must not fail."""
    command = [sys.executable, "-c", program]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=900).stdout


@cache
def designed_once(**wish) -> hmpim.Stimulus:
    """The stimulus of a wish, designed once per process: a stimulus is never changed."""
    return hmpim.design(**wish)


def search_coarsely(monkeypatch: pytest.MonkeyPatch) -> None:
    """Have the gentlest stimulus searched for in a few steps, where what is found matters little.

    How good a whole search is, tests/optimal ask.
    """
    search = import_module("hmpim.optimal.gentlest")  # its function has the module's name
    multisine, sweep = search.best_multisine, search.best_sweep

    def few_steps(*arguments, **options):
        return multisine(*arguments, **{**options, "starts": 1, "steps": 8})

    def few_trials(*arguments, **options):
        return sweep(*arguments, **{**options, "trials": 10})

    monkeypatch.setattr(search, "best_multisine", few_steps)
    monkeypatch.setattr(search, "best_sweep", few_trials)


def missing(name: str, what: str) -> NoReturn:
    """Skip the test, or fail it where HMPIM_TESTS_MUST_RUN says that what is missing is there.

    The variable holds names parted by commas; `.ci/run` sets it to what it has installed.
    """
    if name in os.environ.get("HMPIM_TESTS_MUST_RUN", "").split(","):
        pytest.fail(f"{what} is not installed, and HMPIM_TESTS_MUST_RUN names {name}")
    pytest.skip(f"{what} is not installed")


def c_compiler() -> str:
    """Path of the C compiler; the test is skipped where there is none."""
    return shutil.which("cc") or missing("cc", "a C compiler (cc)")


def run_octave(folder: Path) -> str:
    """What `run.m` of a folder prints in GNU Octave; the test is skipped where there is none."""
    if shutil.which("octave-cli") is None:
        missing("octave", "GNU Octave")
    done = subprocess.run(
        ["octave-cli", "--quiet", "--no-history", "run.m"],
        cwd=folder, capture_output=True, text=True, check=False,
    )  # fmt: skip
    if "control' package" in done.stderr or "package control" in done.stderr:
        missing("octave", "the control package of GNU Octave")
    assert done.returncode == 0, done.stderr
    return done.stdout


def fewest(trials: int, chance: float) -> int:
    """Smallest count of `trials` that an event of this chance falls below with FALSE_ALARM."""
    return int(np.argmax(special.bdtr(np.arange(trials + 1), trials, chance) >= FALSE_ALARM))


def most(trials: int, chance: float) -> int:
    """Largest count of `trials` that an event of this chance exceeds with FALSE_ALARM."""
    return int(np.argmax(special.bdtrc(np.arange(trials + 1), trials, chance) <= FALSE_ALARM))


def excluded(trials: int) -> float:
    """Smallest chance that no event at all in `trials` excludes, at 95 % confidence."""
    return float(1.0 - 0.05 ** (1.0 / trials))


def holds(estimate: Estimate, truth: float) -> bool:
    """Whether the truth is in an estimate's interval."""
    low, high = estimate.ci95
    return low <= truth <= high


def assert_share(hits, *, at_least: float = 0.0, at_most: float = 1.0) -> None:
    """Check that the share of hits is between two chances, as far as the count can tell.

    Parameters
    ----------
    hits : array_like of bool, shape (trials,) or (trials, figures)
        Rows are independent. Figures of one row are not: what they have in common is
        estimated from the rows and makes the number of trials smaller.
    at_least, at_most : float
        The chance that is promised.
    """
    hits = np.asarray(hits, dtype=bool)
    assert hits.size, "nothing was counted"
    rows = hits.reshape(len(hits), -1)
    trials = independent(rows)
    count = rows.mean() * trials
    low, high = fewest(trials, at_least), most(trials, at_most)
    assert low <= count <= high, (
        f"{rows.mean():.3f} of {rows.size} ({trials} independent) where {at_least} to {at_most} "
        f"is promised, {low / trials:.3f} to {high / trials:.3f} with room for chance"
    )


def independent(rows: NDArray[np.bool_]) -> int:
    """How many independent trials say as much as rows of figures that go together."""
    figures = rows.shape[1]
    within = rows.var() / figures  # what the mean of a row would scatter by
    if within == 0.0:
        return int(rows.size)
    together = np.clip(rows.mean(axis=1).var() / within, 1.0, figures)
    return max(int(rows.size / together), len(rows))


def room(trials: int, std: float = 1.0) -> float:
    """How far the mean of `trials` values of this standard deviation may be from theirs."""
    return -float(special.ndtri(FALSE_ALARM / 2)) * std / np.sqrt(trials)


def rms_between(trials: int) -> tuple[float, float]:
    """Between what the r.m.s. of `trials` standard normal values lies."""
    tails = np.array([FALSE_ALARM / 2, 1.0 - FALSE_ALARM / 2])
    low, high = np.sqrt(2.0 * special.gammaincinv(trials / 2, tails) / trials)
    return float(low), float(high)


def second_order_lag(
    time: NDArray[np.float64],
    drive,
    *,
    delay: float,
    natural_frequency: float,
    damping_ratio: float,
    steps: int = 16,
) -> NDArray[np.float64]:
    """Integrate ÿ + 2ζω ẏ + ω² y = ω² u(t - delay) by classical Runge-Kutta, from rest.

    `drive` is the continuous input. Independent of the package: no filter, no exponential.
    """
    omega = 2 * np.pi * natural_frequency
    fine_step = (time[1] - time[0]) / steps
    count = (time.size - 1) * steps
    grid = time[0] + fine_step * np.arange(2 * count + 1) / 2
    u = drive(grid - delay)
    y, v = 0.0, 0.0
    out = np.empty(count + 1)
    out[0] = y
    a, b, h = omega * omega, 2 * damping_ratio * omega, fine_step
    for k in range(count):
        u0, um, u1 = u[2 * k], u[2 * k + 1], u[2 * k + 2]
        k1y, k1v = v, a * (u0 - y) - b * v
        k2y, k2v = v + h / 2 * k1v, a * (um - y - h / 2 * k1y) - b * (v + h / 2 * k1v)
        k3y, k3v = v + h / 2 * k2v, a * (um - y - h / 2 * k2y) - b * (v + h / 2 * k2v)
        k4y, k4v = v + h * k3v, a * (u1 - y - h * k3y) - b * (v + h * k3v)
        y += h / 6 * (k1y + 2 * k2y + 2 * k3y + k4y)
        v += h / 6 * (k1v + 2 * k2v + 2 * k3v + k4v)
        out[k + 1] = y
    return out[::steps]


def answer_of(numerator, denominator, u, t) -> NDArray[np.float64]:
    """Output of a linear system to samples joined by straight lines, from rest at 0.

    As `scipy.signal.lsim` has it, which loops over the samples.
    """
    assert u[0] == 0.0
    above, below, _ = signal.cont2discrete((numerator, denominator), t[1] - t[0], method="foh")
    return signal.lfilter(above.ravel(), below, u)


def field_chirp(time: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear chirp 0.1 to 20 Hz in 10 s, amplitude 1, at rest before 0."""
    return np.where(time > 0, np.sin(2 * np.pi * (0.1 * time + 19.9 / 20 * time**2)), 0.0)


def four_sines(rng: np.random.Generator) -> NDArray[np.float64]:
    """Four sines of 10 to 100 Hz at 1000 Hz, shape (2400,), the first 2000 before a record."""
    t = np.arange(-2000, 400) / 1000.0
    frequency = 1000.0 * np.exp(rng.uniform(np.log(0.01), np.log(0.1), 4))
    angle = rng.uniform(0, 2 * np.pi, 4)
    return np.sin(2 * np.pi * frequency[:, None] * t + angle[:, None]).sum(axis=0)
