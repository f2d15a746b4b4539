"""A record: what went in, what came out, and when."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.arguments import check_rate, checked, shown
from hmpim.equality import ByValue
from hmpim.errors import ArgumentError, RecordError
from hmpim.record.channel import Channel, Intersample, frozen_samples, in_seconds
from hmpim.record.clock import rate_of
from hmpim.record.finding import Finding
from hmpim.record.stopping import Stopping
from hmpim.tables import html_table, shortened

__all__ = ["ROLES", "Record", "Role"]

Role = Literal["input", "output", "reference", "auxiliary"]
"""What a channel is in its record: what went in, what came out, what was asked, what is kept."""

ROLES: tuple[Role, ...] = ("input", "output", "reference", "auxiliary")


def _add(digest: Any, role: Role, channel: "Channel", values: NDArray[np.float64]) -> None:
    """Take a channel with these values into a digest."""
    digest.update(f"{role}\0{channel.name}\0{channel.unit}\0".encode())
    digest.update(np.ascontiguousarray(channel.time, dtype="<f8").tobytes())
    digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Record(ByValue):
    """Inputs and outputs of one test, time-stamped.

    Parameters
    ----------
    inputs, outputs : tuple of Channel
        At least one of each, names unique throughout.
    fs : float
        Nominal sampling rate in Hz.
    band : tuple of float or None
        Excited band in Hz, where known.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'} or None
        What the inputs do between samples, where known.
    source : str
        Where the record comes from, for people.
    findings : tuple of Finding
        What was noticed when the record was read: missing samples, mended stamps, and the like.
    references : tuple of Channel
        What a loop was asked, where the test was made in a closed loop.
    auxiliary : tuple of Channel
        What is kept beside, such as feedforward commands or a temperature; never fitted unless
        it is named.
    stopping : Stopping or None
        That the run was ended because it was sure, and when; None where it was not.

    Raises
    ------
    RecordError
        If there is no input or no output, or two channels share a name.
    """

    inputs: tuple[Channel, ...]
    outputs: tuple[Channel, ...]
    fs: float
    band: tuple[float, float] | None = None
    intersample: Intersample | None = None
    source: str = ""
    findings: tuple[Finding, ...] = ()
    references: tuple[Channel, ...] = ()
    auxiliary: tuple[Channel, ...] = ()
    stopping: Stopping | None = None

    def __post_init__(self) -> None:
        if not len(self.inputs) or not len(self.outputs):
            raise RecordError(
                f"a record needs at least one input and one output; "
                f"this one has {len(self.inputs)} and {len(self.outputs)}"
            )
        for role in ("inputs", "outputs", "references", "auxiliary", "findings"):
            object.__setattr__(self, role, tuple(getattr(self, role)))
        names = [c.name for c in self.channels]
        _check_unique(names)
        check_rate(self.fs)
        if self.band is not None:
            object.__setattr__(self, "band", _rising(self.band))

    def __repr__(self) -> str:
        inputs, outputs = (shortened([c.name for c in p]) for p in (self.inputs, self.outputs))
        found = f", {len(self.findings)} findings" if self.findings else ""
        size = self.outputs[0].values.size
        return (
            f"Record({inputs} → {outputs}, {size} samples, {self.duration:.6g} s at "
            f"{self.fs:.6g} Hz{found})"
        )

    def _repr_html_(self) -> str:
        """Return a table of the channels, as a notebook shows it."""
        roles = ("input", "output", "reference", "auxiliary")
        parts = (self.inputs, self.outputs, self.references, self.auxiliary)
        rows = [
            [role, c.name, c.unit, str(c.values.size), *_spans(c)]
            for role, part in zip(roles, parts, strict=True)
            for c in part
        ]
        heads = ["role", "channel", "unit", "samples", "time in s", "values"]
        return html_table(
            f"Record, {self.duration:.6g} s at {self.fs:.6g} Hz",
            heads,
            rows,
            notes=[*([self.source] if self.source else []), *(f.message for f in self.findings)],
        )

    @classmethod
    @checked
    def from_arrays(
        cls,
        inputs: Mapping[str, ArrayLike] | ArrayLike,
        outputs: Mapping[str, ArrayLike] | ArrayLike,
        *,
        fs: float | None = None,
        time: ArrayLike | None = None,
        units: Mapping[str, str] | None = None,
        band: tuple[float, float] | None = None,
        intersample: Intersample | None = None,
        references: Mapping[str, ArrayLike] | None = None,
        auxiliary: Mapping[str, ArrayLike] | None = None,
    ) -> "Record":
        """Make a record of arrays that share one clock.

        Parameters
        ----------
        inputs, outputs : mapping of str to array_like, shape (n,)
            Samples by channel name; one array alone is called u, or y. What a masked array hides
            is left out of that channel.
        fs : float, optional
            Sampling rate in Hz. Give this or `time`.
        time : array_like, shape (n,), optional
            Time stamps in seconds, or dates. With both, `fs` is the nominal rate.
        units : mapping of str to str, optional
            Unit by channel name; a channel not named has none.
        band : tuple of float, optional
            Excited band in Hz.
        intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}, optional
            What the inputs do between samples, if known.
        references, auxiliary : mapping of str to array_like, shape (n,), optional
            What a loop was asked, and what is kept beside.

        Raises
        ------
        RecordError
            For unequal lengths, NaN, complex numbers, or time that does not increase.
        ArgumentError
            If neither `fs` nor `time` is given, or `fs` is not positive.

        Examples
        --------
        >>> record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0)
        >>> record.duration
        0.3
        >>> seen = np.ma.masked_greater([0.0, 99.0, 1.0, 2.0], 90.0)
        >>> record = Record.from_arrays({"u": [0, 1, 0, 1]}, {"y": seen}, fs=10.0)
        >>> record.outputs[0].values.tolist(), record.outputs[0].time.tolist()
        ([0.0, 1.0, 2.0], [0.0, 0.2, 0.3])
        """
        if fs is None and time is None:
            raise ArgumentError("neither fs nor time is given; one of them is needed")
        if fs is not None:
            check_rate(fs)
        given = (_by_name("u", inputs), _by_name("y", outputs), references or {}, auxiliary or {})
        _check_unique([name for part in given for name in part])
        named = {name: values for part in given for name, values in part.items()}
        lengths = {name: frozen_samples(name, values).size for name, values in named.items()}
        if len(set(lengths.values())) > 1:
            raise RecordError(
                "channels have unequal lengths ("
                + ", ".join(f"{name}: {n}" for name, n in lengths.items())
                + "); give channels of one length, or each with its own time"
            )
        if not lengths:
            raise RecordError("a record needs at least one input and one output; this one has none")
        n = next(iter(lengths.values()))
        if time is None:
            assert fs is not None
            stamps: NDArray[Any] = np.arange(n) / fs
        else:
            stamps = in_seconds(time)
            frozen_samples("time", stamps)
        units = units or {}
        unknown = sorted(set(units) - set(named))
        if unknown:
            raise RecordError(f"a unit is given for {unknown[0]!r}, which is not a channel")

        made = [
            tuple(
                Channel(name=k, time=stamps, values=np.asanyarray(v), unit=units.get(k, ""))
                for k, v in part.items()
            )
            for part in given
        ]
        if fs is None and made[0]:
            fs = rate_of(made[0][0].time)
        return cls(
            inputs=made[0],
            outputs=made[1],
            fs=np.nan if fs is None else float(fs),
            band=band,
            intersample=intersample,
            references=made[2],
            auxiliary=made[3],
        )

    @property
    def duration(self) -> float:
        """Length in seconds: samples of the first input divided by the rate."""
        return self.inputs[0].values.size / self.fs

    @property
    def samples(self) -> int:
        """Number of samples of the first input."""
        return self.inputs[0].values.size

    @property
    def sha256(self) -> str:
        """Digest over names, units, time stamps and values of every channel."""
        digest = hashlib.sha256()
        for role in ROLES:
            for c in self.of(role):
                _add(digest, role, c, c.values)
        return digest.hexdigest()

    def sha256_with(self, outputs: NDArray[np.float64]) -> list[str]:
        """Digests of records of one input and one output that differ in the output's values alone.

        Parameters
        ----------
        outputs : ndarray, shape (k, n)
            The values in each.

        Examples
        --------
        >>> both = ([1, 2], [3, 4])
        >>> one, other = (Record.from_arrays({"u": [0, 1]}, {"y": y}, fs=2.0) for y in both)
        >>> one.sha256_with(np.array([[3.0, 4.0]])) == [other.sha256]
        True
        """
        if len(self.channels) != 2:
            raise RecordError(
                f"a record of {len(self.channels)} channels; what others share with it is known "
                "for one input and one output alone"
            )
        (source, output), head, found = self.channels, hashlib.sha256(), []
        _add(head, "input", source, source.values)
        _add(head, "output", output, output.values[:0])
        for values in outputs:
            digest = head.copy()
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())
            found.append(digest.hexdigest())
        return found

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Every channel: inputs, outputs, references, auxiliary."""
        return (*self.inputs, *self.outputs, *self.references, *self.auxiliary)

    def of(self, role: Role) -> tuple[Channel, ...]:
        """Channels of one role, in order."""
        by_role = {
            "input": self.inputs,
            "output": self.outputs,
            "reference": self.references,
            "auxiliary": self.auxiliary,
        }
        return by_role[role]

    @checked
    def channel(self, name: str) -> Channel:
        """Return the channel called `name`.

        Raises
        ------
        RecordError
            If there is none; the message lists those there are.
        """
        for c in self.channels:
            if c.name == name:
                return c
        known = ", ".join(c.name for c in self.channels)
        raise RecordError(f"there is no channel {name!r}; the record has {known}")

    @checked
    def between(self, start: float, stop: float) -> "Record":
        """Return the part with start <= time < stop, in seconds of the record's own clock.

        An auxiliary channel that has fewer than two samples in that span, such as a slow
        temperature, is left out.

        Raises
        ------
        RecordError
            If fewer than two samples of another channel are in that span.
        """

        def within(c: Channel) -> NDArray[np.bool_]:
            return (c.time >= start) & (c.time < stop)

        def cut(c: Channel) -> Channel:
            keep = within(c)
            if np.count_nonzero(keep) < 2:
                raise RecordError(
                    f"channel {c.name!r} has fewer than 2 samples between {start:g} s and "
                    f"{stop:g} s; widen the span"
                )
            return replace(c, time=c.time[keep], values=c.values[keep])

        return replace(
            self,
            inputs=tuple(cut(c) for c in self.inputs),
            outputs=tuple(cut(c) for c in self.outputs),
            references=tuple(cut(c) for c in self.references),
            auxiliary=tuple(cut(c) for c in self.auxiliary if np.count_nonzero(within(c)) >= 2),
        )

    def with_roles(self, *, inputs: Sequence[str], outputs: Sequence[str]) -> "Record":
        """Return the record with other inputs and outputs; what was one becomes auxiliary.

        Parameters
        ----------
        inputs, outputs : sequence of str
            Names of channels, of whatever role they are now. What inputs do between their
            samples is no longer known if one was no input before.

        Raises
        ------
        RecordError
            If there is no such channel, one is named twice, or none is named.

        Examples
        --------
        >>> record = Record.from_arrays(
        ...     {"u": [0, 1]}, {"y": [0, 1]}, fs=1.0, auxiliary={"rate": [1, 0]}
        ... )
        >>> again = record.with_roles(inputs=["rate"], outputs=["y"])
        >>> [c.name for c in again.inputs], [c.name for c in again.auxiliary]
        (['rate'], ['u'])
        """
        named = [*inputs, *outputs]
        free = [c for c in (*self.inputs, *self.outputs, *self.auxiliary) if c.name not in named]
        same = set(inputs) <= {c.name for c in self.inputs}
        return replace(
            self,
            inputs=tuple(self.channel(name) for name in inputs),
            outputs=tuple(self.channel(name) for name in outputs),
            references=tuple(c for c in self.references if c.name not in named),
            auxiliary=tuple(free),
            intersample=self.intersample if same else None,
        )


