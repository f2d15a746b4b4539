"""Units of a result beside those of a record: that of a scale factor follows from its structure."""

from hmpim.errors import RecordError
from hmpim.identify.reading.figures import units_of
from hmpim.identify.result import PairIdentification
from hmpim.model.dynamics import FILTERS, STRUCTURES, Structure
from hmpim.record import Aligned

__all__ = ["check_units", "gain_unit", "like_gains"]


def gain_unit(pair: PairIdentification, units: tuple[str, str]) -> str:
    """Unit of a pair's scale factor for channels in these units: the input's and the output's."""
    return units_of(_structure(pair), units)["scale_factor"]


def like_gains(one: PairIdentification, other: PairIdentification) -> bool:
    """Whether two scale factors have the same power of time: neither alone integrates."""
    first, second = _structure(one), _structure(other)
    return (first.integrators, first.dc_zeros) == (second.integrators, second.dc_zeros)


def check_units(pair: PairIdentification, aligned: Aligned) -> None:
    """Refuse a record in other units than the result's, where both state them."""
    u, y = aligned.signal(pair.input), aligned.signal(pair.output)
    known = pair.parameters
    if known.bias is None or known.scale_factor is None:
        return
    if not (known.bias.unit and u.unit and y.unit):
        return
    # The result may not have the unit of its input.
    scales = {gain_unit(pair, (unit, y.unit)) for unit in (u.unit, "")}
    if known.bias.unit != y.unit or known.scale_factor.unit not in scales:
        raise RecordError(
            f"{pair.output!r} from {pair.input!r} was identified with an output in "
            f"{known.bias.unit!r} and a scale factor in {known.scale_factor.unit or '1'!r}; the "
            f"record has {u.unit!r} and {y.unit!r}, and numbers are not converted: give a record "
            "in the units of the result"
        )


def _structure(pair: PairIdentification) -> Structure:
    named = (known for known in STRUCTURES.values() if known.name == pair.structure)
    return next(named, FILTERS["static"])  # a filter's gain is output over input as well
