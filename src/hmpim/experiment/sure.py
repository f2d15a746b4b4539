"""Whether enough is known to end a run: looks at the estimate so far, while samples come.

Fixed-width intervals at a random time (Y. S. Chow and H. Robbins, Ann. Math. Stat. 36, 1965;
R. A. Khan, Ann. Math. Stat. 40, 1969): sampling ends at the first look at which the estimated
standard deviation is as small as wanted. See docs/live.md for what has to be added to that for
a sweep.
"""

import threading
from collections.abc import Mapping
from dataclasses import dataclass

from hmpim.errors import ArgumentError, HmpimError, LimitsError
from hmpim.experiment.collect import Played
from hmpim.experiment.paired import Paired
from hmpim.experiment.priority import ordinary
from hmpim.experiment.until import Until
from hmpim.identify import LiveEstimator
from hmpim.identify.statistics import Look
from hmpim.record import Intersample
from hmpim.rigs import ChannelSpec, Layout, Samples
from hmpim.stimulus import Limits, Stimulus, left_early, passes_band_at

__all__ = ["Leave", "Sure", "begun_estimate", "pair_of"]

_FARTHEST = 2.0  # s of commands that are played at most while a look is taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Leave:
    """How a run ends: what is played instead, and how often was looked.

    Parameters
    ----------
    stimuli : mapping of axis to Stimulus
        The same as played so far, and then on to rest.
    after : int
        Commands that are still the old ones.
    looks : int
        At the estimate, so far.
    look : Look
        The last one.
    """

    stimuli: Mapping[str, Stimulus]
    after: int
    looks: int
    look: Look


def pair_of(until: Until, layout: Layout) -> tuple[ChannelSpec, ChannelSpec]:
    """Input and output that a rule is about.

    Parameters
    ----------
    until : Until
        The rule.
    layout : Layout
        What is recorded.

    Raises
    ------
    ArgumentError
        If there are several and none is named, or the name is not there.

    Examples
    --------
    >>> layout = Layout(
    ...     channels=(ChannelSpec(name="u", role="input"), ChannelSpec(name="y", role="output"))
    ... )
    >>> [spec.name for spec in pair_of(Until(delay=1e-3), layout)]
    ['u', 'y']
    """
    inputs, outputs = layout.of("input"), layout.of("output")
    known = ", ".join(repr(spec.name) for spec in layout.channels)
    if until.pair is None:
        if len(inputs) > 1 or len(outputs) > 1:
            raise ArgumentError(
                f"the run has {len(inputs)} inputs and {len(outputs)} outputs; say which pair "
                f"--until refers to, output first; the channels are {known}"
            )
        return inputs[0], outputs[0]
    by_name = {spec.name: spec for spec in layout.channels}
    for name in until.pair:
        if name not in by_name:
            raise ArgumentError(f"--until refers to {name!r}, but the channels are {known}")
    output, source = until.pair
    return by_name[source], by_name[output]


def begun_estimate(stimulus: Stimulus, intersample: Intersample | None) -> LiveEstimator:
    """Return the estimate of a run that begins.

    Parameters
    ----------
    stimulus : Stimulus
        What is played.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'} or None
        What the input does between its samples; None where it is measured, and so smooth.
    """
    return LiveEstimator(
        stimulus, intersample="bandlimited" if intersample in (None, "sampled") else intersample
    )


