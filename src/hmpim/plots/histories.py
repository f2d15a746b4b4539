"""Signals over time: the stimulus in its limits, input and output, model, residual."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.identify.section_iv.correlation import autocorrelation
from hmpim.plots.description import Axis, Curve, Figure, Item, Panel, Rule
from hmpim.plots.results import model_of, residual_of, signals_of
from hmpim.plots.style import axis_label, plain
from hmpim.units import rate_label

if TYPE_CHECKING:
    from hmpim.identify import Identification, PairIdentification
    from hmpim.record import Record
    from hmpim.stimulus import Limits, Stimulus

__all__ = ["input_output", "model_over_measurement", "residuals", "time_histories"]

MOST_LAGS = 100  # of the residual's autocorrelation; more cannot be told apart on a page


def time_histories(stimulus: "Stimulus", *, limits: "Limits | None" = None) -> Figure:
    """Describe a stimulus's position, velocity and acceleration, each with its limit (Fig. 3).

    Parameters
    ----------
    stimulus : hmpim.stimulus.Stimulus
        What is sent to the unit under test.
    limits : hmpim.stimulus.Limits, optional
        Others to draw than its own, in its unit: what the unit under test allows, say.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> figure = time_histories(design(band=(0.1, 10), duration=5, fs=500, limits=limits))
    >>> [panel.y.label for panel in figure.panels]
    ['Position (deg)', 'Velocity (deg/s)', 'Acceleration (deg/s²)']
    """
    limits = stimulus.limits if limits is None else limits
    parts = (
        ("Position", stimulus.position, None if limits is None else limits.position),
        ("Velocity", stimulus.velocity, None if limits is None else limits.velocity),
        ("Acceleration", stimulus.acceleration, None if limits is None else limits.acceleration),
    )
    panels = []
    for order, (quantity, values, limit) in enumerate(parts):
        items: list[Item] = [Curve(x=stimulus.time, y=values, width=1.0)]
        if limit is not None and np.isfinite(limit):
            label = "" if order else "limit"
            items += [Rule(at=at, axis="y", label=label) for at in (-limit, limit)]
        last = order == 2
        panels.append(
            Panel(
                x=Axis(label="Time (s)" if last else "", numbered=last),
                y=Axis(label=axis_label(quantity, rate_label(stimulus.unit, order))),
                items=tuple(items),
                row=order,
            )
        )
    return Figure(
        panels=tuple(panels),
        alt=f"Position, velocity and acceleration of the stimulus over {stimulus.duration:g} s"
        + ("." if limits is None else ", each inside its limit."),
        heights=(1.7,) * 3,
    )


def input_output(
    time: "NDArray[np.float64] | Record",
    u: NDArray[np.float64] | None = None,
    y: NDArray[np.float64] | None = None,
    *,
    input_name: str = "input",
    output_name: str = "output",
    input_unit: str = "",
    output_unit: str = "",
) -> Figure:
    """Describe what went in over what came out (Figs 2 and 7).

    Channels of one unit share one pair of axes, so that lag and scale can be seen.

    Parameters
    ----------
    time : ndarray, shape (n,), or Record
        Seconds; or a record of one input and one output, which tells all the rest.
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
    >>> len(figure.panels)
    2
    """
    if not isinstance(time, np.ndarray):
        return input_output(**signals_of(time))
    if u is None or y is None:
        raise ArgumentError("u and y are missing; give both, or a record alone")
    into = Curve(x=time, y=u, label="input")
    out = Curve(x=time, y=y, label="output", colour="output", dashes="--", width=1.0)
    alt = f"{plain(input_name)} and {plain(output_name)} over time."
    below = Axis(label="Time (s)")
    if input_unit == output_unit:
        both = axis_label(f"{input_name}, {output_name}", input_unit)
        panel = Panel(x=below, y=Axis(label=both), items=(into, out))
        return Figure(panels=(panel,), alt=alt, heights=(2.8,))
    panels = (
        Panel(
            x=Axis(numbered=False),
            y=Axis(label=axis_label(input_name, input_unit)),
            items=(into,),
            title="Input",
            legend=False,
        ),
        Panel(
            x=below,
            y=Axis(label=axis_label(output_name, output_unit)),
            items=(replace(out, dashes="-"),),
            title="Output",
            row=1,
            legend=False,
        ),
    )
    return Figure(panels=panels, alt=alt, heights=(1.8, 1.8))


def model_over_measurement(
    time: "NDArray[np.float64] | Identification | PairIdentification",
    measured: NDArray[np.float64] | None = None,
    predicted: NDArray[np.float64] | None = None,
    *,
    output_name: str = "output",
    unit: str = "",
) -> Figure:
    """Describe the model's output over the measured one, whole and its liveliest part.

    Parameters
    ----------
    time : ndarray, shape (n,), Identification or PairIdentification
        Seconds; or a result of one pair, which tells all the rest.
    measured, predicted : ndarray, shape (n,)
        The output as recorded and as the fitted model says.
    output_name, unit : str
        Of the output.

    Examples
    --------
    >>> t = np.linspace(0.0, 1.0, 50)
    >>> figure = model_over_measurement(t, np.sin(t), np.sin(t), unit="deg")
    >>> len(figure.panels)
    2
    """
    if not isinstance(time, np.ndarray):
        return model_over_measurement(**model_of(time))
    if measured is None or predicted is None:
        raise ArgumentError("measured and predicted are missing; give both, or a result alone")
    start, stop = _busiest_tenth(predicted)
    panels = []
    for row, (part, title) in enumerate(
        (
            (slice(None), "Whole record"),
            (slice(start, stop), "One tenth of the record, where the output moves most"),
        )
    ):
        there = time[part]
        items = (
            Curve(x=there, y=measured[part], label="measured", colour="output", width=1.4),
            Curve(x=there, y=predicted[part], label="model", colour="model", dashes="--"),
        )
        panels.append(
            Panel(
                x=Axis(label="Time (s)" if row else ""),
                y=Axis(label=axis_label(output_name, unit)),
                items=items,
                title=title,
                row=row,
                legend=not row,
            )
        )
    return Figure(
        panels=tuple(panels),
        alt=f"{plain(output_name)} as measured and as the model says, over time: the whole record, "
        f"and {time[start]:.4g} to {time[stop - 1]:.4g} s.",
        heights=(2.0, 2.0),
        share_x=False,
    )


def residuals(
    time: "NDArray[np.float64] | Identification | PairIdentification",
    residual: NDArray[np.float64] | None = None,
    *,
    output_name: str = "output",
    unit: str = "",
) -> Figure:
    """Describe what the model leaves over, and whether it is white.

    The lower axes show the residual's autocorrelation with the bounds ±1.96/√n inside which
    95 % of it lies when the residual is white noise.

    Parameters
    ----------
    time : ndarray, shape (n,), Identification or PairIdentification
        Seconds; or a result of one pair, which tells all the rest.
    residual : ndarray, shape (n,)
        Measured minus predicted.
    output_name, unit : str
        Of the output.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(500)
    >>> figure = residuals(np.arange(500) / 100.0, noise, unit="deg")
    >>> figure.panels[1].y.label
    'Autocorrelation (–)'
    """
    if not isinstance(time, np.ndarray):
        return residuals(**residual_of(time))
    if residual is None:
        raise ArgumentError("residual is missing; give it, or a result alone")
    step = float(np.median(np.diff(time)))
    most = min(residual.size - 1, MOST_LAGS)
    whole = autocorrelation(residual - residual.mean()).value[residual.size - 1 :]
    correlation = whole[1 : most + 1] / (whole[0] or 1.0)
    lags = np.arange(1, most + 1) * step
    bound = 1.96 / np.sqrt(residual.size)
    words = "95 % of white noise lies inside"
    stems = Curve(
        x=np.repeat(lags, 3),
        y=np.stack((0.0 * lags, correlation, np.nan * lags), axis=1).ravel(),
        colour="output",
    )
    panels = (
        Panel(
            x=Axis(label="Time (s)"),
            y=Axis(label=axis_label(f"Residual of {output_name}", unit)),
            items=(Curve(x=time, y=residual, colour="output", width=0.8),),
        ),
        Panel(
            x=Axis(label="Lag (s)"),
            y=Axis(label="Autocorrelation (–)"),
            items=(
                stems,
                Rule(at=0.0, axis="y", colour="muted", dashes="-", width=0.8),
                *(Rule(at=at, axis="y", label=words) for at in (-bound, bound)),
            ),
            title="Autocorrelation of the residual",
            row=1,
        ),
    )
    outside = int(np.sum(np.abs(correlation) > bound))
    return Figure(
        panels=panels,
        alt=f"Residual of {plain(output_name)} over time, and its autocorrelation: {outside} of "
        f"{most} lags outside of what holds 95 % of white noise.",
        heights=(1.9, 1.9),
        share_x=False,
    )


def _busiest_tenth(values: NDArray[np.float64]) -> tuple[int, int]:
    """Sample range of the tenth whose steps have the largest sum of squares."""
    n = values.size
    length = max(n // 10, min(n, 20))
    power = np.concatenate(([0.0], np.cumsum(np.diff(values, prepend=values[0]) ** 2)))
    start = int(np.argmax(power[length:] - power[:-length])) if n > length else 0
    return start, start + length
