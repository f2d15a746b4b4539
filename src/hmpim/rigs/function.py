"""Software under test: a Python function is fed the stimulus, all at once or by the sample."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import RigError
from hmpim.record import Intersample
from hmpim.rigs.block import Block, Layout, Quantity
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.stimuli import feed_of
from hmpim.stimulus import Limits
from hmpim.units import check_unit

__all__ = ["FunctionRig"]

FloatArray = NDArray[np.float64]


@checked
@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FunctionRig(Simulated):
    """An algorithm as the unit under test.

    Parameters
    ----------
    function : callable
        Called as `mode` states; returns as many numbers as it receives.
    mode : {'array', 'sample'}
        'array': called once with all samples, shape (n,). 'sample': called once per sample
        with a float, in order, as an algorithm with an internal state is in service.
    reset : callable or None
        Called before each run, to reset an algorithm with an internal state.
    measures : {'position', 'velocity', 'acceleration'}
        Which quantity of the motion is fed.
    output_unit : str or None
        None: the input's.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'} or None
        What the record states about the input between samples. None, the default, states
        'sampled' for mode 'sample', and nothing for mode 'array', since the function may look
        ahead.
    name, input_name, output_name : str
        Name of the rig, and of its record's channels.
    limits : Limits or None
        What the algorithm is made for; None for anything.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp, Stimulus
    >>> doubling = FunctionRig(function=lambda u: 2 * u, mode="sample")
    >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=4.0)
    >>> from hmpim.experiment import run
    >>> run(doubling, ramp).outputs[0].values.tolist()
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
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_unit(self.output_unit or "")

    @property
    def axes(self) -> tuple[str, ...]:
        """Empty: any one stimulus is fed."""
        return ()

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Bring an algorithm with a memory back to its start, and say what will be recorded."""
        fed = feed_of(stimulus, measures=self.measures, rig=self.name, name=self.input_name)
        if self.reset is not None:
            self.reset()
        self._playing.state = {"fed": fed.values, "returned": None}
        return fed.layout(
            output=self.output_name,
            unit=fed.unit if self.output_unit is None else self.output_unit,
            intersample=self.intersample or ("sampled" if self.mode == "sample" else None),
            source=f"function {self.name}",
        )

    def play(self, block: Block, /) -> dict[str, FloatArray]:
        """Feed the block's samples to the function and return what it returns.

        Raises
        ------
        RigError
            If the function raises, or returns something else than one finite number for each
            sample; the message says at which sample.

        Examples
        --------
        >>> from hmpim.experiment import run
        >>> from hmpim.stimulus import Ramp, Stimulus
        >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=4.0)
        >>> run(FunctionRig(function=np.square), ramp).outputs[0].values.tolist()
        [0.0, 0.0625, 0.25, 0.5625]
        """
        state = self._playing.current(self.name)
        part = slice(block.start, block.stop)
        if self.mode == "sample":
            return {self.output_name: self._one_by_one(state["fed"][part], first=block.start)}
        if state["returned"] is None:
            state["returned"] = self._whole(state["fed"])
        return {self.output_name: state["returned"][part]}

    def _whole(self, fed: FloatArray) -> FloatArray:
        try:
            returned = np.asarray(self.function(fed.copy()))
            if returned.dtype.kind not in "biuf":  # none of numpy's real types
                returned = np.vectorize(_real, otypes=[float])(returned.astype(object))
        except Exception as error:  # whatever the software under test raises
            raise RigError(f"{self.name!r} failed: {type(error).__name__}: {error}") from error
        if returned.shape != fed.shape:
            raise RigError(
                f"{self.name!r} returned shape {returned.shape} for an input of shape {fed.shape}; "
                "make it return one number for each sample, or use mode='sample'"
            )
        return self._finite(returned.astype(np.float64), fed, first=0)

    def _one_by_one(self, fed: FloatArray, *, first: int) -> FloatArray:
        values = np.empty(fed.size)
        for k, sample in enumerate(fed.tolist()):
            try:
                values[k] = _real(self.function(sample))
            except Exception as error:  # whatever the software under test raises
                raise RigError(
                    f"{self.name!r} failed at sample {first + k}, for the input {sample:.6g}: "
                    f"{type(error).__name__}: {error}"
                ) from error
        return self._finite(values, fed, first=first)

    def _finite(self, values: FloatArray, fed: FloatArray, *, first: int) -> FloatArray:
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise RigError(
                f"{self.name!r} returned {values[bad[0]]} at sample {first + bad[0]}, for the "
                f"input {fed[bad[0]]:.6g} ({bad.size} in all); make it return finite numbers"
            )
        return values


def _real(answer: Any) -> Any:
    """Return the answer; numpy would take None for nan, and drop an imaginary part."""
    if answer is None or isinstance(answer, complex):
        raise TypeError(f"it returned {answer!r}, which is not a real number")
    return answer
