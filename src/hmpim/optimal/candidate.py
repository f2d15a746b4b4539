"""A stimulus on trial: its gain solved so that it buys the accuracy, then what that costs."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hmpim.identify.judgement.reach import lines_of
from hmpim.identify.section_iv.spectrum import excited_band
from hmpim.optimal.fisher import fisher_information, standard_deviations
from hmpim.optimal.wish import PARAMETERS, Family, Gentle, Wish
from hmpim.stimulus import Stimulus, Waveform
from hmpim.stimulus.motion import Scalable

__all__ = [
    "COVERED",
    "FULL",
    "Candidate",
    "cost_of",
    "gentleness",
    "gentler",
    "has_lines",
    "needed_gain",
    "shortfall",
    "try_out",
]

FloatArray = NDArray[np.float64]

FULL = 1.0 + 1e-9
"""Share of the limits up to which they are kept."""

COVERED = 1.005
"""Shortfall up to which a band counts as reached: its end is seen in bins."""

_LINES = 3
"""Gain and phase at so many lines are two numbers more than the four figures of the model."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Candidate:
    """A stimulus that buys exactly the accuracy wanted, limits or not.

    Parameters
    ----------
    family : {'sweep', 'exponential', 'multisine'}
        Its kind.
    stimulus : Stimulus
        Sampled, without limits.
    use : float
        Largest share of a limit that it takes; beyond 1 it must not be played.
    value : float
        What is to be small: °/s² for instance, or s; see `gentleness`.
    shape : ndarray
        Where the family's search may go on from.
    """

    family: Family
    stimulus: Stimulus
    use: float
    value: float
    shape: FloatArray


def needed_gain(position: FloatArray, wish: Wish, *, finer: int = 1) -> float:
    """Factor on a stimulus at which the least accurate parameter just is as accurate as wanted.

    Standard deviations are inverse to the size of the stimulus, that of the bias aside, so
    the factor is exact.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Samples.
    wish : Wish
        Accuracy, noise and the models it is wanted of.
    finer : int
        How much finer the range of models is looked at.

    Returns
    -------
    float
        Infinite if the stimulus does not distinguish the parameters.
    """
    worst = 0.0
    for model in wish.models(finer=finer):
        information = fisher_information(
            position, model=model, noise_std=wish.noise_std, fs=wish.fs
        )
        std = standard_deviations(information)[: len(PARAMETERS)]
        worst = max(worst, float(np.max(std / wish.wanted(model))))
    return worst


def shortfall(position: FloatArray, wish: Wish) -> float:
    """How far the band that a stimulus excites ends below what the wish must reach, 1 or more.

    It is the band that `hmpim.identify` sees in the samples alone: a sweep whose amplitude
    falls steeply excites less than it sweeps, and a figure beyond is doubted.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Samples.
    wish : Wish
        What is wanted.

    Examples
    --------
    >>> from hmpim.optimal.wish import Accuracy, ModelRange, RoughModel
    >>> from hmpim.stimulus import Limits, Sweep
    >>> wish = Wish(accuracy=Accuracy(), model_range=ModelRange(), noise_std=0.1, fs=200.0,
    ...             model=RoughModel(natural_frequency=10, damping_ratio=0.4), limits=Limits(),
    ...             gentle="peak_acceleration", duration=10.0)
    >>> time = np.arange(2000) / 200
    >>> for n in (1.0, 1.9):
    ...     sweep = Sweep(band=(0.65, 11.8), duration=10.0, extinction=n)
    ...     print(round(shortfall(sweep.motion(time).position, wish), 2))
    1.0
    1.34
    """
    return max(1.0, wish.reach / excited_band(position, wish.fs)[1])


def has_lines(position: FloatArray) -> bool:
    """Whether a stimulus excites enough frequencies for the model, as `hmpim.identify` sees them.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Samples. Of a few periods of the unit only, what is excited is hardly more than one line.

    Examples
    --------
    >>> time = np.arange(400) / 200
    >>> has_lines(np.sin(2 * np.pi * 5 * time)), has_lines(np.sin(20 * time**2))
    (False, True)
    """
    return lines_of(position).count >= _LINES