def _spans(channel: Channel) -> tuple[str, str]:
    """From when to when, and from what to what."""
    time, values = channel.time, channel.values
    return f"{time[0]:.6g} to {time[-1]:.6g}", f"{values.min():.6g} to {values.max():.6g}"


def _by_name(name: str, given: Mapping[str, ArrayLike] | ArrayLike) -> Mapping[str, ArrayLike]:
    """Samples by channel name; one channel alone is called `name`."""
    if isinstance(given, Mapping):
        for key in given:
            if not isinstance(key, str):
                raise ArgumentError(f"{shown(key)} names a channel and is not a text; write 'u'")
        return given
    if given is None or isinstance(given, (str, bytes)) or np.ndim(given) == 0:
        raise ArgumentError(
            f"{shown(given)} is not a channel; give samples by name, such as "
            f"{{{name!r}: [0.0, 1.0]}}"
        )
    return {name: given}


def _rising(band: tuple[float, float]) -> tuple[float, float]:
    low, high = map(float, band)
    if not 0.0 <= low <= high < np.inf:  # one line alone is a band, too
        raise ArgumentError(
            f"band = ({low:g}, {high:g}) Hz is not a band; give the lower frequency first, such as "
            "(0.1, 20)"
        )
    return low, high


def _check_unique(names: Sequence[str]) -> None:
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordError(f"channel name {twice[0]!r} is used twice; names must be unique")
