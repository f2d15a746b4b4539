"""What a person should know about data or a result, said once and in one form."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from hmpim.errors import ArgumentError

__all__ = ["Finding", "Severity"]

Severity = Literal["info", "doubt"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something a person should know about data or a result.

    Parameters
    ----------
    code : str
        Stable word for programs, such as 'jitter' or 'saturation'.
    message : str
        One plain sentence with a number and a thing to do.
    severity : {'info', 'doubt'}
        A doubt makes the parameters that it names doubtful; information leaves them as they are.
    parameters : tuple of str
        Names of the parameters it touches, as in `hmpim.identify.Parameters`; empty where it
        speaks of the record alone.

    Raises
    ------
    ArgumentError
        If `severity` is not known.

    Examples
    --------
    >>> Finding(code="rate", message="The rate is 99 Hz.", severity="info", parameters=()).to_dict()
    {'code': 'rate', 'message': 'The rate is 99 Hz.', 'severity': 'info', 'parameters': []}
    """

    code: str
    message: str
    severity: Severity
    parameters: tuple[str, ...]

    def __post_init__(self) -> None:
        if self.severity not in get_args(Severity):
            raise ArgumentError(
                f"severity {self.severity!r} is not known; choose one of {list(get_args(Severity))}"
            )

    def to_dict(self) -> dict[str, Any]:
        """Return the finding as plain JSON values."""
        return {
            "code": self.code,
            "message": self.message,
            "severity": self.severity,
            "parameters": list(self.parameters),
        }

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> "Finding":
        """Read back what `to_dict` wrote."""
        return cls(
            code=data["code"],
            message=data["message"],
            severity=data["severity"],
            parameters=tuple(data["parameters"]),
        )
