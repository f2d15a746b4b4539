"""Software under test: a Python function is fed the stimulus, all at once or by the sample."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from hmpim.errors import ArgumentError, RigError
from hmpim.record import Channel, Intersample, Record
from hmpim.rigs.sensor import Quantity
from hmpim.stimulus import Limits, Stimulus
from hmpim.units import check_unit, rate_unit

__all__ = ["FunctionRig"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FunctionRig:
    """An algorithm as the unit under test.

    Parameters
    ----------
    function : callable
        Takes what `mode` says and returns as much.
    mode : {'array', 'sample'}
        'array': called once with all samples, shape (n,). 'sample': called with one float
        after the other, in order, as an algorithm with a memory is in service.
    reset : callable or None
        Called before each run, to bring an algorithm with a memory back to its start.
    measures : {'position', 'velocity', 'acceleration'}
        Which quantity of the motion is fed.
    output_unit : str or None
        None takes the input's.
    intersample : {'zoh', 'foh', 'bandlimited'} or None
        What the record says of the input between samples. An algorithm sees samples only, so
        that None, the default, leaves it open.
    name, input_name, output_name : str
        Name of the rig, and of its record's channels.
    limits : Limits or None
        What the algorithm is made for; None for anything.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp, Stimulus
    >>> doubling = FunctionRig(function=lambda u: 2 * u, mode="sample")
    >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=4.0)
    >>> doubling.play(ramp, rng=np.random.default_rng(0)).outputs[0].values.tolist()
    [0.0, 0.5, 1.0, 1.5]
    """

    function: Callable[[Any], Any]
    mode: Literal["array", "sample"] = "array"
    reset: Callable[[], object] | None = None
    measures: Quantity = "position"
    output_unit: str | None = None
    intersample: Intersample | None = None
    name: str = "function"
    input_name: str = "u"
    output_name: str = "y"
    limits: Limits | None = None

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise ArgumentError(f"function = {self.function!r} cannot be called; give a function")
        if self.mode not in ("array", "sample"):
            raise ArgumentError(f"mode = {self.mode!r} is not known; use 'array' or 'sample'")
        if self.measures not in ("position", "velocity", "acceleration"):
            raise ArgumentError(
                f"measures = {self.measures!r} is not known; "
                "use 'position', 'velocity' or 'acceleration'"
            )
        if self.output_unit is not None:
            check_unit(self.output_unit)

    def play(self, stimulus: Stimulus, *, rng: np.random.Generator) -> Record:
        """Feed the stimulus's samples to the function and record what it returns.

        Raises
        ------
        RigError
            If the function raises, or returns something else than one finite number for each
            sample; the message says at which sample.

        Examples
        --------
        >>> from hmpim.stimulus import Ramp, Stimulus
        >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=4.0)
        >>> record = FunctionRig(function=np.square).play(ramp, rng=np.random.default_rng(0))
        >>> record.outputs[0].values.tolist()
        [0.0, 0.0625, 0.25, 0.5625]
        """
        del rng  # an algorithm brings its own randomness, if any
        fed = np.array(getattr(stimulus, self.measures), dtype=np.float64)
        if self.reset is not None:
            self.reset()
        values = self._whole(fed) if self.mode == "array" else self._one_by_one(fed)
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise RigError(
                f"{self.name!r} returned {values[bad[0]]} at sample {bad[0]}, for the input "
                f"{fed[bad[0]]:.6g} ({bad.size} such in all); make it return finite numbers"
            )
        order = ("position", "velocity", "acceleration").index(self.measures)
        in_unit = rate_unit(stimulus.unit, order)
        out_unit = in_unit if self.output_unit is None else self.output_unit
        return Record(
            inputs=(Channel(name=self.input_name, time=stimulus.time, values=fed, unit=in_unit),),
            outputs=(
                Channel(name=self.output_name, time=stimulus.time, values=values, unit=out_unit),
            ),
            fs=stimulus.fs,
            band=stimulus.band,
            intersample=self.intersample,
            source=f"function {self.name}",
        )

    def _whole(self, fed: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
        try:
            values = np.asarray(self.function(fed.copy()), dtype=np.float64)
        except Exception as error:  # whatever the software under test raises
            raise RigError(f"{self.name!r} failed: {type(error).__name__}: {error}") from error
        if values.shape != fed.shape:
            raise RigError(
                f"{self.name!r} returned shape {values.shape} for an input of shape {fed.shape}; "
                "make it return one number for each sample, or use mode='sample'"
            )
        return values

    def _one_by_one(self, fed: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
        values = np.empty(fed.size)
        for k, sample in enumerate(fed.tolist()):
            try:
                values[k] = self.function(sample)
            except Exception as error:  # whatever the software under test raises
                raise RigError(
                    f"{self.name!r} failed at sample {k}, for the input {sample:.6g}: "
                    f"{type(error).__name__}: {error}"
                ) from error
        return values
