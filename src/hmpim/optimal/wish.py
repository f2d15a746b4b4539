"""What is wanted of a test, and what is roughly known of the unit before it."""

import itertools
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import check_size, checked, size_of
from hmpim.errors import ArgumentError
from hmpim.model import Model
from hmpim.stimulus import Limits

__all__ = [
    "PARAMETERS",
    "Accuracy",
    "Family",
    "Gentle",
    "ModelRange",
    "RoughModel",
    "Step",
    "Wish",
]

Gentle = Literal["peak_acceleration", "rms_acceleration", "travel", "duration"]
"""What is kept small: peak or r.m.s. acceleration, distance moved in all, or time."""

Family = Literal["sweep", "exponential", "multisine"]
"""Kinds of stimulus that are tried."""

Step = Callable[[], None]
"""Called at each trial of a search, so that who waits can see it move."""

PARAMETERS = ("delay", "natural_frequency", "damping_ratio", "scale_factor")
"""Parameters an accuracy may be asked of, in the order used throughout."""

Z95 = 1.959963984540054
"""97.5 % point of the normal distribution."""


_TOLD = {
    "delay": 0.1,
    "natural_frequency": 0.05,
    "damping_ratio": 0.12,
    "scale_factor": 0.1,
}
"""Largest standard deviation of what is not asked for, as a share of its value: a third of the
30 % from which `hmpim.identify` doubts a figure; less for what says where the band must end."""

_REACH = 0.95
"""End of the band over the natural frequency, the edge that is read off a spectrum being soft."""

_PAST = 1.18
"""Natural frequency over the end of the band; `hmpim.identify` doubts one beyond 1.2."""

_SETTLED = 2.2
"""Record over delay and settling time; `hmpim.identify` doubts what is read off less than 2."""

_MOST_SNR = 1e15
"""Largest output over the noise: what double precision tells apart."""

FloatArray = NDArray[np.float64]


