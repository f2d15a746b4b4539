"""Is it worth while to aim: to sweep where the estimate so far says that most is to be learned?

``aiming.py`` prints the table of docs/decisions/0011: for several peak accelerations, when runs end
that repeat one sweep, and runs that aim after the first one. System, accuracy and rule are those
of ``stopping.py``; the model is linear in its parameters about the truth, and its errors are
those of least squares, from the same draws of the noise for all.

An aimed stimulus is the repeated one up to some instant. From there its frequency dwells on either
side of the natural frequency found, or sweeps to and fro about it. What shape is best was
picked afterwards for each row, which favours aiming. ``best`` is what nobody can do better: the
model is known exactly after one sweep, and the time is shared out over all frequencies at will.
"""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np
from stopping import BAND, FS, NOISE, TARGETS, TRUTH, linear_ends

from hmpim.optimal import RoughModel
from hmpim.optimal.fisher import responses, sensitivities

MODEL = RoughModel(delay=0.15, natural_frequency=10.0, damping_ratio=0.4)
PEAKS = (math.inf, 12000.0, 8000.0, 4000.0)
LENGTH, LEAD, SWEEP = 6.0, 0.08, 0.6  # s: of the record, before the first sweep, of a sweep
BEGINS = ((0.68, 0.68), (0.93, 0.73))  # s: aimed from, by what was known; in real time 0.2 s ahead
SHAPES = (  # shares of the natural frequency between which it goes; s of a dwell, of a glide
    (0.5, 1.4, 0.0, 0.2),
    (0.7, 1.2, 0.15, 0.05),
    (0.7, 1.25, 0.2, 0.06),
    (0.65, 1.2, 0.25, 0.08),
    (0.7, 1.3, 0.1, 0.05),
)
FINER = 16  # points a sample on which a motion is made
NATURAL = np.arange(4.0, 16.1, 0.5)  # Hz: an aimed stimulus is made for the nearest
EVERY = 2  # samples between two looks
Real = Any


def repeated_turns(until: float = LENGTH) -> list[tuple[float, float]]:
    """Times in s and frequencies in Hz at which the repeated sweep turns."""
    count = math.ceil((until - LEAD) / SWEEP) + 1
    turns = [(LEAD + SWEEP * k, BAND[k % 2]) for k in range(count)]
    return [(0.0, BAND[0]), *turns]


def aimed_turns(natural: float, begin: float, shape: Real) -> list[tuple[float, float]]:
    """The same as the repeated one up to `begin`, then about the natural frequency."""
    low, high, dwell, glide = natural * shape[0], natural * shape[1], *shape[2:]
    whole = repeated_turns()
    at = float(np.interp(begin, *zip(*whole, strict=True)))
    turns = [turn for turn in whole if turn[0] < begin - 1e-9] + [(begin, at)]
    to = high if abs(at - high) < abs(at - low) else low
    turns.append((begin + max(0.03, glide * abs(to - at) / (high - low)), to))
    while turns[-1][0] < LENGTH:
        turns.append((turns[-1][0] + dwell, to))
        to = low if to == high else high
        turns.append((turns[-1][0] + glide, to))
    return turns


def played(turns: list[tuple[float, float]], peak: float) -> tuple[Real, float]:
    """Samples of amplitude 1, less where the peak acceleration would be exceeded; and its peak."""
    time = np.arange(round(LENGTH * FS * FINER)) / (FS * FINER)
    frequency = np.interp(time, *zip(*turns, strict=True))
    rounded = np.hanning(round(0.06 * FS * FINER))
    edges = np.pad(frequency, rounded.size, mode="edge")
    smooth = np.convolve(edges, rounded / rounded.sum(), "same")[rounded.size : -rounded.size]
    omega = 2.0 * np.pi * smooth
    phase = np.cumsum(omega) / (FS * FINER)
    size = (1.0 + (omega**2 / peak) ** 4) ** -0.25 * np.clip(time / LEAD, 0.0, 1.0) ** 3
    position = size * np.sin(phase)
    acceleration = np.gradient(np.gradient(position, time), time)
    return position[::FINER], float(np.abs(acceleration).max())


def slopes_of(position: Real) -> Real:
    """Derivatives of the output by each parameter, shape (n, 5)."""
    rows = sensitivities(position, model=MODEL, fs=FS)
    return np.vstack([rows, np.ones(position.size)]).T