class Sure:
    """Looks on while a run is played, and says how to leave it as soon as enough is known.

    Parameters
    ----------
    until : Until
        What must be known.
    stimuli : mapping of axis to Stimulus
        What is played.
    limits : mapping of axis to Limits or None
        To be kept on the way to rest.
    layout : Layout
        What is recorded.
    ahead : float
        Seconds of commands that are played while a look is taken; 0 where the run waits for it.
    """

    def __init__(
        self,
        until: Until,
        stimuli: Mapping[str, Stimulus],
        limits: Mapping[str, Limits | None],
        layout: Layout,
        *,
        ahead: float = 0.0,
    ) -> None:
        source, output = pair_of(until, layout)
        if len(stimuli) > 1:
            raise ArgumentError(
                f"--until is for one axis at a time, but {', '.join(stimuli)} move together; run "
                "them one after another"
            )
        self._until, self._stimuli, self._limits = until, dict(stimuli), dict(limits)
        self._stimulus = next(iter(stimuli.values()))
        if self._stimulus.band is None:
            raise ArgumentError(
                "the stimulus has no band, so it is not known when the whole band was covered; "
                "use one that has a band, such as design(kind='repeated')"
            )
        self._pair = Paired((source.name, output.name), fs=self._stimulus.fs)
        mode = layout.intersample if source.role == "input" else None  # a measured one is smooth
        self._live = begun_estimate(self._stimulus, mode)
        self._passed = passes_band_at(self._stimulus)
        self._ahead = ahead
        self._next = 0.0
        self._met = self._looks = 0
        self._waiting: list[Mapping[str, Samples]] = []
        self._stop = 0
        self._busy: threading.Thread | None = None
        self._found: Leave | None = None
        self._failed: HmpimError | None = None

    def __call__(self, played: Played) -> Leave | None:
        """Take a block; return how to leave the run once enough is known.

        Raises
        ------
        HmpimError
            If the samples cannot be read.
        """
        now = float(played.block.time[-1])
        self._stop = played.block.stop
        self._waiting.append(played.samples)
        if self._failed is not None:
            raise self._failed
        if self._found is not None:
            found, self._found = self._found, None
            late = (played.block.stop - found.after) / self._stimulus.fs
            if late <= 0.0:
                return found
            self._met = self._until.looks - 1  # it came too late; the next look decides
            self._ahead = min(2.0 * (self._ahead + late), _FARTHEST)
        if now < self._next or (self._busy is not None and self._busy.is_alive()):
            return None
        self._next = max(self._next + self._until.every, now)
        waiting, self._waiting = self._waiting, []
        if self._ahead == 0.0:
            return self._looked(waiting)
        # Not a daemon: a look that is broken off within compiled code takes the process with it.
        self._busy = threading.Thread(target=self._beside, args=(waiting,), name="look")
        self._busy.start()
        return None

    def _beside(self, waiting: list[Mapping[str, Samples]]) -> None:
        """Look beside the run, which goes on."""
        ordinary()
        try:
            self._found = self._looked(waiting)
        except HmpimError as error:
            self._failed = error

    def _looked(self, waiting: list[Mapping[str, Samples]]) -> Leave | None:
        for samples in waiting:
            self._pair.add(samples)
        u, y = self._pair.fresh()
        self._live.read(u, y)
        time = self._live.statistics.samples / self._stimulus.fs
        if not u.size or time < self._passed:
            return None
        look = self._live.look()
        self._looks += 1
        self._met = self._met + 1 if look is not None and self._is_enough(look) else 0
        if look is None or self._met < self._until.looks:
            return None
        after = self._stop + round(self._ahead * self._stimulus.fs)
        try:
            stimuli = {
                axis: left_early(one, after=after, limits=self._limits[axis], whose=axis or "it")
                for axis, one in self._stimuli.items()
            }
        except LimitsError:
            return None  # later, perhaps; or it is played to its end
        if all(short is self._stimuli[axis] for axis, short in stimuli.items()):
            return None  # it ends by itself as soon
        return Leave(stimuli=stimuli, after=after, looks=self._looks, look=look)

    def _is_enough(self, look: Look) -> bool:
        """Whether the rule holds, and the answer to the whole band is in."""
        delay = look.parameters.delay
        answered = 0.0 if delay is None else max(delay.value, 0.0)
        return (
            self._pair.whole
            and look.time >= self._passed + answered
            and self._until.is_met(look.parameters)
        )
