"""Accuracy of the local frequency responses, against the best public local rational estimator.

The record is the one every tool is compared on: second order 10 Hz, ζ 0.4, delay 150 ms,
bias 0.6, noise 0.1, linear chirp 0.1 to 20 Hz, amplitude 1, 10 s at 200 Hz. For each seed the
median relative complex error over 0.5 to 20 Hz is taken; all estimators see the same record, with
the same delay taken out first.

SDynPy (`pip install sdynpy psutil joblib`) is used where it is installed, at its default
bandwidth and at the best of a series chosen with the truth at hand. Version 0.23 runs with
NumPy 2.0, not with 2.4, so give it an environment of its own. The published estimator of McKelvey
and Guerin (SYSID 2012), written out below, always runs, likewise at the best of a series.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from scipy import signal

from hmpim.identify.frf.local import local_response
from hmpim.identify.frf.neighbours import transform

FS, BAND, DELAY, NATURAL, DAMPING, BIAS, NOISE = 200.0, (0.1, 20.0), 0.15, 10.0, 0.4, 0.6, 0.1
FINE = 32
Response = tuple[np.ndarray, np.ndarray]
Estimator = Callable[[np.ndarray, np.ndarray], Response]


def chirp(t: np.ndarray) -> np.ndarray:
    t = np.maximum(t, 0.0)
    return np.sin(2 * np.pi * (0.1 * t + 0.995 * t**2))


def clean_record() -> tuple[np.ndarray, np.ndarray]:
    """Input and output without noise; the input is linear over 1/6400 s."""
    w = 2 * np.pi * NATURAL
    t = np.arange(2000 * FINE) / (FS * FINE)
    matrices = ([[0, 1], [-(w**2), -2 * DAMPING * w]], [[0], [w**2]], [[1.0, 0]], [[0.0]])
    step = signal.cont2discrete(tuple(map(np.array, matrices)), 1 / (FS * FINE), "foh")
    numerator, denominator = signal.ss2tf(*step[:4])
    y = signal.lfilter(numerator[0], denominator, chirp(t - DELAY))[::FINE] + BIAS
    return chirp(np.arange(2000) / FS), y


def truth(f: np.ndarray) -> np.ndarray:
    s, w = 2j * np.pi * f, 2 * np.pi * NATURAL
    return w**2 / (s**2 + 2 * DAMPING * w * s + w**2) * np.exp(-s * DELAY)


def ours(u: np.ndarray, y: np.ndarray) -> Response:
    found = local_response(u, y, FS, band=BAND, delay=DELAY)
    return found.frequency, found.response


def published(width: int) -> Estimator:
    """McKelvey and Guerin: A Y = B U + T by least squares, all of order two."""

    def estimate(u: np.ndarray, y: np.ndarray) -> Response:
        spectra = transform(u, y, FS, DELAY)
        inside = np.flatnonzero((spectra.frequency >= BAND[0]) & (spectra.frequency <= BAND[1]))
        out = np.empty(inside.size, dtype=complex)
        for k, centre in enumerate(inside):
            start = max(centre - width, 1)
            at = np.arange(start, start + 2 * width + 1)
            x = ((at - centre) / width)[:, None] ** np.arange(3)
            columns = np.hstack((spectra.u[at, None] * x, x, -spectra.y[at, None] * x[:, 1:]))
            scale = np.linalg.norm(columns, axis=0)
            theta = np.linalg.lstsq(columns / scale, spectra.y[at], rcond=None)[0] / scale
            out[k] = theta[0]
        f = spectra.frequency[inside]
        return f, out * np.exp(-2j * np.pi * f * DELAY)

    return estimate


def sdynpy(bandwidth: float | None) -> Estimator:
    """SDynPy's local models, with its own choice among them; the delay taken out as ours."""
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    from sdynpy.signal_processing.sdynpy_lrm import frf_local_model

    def estimate(u: np.ndarray, y: np.ndarray) -> Response:
        spectra = transform(u, y, FS, DELAY)
        f, h, _ = frf_local_model(
            spectra.u[None, 1:],
            spectra.y[None, 1:],
            spectra.frequency[1:],
            bandwidth=bandwidth,
            print_time=False,
            max_parallel=1,
        )
        keep = (f >= BAND[0]) & (f <= BAND[1])
        return f[keep], h[keep, 0, 0] * np.exp(-2j * np.pi * f[keep] * DELAY)

    return estimate


def study(estimator: Estimator, seeds: int) -> dict[str, float]:
    """Median over the seeds of the median error, the worst of them, and the time of one."""
    u, clean = clean_record()
    errors, times = [], []
    for seed in range(seeds):
        y = clean + NOISE * np.random.default_rng(seed).standard_normal(clean.size)
        begin = time.perf_counter()
        f, g = estimator(u, y)
        times.append(time.perf_counter() - begin)
        keep = f >= 0.5
        errors.append(float(np.median(np.abs(g / truth(f) - 1)[keep])))
    return {
        "seeds": seeds,
        "median_percent": 100 * float(np.median(errors)),
        "worst_percent": 100 * max(errors),
        "time_ms": 1e3 * float(np.median(times)),
    }


def best_of(make: Callable[[float], Estimator], choices: tuple[float, ...], seeds: int) -> float:
    """Setting with the least error on a few seeds, the truth at hand: no user has it."""
    return min(choices, key=lambda choice: study(make(choice), seeds)["median_percent"])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=300)
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows = {"local_response": study(ours, options.seeds)}
    few = min(options.seeds, 10)
    width = int(best_of(lambda w: published(int(w)), (15, 25, 40, 60, 80, 99), few))
    rows[f"McKelvey-Guerin, best width {width}"] = study(published(width), options.seeds)
    if importlib.util.find_spec("sdynpy") is None:
        print(
            "SDynPy is not installed (pip install sdynpy psutil joblib); left out", file=sys.stderr
        )
    else:
        rows["SDynPy, default bandwidth"] = study(sdynpy(None), options.seeds)
        hertz = best_of(sdynpy, (3.0, 5.0, 8.0, 12.0, 16.0, 20.0), few)
        rows[f"SDynPy, best bandwidth {hertz:g} Hz"] = study(sdynpy(hertz), options.seeds)
    print(f"{'estimator':36} {'seeds':>6} {'median':>8} {'worst':>8} {'time':>9}")
    for name, row in rows.items():
        print(
            f"{name:36} {row['seeds']:6.0f} {row['median_percent']:6.2f} % "
            f"{row['worst_percent']:6.2f} % {row['time_ms']:6.1f} ms"
        )
    if options.json:
        options.json.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
