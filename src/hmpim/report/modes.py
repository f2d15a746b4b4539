"""Every mode of a sum of modes, as rows of text."""

from hmpim.errors import RecordError
from hmpim.identify import Estimate, PairIdentification, to_model
from hmpim.identify.chance import HALF
from hmpim.report.numbers import format_value

__all__ = ["MODES_SAID", "mode_rows"]

MODES_SAID = "Modes, with the errors of the fit alone"


def mode_rows(pair: PairIdentification) -> list[tuple[str, str]]:
    """Natural frequency in Hz and damping ratio of each mode, the lowest first, errors included.

    Empty of fewer than two modes, and where not even the lowest is told.
    """
    lowest = pair.parameters.natural_frequency
    if lowest is None or pair.parameters.scale_factor is None:
        return []
    try:
        modes = to_model(pair).modes
    except RecordError:
        return []
    if len(modes) < 2:
        return []
    damping = pair.parameters.damping_ratio
    doubts = [
        "" if one is None or one.verdict == "ok" else " (doubtful)" for one in (lowest, damping)
    ]
    return [
        (
            _written(mode.natural_frequency, mode.natural_frequency_std) + doubts[0],
            _written(mode.damping_ratio, mode.damping_ratio_std) + doubts[1],
        )
        for mode in modes
    ]


def _written(value: float, std: float | None) -> str:
    ends = None if std is None else (value - HALF * std, value + HALF * std)
    return format_value(
        Estimate(
            value=value, std=std, ci95=ends, unit="", verdict="doubtful" if ends is None else "ok"
        )
    )
