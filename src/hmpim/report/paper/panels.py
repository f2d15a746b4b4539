"""Panels that several figures of the paper share."""

from hmpim.identify import PaperAnalysis
from hmpim.plots.description import Axis, Curve, Panel, Scale

__all__ = ["response_panels"]


def response_panels(
    analysis: PaperAnalysis, *, label: str = "measured", scale: Scale = "log", row: int = 0
) -> tuple[Panel, Panel]:
    """Describe the transfer function of section IV.D, magnitude over phase.

    Parameters
    ----------
    analysis : PaperAnalysis
        The paper's steps.
    label : str
        For the legend.
    scale : {'linear', 'log'}
        Of the frequency.
    row : int
        Of the upper panel.

    Examples
    --------
    >>> import numpy as np
    >>> from hmpim.identify import paper_analysis
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> _, phase = response_panels(paper_analysis(u, u, 200.0, band=(0.1, 20.0)))
    >>> phase.y.label
    'Phase (deg)'
    """
    low, high = analysis.band
    f = analysis.band_frequency
    return (
        Panel(
            x=Axis(scale=scale, low=low, high=high, numbered=False),
            y=Axis(label="Magnitude (dB)"),
            items=(Curve(x=f, y=analysis.magnitude_db, label=label),),
            row=row,
        ),
        Panel(
            x=Axis(label="Frequency (Hz)", scale=scale, low=low, high=high),
            y=Axis(label="Phase (deg)", degrees=True),
            items=(Curve(x=f, y=analysis.phase),),
            row=row + 1,
        ),
    )
