"""What the paper's steps read off many records of one system: means and scatter, not one seed."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.experiment import run
from hmpim.identify import PaperAnalysis, paper_analysis
from hmpim.identify.section_iv.response import delay_phase, falling_crossing
from hmpim.identify.section_iv.windows import WindowName
from hmpim.rigs import Sensor
from hmpim.stimulus import Stimulus

__all__ = ["FIG_17", "Printed", "Readings", "read_many", "spike"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Readings:
    """What the paper's steps read, record by record; NaN where a step has no answer.

    Parameters
    ----------
    delay : ndarray, shape (seeds,)
        Peak of (8), s.
    bias, noise_std : ndarray, shape (seeds,)
        (11) and (14), the stimulus's unit.
    spike : ndarray, shape (seeds,)
        Root of R(0) - R(1) of the error's autocorrelation, the same unit.
    scale_factor : ndarray, shape (seeds,)
        (13).
    natural_frequency : ndarray, shape (seeds,)
        Where the phase without the delay of (8) passes -90°, Hz.
    natural_by_pure_delay : ndarray, shape (seeds,)
        The same without the system's own pure delay, Hz.
    damping_ratio, peak_gain_db : ndarray, shape (seeds,)
        The hump, and what it makes of the damping.
    bandwidth_phase90 : ndarray, shape (seeds,)
        Where the phase passes -90°, Hz.
    low_gain_db, high_gain_db : ndarray, shape (seeds,)
        Median level from 0.3 to 1 Hz and from 14.5 to 15.5 Hz, dB.
    """

    delay: FloatArray
    bias: FloatArray
    noise_std: FloatArray
    spike: FloatArray
    scale_factor: FloatArray
    natural_frequency: FloatArray
    natural_by_pure_delay: FloatArray
    damping_ratio: FloatArray
    peak_gain_db: FloatArray
    bandwidth_phase90: FloatArray
    low_gain_db: FloatArray
    high_gain_db: FloatArray

    def mean(self, name: str) -> float | None:
        """Mean of one figure over the records that have it; None where fewer than half do."""
        found = self.found(name)
        return None if 2 * found.size < self.delay.size else float(np.mean(found))

    def scatter(self, name: str) -> float | None:
        """Standard deviation of one figure from record to record, as `mean`."""
        found = self.found(name)
        return None if 2 * found.size < self.delay.size else float(np.std(found, ddof=1))

    def found(self, name: str) -> FloatArray:
        """Values of one figure, of those records that have it."""
        values: FloatArray = getattr(self, name)
        return values[np.isfinite(values)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Printed:
    """Figures that the paper prints for Fig. 17, and how near counts as equal.

    Delay to a sample, as the paper says of it; bias and noise to its own 3 %; the bandwidth to
    2 % and the natural frequency to 3 %, which is what reading a printed plot is worth.
    """

    delay: float = 0.150
    bias: float = 0.6
    noise_std: float = 0.1
    natural_frequency: float = 9.83
    bandwidth_phase90: float = 1.78

    def each(self, readings: Readings, *, room: float = 1.0) -> dict[str, NDArray[np.bool_]]:
        """Which records give which printed figure, with `room` times the usual nearness."""
        return {
            "delay": np.abs(readings.delay - self.delay) < 1e-9,
            "bias": np.abs(readings.bias / self.bias - 1.0) <= 0.03 * room,
            "noise": np.abs(readings.spike / self.noise_std - 1.0) <= 0.03 * room,
            "natural frequency": np.abs(
                readings.natural_by_pure_delay / self.natural_frequency - 1.0
            )
            <= 0.03 * room,
            "bandwidth": np.abs(readings.bandwidth_phase90 / self.bandwidth_phase90 - 1.0)
            <= 0.02 * room,
        }

    def together(self, readings: Readings, *, room: float = 1.0) -> float:
        """Share of the records that give all five figures at once."""
        return float(np.mean(np.all(list(self.each(readings, room=room).values()), axis=0)))


FIG_17 = Printed()


def spike(analysis: PaperAnalysis) -> float:
    """Root of R(0) - R(1) of the error's autocorrelation: white noise, and nothing slow.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + 0.5 * t**2))
    >>> noise = 0.1 * np.random.default_rng(1).standard_normal(2000)
    >>> round(spike(paper_analysis(u, u + 0.6 + noise, 200.0, band=(0.1, 10.0))), 2)
    0.1
    """
    middle = analysis.error.size - 1
    correlation = analysis.error_autocorrelation
    return math.sqrt(max(float(correlation[middle] - correlation[middle + 1]), 0.0))


def read_many(
    system: Sensor,
    stimulus: Stimulus,
    seeds: Sequence[int],
    *,
    window: WindowName = "gaussian",
    pad: int | None = None,
    remove_mean: bool = True,
) -> Readings:
    """Read the paper's figures off one record per seed.

    The system is stepped once without noise; each seed then draws white noise of its own.

    Parameters
    ----------
    system : Sensor
        Under test; linear but for its noise.
    stimulus : Stimulus
        What it is tested with.
    seeds : sequence of int
        Of the noise.
    window, pad, remove_mean
        As in `hmpim.paper_analysis`.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> sweep = design(band=(0.1, 20), duration=10, fs=200, extinction=1.0, lead=0,
    ...                limits=Limits(position=3, unit="deg"))
    >>> sensor = Sensor(delay=0.13, natural_frequency=10, damping_ratio=0.4, noise_std=0.1)
    >>> read_many(sensor, sweep, range(3)).delay.tolist()
    [0.15, 0.15, 0.15]
    """
    record = run(replace(system, noise_std=0.0), stimulus)
    u, y = record.inputs[0].values, record.outputs[0].values
    rows = []
    for seed in seeds:
        noise = np.random.default_rng(seed).standard_normal(y.size)
        analysis = paper_analysis(
            u,
            y + system.noise_std * noise,
            stimulus.fs,
            band=stimulus.band,
            window=window,
            pad=pad,
            remove_mean=remove_mean,
        )
        rows.append(_row(analysis, system.delay))
    return Readings(
        **{
            field.name: np.array([row[field.name] for row in rows], dtype=np.float64)
            for field in fields(Readings)
        }
    )


def _row(analysis: PaperAnalysis, pure_delay: float) -> dict[str, Any]:
    """One record's figures by name; None, which becomes NaN, where there is none."""
    found, f = analysis.estimates, analysis.band_frequency
    bare = analysis.phase - delay_phase(f, pure_delay)
    level = analysis.magnitude_db
    return {
        "delay": found.delay,
        "bias": found.bias,
        "noise_std": found.noise_std,
        "spike": spike(analysis),
        "scale_factor": found.scale_factor,
        "natural_frequency": found.natural_frequency,
        "natural_by_pure_delay": falling_crossing(f, bare, -90.0),
        "damping_ratio": found.damping_ratio,
        "peak_gain_db": found.peak_gain_db,
        "bandwidth_phase90": found.bandwidth_phase90,
        "low_gain_db": float(np.median(level[(f >= 0.3) & (f <= 1.0)])),
        "high_gain_db": float(np.median(level[(f >= 14.5) & (f <= 15.5)])),
    }
