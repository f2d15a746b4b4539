"""Equations (8), (9), (11), (13) and (14) tried with the signs that are printed."""

import math

import numpy as np
from numpy.typing import NDArray

from hmpim.identify import PaperAnalysis
from hmpim.report.paper.odds import spike
from hmpim.report.paper.rows import Row
from hmpim.rigs import Sensor

__all__ = ["sign_rows"]

FloatArray = NDArray[np.float64]


def sign_rows(
    u: FloatArray, y: FloatArray, analysis: PaperAnalysis, sensor: Sensor
) -> tuple[Row, ...]:
    """Return what the equations give with the signs as printed, on the record of Figs 7 to 11.

    Parameters
    ----------
    u, y : ndarray, shape (n,)
        Stimulus and measurement.
    analysis : PaperAnalysis
        The same by the steps as they are meant.
    sensor : Sensor
        What made the record.
    """
    fs = analysis.fs
    lag = round((analysis.estimates.delay or 0.0) * fs)
    as_printed, meant = _shifted(y, -lag), _shifted(y, lag)
    bias = analysis.estimates.bias or 0.0
    return (
        _delay_row(u, y, fs, truth=1e3 * sensor.delay),
        Row(
            figure=9,
            where="Eq. (9)",
            quantity="Error left by ε(n) − ε̃(n − δ), r.m.s.",
            paper="n − δ",
            value=_rms(u - as_printed),
            truth=math.hypot(sensor.bias, sensor.noise_std),
            unit="deg",
            why="The sign is wrong: the measurement is late, and n − δ makes it even later. "
            f"n + δ, which is used here, leaves {_rms(u - meant):.3f} deg.",
        ),
        Row(
            figure=9,
            where="Eq. (11)",
            quantity=f"What (11) reads of a bias of −{sensor.bias:g} deg",
            paper="√R(0)",
            value=math.sqrt(float(np.nanmean((u - (meant - 2.0 * sensor.bias)) ** 2))),
            truth=-sensor.bias,
            unit="deg",
            why="A root is never negative, and (11) loses the bias's sign. Here it is that of the "
            "error's mean, as Fig. 10 would show it.",
        ),
        Row(
            figure=10,
            where="Eq. (13)",
            quantity="What (13) gives with ε̃(n − δ)",
            paper="n − δ",
            value=_slope(u, as_printed, bias),
            truth=sensor.scale_factor,
            why="The sign is wrong, as in (9): n + δ is meant, and gives "
            f"{_slope(u, meant, bias):.4f} over the whole record.",
        ),
        *_taper_rows(analysis, sensor),
    )


def _taper_rows(analysis: PaperAnalysis, sensor: Sensor) -> tuple[Row, ...]:
    correlation = analysis.error_autocorrelation
    middle = analysis.error.size - 1
    last = float(np.sqrt(max(correlation[middle] - correlation[-1], 0.0)))
    half = correlation[middle + round(0.5 * analysis.fs)]
    near = float(np.sqrt(max(correlation[middle] - half, 0.0)))
    truth = sensor.noise_std
    return (
        Row(
            figure=11,
            where="Fig. 11, (14)",
            quantity="What (14) gives with R(∞) at the last lag",
            paper="R(∞)",
            value=last,
            truth=truth,
            unit="deg",
            why="(10) divides every lag by the same N, so that R falls to zero along a straight "
            "line whatever the bias: at the last lag (14) gives (11) again. At a lag of 0.5 s it "
            f"gives {near:.4f} deg. The square of the mean is meant, and is used here.",
        ),
        Row(
            figure=11,
            where="Fig. 11, (14)",
            quantity="Root of the spike, R(0) − R(1)",
            value=spike(analysis),
            truth=truth,
            unit="deg",
            why="Not printed. One lag apart the line has hardly fallen, and what is slow cancels.",
        ),
    )


def _delay_row(u: FloatArray, y: FloatArray, fs: float, *, truth: float) -> Row:
    # (1/N) Σ u(n) y(n - k): the stimulus first, as printed
    lags = np.arange(-round(fs), round(fs) + 1)
    products = [float(np.nanmean(u * _shifted(y, -int(k)))) for k in lags]
    peak = 1e3 * float(lags[int(np.argmax(products))]) / fs
    return Row(
        figure=8,
        where="Eq. (8)",
        quantity="Lag k of the peak of the mean of ε(n) ε̃(n − k)",
        paper="~150 ms",
        value=peak,
        truth=truth,
        unit="ms",
        why="The sign is wrong in print: ε̃(n − k) makes a late measurement peak at a negative k. "
        "With ε̃(n + k), which is used here, the lag is the delay.",
    )


def _shifted(y: FloatArray, lag: int) -> FloatArray:
    """y(n + lag), NaN where there is none."""
    out = np.full(y.size, np.nan)
    if lag >= 0:
        out[: y.size - lag] = y[lag:]
    else:
        out[-lag:] = y[:lag]
    return out


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def _slope(u: FloatArray, y: FloatArray, bias: float) -> float:
    """Mean of (y - bias) over u where u is not near zero, each point by its own size."""
    there = np.isfinite(y)
    return float(u[there] @ (y[there] - bias) / (u[there] @ u[there]))
