"""Values set by hand, said beside the automatic ones and marked as such."""

from collections.abc import Mapping

from hmpim.errors import ArgumentError
from hmpim.identify import PairIdentification, gain_and_phase
from hmpim.plots.curves import is_measured
from hmpim.report.numbers import format_estimate
from hmpim.report.words import GLOSSARY, structure_words

__all__ = ["fit_note", "hand_notes", "reading_at"]

_FREQUENCIES = (
    "natural_frequency",
    "bandwidth_phase90",
    "bandwidth_phase90_without_delay",
    "bandwidth_3db",
)


def hand_notes(
    pair: PairIdentification, hand: Mapping[str, float], *, fs: float
) -> tuple[str, ...]:
    """Say each value that was set by hand, beside what was found.

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    hand : mapping of str to float
        Values by parameter, in the parameter's own unit.
    fs : float
        Rate of the record, Hz.

    Raises
    ------
    ArgumentError
        If there is no such parameter.

    Examples
    --------
    >>> from hmpim.identify import FrequencyResponse, PaperEstimates, Parameters, Estimate
    >>> import numpy as np
    >>> none = np.empty(0)
    >>> late = Estimate(value=0.15, std=0.001, ci95=(0.148, 0.152), unit="s")
    >>> pair = PairIdentification(
    ...     input="u", output="y", structure="static", intersample="zoh", fit_percent=0.0,
    ...     parameters=Parameters(delay=late), paper=PaperEstimates(), candidates=(),
    ...     frequency_response=FrequencyResponse(frequency=none, response=none, std=none),
    ...     numerator=(), denominator=(), verdict="doubtful", warnings=())
    >>> hand_notes(pair, {"delay": 0.16}, fs=100.0)
    ('y from u, by hand: delay 0.16 s; automatic 0.1500 ± 0.0010 s.',)
    """
    notes = []
    known = {words.name: words for words in GLOSSARY}
    for name, value in hand.items():
        if name not in known:
            raise ArgumentError(f"{name!r} is not a parameter; choose one of {', '.join(known)}")
        found = getattr(pair.parameters, name)
        unit = "Hz" if name in _FREQUENCIES else "s" if "delay" in name else ""
        unit = unit if found is None else found.unit
        automatic = "none" if found is None else format_estimate(found)
        said = f"{pair.output} from {pair.input}, by hand: {known[name].inline} {value:.5g} {unit}"
        note = f"{said.rstrip()}; automatic {automatic}."
        if name in _FREQUENCIES:
            note = f"{note} {reading_at(pair, value, fs=fs)}".rstrip()
        notes.append(note)
    return tuple(notes)


def fit_note(automatic: PairIdentification, *, set_by_hand: str) -> str:
    """Say what was found before structure or interval were set by hand.

    Parameters
    ----------
    automatic : PairIdentification
        What was found of the whole record, any structure allowed.
    set_by_hand : str
        What was set, such as 'second order, 1 to 8 s'.
    """
    found = [
        f"{words.inline} {format_estimate(estimate)}"
        for words in GLOSSARY
        if (estimate := getattr(automatic.parameters, words.name)) is not None
    ]
    return (
        f"{automatic.output} from {automatic.input}, by hand: {set_by_hand}; automatic: "
        f"{structure_words(automatic.structure)}, whole record: {', '.join(found)}."
    )


def reading_at(pair: PairIdentification, frequency: float, *, fs: float) -> str:
    """Say gain and phase at a frequency, as measured and by the model; '' where there is none.

    Parameters
    ----------
    pair : PairIdentification
        What was found.
    frequency : float
        Hz.
    fs : float
        Rate of the record, Hz.
    """
    try:
        (at,) = gain_and_phase(pair, [frequency], fs=fs)
    except ArgumentError:
        return ""
    model = f"the model {format_estimate(at.model_gain_db)}, {format_estimate(at.model_phase)}"
    if at.gain_db is None or at.phase is None or not is_measured(pair):
        return f"At {frequency:.4g} Hz nothing was measured; {model}."
    measured = f"{format_estimate(at.gain_db)}, {format_estimate(at.phase)}"
    return f"At {frequency:.4g} Hz: measured {measured}; {model}."
