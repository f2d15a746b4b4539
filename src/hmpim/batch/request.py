"""What is asked of every record of a batch, in plain values that travel and are kept."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any, Literal, Self

from hmpim.arguments import check_rate, checked
from hmpim.errors import ArgumentError
from hmpim.model.dynamics import STRUCTURES
from hmpim.record import Intersample

__all__ = ["Keep", "Request"]

Keep = Literal["results", "parameters"]
"""All that `identify` says, or the parameters of the joint fit alone."""


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """One specification of what to identify, for all records of a batch.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Names of the channels; empty for those that the file states, or the usual names.
    fs : float or None
        Rate in Hz of records that hold no time.
    time : str or None
        Name of the channel of time.
    units : mapping of str to str
        Unit by channel, where the files state none.
    intersample : {'auto', 'zoh', 'foh', 'bandlimited'}
        What the input does between its samples.
    structures : tuple of str
        Dynamics to try; empty for all.
    keep : {'results', 'parameters'}
        All that `hmpim.identify` says, or the parameters alone, which is quicker.
    record_column : str
        Column of a Parquet file that says to which record a row belongs.
    group : str
        Group of an HDF5 file under which each group is a record.
    metadata : str
        A CSV or Parquet file with one row a record; empty for none. Its column `record` holds
        the records' names, or the ends of them.
    pool_by : str
        Column of metadata whose records are identified as one, such as a unit's serial number;
        ``all`` for one model of all; empty for each record by itself.
    lags : int or None
        Window in samples of records identified as one: delay and settling time must fit into it.
        None for a fifth of the first record.

    Raises
    ------
    ArgumentError
        If a value is not one of those.

    Examples
    --------
    >>> Request(inputs=("u",), outputs=("y",)).digest == Request(outputs=("y",)).digest
    False
    """

    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    fs: float | None = None
    time: str | None = None
    units: Mapping[str, str] = field(default_factory=dict)
    intersample: Intersample | Literal["auto"] = "auto"
    structures: tuple[str, ...] = ()
    keep: Keep = "results"
    record_column: str = "record"
    group: str = "/"
    metadata: str = ""
    pool_by: str = ""
    lags: int | None = None

    def __post_init__(self) -> None:
        if self.fs is not None:
            check_rate(self.fs)
        if self.lags is not None and not self.pool_by:
            raise ArgumentError(
                f"lags = {self.lags} is for records identified as one; say which: pool_by='serial'"
            )
        if self.pool_by and (self.structures or self.intersample != "auto"):
            raise ArgumentError(
                "records identified as one take every structure and find what lies between the "
                "samples; leave out structures and intersample"
            )
        for name in self.structures:
            if name not in STRUCTURES:
                raise ArgumentError(
                    f"structure {name!r} is not known; choose one of {list(STRUCTURES)}"
                )

    @property
    def digest(self) -> str:
        """Hexadecimal digest of all fields, equal for equal requests only."""
        return hashlib.sha256(json.dumps(self.to_dict(), sort_keys=True).encode()).hexdigest()

    def to_dict(self) -> dict[str, Any]:
        """Return the request as plain JSON values."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        if not self.pool_by:  # each by itself: nothing to say
            del values["pool_by"], values["lags"]
        listed = {k: list(v) if isinstance(v, tuple) else v for k, v in values.items()}
        return {**listed, "units": dict(self.units)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> Self:
        """Read back what `to_dict` wrote."""
        values: dict[str, Any] = {
            k: tuple(v) if isinstance(v, list) else v for k, v in data.items()
        }
        return cls(**values)
