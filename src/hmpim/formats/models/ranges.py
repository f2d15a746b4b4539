"""Ranges to draw a simulated unit from: the 95 % intervals of what was identified."""

from hmpim.formats.models.source import Source

__all__ = ["ranges_of"]

_DRAWN = (
    *("delay", "scale_factor", "bias", "natural_frequency", "damping_ratio", "time_constant"),
    "noise_std",
)


def ranges_of(source: Source) -> dict[str, tuple[float, float]]:
    """Return the closed 95 % intervals of the parameters that a simulator can draw."""
    found = {}
    for name, estimate in source.estimates():
        if name not in _DRAWN or estimate.ci95 is None:
            continue
        low, high = estimate.ci95
        if low is not None and high is not None:
            found[name] = (low, high)
    return found
