"""Shares and ratios at which an effect is reported, modelled or doubted.

Many decisions share these numbers. Each is tuned: docs/thresholds.md states how 30 % more or less
changes the results of the families study.
"""

__all__ = [
    "BLURRED",
    "DEEPEST",
    "FEW",
    "INTERPOLATED",
    "MATERIAL",
    "MOST",
    "MUCH",
    "NEARLY",
    "PART",
    "PAST",
    "ROUNDING",
    "TOLERATED",
    "TWICE",
    "WORTH",
]

ROUNDING = 1e-9
"""Residual over output (r.m.s.) up to which a model explains all but rounding."""

INTERPOLATED = 1e-7
"""The same, up to which it may be interpolation error: -140 dB, below a converter's noise."""

WORTH = 0.003
"""Share of a figure, or of an output (r.m.s.), from which an effect is reported."""

MATERIAL = 0.01
"""The same, from which it is modelled, or makes figures doubtful."""

TOLERATED = 0.03
"""The same, up to which a known model error is tolerated."""

FEW = 0.05
"""Share up to which a count is an exception or a change is none: of a sample, an interval's half
width, a band, a standard deviation.
"""

PART = 0.2
"""Share from which a part is not negligible."""

MUCH = 0.3
"""Share from which a part is too large for noise or an exception."""

MOST = 0.5
"""Share from which a part is the majority."""

NEARLY = 0.85
"""Share from which a part is almost the whole."""

PAST = 1.2
"""Frequency, over the end of the excited band, up to which the band still determines it."""

TWICE = 2.0
"""Ratio of two sizes from which they differ; of powers its square, 6 dB.

A model whose sum of squares is so many times the least is abandoned.
"""

DEEPEST = 1e-5
"""Power over the peak of the spectrum, below which an input gives no information: -50 dB."""

BLURRED = 2.0
"""Standard deviation of the delay, in samples, up to which it is always known well enough."""
