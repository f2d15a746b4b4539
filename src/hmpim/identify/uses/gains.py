"""The unit of a scale factor, which follows from the structure and the units of the channels."""

from hmpim.identify.reading.figures import units_of
from hmpim.identify.result import PairIdentification
from hmpim.model.dynamics import FILTERS, STRUCTURES, Structure

__all__ = ["gain_unit", "like_gains"]


def gain_unit(pair: PairIdentification, units: tuple[str, str]) -> str:
    """Unit of a pair's scale factor for channels in these units: the input's and the output's."""
    return units_of(_structure(pair), units)["scale_factor"]


def like_gains(one: PairIdentification, other: PairIdentification) -> bool:
    """Whether two scale factors have the same power of time: neither alone integrates."""
    first, second = _structure(one), _structure(other)
    return (first.integrators, first.dc_zeros) == (second.integrators, second.dc_zeros)


def _structure(pair: PairIdentification) -> Structure:
    named = (known for known in STRUCTURES.values() if known.name == pair.structure)
    return next(named, FILTERS["static"])  # a filter's gain is output over input as well
