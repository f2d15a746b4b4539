"""Signals over time: the stimulus in its limits, input and output, model, residual."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.correlation import autocorrelation
from hmpim.plots.style import (
    COLOURS,
    axis_label,
    draw_legend,
    draw_level,
    draw_line,
    finish_axes,
    new_figure,
)
from hmpim.units import rate_label

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from hmpim.stimulus import Stimulus

__all__ = ["input_output", "model_over_measurement", "residuals", "time_histories"]

MOST_LAGS = 100  # of the residual's autocorrelation; more cannot be told apart on a page


def time_histories(stimulus: "Stimulus") -> "Figure":
    """Draw a stimulus's position, velocity and acceleration, each with its limit (Fig. 3).

    Parameters
    ----------
    stimulus : hmpim.stimulus.Stimulus
        What is sent to the unit under test.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> figure = time_histories(design(band=(0.1, 10), duration=5, fs=500, limits=limits))
    >>> [axes.get_ylabel() for axes in figure.axes]
    ['Position (deg)', 'Velocity (deg/s)', 'Acceleration (deg/s²)']
    """
    figure, axes = new_figure(3, height=1.7)
    limits = stimulus.limits
    panels = (
        ("Position", stimulus.position, None if limits is None else limits.position),
        ("Velocity", stimulus.velocity, None if limits is None else limits.velocity),
        ("Acceleration", stimulus.acceleration, None if limits is None else limits.acceleration),
    )
    for order, (panel, (quantity, values, limit)) in enumerate(zip(axes, panels, strict=True)):
        draw_line(panel, stimulus.time, values, colour="input", width=1.0)
        if limit is not None and np.isfinite(limit):
            draw_level(panel, (-limit, limit), label="limit")
        last = "Time (s)" if order == 2 else ""
        finish_axes(panel, x=last, y=axis_label(quantity, rate_label(stimulus.unit, order)))
    if axes[0].get_legend_handles_labels()[0]:
        draw_legend(axes[0])
    figure.align_ylabels(axes)
    return figure


def input_output(
    time: NDArray[np.float64],
    u: NDArray[np.float64],
    y: NDArray[np.float64],
    *,
    input_name: str = "input",
    output_name: str = "output",
    input_unit: str = "",
    output_unit: str = "",
) -> "Figure":
    """Draw what went in over what came out (Figs 2 and 7).

    Channels of one unit share one pair of axes, so that lag and scale can be seen.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    u, y : ndarray, shape (n,)
        Input and output.
    input_name, output_name : str
        Their names.
    input_unit, output_unit : str
        Their units.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 50)
    >>> figure = input_output(t, np.sin(t), np.cos(t), input_unit="deg", output_unit="V")
    >>> len(figure.axes)
    2
    """
    if input_unit == output_unit:
        figure, (axes,) = new_figure(1, height=2.8)
        draw_line(axes, time, u, colour="input", label="input")
        draw_line(axes, time, y, colour="output", label="output", width=0.9)
        both = f"{input_name}, {output_name}"
        finish_axes(axes, x="Time (s)", y=axis_label(both, input_unit))
        draw_legend(axes)
        return figure
    figure, axes_pair = new_figure(2, height=1.8)
    draw_line(axes_pair[0], time, u, colour="input")
    draw_line(axes_pair[1], time, y, colour="output", width=0.9)
    finish_axes(axes_pair[0], y=axis_label(input_name, input_unit), title="Input")
    finish_axes(axes_pair[1], x="Time (s)", y=axis_label(output_name, output_unit), title="Output")
    figure.align_ylabels(axes_pair)
    return figure


def model_over_measurement(
    time: NDArray[np.float64],
    measured: NDArray[np.float64],
    predicted: NDArray[np.float64],
    *,
    output_name: str = "output",
    unit: str = "",
) -> "Figure":
    """Draw the model's output over the measured one, whole and its liveliest part.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    measured, predicted : ndarray, shape (n,)
        The output as recorded and as the fitted model says.
    output_name, unit : str
        Of the output.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 50)
    >>> figure = model_over_measurement(t, np.sin(t), np.sin(t), unit="deg")
    >>> len(figure.axes)
    2
    """
    figure, axes = new_figure(2, height=2.0, share_x=False)
    start, stop = _busiest_tenth(predicted)
    for panel, part, title in (
        (axes[0], slice(None), "Whole record"),
        (axes[1], slice(start, stop), "A tenth of it, where the output moves most"),
    ):
        draw_line(panel, time[part], measured[part], colour="output", label="measured", width=1.4)
        draw_line(panel, time[part], predicted[part], colour="model", label="model", dashes="--")
        finish_axes(panel, x="Time (s)", y=axis_label(output_name, unit), title=title)
    draw_legend(axes[0])
    figure.align_ylabels(axes)
    return figure


def residuals(
    time: NDArray[np.float64],
    residual: NDArray[np.float64],
    *,
    output_name: str = "output",
    unit: str = "",
) -> "Figure":
    """Draw what the model leaves over, and whether it is white.

    The lower axes show the residual's autocorrelation with the bounds ±1.96/√n inside which
    95 % of it lies when the residual is white noise.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    residual : ndarray, shape (n,)
        Measured minus predicted.
    output_name, unit : str
        Of the output.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(500)
    >>> figure = residuals(np.arange(500) / 100.0, noise, unit="deg")
    >>> figure.axes[1].get_ylabel()
    'Autocorrelation (–)'
    """
    figure, axes = new_figure(2, height=1.9, share_x=False)
    draw_line(axes[0], time, residual, colour="output", width=0.8)
    finish_axes(axes[0], x="Time (s)", y=axis_label(f"Residual of {output_name}", unit))
    step = float(np.median(np.diff(time)))
    most = min(residual.size - 1, MOST_LAGS)
    whole = autocorrelation(residual - residual.mean()).value[residual.size - 1 :]
    correlation = whole[1 : most + 1] / (whole[0] or 1.0)
    lags = np.arange(1, most + 1) * step
    axes[1].vlines(lags, 0.0, correlation, colors=COLOURS["output"], linewidth=1.2)
    axes[1].axhline(0.0, color=COLOURS["muted"], linewidth=0.8)
    bound = 1.96 / np.sqrt(residual.size)
    draw_level(axes[1], (-bound, bound), label="95 % of white noise lies inside")
    finish_axes(axes[1], x="Lag (s)", y="Autocorrelation (–)", title="Residual against itself")
    draw_legend(axes[1])
    figure.align_ylabels(axes)
    return figure


def _busiest_tenth(values: NDArray[np.float64]) -> tuple[int, int]:
    """Sample range of the tenth whose steps have the largest sum of squares."""
    n = values.size
    length = max(n // 10, min(n, 20))
    power = np.concatenate(([0.0], np.cumsum(np.diff(values, prepend=values[0]) ** 2)))
    start = int(np.argmax(power[length:] - power[:-length])) if n > length else 0
    return start, start + length
