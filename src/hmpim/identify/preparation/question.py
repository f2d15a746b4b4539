"""One output of a record, and all that is known of it before anything is fitted.

Also whether the record is that of software, which processes samples and nothing between them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import cast

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.software import is_exact
from hmpim.identify.nonlinear.speed import LimitedCommand
from hmpim.identify.preparation.reference import Instrument
from hmpim.identify.result import InputSet
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.identify.worth import ROUNDING, TWICE
from hmpim.model.dynamics import FILTERS, STRUCTURES, StructureName
from hmpim.record import Aligned, Finding, Intersample, Record, Signal
from hmpim.record.slower import restored

__all__ = ["Question", "recognise_software"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Question:
    """One output of a record, to be modelled from the inputs."""

    record: Record
    aligned: Aligned  # the record on one clock
    output: Signal  # the output to identify
    intersample: Intersample | None  # what the inputs do between samples; None if unknown
    structures: tuple[StructureName, ...]  # dynamics to try
    inputs: InputSet | None  # how well several inputs are distinguished; None with one
    instrument: Instrument | None  # the part of the input that a loop's reference moves
    swapped: Finding | None = None  # if the input follows the output; only plain structures then
    exact: bool = False  # whether a filter between samples explains all but rounding
    limited: LimitedCommand | None = None  # a speed limit; the input is then the limited command
    linear: bool = False  # whether a nonlinearity is only reported, not modelled
    # samples of delay in addition, by input, if one that a slow clock may record moved smoothly
    later: Mapping[int, float] = field(default_factory=dict)

    @property
    def plain(self) -> tuple[StructureName, ...]:
        """The plain structures among those to try; all of them if none is plain."""
        return tuple(name for name in self.structures if name in PLAIN) or self.structures

    @property
    def moves(self) -> bool:
        """Whether the output is more than a constant."""
        return bool(np.ptp(self.output.values[self.output.valid]) > 0)

    @property
    def measured(self) -> Mask | None:
        """Samples at which every input is known, shape (n,); None if all are."""
        known = np.logical_and.reduce([_known(source) for source in self.aligned.inputs])
        return None if bool(known.all()) else np.asarray(known)

    def band(self, i: int) -> tuple[float, float]:
        """Band in Hz that an input excites."""
        if self.inputs is not None:
            return self.inputs.bands[i]
        source, aligned = self.aligned.inputs[i], self.aligned
        return self.record.band or excited_band(source.values, aligned.fs)


def _known(source: Signal) -> Mask:
    """Samples that were measured, and lost ones that are known as the input holds its value."""
    if source.valid.all():
        return source.valid
    place = np.arange(source.valid.size)
    before = np.maximum.accumulate(np.where(source.valid, place, 0))
    after = np.minimum.accumulate(np.where(source.valid, place, place[-1])[::-1])[::-1]
    stands = source.values[before] == source.values[after]
    stands &= after - before - 1 < _shortest_stay(source.values, source.valid)
    return np.asarray(source.valid | stands | restored(source.values, source.valid)[1])


def _shortest_stay(u: Real, valid: Mask) -> float:
    """Shortest complete stay at a level, in samples; infinite if levels hardly recur.

    A shorter gap between two equal values hides no motion.
    """
    measured = u[valid]
    stays = 1 + np.count_nonzero(np.diff(measured))
    if stays <= TWICE * np.unique(measured).size:
        return np.inf
    edges = np.flatnonzero(np.diff(u) != 0.0) + 1
    lost = np.concatenate([[0], np.cumsum(~valid)])
    whole = lost[edges[1:] + 1] == lost[edges[:-1] - 1]  # measured from one sample before to after
    lengths = np.diff(edges)[whole]
    return float(lengths.min()) if lengths.size else 1.0


def recognise_software(question: Question) -> Question:
    """Try filters if rounding is the only noise, and no simpler system explains the record.

    Only for one input, with all samples valid and no assumption stated.
    """
    source, output = question.aligned.inputs[0], question.output
    if question.intersample is not None or question.swapped or question.instrument:
        return question
    if question.inputs or not (source.valid.all() and output.valid.all()):
        return question
    u, y = source.values, output.values
    if not is_exact(u, y):
        return question
    names = cast(tuple[StructureName, ...], tuple(FILTERS))
    filters = joint_fit(u, y, intersample="sampled", structures=names).best.fit
    enough = ROUNDING**2 * float(np.sum((y - y.mean()) ** 2))
    if filters.cost > enough:
        return question
    fewest = filters.structure.parameters
    plainer = tuple(name for name in PLAIN if STRUCTURES[name].parameters < fewest)
    if plainer and any(
        one.fit.cost <= enough for one in joint_fit(u, y, structures=plainer).trials
    ):
        return question
    return replace(question, intersample="sampled", structures=names, exact=True)
