"""One run of a campaign: which axes move, and how."""

from dataclasses import dataclass
from typing import Any

from hmpim.campaign.plan import Mode

__all__ = ["Case"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One run: the axes that move, and how.

    Examples
    --------
    >>> Case(test="rates", axes=("yaw",), mode="P", rate=500.0, level=0.5, load="none").id
    'rates.none.P.500Hz.0.5.yaw'
    """

    test: str
    axes: tuple[str, ...]
    mode: Mode
    rate: float
    level: float
    load: str
    together: bool = False
    levels_of: tuple[str, ...] = ("velocity", "acceleration")

    @property
    def id(self) -> str:
        """Name of the case, and of its file."""
        load = "".join(c if c.isalnum() or c in "+-_" else "_" for c in self.load)
        what = "together" if self.together else self.axes[0]
        return f"{self.test}.{load}.{self.mode}.{self.rate:g}Hz.{self.level:g}.{what}"

    def to_dict(self) -> dict[str, Any]:
        """Return the case as plain JSON values."""
        return {
            "test": self.test,
            "axes": list(self.axes),
            "mode": self.mode,
            "rate": self.rate,
            "level": self.level,
            "load": self.load,
            "together": self.together,
        }
