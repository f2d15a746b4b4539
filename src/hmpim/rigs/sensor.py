"""The sensor of Fig. 1, stepped in time.

The chain, from the true motion to the number that is read::

    motion ─► delay ─► dynamics ─► × scale factor, + bias ─► + noise ─► saturation
           ─► data hold ─► quantisation ─► output

Up to the noise all is continuous. The unit takes one reading at each instant of its own clock:
that of the data hold if there is one, else that of the record. Noise is drawn once per reading,
so a held value carries its noise along, and an AR(1) coefficient counts readings. Quantisation
acts on the held value as it would on the reading.
"""

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hmpim.arguments import checked, generator
from hmpim.errors import ArgumentError
from hmpim.record import Intersample
from hmpim.rigs.between import ContinuousInput, between_samples
from hmpim.rigs.block import Block, ChannelSpec, Layout, Quantity
from hmpim.rigs.dynamics import Poles, first_order, respond, second_order
from hmpim.rigs.protocol import Stimuli
from hmpim.rigs.simulated import Playing, Simulated
from hmpim.rigs.stimuli import stimuli_by_axis
from hmpim.stimulus import Limits, Stimulus
from hmpim.units import check_unit, rate_unit

__all__ = ["Sensor"]

FloatArray = NDArray[np.float64]

