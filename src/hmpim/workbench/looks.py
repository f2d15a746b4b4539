"""The estimate so far of a run that goes on: `hmpim.LiveEstimator`, fed with what comes in."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import HmpimError
from hmpim.experiment.paired import Paired
from hmpim.experiment.sure import begun_estimate
from hmpim.identify import LiveEstimator, Look
from hmpim.record import Intersample
from hmpim.rigs import Samples
from hmpim.stimulus import Stimulus, passes_band_at
from hmpim.workbench.live import Live

__all__ = ["Looks", "begun_looks", "looked"]

Do = Callable[..., Coroutine[Any, Any, tuple[LiveEstimator, Look | None]]]


class Looks:
    """What is known so far of one axis, for every window that looks on.

    Parameters
    ----------
    stimulus : Stimulus
        What is played; it has a band.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'} or None
        What the input does between its samples; None where it is measured.
    """

    def __init__(self, stimulus: Stimulus, intersample: Intersample | None) -> None:
        self.estimator = begun_estimate(stimulus, intersample)
        self.passed_at = passes_band_at(stimulus)  # s
        self.look: Look | None = None
        self.closing: list[tuple[float, float]] = []
        """Time in s and half the 95 % interval of the natural frequency in % of it, where a look
        claims one."""
        self._pair = Paired(("input", "output"), fs=stimulus.fs)
        self._taken: dict[str, int] = {}
        self._busy = False

    @property
    def passed(self) -> bool:
        """Whether the whole band has been played."""
        return self.look is not None and self.look.time >= self.passed_at

    async def follow(self, live: Live, axis: str, do: Do) -> None:
        """Read what has come in since, and look; at once if another window has it done just now.

        Parameters
        ----------
        live : Live
            Where the samples come in.
        axis : str
            Whose.
        do : callable
            Does `looked` elsewhere.
        """
        if self._busy:
            return
        self._busy = True
        try:
            u, y = await asyncio.to_thread(self._fresh, live, axis)
            if not u.size:
                return
            self.estimator, look = await do(looked, self.estimator, u, y)
            if look is not None:
                self._note(look)
        finally:
            self._busy = False

    def _fresh(self, live: Live, axis: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        parts = {}
        for role, channel in live.of(axis).items():
            first, end = self._taken.get(role, 0), channel.size
            self._taken[role] = end
            parts[role] = Samples(
                time=channel.time[first:end].copy(), values=channel.values[first:end].copy()
            )
        self._pair.add(parts)
        return self._pair.fresh()

    def _note(self, look: Look) -> None:
        self.look = look
        found = look.parameters.natural_frequency
        if found is None or found.ci95 is None or found.verdict != "ok":
            return
        low, high = found.ci95
        if low is not None and high is not None:
            self.closing.append((look.time, 50.0 * (high - low) / found.value))


def begun_looks(stimulus: Stimulus, intersample: Intersample | None) -> Looks | None:
    """Return what looks on while a stimulus is played; None where no estimate so far can be made.

    Parameters
    ----------
    stimulus, intersample
        As `Looks` takes them.

    Examples
    --------
    >>> from hmpim.stimulus import Chirp
    >>> chirp = Chirp(band=(0.5, 20.0), duration=3.0)
    >>> begun_looks(Stimulus(waveform=chirp, fs=200.0), "zoh").passed_at
    3.0
    """
    if stimulus.band is None:
        return None
    try:
        return Looks(stimulus, intersample)
    except HmpimError:
        return None


def looked(
    estimator: LiveEstimator, u: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[LiveEstimator, Look | None]:
    """Read the samples that follow, look, and return the estimator as it is then.

    Parameters
    ----------
    estimator : LiveEstimator
        As it was.
    u, y : ndarray, shape (n,)
        Samples after the last ones read.
    """
    look = estimator.update(u, y)
    return estimator, look