def _positive(name: str, value: float, unit: str = "", *, added: bool = False) -> None:
    real = isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)
    if not real or not (math.isfinite(value) and value > 0):
        shown = f"{value!r} {unit}".rstrip()
        raise ArgumentError(f"{name} = {shown} must be a positive, finite number")
    check_size(name, value, unit, added=added)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class RoughModel:
    """What is roughly known of the unit: delay, second-order dynamics, scale factor.

    Parameters
    ----------
    delay : float
        Pure delay in s, 0 or more.
    natural_frequency : float
        Hz.
    damping_ratio : float
        Damping ratio ζ.
    scale_factor : float
        Output unit per stimulus unit.

    Raises
    ------
    ArgumentError
        If a value is outside what it may be.

    Examples
    --------
    >>> rough = RoughModel(delay=0.15, natural_frequency=10, damping_ratio=0.4)
    >>> round(rough.settling, 4)
    0.0398
    """

    delay: float = 0.0
    natural_frequency: float
    damping_ratio: float
    scale_factor: float = 1.0

    def __post_init__(self) -> None:
        if self.delay != 0:
            _positive("delay", self.delay, "s", added=True)
        _positive("natural_frequency", self.natural_frequency, "Hz")
        _positive("damping_ratio", self.damping_ratio)
        _positive("size of scale_factor", abs(self.scale_factor))

    @property
    def omega(self) -> float:
        """Natural frequency in rad/s."""
        return 2.0 * math.pi * self.natural_frequency

    @property
    def settling(self) -> float:
        """Slowest time constant, in s."""
        beyond = math.sqrt(max(self.damping_ratio**2 - 1.0, 0.0))
        if beyond > 0.0:
            return (self.damping_ratio + beyond) / self.omega  # without cancellation
        return 1.0 / (self.omega * self.damping_ratio)

    @classmethod
    def of(cls, model: Model) -> "RoughModel":
        """Take over an identified model of second order.

        Raises
        ------
        ArgumentError
            If its dynamics are of another kind.

        Examples
        --------
        >>> model = Model(delay=0.1, scale_factor=2.0, denominator=(0.25, 0.5, 1.0))
        >>> round(RoughModel.of(model).damping_ratio, 9)
        0.5
        """
        if len(model.denominator) != 3 or len(model.numerator) != 1:
            raise ArgumentError(
                f"a model of order {len(model.denominator) - 1} cannot be taken over; "
                "the gentlest stimulus is found for second-order dynamics without a zero"
            )
        c2, c1, c0 = model.denominator
        omega = math.sqrt(c0 / c2)
        return cls(
            delay=model.delay,
            natural_frequency=omega / (2.0 * math.pi),
            damping_ratio=0.5 * omega * c1 / c0,
            scale_factor=model.scale_factor,
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Accuracy:
    """Errors that are wanted at 95 %: the half width of each interval.

    None asks for no more than that the record tells the figure at all (`Wish.wanted`).

    Parameters
    ----------
    delay : float or None
        In s.
    natural_frequency : float or None
        As a share of itself.
    scale_factor : float or None
        As a share of itself.
    damping_ratio : float or None
        Absolute.

    Raises
    ------
    ArgumentError
        If one is not positive, or none is given.

    Examples
    --------
    The accuracy that the paper claims (Fig. 17):

    >>> Accuracy().delay
    0.005
    """

    delay: float | None = 0.005
    natural_frequency: float | None = 0.017
    scale_factor: float | None = 0.02
    damping_ratio: float | None = 0.04

    def __post_init__(self) -> None:
        given = [(name, getattr(self, name)) for name in PARAMETERS]
        for name, value in given:
            if value is not None:
                _positive(f"accuracy of {name}", value)
        if all(value is None for _, value in given):
            raise ArgumentError("no accuracy is given; give one of " + ", ".join(PARAMETERS))

    def std(self, model: RoughModel) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Wanted standard deviations in the order of `PARAMETERS`, infinite where any will do.

        Examples
        --------
        >>> rough = RoughModel(natural_frequency=10, damping_ratio=0.4)
        >>> Accuracy(natural_frequency=0.0196).std(rough).round(3).tolist()
        [0.003, 0.1, 0.02, 0.01]
        """
        shares = {
            "natural_frequency": model.natural_frequency,
            "scale_factor": abs(model.scale_factor),
        }
        wanted = [
            math.inf if (asked := getattr(self, name)) is None else asked * shares.get(name, 1.0)
            for name in PARAMETERS
        ]
        return np.array(wanted) / Z95

    def times(self, factor: float) -> "Accuracy":
        """Return all errors times `factor`.

        Examples
        --------
        >>> Accuracy().times(2.0).delay
        0.01
        """
        return Accuracy(
            **{
                name: None if (asked := getattr(self, name)) is None else asked * factor
                for name in PARAMETERS
            }
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class ModelRange:
    """Where the unit's parameters may lie; None where the rough model is good enough.

    Parameters
    ----------
    delay, natural_frequency, damping_ratio : tuple of float, or None
        Lowest and highest, in s, Hz and without unit.

    Raises
    ------
    ArgumentError
        If a range does not rise.

    Examples
    --------
    >>> rough = RoughModel(natural_frequency=10, damping_ratio=0.4)
    >>> [round(m.natural_frequency, 1) for m in ModelRange(natural_frequency=(7, 14)).models(rough)]
    [7.0, 8.3, 9.9, 11.8, 14.0]
    """

    delay: tuple[float, float] | None = None
    natural_frequency: tuple[float, float] | None = None
    damping_ratio: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        for name in ("delay", "natural_frequency", "damping_ratio"):
            given = getattr(self, name)
            if given is None:
                continue
            low, high = given
            if not (0 <= low < high < math.inf and (low > 0 or name == "delay")):
                raise ArgumentError(
                    f"range of {name} = ({low!r}, {high!r}) does not rise from a positive number; "
                    "give the lower one first"
                )
            for end in given:
                check_size(f"range of {name}", end, added=name == "delay")

    def models(self, around: RoughModel, *, finer: int = 1) -> tuple[RoughModel, ...]:
        """Models that stand for the range, its ends included, `finer` times as many each way."""
        delays = _between(self.delay, around.delay, 1, geometric=False)
        naturals = _between(self.natural_frequency, around.natural_frequency, 4 * finer)
        dampings = _between(self.damping_ratio, around.damping_ratio, 2 * finer)
        return tuple(
            RoughModel(
                delay=delay,
                natural_frequency=natural,
                damping_ratio=damping,
                scale_factor=around.scale_factor,
            )
            for delay, natural, damping in itertools.product(delays, naturals, dampings)
        )


def _between(
    given: tuple[float, float] | None, otherwise: float, steps: int, *, geometric: bool = True
) -> list[float]:
    if given is None:
        return [otherwise]
    spaced = np.geomspace if geometric else np.linspace
    return [float(v) for v in spaced(given[0], given[1], steps + 1)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """All that a search for the gentlest stimulus goes by.

    Parameters
    ----------
    accuracy : Accuracy
        What is wanted.
    model : RoughModel
        What is roughly known.
    model_range : ModelRange
        How roughly.
    noise_std : float
        Standard deviation of the white measurement noise, in the output's unit.
    limits : Limits
        What the axis may do.
    fs : float
        Sampling rate, Hz.
    gentle : {'peak_acceleration', 'rms_acceleration', 'travel', 'duration'}
        What is kept small.
    duration : float
        Length of the record in s, the longest one where the duration is kept small.

    Raises
    ------
    ArgumentError
        If a value is outside what it may be.
    """

    accuracy: Accuracy
    model: RoughModel
    model_range: ModelRange
    noise_std: float
    limits: Limits
    fs: float
    gentle: Gentle
    duration: float

    def __post_init__(self) -> None:
        _positive("noise_std", self.noise_std)
        _positive("fs", self.fs, "Hz")
        _positive("duration", self.duration, "s")
        size_of(self.duration, self.fs)
        if self.gentle not in ("peak_acceleration", "rms_acceleration", "travel", "duration"):
            raise ArgumentError(
                f"gentle = {self.gentle!r} is not known; use 'peak_acceleration', "
                "'rms_acceleration', 'travel' or 'duration'"
            )
        if self.gentle == "duration" and self.unlimited:
            raise ArgumentError(
                "no limit is finite, so any accuracy takes no time at all; "
                "give a position, velocity or acceleration limit"
            )
        self._check_range()
        self._check_noise()
        highest = max(m.natural_frequency for m in self.models())
        if highest > 0.3 * self.fs:
            raise ArgumentError(
                f"natural_frequency up to {highest:g} Hz cannot be observed at fs = "
                f"{self.fs:g} Hz; "
                f"sample at {math.ceil(highest / 0.3):g} Hz or faster"
            )

    def _check_range(self) -> None:
        """Refuse a rough model outside its own range."""
        for name in ("natural_frequency", "damping_ratio"):
            rough, given = getattr(self.model, name), getattr(self.model_range, name)
            if given is not None and not given[0] <= rough <= given[1]:
                raise ArgumentError(
                    f"{name} = {rough:g} is outside its range, {given[0]:g} to {given[1]:g}; give "
                    "one within it"
                )

    def _check_noise(self) -> None:
        """Refuse noise that double precision does not tell from none."""
        limits, half = self.limits, 0.5 * self.duration
        travel = min(limits.position, limits.velocity * half, limits.acceleration * half**2)
        largest = abs(self.model.scale_factor) * travel
        if math.isfinite(largest) and largest > _MOST_SNR * self.noise_std:
            raise ArgumentError(
                f"noise_std = {self.noise_std:g} is nothing beside an output of up to {largest:g} "
                f"(scale factor {self.model.scale_factor:g}, travel {travel:g}); give the noise "
                "and the scale factor in one unit of the output"
            )

    def models(self, *, finer: int = 1) -> tuple[RoughModel, ...]:
        """Models over the range, the accuracy being wanted of each."""
        return self.model_range.models(self.model, finer=finer)

    def wanted(self, model: RoughModel) -> FloatArray:
        """Return the standard deviations wanted, in the order of `PARAMETERS`, all finite.

        What is not asked for must still be told, or the verdict on the record is doubtful: no
        standard deviation may be beyond `_TOLD` of its figure, or, of a short delay, a sample.
        """
        told = np.array(
            [
                max(_TOLD["delay"] * model.delay, 1.0 / self.fs),
                _TOLD["natural_frequency"] * model.natural_frequency,
                _TOLD["damping_ratio"] * model.damping_ratio,
                _TOLD["scale_factor"] * abs(model.scale_factor),
            ]
        )
        return np.asarray(np.minimum(self.accuracy.std(model), told), dtype=np.float64)

    @property
    def reach(self) -> float:
        """Frequency in Hz at which the band that is seen in a stimulus may end at the soonest.

        Three standard deviations keep the natural frequency inside what the band still tells.
        """
        ends = []
        for model in self.models():
            spread = 3.0 * float(self.wanted(model)[PARAMETERS.index("natural_frequency")])
            ends.append(
                max(_REACH * model.natural_frequency, (model.natural_frequency + spread) / _PAST)
            )
        return max(ends)

    @property
    def shortest(self) -> float:
        """Shortest record in s from which a settled response can be read off."""
        return _SETTLED * max(m.delay + 5.0 * m.settling for m in self.models())

    @property
    def unlimited(self) -> bool:
        """Whether nothing bounds position, velocity or acceleration."""
        limits = self.limits
        return math.isinf(min(limits.position, limits.velocity, limits.acceleration))

    @property
    def tail(self) -> float:
        """Seconds at rest at the end, in which the delayed response is still read.

        The longest delay, and time constants until 1 % is left; where the duration is kept
        small, until 14 % is left, for what follows tells little for the time it takes.
        """
        constants = 2.0 if self.gentle == "duration" else 4.6
        return max(m.delay + constants * m.settling for m in self.models())
