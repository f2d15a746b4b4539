"""What a result does not state: figures of its model that it lacks, and effects not found."""

from hmpim.identify import PairIdentification
from hmpim.model.dynamics import FILTERS, STRUCTURES, Structure
from hmpim.plots.curves import is_measured
from hmpim.report.words import GLOSSARY

__all__ = ["untold"]


def untold(pair: PairIdentification) -> str:
    """Say which figures of its model a pair lacks, and which effects were looked for in vain.

    A figure that the model does not have, such as the damping of a static unit, is not listed; of
    an output that does not follow its input, none is.

    Returns
    -------
    str
        Sentences; empty if nothing is missing.
    """
    if pair.verdict == "not_identifiable":
        return ""
    lacking = _not_of(pair.structure)
    missing = [w for w in GLOSSARY if getattr(pair.parameters, w.name) is None]
    names = [w.inline for w in missing if w.name not in lacking and w.name not in _EFFECTS]
    said = [f"Not determined: {'; '.join(names)}."] if names else []
    seen = {_EFFECTS[name] for name in _EFFECTS if getattr(pair.parameters, name) is not None}
    effects = [kind for kind in dict.fromkeys(_EFFECTS.values()) if kind not in seen]
    if effects and is_measured(pair):
        said.append(f"Looked for and not found: {', '.join(effects)}.")
    return " ".join(said)


_EFFECTS = {
    "hold_period": "a held output",
    "saturation_low": "saturation",
    "saturation_high": "saturation",
    "quantization_step": "rounding",
}
"""What a sensor may do to its output, by the figure that it has then."""


def _not_of(name: str) -> frozenset[str]:
    """Figures that a structure does not have; a time constant is known where the slowest pole is.

    Marks are relative to the gain at 0 Hz, which an integrator and a washout do not have.
    """
    known: dict[str, Structure] = {s.name: s for s in (*STRUCTURES.values(), *FILTERS.values())}
    structure = known.get(name)
    sections = () if structure is None else structure.sections
    unsteady = structure is not None and bool(structure.integrators or structure.dc_zeros)
    lacking = {"time_constant"}
    if 2 not in sections:
        lacking |= {"natural_frequency", "damping_ratio"}
    if sum(sections) < 2 or unsteady:  # less than 90° of its own
        lacking.add("bandwidth_phase90_without_delay")
    if not sections or unsteady:
        lacking |= {"bandwidth_3db", "peak_gain_db"}
    if unsteady:
        lacking.add("bandwidth_phase90")
    return frozenset(lacking)
