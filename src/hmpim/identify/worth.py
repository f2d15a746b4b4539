"""What is worth modelling, worth a word and worth a doubt.

Many decisions share these numbers. Each is tuned: docs/thresholds.md tells what 30 % more or less
of it does to the records of the families study.
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
"""Share of an output (r.m.s.) up to which a model explains it to rounding."""

INTERPOLATED = 1e-7
"""The same up to which it may be the error of interpolation: -140 dB, below a converter's noise."""

WORTH = 0.003
"""Share of a figure, or of an output (r.m.s.), from which an effect is worth a word."""

MATERIAL = 0.01
"""The same, from which it is modelled, or makes figures doubtful."""

TOLERATED = 0.03
"""The same, up to which a model may be off where it is known to be."""

FEW = 0.05
"""Share up to which what is seen is an exception, or what moves does not: of a sample, of an
interval's half width, of a band, of a standard deviation.
"""

PART = 0.2
"""Share from which a part is not to be neglected."""

MUCH = 0.3
"""Share from which it is too much for what it would otherwise pass for."""

MOST = 0.5
"""Share from which a part is the greater one."""

NEARLY = 0.85
"""Share from which a part is all but the whole."""

PAST = 1.2
"""Frequency, over the end of the excited band, up to which the band still tells it."""

TWICE = 2.0
"""Ratio of two sizes from which they are not alike; of powers its square, 6 dB.

A model whose sum of squares is so many times the least is not followed on.
"""

DEEPEST = 1e-5
"""Power over the greatest of its spectrum, below which an input tells nothing: -50 dB."""

BLURRED = 2.0
"""Standard deviation of the delay, in samples, up to which it is always known well enough."""
