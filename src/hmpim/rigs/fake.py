"""A rig for your own tests: it gives the answers that you set, and records the calls made to it."""

from collections.abc import Callable
from dataclasses import dataclass, field

from hmpim.rigs.block import Block, Reply
from hmpim.rigs.protocol import LimitsOfAxes, Stimuli

__all__ = ["FakeRig"]


@dataclass(kw_only=True)
class FakeRig:
    """A rig that answers each block with ``answer(block)`` and records each call in `told`.

    Examples
    --------
    >>> from hmpim.experiment import run
    >>> from hmpim.stimulus import Ramp, Stimulus
    >>> rig = FakeRig(answer=lambda block: 2.0 * block.position)
    >>> record = run(rig, Stimulus(waveform=Ramp(duration=1.0), fs=4.0))
    >>> record.outputs[0].values.tolist(), rig.told[:3], rig.told[-2:]
    ([0.0, 0.5, 1.0, 1.5], ['enter', 'prepare', 'play'], ['stop', 'exit'])
    """

    answer: Callable[[Block], Reply] = lambda block: block.position
    name: str = "fake"
    axes: tuple[str, ...] = ()
    limits: LimitsOfAxes = None
    moves: bool = False
    told: list[str] = field(default_factory=list)

    def __enter__(self) -> "FakeRig":
        self.told.append("enter")
        return self

    def __exit__(self, *_: object) -> None:
        self.told.append("exit")

    def prepare(self, _stimulus: Stimuli, /) -> None:
        """Note it."""
        self.told.append("prepare")

    def play(self, block: Block, /) -> Reply:
        """Note it, and answer."""
        self.told.append("play")
        return self.answer(block)

    def stop(self) -> None:
        """Note it."""
        self.told.append("stop")
