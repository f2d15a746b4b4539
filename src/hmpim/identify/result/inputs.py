"""Several inputs driven at once: which are distinguished, and how much all of them explain."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from hmpim.equality import ByValue
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.result.plain import Plain, by_fields, fields_in
from hmpim.identify.worth import MATERIAL

__all__ = ["Alike", "InputSet", "OutputCoherence"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Alike(Plain):
    """Inputs that are not distinguished, and where.

    Parameters
    ----------
    names : tuple of str
        Of the inputs.
    bands : tuple of (float, float)
        Hz.
    share : float
        Of the frequencies that all of them excite.
    """

    names: tuple[str, ...]
    bands: tuple[tuple[float, float], ...]
    share: float

    @property
    def where(self) -> str:
        """The bands in words."""
        spans = [f"{low:.3g} to {high:.3g}" for low, high in self.bands]
        return ", ".join(spans[:4]) + (" and further" if len(spans) > 4 else "") + " Hz"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OutputCoherence(ByValue, Plain):
    """Share of an output that all inputs together explain, over frequency.

    Parameters
    ----------
    output : str
        Name.
    frequency, multiple : ndarray, shape (f,)
        Hz, and the multiple coherence, 0 to 1, corrected for the number of coefficients. The
        partial coherence of one input, given the others, is in each pair's frequency response.
    """

    output: str
    frequency: Real
    multiple: Real


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InputSet(ByValue, Plain):
    """Several inputs driven at once, and how well one record distinguishes them.

    Parameters
    ----------
    names : tuple of str
        Of the inputs.
    bands : tuple of (float, float)
        Excited by each of them, Hz.
    frequency : ndarray, shape (f,)
        Hz.
    condition : ndarray, shape (f,)
        Condition number of the errors of the responses, for those inputs that excite the
        frequency; each counts with its own power. 1 for uncorrelated inputs.
    alike : tuple of Alike
        Inputs that are not distinguished, and where.
    coherence : tuple of OutputCoherence
        One for each output.
    """

    names: tuple[str, ...]
    bands: tuple[tuple[float, float], ...]
    frequency: Real
    condition: Real
    alike: tuple[Alike, ...] = ()
    coherence: tuple[OutputCoherence, ...] = ()

    @property
    def usable(self) -> Mask:
        """Where the inputs are distinguished: condition at most 10, shape (f,)."""
        return np.asarray(self.condition <= MATERIAL**-0.5)

    def alike_bins(self, samples: int, fs: float) -> tuple[tuple[frozenset[int], Mask], ...]:
        """Inputs that are not distinguished, and the bins of a transform of `samples` there."""
        frequency = np.arange(samples // 2 + 1) * (fs / samples)
        found = []
        for group in self.alike:
            inside = np.zeros(frequency.size, dtype=bool)
            for low, high in group.bands:
                inside |= (frequency >= low) & (frequency <= high)
            found.append((frozenset(self.names.index(name) for name in group.names), inside))
        return tuple(found)

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values; an infinite condition is null."""
        condition = [c if np.isfinite(c) else None for c in self.condition.tolist()]
        return {**fields_in(self), "condition": condition}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "InputSet":
        """Read back what `to_dict` wrote."""
        condition = [np.inf if c is None else c for c in data["condition"]]
        return by_fields(cls, {**data, "condition": condition})
