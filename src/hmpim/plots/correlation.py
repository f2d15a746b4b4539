"""Correlations of section IV: the delay's (8) and the error's own (10)."""

import numpy as np
from numpy.typing import NDArray

from hmpim.plots.description import Axis, Curve, Figure, Item, Panel, Rule
from hmpim.plots.style import axis_label

__all__ = ["cross_correlation", "error_autocorrelation"]


def cross_correlation(
    lags: NDArray[np.float64],
    correlation: NDArray[np.float64],
    *,
    peak: float | None = None,
    delay: float | None = None,
    unit: str = "",
) -> Figure:
    """Describe the cross-correlation of input and output (Eq. 8, Fig. 8).

    Parameters
    ----------
    lags : ndarray, shape (m,)
        Seconds by which the output is later.
    correlation : ndarray, shape (m,)
        In `unit`.
    peak : float, optional
        Where the peak is, in seconds: the paper's delay.
    delay : float, optional
        The pure delay of the joint fit, in seconds, marked beside it.
    unit : str
        Product of the two channels' units.

    Examples
    --------
    >>> lags = np.linspace(-1.0, 1.0, 201)
    >>> figure = cross_correlation(lags, np.exp(-(lags - 0.15) ** 2), peak=0.15, unit="deg²")
    >>> figure.panels[0].y.label
    'Cross-correlation (deg²)'
    """
    items: list[Item] = [Curve(x=lags, y=correlation)]
    words = []
    if peak is not None:
        words.append(f"peak at {peak:.4g} s")
        items.append(Rule(at=peak, words=words[-1], colour="output", side="right"))
    if delay is not None:
        words.append(f"pure delay {delay:.4g} s")
        items.append(
            Rule(at=delay, words=words[-1], colour="ink", dashes=":", side="left", words_at=0.86)
        )
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Lag of the output (s)"),
                y=Axis(label=axis_label("Cross-correlation", unit)),
                items=tuple(items),
            ),
        ),
        alt=", ".join(["Cross-correlation of input and output over the lag", *words]) + ".",
        heights=(2.4,),
    )


def error_autocorrelation(
    lags: NDArray[np.float64],
    correlation: NDArray[np.float64],
    *,
    bias: float | None = None,
    duration: float | None = None,
    unit: str = "",
) -> Figure:
    """Describe the autocorrelation of the time-corrected error (Eqs 9 to 11, Figs 9 and 11).

    Parameters
    ----------
    lags : ndarray, shape (m,)
        Seconds.
    correlation : ndarray, shape (m,)
        In the square of `unit`.
    bias : float, optional
        The joint fit's bias in `unit`; what it alone would give is drawn beside the curve.
    duration : float, optional
        Length of the error in s. Equation (10) divides every lag by the same number of
        samples, so that even a constant falls off in proportion to the lag.
    unit : str
        Unit of the output.

    Examples
    --------
    >>> lags = np.linspace(-1.0, 1.0, 201)
    >>> figure = error_autocorrelation(lags, 0.36 * np.ones(201), bias=0.6, unit="deg")
    >>> figure.panels[0].y.label
    'Autocorrelation of the error (deg²)'
    """
    items: list[Item] = [Curve(x=lags, y=correlation, colour="output")]
    if bias is not None:
        fall = np.ones_like(lags) if duration is None else 1.0 - np.abs(lags) / duration
        words = "from the fitted bias alone"
        items.append(Curve(x=lags, y=bias**2 * fall, label=words, colour="ink", dashes="--"))
    squared = f"{unit}²" if unit else ""
    return Figure(
        panels=(
            Panel(
                x=Axis(label="Lag (s)"),
                y=Axis(label=axis_label("Autocorrelation of the error", squared)),
                items=tuple(items),
            ),
        ),
        alt="Autocorrelation of the time-corrected error over the lag.",
        heights=(2.4,),
    )