def aimed_ends(noise: Real, peak: float, begin: float, known: float, shape: Real) -> Real:
    """Ends, and errors there, of runs aimed by what each draw of the noise shows until `known`."""
    before = slopes_of(played(aimed_turns(10.0, begin, shape), peak)[0])[: round(known * FS)]
    off = noise[:, : len(before)] @ before @ np.linalg.inv(before.T @ before)
    natural = TRUTH["natural_frequency"] + off[:, list(TRUTH).index("natural_frequency")]
    nearest = np.abs(natural[:, None] - NATURAL).argmin(axis=1)
    ends, z = [], []
    for k in np.unique(nearest):
        slopes = slopes_of(played(aimed_turns(float(NATURAL[k]), begin, shape), peak)[0])
        found = linear_ends(slopes, noise[nearest == k], step=EVERY, needed=3)
        ends.append(found[0])
        z.append(found[1])
    return np.concatenate(ends), np.concatenate(z)


def best_possible(peak: float) -> float:
    """Seconds in which the accuracy can be reached at all after the first sweep, no rule asked.

    A sine of amplitude A tells A²/2 Re(R R*) a sample of R, the response's derivatives. The shares
    of time are found by multiplication (D. M. Titterington, Algorithms for computing D-optimal
    designs on a finite design space, 1976); all that the first sweep tells is counted at once.
    """
    hertz = np.arange(1.0, BAND[1], 0.25)
    slope = responses(MODEL, 2j * np.pi * hertz)
    size = np.minimum(1.0, peak / (2.0 * np.pi * hertz) ** 2)
    told = 0.5 * np.real(np.einsum("im,jm->mij", slope, slope.conj())) * (FS / NOISE**2)
    told *= size[:, None, None] ** 2
    first = played(repeated_turns(), peak)[0][: round((LEAD + SWEEP) * FS)]
    rows = slopes_of(np.concatenate([first, np.zeros(round(0.6 * FS))]))
    begun = rows.T @ rows / NOISE**2
    goals = np.array([TARGETS["delay"], TARGETS["natural_frequency"]])

    def reached(seconds: float) -> bool:
        share = np.full(hertz.size, 1.0 / hertz.size)
        for _ in range(300):
            whole = begun.copy()
            whole[:4, :4] += seconds * np.einsum("m,mij->ij", share, told)
            whole[4, 4] += seconds * FS / NOISE**2
            inverse = np.linalg.inv(whole)
            over = np.sqrt(np.diag(inverse)[:2]) / goals
            if over.max() <= 1.0:
                return True
            weight = np.exp(20.0 * (over - over.max()))
            gain = np.zeros(hertz.size)
            for k in range(2):
                along = inverse[k, :4]
                gain += weight[k] * np.einsum("i,mij,j->m", along, told, along) / inverse[k, k]
            share = share * (gain / np.sum(share * gain)) ** 0.7
            share /= share.sum()
        return False

    low, high = 0.0, LENGTH
    for _ in range(14):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    return LEAD + SWEEP + MODEL.delay + high


def row(noise: Real, peak: float) -> str:
    """A line of the table."""
    position, reached = played(repeated_turns(), peak)
    ends, z = linear_ends(slopes_of(position), noise, step=EVERY, needed=3)
    fixed, held = float(np.median(ends)), _held(z)
    cells = [f"{reached:.0f}", f"{fixed:.2f}", f"{held:.1f}"]
    for begin, known in BEGINS:
        found = [aimed_ends(noise, peak, begin, known, shape) for shape in SHAPES]
        middle, held = min((float(np.median(e)), _held(z)) for e, z in found)
        cells += [f"{middle:.2f}", f"{held:.1f}", f"{100 * (1 - middle / fixed):.0f}"]
    overhead = 2 * EVERY / FS  # the rule must hold at three looks
    cells.append(f"{best_possible(peak) + overhead:.2f}")
    return "| " + " | ".join(cells) + " |"


def _held(z: Real) -> float:
    return 100.0 * float(np.mean(np.abs(z) < 1.96))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--draws", type=int, default=2000)
    draws = parser.parse_args().draws
    noise = NOISE * np.random.default_rng(1).standard_normal((draws, round(LENGTH * FS)))
    print("| peak, 1/s² | repeated, s | held, % | aimed at once, s | held, % | saved, % "
          "| aimed in real time, s | held, % | saved, % | best, s |")  # fmt: skip
    print("| --- " * 10 + "|")
    for peak in PEAKS:
        print(row(noise, peak), flush=True)


if __name__ == "__main__":
    main()
