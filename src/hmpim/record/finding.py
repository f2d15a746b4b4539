"""What a person should know about data or a result."""

from dataclasses import dataclass

__all__ = ["Finding"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """Something a person should know about data or a result.

    Parameters
    ----------
    code : str
        Stable word for programs, such as 'jitter' or 'saturation'.
    message : str
        One plain sentence with a number and a thing to do.
    """

    code: str
    message: str
