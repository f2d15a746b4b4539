"""Quality of the data: what is odd about a record's clock and values, said plainly."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Finding", "inspect_timing"]


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


def inspect_timing(time: NDArray[np.float64], fs: float) -> tuple[Finding, ...]:
    """Placeholder docstring; see the issue."""
    return ()
