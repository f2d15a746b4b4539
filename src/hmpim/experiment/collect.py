"""Replies of a rig, block by block, put together as a record."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RecordError, RigError
from hmpim.record import Channel, Record, Role, Series, Stopping
from hmpim.record.mend import mend
from hmpim.rigs import Block, ChannelSpec, Commands, Layout, Reply, RunReport, Samples

__all__ = ["Collected", "Played", "default_layout"]

FloatArray = NDArray[np.float64]
_EMPTY = Samples(time=np.empty(0), values=np.empty(0))
_BACK = 0.1  # s: no network lets newer samples pass one for so long
_AHEAD = 10.0  # s that stamps may gain on the run from one block to the next


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Played:
    """A block as it was played, for whoever watches the run.

    Parameters
    ----------
    block : Block
        What was commanded.
    layout : Layout
        Channels of the run.
    samples : mapping of str to Samples
        What has come in since the block before, by channel; may be empty.
    seconds : float
        Length of the whole run, s.
    """

    block: Block
    layout: Layout
    samples: Mapping[str, Samples]
    seconds: float


def default_layout(commands: Commands, *, name: str) -> Layout:
    """Layout of a rig that states none: each axis's command, and one output for each.

    Examples
    --------
    >>> from hmpim.rigs import commands_of
    >>> from hmpim.stimulus import Ramp, Stimulus
    >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=4.0, unit="deg")
    >>> [c.name for c in default_layout(commands_of({"": ramp}), name="mine").channels]
    ['u', 'y']
    """
    inputs, outputs = [], []
    for axis, unit in zip(commands.axes, commands.units, strict=True):
        u, y = (f"{axis}.command", f"{axis}.position") if axis else ("u", "y")
        inputs.append(
            ChannelSpec(
                name=u, role="input", unit=unit, axis=axis, quantity="position", commanded=True
            )
        )
        outputs.append(ChannelSpec(name=y, role="output", unit=unit, axis=axis))
    return Layout(channels=(*inputs, *outputs), source=f"rig {name}")


class Collected:
    """Samples of all channels so far.

    Parameters
    ----------
    layout : Layout
        Channels to come.
    name : str
        Of the rig, for messages.
    """

    def __init__(self, layout: Layout, *, name: str) -> None:
        self._layout = layout
        self._name = name
        self._specs = {spec.name: spec for spec in layout.channels}
        self._parts: dict[str, list[Samples]] = {spec.name: [] for spec in layout.channels}
        self._newest: dict[str, tuple[float, float]] = {}  # stamp, and when it came
        self.stopping: Stopping | None = None
        """That the run ends because it is sure."""

    def take(
        self, block: Block, reply: Reply, *, sent: FloatArray | None = None
    ) -> Mapping[str, Samples]:
        """Add what a rig returned for a block.

        Parameters
        ----------
        block : Block
            What was played.
        reply : Reply
            What the rig returned for it.
        sent : ndarray, shape (n,), or None
            When each command really went, s; the stamps of commands and of bare arrays. None
            for when they were due.

        Raises
        ------
        RigError
            If it returned a channel that its layout does not have, another number of samples
            than the block has commands, or stamps of a clock that was set meanwhile: no record
            could hold them together with those before.
        """
        stamps = block.time if sent is None else sent
        new = self._named(block, reply, stamps)
        for spec in self._specs.values():
            if spec.name in new or not spec.commanded:
                continue
            if spec.axis is not None and spec.quantity is not None:
                values = block.of(spec.axis, spec.quantity)
                new[spec.name] = Samples(time=stamps, values=values)
        for name, samples in new.items():
            self._parts[name].append(samples)
        return MappingProxyType(new)

    def record(
        self, *, fs: float, band: tuple[float, float] | None, report: RunReport | None = None
    ) -> Record:
        """Return all that was collected, its stamps put right as the rig's report says.

        What a reader mends in a file is mended here: a sample that is no number is a gap, and said.

        Raises
        ------
        RigError
            If a channel got fewer than two samples, or samples that no record can hold.
        """
        said = RunReport() if report is None else report

        def series(spec: ChannelSpec) -> Series:
            whole = Samples.joined(self._parts[spec.name] or [_EMPTY])
            retime = said.clocks.get(spec.clock)
            time = whole.time if retime is None else retime(whole.time)
            return Series(name=spec.name, time=time, values=whole.values, unit=spec.unit)

        try:
            mended = mend([series(spec) for spec in self._layout.channels])
            made = dict(zip(self._specs, mended.channels, strict=True))

            def channels(role: Role) -> tuple[Channel, ...]:
                return tuple(made[spec.name] for spec in self._layout.of(role))

            return Record(
                inputs=channels("input"),
                outputs=channels("output"),
                fs=fs,
                band=band,
                intersample=self._layout.intersample,
                source=self._layout.source,
                references=channels("reference"),
                auxiliary=channels("auxiliary"),
                findings=(*said.findings, *mended.findings),
                stopping=self.stopping,
            )
        except RecordError as error:
            raise RigError(f"rig {self._name!r} delivered no usable record: {error}") from error

    def _named(self, block: Block, reply: Reply, stamps: FloatArray) -> dict[str, Samples]:
        if reply is None:
            return {}
        if not isinstance(reply, Mapping):
            reply = self._columns(block, reply)
        new: dict[str, Samples] = {}
        for name, given in reply.items():
            if name not in self._specs:
                raise RigError(
                    f"rig {self._name!r} returned channel {name!r}, which its layout does not "
                    f"have; it has {', '.join(self._specs)}"
                )
            if isinstance(given, Samples):
                self._check_clock(name, given, now=float(block.time[-1]))
                new[name] = given
            else:
                new[name] = self._on_clock(name, given, stamps)
        return new

    def _check_clock(self, name: str, samples: Samples, *, now: float) -> None:
        """Refuse samples whose clock was set since those before; single stamps may be damaged."""
        time = samples.time[np.isfinite(samples.time)]
        if not time.size:
            return
        newest, came = self._newest.get(name, (float(np.median(time)), now))
        likely = time[time <= newest + 2.0 * (now - came) + _AHEAD]
        if not likely.size or float(np.max(likely)) < newest - _BACK:
            raise RigError(
                f"the clock of {name!r} was set: a sample at {newest:.6g} s is followed by one at "
                f"{time[0]:.6g} s; {self._name!r} is stopped, and the samples until then are kept"
            )
        self._newest[name] = (max(newest, float(np.max(likely))), now)

    def _columns(self, block: Block, reply: object) -> dict[str, FloatArray]:
        """Columns of a bare array, by the names of the outputs."""
        outputs = self._layout.of("output")
        try:
            values = np.asarray(reply, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise RigError(
                f"rig {self._name!r} returned {type(reply).__name__} from play; return samples by "
                "channel name, or an array with a column for each output"
            ) from error
        if values.ndim == 1:
            values = values[:, None]
        if values.shape != (len(block), len(outputs)):
            raise RigError(
                f"rig {self._name!r} returned an array of shape {values.shape} for a block of "
                f"{len(block)} commands with {len(outputs)} outputs; return one row for each "
                "command and one column for each output"
            )
        return {spec.name: values[:, k] for k, spec in enumerate(outputs)}

    def _on_clock(self, name: str, given: object, stamps: FloatArray) -> Samples:
        try:
            values = np.asarray(given, dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise RigError(
                f"channel {name!r} of rig {self._name!r} is not numeric: {error}"
            ) from error
        if values.shape != stamps.shape:
            raise RigError(
                f"channel {name!r} of rig {self._name!r} has shape {values.shape} for a block of "
                f"{stamps.size} commands; return one sample for each, or Samples with their times"
            )
        return Samples(time=stamps, values=values)
