"""Spectra of input and output, with and without the window (Figs 12 to 14, 18, 23)."""

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Axis, Curve, Figure, Panel, Span
from hmpim.plots.style import Colour, plain

__all__ = ["excited_band", "spectra", "spectrum_curve"]


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
) -> Figure:
    """Describe the spectra of input and output, each as it is and after the window.

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
    >>> figure.panels[0].y.label
    'Spectrum (dB)'
    """
    parts = [("Input", input_name, input_plain, input_windowed)]
    if output_plain is not None and output_windowed is not None:
        parts.append(("Output", output_name, output_plain, output_windowed))
    panels = []
    for row, (kind, name, unwindowed, windowed) in enumerate(parts):
        colour: Colour = "input" if kind == "Input" else "output"
        low, high, bottom, top = _depth(frequency, (unwindowed, windowed), band)
        last = row == len(parts) - 1
        panels.append(
            Panel(
                x=Axis(
                    label="Frequency (Hz)" if last else "",
                    scale="log",
                    low=low,
                    high=high,
                    numbered=last,
                ),
                y=Axis(label="Spectrum (dB)", low=bottom, high=top),
                items=(
                    *excited_band(band),
                    spectrum_curve(frequency, unwindowed, label="no window", colour="muted"),
                    spectrum_curve(frequency, windowed, label="with window", colour=colour),
                ),
                title=f"{kind}: {plain(name)}",
                row=row,
            )
        )
    names = " and ".join(plain(name) for _, name, _, _ in parts)
    span = "" if band is None else f"; the excited band is {band[0]:.4g} to {band[1]:.4g} Hz"
    return Figure(
        panels=tuple(panels),
        alt=f"Spectra of {names} in dB, without and with the window{span}.",
        heights=(2.2,) * len(panels),
    )


def spectrum_curve(
    frequency: NDArray[np.float64],
    level: NDArray[np.float64],
    *,
    label: str = "",
    colour: Colour = "input",
) -> Curve:
    """Describe one spectrum for a logarithmic frequency axis.

    Parameters
    ----------
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
    >>> spectrum_curve(np.array([0.0, 1.0, 2.0]), np.zeros(3)).x.tolist()
    [1.0, 2.0]
    """
    seen = (frequency > 0) & np.isfinite(level)
    return Curve(x=frequency[seen], y=level[seen], label=label, colour=colour, width=1.0)


def excited_band(band: tuple[float, float] | None) -> tuple[Span, ...]:
    """Shade the excited band, in Hz; nothing where it is unknown.

    Examples
    --------
    >>> excited_band((0.1, 20.0))[0].label
    'excited band'
    """
    return () if band is None else (Span(low=band[0], high=band[1], label="excited band"),)


def _depth(
    frequency: NDArray[np.float64],
    levels: tuple[NDArray[np.float64], ...],
    band: tuple[float, float] | None,
) -> tuple[float, float, float, float]:
    """Cut the picture 100 dB below its top, and far outside the band: there is only rounding."""
    seen = frequency > 0
    top = max(float(np.max(level[seen])) for level in levels)
    bottom = min(float(np.min(level[seen & np.isfinite(level)])) for level in levels)
    low, high = float(frequency[seen][0]), float(frequency[seen][-1])
    if band is not None:
        low = max(low, band[0] / 4.0)
        high = min(high, band[1] * 5.0)
    return low, high, max(bottom - 3.0, top - 100.0), top + 5.0
