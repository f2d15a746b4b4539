"""What is worth modelling, worth a word and worth a doubt.

Many decisions share these numbers. Each is tuned: docs/thresholds.md tells what 30 % more or less
of it does to the records of the families study.
"""

__all__ = ["LOOSE", "MATERIAL", "PAST", "POOR", "ROUNDING", "TOLERATED", "WORTH"]

ROUNDING = 1e-9
"""Share of an output (r.m.s.) up to which a model explains it to rounding."""

WORTH = 0.003
"""Share of a figure, or of an output (r.m.s.), from which an effect is worth a word."""

MATERIAL = 0.01
"""The same, from which it is modelled, or makes figures doubtful."""

TOLERATED = 0.03
"""The same, up to which a model may be off where it is known to be."""

POOR = 0.2
"""Share of an output's power left over, in colour, that asks for another model anyway."""

LOOSE = 0.3
"""Relative standard deviation beyond which a figure is not known."""

PAST = 1.2
"""Frequency, over the end of the excited band, up to which the band still tells it."""
