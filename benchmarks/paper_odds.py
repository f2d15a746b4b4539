"""Fig. 17 over many records: what each reading of it gives, and how often it gives the printed one.

    python benchmarks/paper_odds.py [--seeds 400]

Prints two tables of docs/paper.md: the stated system by the paper's steps with and without
window, padding and mean; and the odds of the printed figures, by delay and by
amplitude. Before a semicolon stands what comes out without noise. The tables are Markdown.
"""

import argparse
import sys
from dataclasses import replace

import numpy as np

from hmpim.report.paper.bound import phase90, resonance_db
from hmpim.report.paper.odds import FIG_17, Readings, read_many
from hmpim.report.paper.sample import SYSTEM, sample_stimulus

SETTINGS = (
    ("none", {"window": "rectangular", "pad": 0, "remove_mean": False}),
    ("window", {"pad": 0, "remove_mean": False}),
    ("window, mean off", {"pad": 0}),
    ("window, padding", {"remove_mean": False}),
    ("window, mean off, padding", {}),
)
DELAYS = (0.120, 0.125, 0.130, 0.135, 0.140, 0.150)  # s
AMPLITUDES = (1.0, 2.0, 3.0, 4.0, 5.0, 10.0)  # deg


def plus_minus(readings: Readings, name: str, digits: int, *, factor: float = 1.0) -> str:
    """Mean and scatter, or how few records have the figure at all."""
    mean, scatter = readings.mean(name), readings.scatter(name)
    if mean is None or scatter is None:
        return f"in {readings.found(name).size} of {readings.delay.size}"
    if scatter < 1e-12:
        return f"{factor * mean:.{digits}f}"
    return f"{factor * mean:.{digits}f} ± {factor * scatter:.{digits}f}"


def clean(settings: dict[str, object]) -> Readings:
    """The stated system without its noise: what the steps themselves do to it."""
    return read_many(replace(SYSTEM, noise_std=0.0), sample_stimulus(), [0], **settings)


def settings_table(seeds: range) -> list[str]:
    natural, damping = SYSTEM.natural_frequency, SYSTEM.damping_ratio
    lines = [
        "| Done before (18) | −90° (Hz) | Hump (dB) | ζ | Gain from 0.3 to 1 Hz (dB) |"
        " Gain at 15 Hz (dB), true is less by |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    share = 15.0 / natural
    true_high = -10.0 * np.log10((1.0 - share**2) ** 2 + (2.0 * damping * share) ** 2)
    for words, settings in SETTINGS:
        bare, many = clean(settings), read_many(SYSTEM, sample_stimulus(), seeds, **settings)
        cells = (
            words,
            f"{bare.bandwidth_phase90[0]:.3f}; {plus_minus(many, 'bandwidth_phase90', 3)}",
            f"{bare.peak_gain_db[0]:.2f}; {plus_minus(many, 'peak_gain_db', 2)}",
            f"{bare.damping_ratio[0]:.3f}; {plus_minus(many, 'damping_ratio', 3)}",
            f"{bare.low_gain_db[0]:+.2f}".replace("-", "−"),
            f"{bare.high_gain_db[0] - true_high:+.2f}".replace("-", "−"),
        )
        lines.append(f"| {' | '.join(cells)} |")
    truth = phase90(SYSTEM.delay, natural, damping)
    lines.append(f"| true | {truth:.3f} | {resonance_db(damping):.2f} | {damping:g} | 0 | 0 |")
    return lines


def odds_table(seeds: range) -> list[str]:
    lines = [
        "| Pure delay, amplitude | (8) (ms) | Bias (11) | Noise, spike | Natural (Hz) | −90° (Hz) |"
        " All five at once | With twice the room |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    cases = [(delay, 3.0) for delay in DELAYS] + [(0.130, a) for a in AMPLITUDES if a != 3.0]
    for delay, amplitude in cases:
        many = read_many(replace(SYSTEM, delay=delay), sample_stimulus(amplitude), seeds)
        cells = (
            f"{1e3 * delay:g} ms, {amplitude:g}°",
            plus_minus(many, "delay", 1, factor=1e3),
            plus_minus(many, "bias", 3),
            plus_minus(many, "spike", 3),
            plus_minus(many, "natural_by_pure_delay", 2),
            plus_minus(many, "bandwidth_phase90", 3),
            f"{100.0 * FIG_17.together(many):.0f} %",
            f"{100.0 * FIG_17.together(many, room=2.0):.0f} %",
        )
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def shares_line(seeds: range) -> str:
    many = read_many(replace(SYSTEM, delay=0.130), sample_stimulus(3.0), seeds)
    each = ", ".join(
        f"{name} {100.0 * np.mean(hit):.0f} %" for name, hit in FIG_17.each(many).items()
    )
    return f"Of {len(seeds)} records at 130 ms and 3°: {each}."


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--seeds", type=int, default=400, help="records of each case")
    seeds = range(parser.parse_args().seeds)
    for table in (settings_table(seeds), odds_table(seeds), [shares_line(seeds)]):
        print("\n".join(table), end="\n\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
