"""Axes beside one another, in the style of `hmpim.plots`."""

from typing import TYPE_CHECKING

from hmpim.identify import PaperAnalysis
from hmpim.plots.envelope import Spacing
from hmpim.plots.style import WIDTH, draw_line, finish_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["grid_figure", "response_axes", "wide_figure"]


def grid_figure(
    rows: int, columns: int = 2, *, height: float = 1.9
) -> "tuple[Figure, list[list[Axes]]]":
    """Return an empty figure and its axes, row by row.

    Parameters
    ----------
    rows, columns : int
        Number of axes down and across.
    height : float
        Height of each in inches.

    Examples
    --------
    >>> figure, axes = grid_figure(3)
    >>> len(axes), len(axes[0])
    (3, 2)
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height * rows + 0.4), layout="constrained")
    axes = [
        [figure.add_subplot(rows, columns, row * columns + k + 1) for k in range(columns)]
        for row in range(rows)
    ]
    return figure, axes


def wide_figure(
    wide: int, *, columns: int = 2, height: float = 1.5, last: float = 2.3
) -> "tuple[Figure, list[Axes], list[Axes]]":
    """Return a figure with some wide axes on one time axis, and a row of narrow ones below.

    Parameters
    ----------
    wide : int
        Number of wide axes.
    columns : int
        Number of narrow axes in the last row.
    height, last : float
        Height of a wide axes and of the last row, in inches.

    Examples
    --------
    >>> figure, upper, lower = wide_figure(3)
    >>> len(upper), len(lower)
    (3, 2)
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height * wide + last + 0.4), layout="constrained")
    grid = figure.add_gridspec(wide + 1, columns, height_ratios=[height] * wide + [last])
    upper = [figure.add_subplot(grid[0, :])]
    upper += [figure.add_subplot(grid[k, :], sharex=upper[0]) for k in range(1, wide)]
    for axes in upper[:-1]:
        axes.tick_params(labelbottom=False)
    return figure, upper, [figure.add_subplot(grid[wide, k]) for k in range(columns)]


def response_axes(
    figure: "Figure",
    magnitude: "Axes",
    phase: "Axes",
    analysis: PaperAnalysis,
    *,
    label: str = "measured",
    log_x: bool = True,
) -> None:
    """Draw the transfer function of section IV.D on two axes, magnitude and phase.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.identify import paper_analysis
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> figure, ((magnitude, phase),) = grid_figure(1)
    >>> analysis = paper_analysis(u, u, 200.0, band=(0.1, 20.0))
    >>> response_axes(figure, magnitude, phase, analysis)
    >>> phase.get_ylabel()
    'Phase (deg)'
    """
    spacing: Spacing = "log" if log_x else "linear"
    for axes, curve, name in (
        (magnitude, analysis.magnitude_db, "Magnitude (dB)"),
        (phase, analysis.phase, "Phase (deg)"),
    ):
        draw_line(
            axes, analysis.band_frequency, curve, label=label, colour="input", spacing=spacing
        )
        last = axes is phase
        axes.set_xlim(*analysis.band)
        finish_axes(axes, x="Frequency (Hz)" if last else "", y=name, log_x=log_x)
        axes.set_xlim(*analysis.band)
    figure.align_ylabels([magnitude, phase])