def gentleness(stimulus: Stimulus, gentle: Gentle) -> float:
    """Return what is to be small.

    Parameters
    ----------
    stimulus : Stimulus
        Any.
    gentle : {'peak_acceleration', 'rms_acceleration', 'travel', 'duration'}
        Which: the true peak; the root mean square over the record; the distance moved in
        all, to and fro; the length of the record with leads and tail.

    Returns
    -------
    float
        In the stimulus's unit per s², the same, the unit itself, and s.

    Examples
    --------
    >>> from hmpim.stimulus import Sine
    >>> once = Stimulus(waveform=Sine(frequency=1.0, duration=1.0), fs=400.0)
    >>> round(gentleness(once, "travel"), 3), gentleness(once, "duration")
    (4.0, 1.0)
    """
    if gentle == "peak_acceleration":
        return stimulus.peaks.acceleration
    if gentle == "rms_acceleration":
        return float(np.sqrt(np.mean(stimulus.acceleration**2)))
    if gentle == "travel":
        return float(np.abs(stimulus.velocity).sum() / stimulus.fs)
    return stimulus.samples / stimulus.fs


def gentler(one: Candidate | None, other: Candidate | None) -> Candidate | None:
    """Return the gentler one inside the limits, else the one that is less beyond them.

    Parameters
    ----------
    one, other : Candidate or None
        None for none.

    Examples
    --------
    >>> gentler(None, None) is None
    True
    """
    both = [c for c in (one, other) if c is not None]
    if not both:
        return None
    return min(both, key=lambda c: (c.use > FULL, c.value if c.use <= FULL else c.use))


def try_out(
    waveform: Waveform,
    wish: Wish,
    *,
    family: Family,
    total: float,
    shape: FloatArray,
    finer: int = 1,
) -> Candidate | None:
    """Solve a waveform's gain for the accuracy and see what it costs.

    Parameters
    ----------
    waveform : Waveform
        At rest at both ends, of any size.
    wish : Wish
        What is wanted.
    family : str
        Its kind.
    total : float
        Length of the record in s, no shorter than the waveform.
    shape : ndarray
        Where the family's search may go on from.
    finer : int
        As in `needed_gain`.

    Returns
    -------
    Candidate or None
        None if no gain will do, or the band ends below what must be told.
    """
    sized = _sized(waveform, wish, total=total, finer=finer)
    if sized is None or not isinstance(waveform, Scalable):
        return None
    first, gain = sized
    if shortfall(first.position, wish) > COVERED:
        return None
    stimulus = replace(first, waveform=waveform.scaled(gain))
    return Candidate(
        family=family,
        stimulus=stimulus,
        use=wish.limits.use(stimulus.peaks),
        value=gentleness(stimulus, wish.gentle),
        shape=shape,
    )


def cost_of(waveform: Waveform, wish: Wish, *, total: float) -> tuple[float, float, float] | None:
    """Share of the limits, value and shortfall that `try_out` would find, at less expense.

    Both grow with the gain, the duration aside, so that the stimulus of gain 1 tells them.

    Parameters
    ----------
    waveform, wish, total
        As in `try_out`.

    Returns
    -------
    tuple of float, or None
        Largest share of a limit; what is to be small; `shortfall`. None if no gain will do.
    """
    sized = _sized(waveform, wish, total=total, finer=1)
    if sized is None:
        return None
    first, gain = sized
    value = gentleness(first, wish.gentle)
    use = gain * wish.limits.use(first.peaks)
    short = shortfall(first.position, wish)
    return use, value if wish.gentle == "duration" else gain * value, short


def _sized(
    waveform: Waveform, wish: Wish, *, total: float, finer: int
) -> tuple[Stimulus, float] | None:
    """The stimulus as it stands, and the gain at which it is as accurate as wanted."""
    if not isinstance(waveform, Scalable):
        return None
    tail = max(total - waveform.duration, 0.0)
    first = Stimulus(waveform=waveform, fs=wish.fs, unit=wish.limits.unit, tail=tail)
    gain = needed_gain(first.position, wish, finer=finer)
    return (first, gain) if math.isfinite(gain) and gain > 0.0 else None
