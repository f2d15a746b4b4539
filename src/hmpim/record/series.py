"""A channel as a file holds it: samples may be missing, stamps may stand still or run back."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.record.finding import Finding

__all__ = ["Series"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Series:
    """One signal as it was found, before anything is mended.

    Parameters
    ----------
    name : str
        Name of the signal in its file.
    values : ndarray, shape (n,)
        Samples in `unit`; NaN where a sample is missing.
    time : ndarray, shape (n,), or None
        Stamps in s as they were found; None where the file holds none. Series that share a
        clock should share one array.
    unit : str
        Unit as the file states it; empty where it states none.
    findings : tuple of Finding
        What its reader noticed, such as a file that is cut short.

    Raises
    ------
    RecordError
        If values and stamps are not two arrays of one length.

    Examples
    --------
    >>> import numpy as np
    >>> gyro = Series(name="gyro", values=np.array([1.0, np.nan]), time=np.array([0.0, 0.1]))
    >>> gyro.values.size
    2
    """

    name: str
    values: NDArray[np.float64]
    time: NDArray[np.float64] | None = None
    unit: str = ""
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        for label, array in (("values", self.values), ("time", self.time)):
            if array is not None and (array.ndim != 1 or array.size != self.values.size):
                raise RecordError(
                    f"{label} of {self.name!r} have shape {array.shape}; values and time must be "
                    "two arrays of one length, shape (n,)"
                )
