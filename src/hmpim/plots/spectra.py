"""Spectra of input and output, with and without the window (Figs 12 to 14, 18, 23)."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.style import (
    COLOURS,
    Colour,
    draw_legend,
    draw_line,
    finish_axes,
    new_figure,
    plain,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_spectrum", "shade_band", "spectra"]


def spectra(
    frequency: NDArray[np.float64],
    *,
    input_plain: NDArray[np.float64],
    input_windowed: NDArray[np.float64],
    output_plain: NDArray[np.float64] | None = None,
    output_windowed: NDArray[np.float64] | None = None,
    band: tuple[float, float] | None = None,
    input_name: str = "input",
    output_name: str = "output",
) -> "Figure":
    """Draw the spectra of input and output, each as it is and after the window.

    Parameters
    ----------
    frequency : ndarray, shape (m,)
        Hz, increasing; what is not positive is left out.
    input_plain, input_windowed : ndarray, shape (m,)
        Spectrum of the input in dB.
    output_plain, output_windowed : ndarray, shape (m,), optional
        The same of the output.
    band : tuple of float, optional
        Excited band in Hz, shaded.
    input_name, output_name : str
        Names of the channels.

    Examples
    --------
    >>> f = np.linspace(0.1, 100.0, 500)
    >>> figure = spectra(f, input_plain=-f, input_windowed=-2 * f, band=(1.0, 10.0))
    >>> figure.axes[0].get_ylabel()
    'Spectrum (dB)'
    """
    panels = [("Input", input_name, input_plain, input_windowed)]
    if output_plain is not None and output_windowed is not None:
        panels.append(("Output", output_name, output_plain, output_windowed))
    figure, axes = new_figure(len(panels), height=2.2)
    for panel, (kind, name, unwindowed, windowed) in zip(axes, panels, strict=True):
        colour: Colour = "input" if kind == "Input" else "output"
        draw_spectrum(panel, frequency, unwindowed, label="no window", colour="muted")
        draw_spectrum(panel, frequency, windowed, label="with window", colour=colour)
        if band is not None:
            shade_band(panel, band)
        _limit_depth(panel, frequency, (unwindowed, windowed), band)
        finish_axes(
            panel,
            x="Frequency (Hz)" if panel is axes[-1] else "",
            y="Spectrum (dB)",
            title=f"{kind}: {plain(name)}",
            log_x=True,
        )
        draw_legend(panel)
    figure.align_ylabels(axes)
    return figure


def draw_spectrum(
    axes: "Axes",
    frequency: NDArray[np.float64],
    level: NDArray[np.float64],
    *,
    label: str = "",
    colour: Colour = "input",
) -> None:
    """Draw one spectrum on a logarithmic frequency axis.

    Parameters
    ----------
    axes : matplotlib.axes.Axes
        Where.
    frequency : ndarray, shape (m,)
        Hz; what is not positive is left out.
    level : ndarray, shape (m,)
        dB.
    label : str
        For the legend.
    colour : str
        A name of `COLOURS`.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> draw_spectrum(axes, np.array([0.0, 1.0, 2.0]), np.zeros(3))
    >>> len(axes.lines[0].get_xdata())
    2
    """
    seen = (frequency > 0) & np.isfinite(level)
    draw_line(
        axes,
        frequency[seen],
        level[seen],
        colour=colour,
        label=label,
        width=1.0,
        spacing="log",
    )


def shade_band(axes: "Axes", band: tuple[float, float]) -> None:
    """Shade the excited band, in Hz.

    Examples
    --------
    >>> figure, (axes,) = new_figure()
    >>> shade_band(axes, (0.1, 20.0))
    >>> len(axes.patches)
    1
    """
    axes.axvspan(*band, color=COLOURS["other"], alpha=0.09, linewidth=0, label="excited band")


def _limit_depth(
    axes: "Axes",
    frequency: NDArray[np.float64],
    levels: tuple[NDArray[np.float64], ...],
    band: tuple[float, float] | None,
) -> None:
    """Cut the picture 100 dB below its top, and far outside the band: there is only rounding."""
    seen = frequency > 0
    top = max(float(np.max(level[seen])) for level in levels)
    bottom = min(float(np.min(level[seen & np.isfinite(level)])) for level in levels)
    axes.set_ylim(max(bottom - 3.0, top - 100.0), top + 5.0)
    low, high = float(frequency[seen][0]), float(frequency[seen][-1])
    if band is not None:
        low = max(low, band[0] / 4.0)
        high = min(high, band[1] * 5.0)
    axes.set_xlim(low, high)
