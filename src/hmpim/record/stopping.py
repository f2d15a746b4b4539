"""Why a run ended before its stimulus was over: it was sure."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

__all__ = ["Stopping"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stopping:
    """That a run was ended by a rule, and when.

    Parameters
    ----------
    rule : str
        What was asked, as `hmpim run --until` takes it: each target is a standard deviation.
    looks : int
        How often the estimate was looked at.
    time : float
        Seconds of motion until then; the way to rest comes after.
    saved : float
        Seconds of the stimulus that were not played.

    Examples
    --------
    >>> stopping = Stopping(rule="delay=0.0004s", looks=12, time=1.3, saved=8.7)
    >>> Stopping.from_dict(stopping.to_dict()) == stopping
    True
    """

    rule: str
    looks: int
    time: float
    saved: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain JSON values."""
        return {"rule": self.rule, "looks": self.looks, "time": self.time, "saved": self.saved}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Stopping":
        """Read back what `to_dict` wrote."""
        return cls(
            rule=str(data["rule"]),
            looks=int(data["looks"]),
            time=float(data["time"]),
            saved=float(data["saved"]),
        )