_GRACE = 1e-9  # of an interval: an instant that falls on an update takes the new value


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor(Simulated):
    """A simulated sensor, hardware and software (Fig. 1).

    Parameters
    ----------
    delay : float
        Pure delay in s; any fraction of a sample.
    hold_period : float or None
        Interval in s at which the output is updated; None for at every sample.
    hold_phase : float
        Time in s of one of the updates.
    natural_frequency, damping_ratio : float or None
        Second-order dynamics ωn²/(s² + 2ζωn s + ωn²); Hz, and no unit.
    time_constant : float or None
        First-order dynamics 1/(1 + sT) in s; not together with the second-order ones.
    scale_factor : float
        Output unit per input unit.
    bias : float
        In the output's unit.
    noise_std : float
        Standard deviation of the noise, whatever its colour, in the output's unit.
    noise_colour : float
        AR(1) coefficient between one reading and the next; 0 is white.
    saturation_low, saturation_high : float or None
        Range of the output, in its unit; None where it is open.
    quantization_step : float or None
        The output is rounded to whole steps of this size, in its unit.
    output_unit : str or None
        None takes the input's.
    measures : {'position', 'velocity', 'acceleration'}
        Which quantity of the motion goes in.
    command : {'continuous', 'zoh', 'foh'}
        What goes in: the motion itself, or its samples, held or joined linearly.
    name, input_name, output_name : str
        Name of the rig, and of its record's channels.
    limits : Limits or None
        Limits of the unit; None for no limits.

    Raises
    ------
    ArgumentError
        If a value is outside what it may be.

    Examples
    --------
    The system of the paper's Fig. 17, with a plain sweep:

    >>> from hmpim.stimulus import Chirp, Stimulus
    >>> sensor = Sensor(delay=0.15, natural_frequency=10, damping_ratio=0.4, bias=0.6)
    >>> stimulus = Stimulus(waveform=Chirp(band=(0.1, 20), duration=10), fs=200, unit="deg")
    >>> from hmpim.experiment import run
    >>> record = run(sensor, stimulus, rng=0)
    >>> record.samples, record.outputs[0].unit, record.outputs[0].values[:30].tolist() == [0.6] * 30
    (2000, 'deg', True)
    """

    delay: float = 0.0
    hold_period: float | None = None
    hold_phase: float = 0.0
    natural_frequency: float | None = None
    damping_ratio: float | None = None
    time_constant: float | None = None
    scale_factor: float = 1.0
    bias: float = 0.0
    noise_std: float = 0.0
    noise_colour: float = 0.0
    saturation_low: float | None = None
    saturation_high: float | None = None
    quantization_step: float | None = None
    output_unit: str | None = None
    measures: Quantity = "position"
    command: Literal["continuous", "zoh", "foh"] = "continuous"
    name: str = "sensor"
    input_name: str = "u"
    output_name: str = "y"
    limits: Limits | None = None
    _playing: Playing = field(default_factory=Playing, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for name in ("hold_phase", "scale_factor", "bias"):
            _check(name, getattr(self, name))
        for name in ("delay", "noise_std"):
            _check(name, getattr(self, name), above=0.0, or_equal=True)
        for name in ("hold_period", "natural_frequency", "damping_ratio", "time_constant"):
            _check(name, getattr(self, name), above=0.0)
        _check("quantization_step", self.quantization_step, above=0.0)
        _check("saturation_low", self.saturation_low)
        _check("saturation_high", self.saturation_high)
        _check("noise_colour", self.noise_colour)
        if abs(self.noise_colour) >= 1.0:
            raise ArgumentError(
                f"noise_colour = {self.noise_colour!r} makes noise that grows without end; "
                "give a coefficient between -1 and 1"
            )
        if (self.natural_frequency is None) != (self.damping_ratio is None):
            raise ArgumentError(
                f"natural_frequency = {self.natural_frequency!r} and damping_ratio = "
                f"{self.damping_ratio!r} belong together; give both or neither"
            )
        if self.time_constant is not None and self.natural_frequency is not None:
            raise ArgumentError(
                f"time_constant = {self.time_constant!r} s and natural_frequency = "
                f"{self.natural_frequency!r} Hz are two kinds of dynamics; give only one of them"
            )
        low, high = self.saturation_low, self.saturation_high
        if low is not None and high is not None and low >= high:
            raise ArgumentError(
                f"saturation_low = {low!r} is not below saturation_high = {high!r}; swap them"
            )
        if self.output_unit is not None:
            check_unit(self.output_unit)
        for name, known in (
            ("measures", ("position", "velocity", "acceleration")),
            ("command", ("continuous", "zoh", "foh")),
        ):
            if getattr(self, name) not in known:
                raise ArgumentError(
                    f"{name} = {getattr(self, name)!r} is not known; use one of {known}"
                )

    @property
    def axes(self) -> tuple[str, ...]:
        """Empty: any one stimulus is measured."""
        return ()

    def prepare(self, stimulus: Stimuli, /) -> Layout:
        """Measure the stimulus's motion; before its time 0 the sensor is at rest.

        Returns
        -------
        Layout
            Input and output at the stimulus's sample times; `intersample` says what went in
            between them: 'bandlimited' for the motion itself.

        Examples
        --------
        >>> from hmpim.experiment import run
        >>> from hmpim.stimulus import Ramp, Stimulus
        >>> ramp = Stimulus(waveform=Ramp(duration=1.0), fs=4.0)
        >>> run(Sensor(delay=0.1), ramp).outputs[0].values.round(9).tolist()
        [0.0, 0.15, 0.4, 0.65]
        """
        ((axis, only),) = stimuli_by_axis(stimulus, name=repr(self.name)).items()
        commanded: FloatArray = getattr(only, self.measures)
        intersample, went_in = self._input(only, commanded)
        rng = self._playing.take_rng()
        read = self._read(went_in, fs=only.fs, count=only.samples, rng=rng)
        self._playing.state = (commanded, read)
        in_unit = rate_unit(only.unit, get_args(Quantity).index(self.measures))
        out_unit = in_unit if self.output_unit is None else self.output_unit
        given = ChannelSpec(
            name=self.input_name, role="input", unit=in_unit, axis=axis, quantity=self.measures
        )
        return Layout(
            channels=(given, ChannelSpec(name=self.output_name, role="output", unit=out_unit)),
            intersample=intersample,
            source=f"simulated {self.name}",
        )

    def play(self, block: Block, /) -> dict[str, FloatArray]:
        """Return what went in and what was read at the block's times."""
        commanded, read = self._playing.current(self.name)
        part = slice(block.start, block.stop)
        return {self.input_name: commanded[part], self.output_name: read[part]}

    def _input(
        self, stimulus: Stimulus, commanded: FloatArray
    ) -> tuple[Intersample, ContinuousInput]:
        """What goes in at any time, and what it does between the samples."""
        if self.command != "continuous":
            return self.command, between_samples(commanded, stimulus.fs, self.command)

        def motion(t: FloatArray) -> FloatArray:
            return np.asarray(getattr(stimulus.motion(t), self.measures))

        rest = float(motion(np.array([-1.0]))[0])
        return "bandlimited", ContinuousInput(at=motion, rest=rest, breaks=None)

    def respond(
        self,
        values: ArrayLike,
        *,
        fs: float,
        intersample: Intersample = "bandlimited",
        rng: np.random.Generator | int | None = None,
    ) -> FloatArray:
        """Measure any sampled signal.

        Parameters
        ----------
        values : array_like, shape (n,)
            The input at k/fs; at rest at its first value before that.
        fs : float
            Rate in Hz.
        intersample : {'bandlimited', 'foh', 'zoh'}
            What the input does between its samples: smooth, linear, held.
        rng : numpy.random.Generator, int or None
            Source of the noise, or its seed.

        Returns
        -------
        ndarray, shape (n,)
            What is read at k/fs, in the output's unit.

        Raises
        ------
        ArgumentError
            If the values are not finite numbers of shape (n,), n >= 2, or `fs` is not positive.

        Examples
        --------
        >>> Sensor(scale_factor=2.0, delay=0.5).respond([0, 1, 2], fs=1.0, intersample="foh")
        array([0., 1., 3.])
        """
        try:
            samples = np.asarray(values, dtype=np.float64)
        except (TypeError, ValueError):
            raise ArgumentError("the input holds something that is not a number") from None
        if samples.ndim != 1 or samples.size < 2 or not np.all(np.isfinite(samples)):
            raise ArgumentError(
                f"the input has shape {samples.shape} and {np.count_nonzero(~np.isfinite(samples))}"
                " values that are not finite; give two or more finite samples, shape (n,)"
            )
        _check("fs", fs, above=0.0)
        if intersample not in ("zoh", "foh", "bandlimited"):
            raise ArgumentError(
                f"intersample = {intersample!r} is not known; use 'zoh', 'foh' or 'bandlimited'"
            )
        u = between_samples(samples, fs, intersample)
        return self._read(u, fs=fs, count=samples.size, rng=generator(rng))

    @property
    def poles(self) -> Poles | None:
        """Poles of the dynamics, None for a static sensor."""
        if self.time_constant is not None:
            return first_order(self.time_constant)
        if self.natural_frequency is not None and self.damping_ratio is not None:
            return second_order(self.natural_frequency, self.damping_ratio)
        return None

    def digitised(self, reading: FloatArray) -> FloatArray:
        """What its converter makes of readings: clipped, then rounded.

        Examples
        --------
        >>> sensor = Sensor(saturation_high=1.0, quantization_step=0.5)
        >>> sensor.digitised(np.array([0.2, 0.3, 7.0])).tolist()
        [0.0, 0.5, 1.0]
        """
        if self.saturation_low is not None or self.saturation_high is not None:
            reading = np.clip(reading, self.saturation_low, self.saturation_high)
        if self.quantization_step is not None:
            reading = self.quantization_step * np.rint(reading / self.quantization_step)
        return np.asarray(reading)

    def _read(
        self, u: ContinuousInput, *, fs: float, count: int, rng: np.random.Generator
    ) -> FloatArray:
        """What is read at k/fs, k = 0 ... count - 1."""
        start, step, readings = 0.0, 1.0 / fs, count
        if self.hold_period is not None:
            step = self.hold_period
            if step * fs < 0.02:
                raise ArgumentError(
                    f"hold_period = {step!r} s is less than a fiftieth of the sampling interval "
                    f"{1 / fs:.6g} s and makes no difference; leave it None"
                )
            first = math.floor(-self.hold_phase / step + _GRACE)
            last = math.floor(((count - 1) / fs - self.hold_phase) / step + _GRACE)
            start = self.hold_phase + first * step
            readings = last - first + 1
        poles = self.poles
        if poles is None:
            moved = u.at(np.asarray(start - self.delay + np.arange(readings) * step))
        else:
            moved = respond(poles, u, start=start, step=step, count=readings, delay=self.delay)
        reading = self.scale_factor * moved + self.bias
        if self.noise_std > 0.0:
            reading = reading + self._noise(readings, rng)
        reading = self.digitised(reading)
        if self.hold_period is not None:
            index = np.floor((np.arange(count) / fs - start) / step + _GRACE).astype(np.int64)
            reading = reading[index]
        return reading

    def _noise(self, count: int, rng: np.random.Generator) -> FloatArray:
        """Stationary AR(1) noise of standard deviation `noise_std`, shape (count,)."""
        white = rng.standard_normal(count)
        c = self.noise_colour
        if c == 0.0:
            return self.noise_std * white
        fed = math.sqrt(1.0 - c * c) * white
        fed[0] = white[0]  # starts in its steady state
        return np.asarray(self.noise_std * scipy.signal.lfilter([1.0], [1.0, -c], fed))


def _check(
    field: str, value: float | None, *, above: float | None = None, or_equal: bool = False
) -> None:
    """Refuse what is not a finite number, or not above a bound; None passes."""
    if value is None:
        return
    number = isinstance(value, (int, float, np.integer, np.floating))
    if not number or isinstance(value, bool) or not math.isfinite(value):
        raise ArgumentError(f"{field} = {value!r} is not a finite number; give one")
    if above is not None and not (value > above or (or_equal and value == above)):
        least = "at least" if or_equal else "more than"
        raise ArgumentError(f"{field} = {value!r} is out of range; it must be {least} {above:g}")
