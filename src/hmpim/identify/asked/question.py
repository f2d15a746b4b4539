"""One output of a record, and all that is known of it before anything is fitted."""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Mask
from hmpim.identify.asked.reference import Instrument
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.nonlinear.speed import LimitedCommand
from hmpim.identify.result import InputSet
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.model.dynamics import StructureName
from hmpim.record import Aligned, Finding, Intersample, Record, Signal

__all__ = ["Question"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Question:
    """Which model leads from the inputs of a record to one of its outputs.

    Parameters
    ----------
    record, aligned : Record, Aligned
        As recorded, and on one clock.
    output : Signal
        The output that is asked for.
    intersample : {'zoh', 'foh', 'bandlimited', 'sampled'} or None
        What the inputs do between their samples; None where the data are to choose.
    structures : tuple of str
        Dynamics to try.
    inputs : InputSet or None
        How well several inputs are told apart; None of one.
    instrument : Instrument or None
        What a loop's reference moves of the input.
    swapped : Finding or None
        Said where the input follows the output: then only plain structures are tried.
    exact : bool
        Whether a filter between samples explains all but rounding.
    limited : LimitedCommand or None
        Of a unit that follows its command up to some speed: then the input is what it follows.
    """

    record: Record
    aligned: Aligned
    output: Signal
    intersample: Intersample | None
    structures: tuple[StructureName, ...]
    inputs: InputSet | None
    instrument: Instrument | None
    swapped: Finding | None = None
    exact: bool = False
    limited: LimitedCommand | None = None

    @property
    def plain(self) -> tuple[StructureName, ...]:
        """The plain structures among those to try; all of them where none is plain."""
        return tuple(name for name in self.structures if name in PLAIN) or self.structures

    @property
    def moves(self) -> bool:
        """Whether the output is more than a constant."""
        return bool(np.ptp(self.output.values[self.output.valid]) > 0)

    @property
    def measured(self) -> Mask | None:
        """Samples at which every input was measured, shape (n,); None when all were."""
        told = np.logical_and.reduce([source.valid for source in self.aligned.inputs])
        return None if bool(told.all()) else np.asarray(told)

    def band(self, i: int) -> tuple[float, float]:
        """Band in Hz that an input excites."""
        if self.inputs is not None:
            return self.inputs.bands[i]
        source, aligned = self.aligned.inputs[i], self.aligned
        return self.record.band or excited_band(source.values, aligned.fs)
