"""A model of one input-output pair: what a simulation needs, ready to run."""

from dataclasses import dataclass, replace
from math import ceil
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.arguments import check_size, checked, generator, numbers_of
from hmpim.errors import ArgumentError
from hmpim.model.chain import Chain, Readout, chain_of, run_chain
from hmpim.model.driven import driven
from hmpim.model.filters import in_z
from hmpim.model.mode import Mode, modes_of
from hmpim.model.nonlinear import (
    NonlinearPart,
    excursion,
    farthest,
    followed_command,
    nonlinear_effect,
)
from hmpim.model.response import RationalDelay, response
from hmpim.model.sampled import prepare_input
from hmpim.model.spread import Spread
from hmpim.record import Intersample

__all__ = ["Model", "frequency_response", "simulate", "simulate_with_reach"]


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """Delay, dynamics, scale factor and bias between one input and one output (Fig. 1).

    Parameters
    ----------
    delay : float
        Pure delay in s.
    scale_factor : float
        Output at DC per input, bias aside; with an integrator, the output's rate per input.
    numerator, denominator : tuple of float
        Dynamics without delay and with unit gain at DC, in powers of s (rad/s), highest first.
        A denominator that ends in 0 integrates. Of software ('sampled'), in powers of z.
    bias : float
        Output at zero input.
    noise_std : float
        Standard deviation of the measurement noise, in the output's unit.
    input, output, input_unit, output_unit : str
        Names and units of the channels.
    saturation_low, saturation_high : float or None
        Range of the output, in its unit; None where it is open.
    hold_period, hold_phase : float or None, float
        Interval in s at which the output is read and then held, and the instant of one reading;
        None for a reading at every sample.
    quantization_step : float or None
        The output is rounded to whole steps of this size, in its unit.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'}
        What the input does between its samples, as it was identified; 'sampled' for software,
        which sees the samples alone and runs at `fs`.
    fs : float or None
        Rate in Hz at which it was identified.
    band : float or None
        Frequency in Hz up to which it was excited.
    spread : Spread or None
        What is known of the errors of these figures.
    nonlinear : NonlinearPart or None
        A backlash, dead zone, friction, spring or limited speed that the unit has as well; None
        of a linear unit.

    Raises
    ------
    ArgumentError
        If the denominator is empty, ends in 0 twice, or has a pole that is not in the left half
        plane; if a level, period or step is not what it may be.
    """

    delay: float
    scale_factor: float
    numerator: tuple[float, ...] = (1.0,)
    denominator: tuple[float, ...] = (1.0,)
    bias: float = 0.0
    noise_std: float = 0.0
    input: str = "u"
    output: str = "y"
    input_unit: str = ""
    output_unit: str = ""
    saturation_low: float | None = None
    saturation_high: float | None = None
    hold_period: float | None = None
    hold_phase: float = 0.0
    quantization_step: float | None = None
    intersample: Intersample = "bandlimited"
    fs: float | None = None
    band: float | None = None
    spread: Spread | None = None
    nonlinear: NonlinearPart | None = None

    def __post_init__(self) -> None:
        for name in ("numerator", "denominator"):
            coefficients = tuple(numbers_of(name, getattr(self, name)).tolist())
            if not coefficients:
                raise ArgumentError(f"{name} is empty; give its coefficients, such as (1.0,)")
            object.__setattr__(self, name, coefficients)
        for name in ("delay", "scale_factor", "bias", "noise_std", "hold_phase"):
            numbers_of(name, getattr(self, name))
        check_size("delay", float(self.delay), "s", added=True)
        _check_readout(self)
        if self.intersample == "sampled":
            _check_filter(self)
            return
        if not any(self.denominator[-2:]):
            raise ArgumentError(
                f"denominator {self.denominator} integrates more than once; one of its last two "
                "coefficients must not be 0"
            )
        if len(self.numerator) > len(self.denominator):
            raise ArgumentError(
                f"numerator of degree {len(self.numerator) - 1} over denominator of degree "
                f"{len(self.denominator) - 1} is not proper; leave out its highest power"
            )
        poles = np.roots(self.denominator)
        if np.any(poles[np.abs(poles) > 0].real >= 0):
            raise ArgumentError(
                f"denominator {self.denominator} has a pole at {poles[np.argmax(poles.real)]:.4g}; "
                "only stable dynamics can be simulated"
            )

    @property
    def modes(self) -> tuple[Mode, ...]:
        """Pairs of conjugate poles, the lowest first, with their errors; none of software."""
        if self.intersample == "sampled":
            return ()
        falling = self.system.denominator[::-1]
        poles = len(self.denominator) - 1 - (self.denominator[-1] == 0.0)
        known = None
        if self.spread is not None and poles:
            known = np.array(self.spread.covariance)[-poles:, -poles:]
        return modes_of(falling, known)

    @property
    def system(self) -> RationalDelay:
        """Rising powers of s, scale factor included, the first that is not 0 of A made 1.

        Of software ('sampled') they are powers of 1 - 1/z, and `step` is the time of a sample.
        """
        if self.intersample == "sampled" and self.fs is not None:
            constant = sum(self.denominator)
            return RationalDelay(
                delay=self.delay,
                numerator=self.scale_factor * in_z(np.asarray(self.numerator)) / constant,
                denominator=in_z(np.asarray(self.denominator)) / constant,
                step=1.0 / self.fs,
            )
        constant = self.denominator[-1] or self.denominator[-2]
        return RationalDelay(
            delay=self.delay,
            numerator=self.scale_factor * np.asarray(self.numerator[::-1]) / constant,
            denominator=np.asarray(self.denominator[::-1]) / constant,
        )

    @property
    def readout(self) -> Readout:
        """What happens to the output once the dynamics are through."""
        return Readout(
            bias=self.bias,
            noise_std=self.noise_std,
            saturation_low=self.saturation_low,
            saturation_high=self.saturation_high,
            hold_period=self.hold_period,
            hold_phase=self.hold_phase,
            quantization_step=self.quantization_step,
        )

    def within(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """The output, (n,), kept within its range; as it is where there is none."""
        if self.saturation_low is None and self.saturation_high is None:
            return y
        return np.clip(y, self.saturation_low, self.saturation_high)

    def at_rate(self, fs: float, *, intersample: Intersample | None = None) -> Chain:
        """Put the model on a rate in Hz: the arithmetic that `simulate` and the exports share.

        Raises
        ------
        ArgumentError
            If the delay would need input samples that are still to come, or the rate is not
            positive.
        """
        return chain_of(
            self.system,
            self.readout,
            fs=fs,
            intersample=_known(intersample or self.intersample),
            band=self.band,
            nonlinear=self.nonlinear,
        )

    def simulate(
        self,
        u: ArrayLike,
        t: ArrayLike,
        *,
        intersample: Intersample | None = None,
        rng: np.random.Generator | int | None = None,
    ) -> NDArray[np.float64]:
        """Output of the whole chain of Fig. 1, up to saturation, hold and rounding.

        Parameters
        ----------
        u : array_like, shape (n,)
            Input samples. Before the first the input stood there; in front of an integrator, at 0.
        t : array_like, shape (n,)
            Their times in s, evenly spaced. Readings of a held output count from time 0.
        intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}, optional
            What the input does between its samples; as identified by default.
        rng : numpy.random.Generator or int, optional
            Adds noise drawn from it, one value a reading; none is added by default.

        Returns
        -------
        ndarray, shape (n,)
            In the output's unit.

        Raises
        ------
        ArgumentError
            If `u` and `t` are not two or more finite numbers each, or `t` not evenly spaced.

        Notes
        -----
        The arithmetic is causal. A band-limited input's response is that of the model up to
        `band`, to the error that ``at_rate(fs).error`` states.

        Examples
        --------
        >>> model = Model(delay=0.02, scale_factor=2.0, quantization_step=0.5, intersample="zoh")
        >>> model.simulate([0.0, 0.6, 0.6, 0.6], [0.0, 0.01, 0.02, 0.03]).tolist()
        [0.0, 0.0, 0.0, 1.0]
        """
        values, fs, start = _evenly(u, t)
        _check_ahead(self, fs, values.size)
        model = replace(self, hold_phase=self.hold_phase - start)
        lead = max(ceil(-self.delay * fs - 1e-9), 0)
        if lead:  # a model that is ahead of its input sees the input go on as it ended
            values = np.concatenate([values, np.full(lead, values[-1])])
            model = replace(
                model, delay=self.delay + lead / fs, hold_phase=model.hold_phase + lead / fs
            )
        chain = model.at_rate(fs, intersample=intersample)
        noise = None if rng is None else generator(rng)
        return run_chain(chain, values, rng=noise)[lead:]


def _check_ahead(model: Model, fs: float, samples: int) -> None:
    """Raise ArgumentError if a model runs ahead of its input by more than the whole of it."""
    if -model.delay * fs > samples:
        raise ArgumentError(
            f"delay = {model.delay:g} s runs ahead of the input, which is {samples / fs:g} s long; "
            "give a longer input, or a smaller lead"
        )


def _known(intersample: str) -> Intersample:
    for name in get_args(Intersample):
        if intersample == name:
            return name  # type: ignore[no-any-return]
    raise ArgumentError(
        f"intersample = {intersample!r} is not known; use 'zoh', 'foh', 'bandlimited', "
        "'feedforward' or 'sampled'"
    )


def _evenly(u: ArrayLike, t: ArrayLike) -> tuple[NDArray[np.float64], float, float]:
    """Check samples and their times; return samples, rate and first time."""
    try:
        values, time = np.asarray(u, dtype=np.float64), np.asarray(t, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError("u or t holds something that is not a number") from None
    if values.ndim != 1 or values.shape != time.shape or values.size < 2:
        raise ArgumentError(
            f"u has shape {values.shape} and t {time.shape}; give two or more samples and as many "
            "times, shape (n,)"
        )
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(time))):
        raise ArgumentError("u or t holds a value that is not finite; give finite numbers")
    step = (time[-1] - time[0]) / (time.size - 1)
    off = np.abs(np.diff(time) - step)
    if not step > 0 or np.max(off) > 1e-3 * step:
        k = int(np.argmax(off))
        raise ArgumentError(
            f"t is not evenly spaced: {time[k + 1] - time[k]:.6g} s after sample {k}, "
            f"{step:.6g} s on average; resample the input first"
        )
    return values, float(1.0 / step), float(time[0])


def _check_filter(model: "Model") -> None:
    """Software: a filter in z at a rate, causal and stable, late by whole samples."""
    if model.fs is None or not model.fs > 0:
        raise ArgumentError(
            f"fs = {model.fs!r} Hz is not the rate of software; a model with intersample='sampled' "
            "needs it"
        )
    late = model.delay * model.fs
    if abs(late - round(late)) > 1e-6 or late < -1e-6:
        raise ArgumentError(
            f"delay = {model.delay!r} s is {late:.6g} samples; software is late by a whole number"
        )
    if not model.denominator[0] or len(model.numerator) > len(model.denominator):
        raise ArgumentError(
            f"a filter of numerator {model.numerator} over denominator {model.denominator} needs "
            "input from after its output; give as many powers of z below as above"
        )
    poles = np.roots(model.denominator)
    if np.any(np.abs(poles) >= 1.0):
        raise ArgumentError(
            f"denominator {model.denominator} has a pole at z = "
            f"{poles[np.argmax(np.abs(poles))]:.4g}; only stable dynamics can be simulated"
        )


def _check_readout(model: Model) -> None:
    for name in ("hold_period", "quantization_step"):
        value = getattr(model, name)
        if value is not None and not (np.isfinite(value) and value > 0):
            raise ArgumentError(f"{name} = {value!r} is out of range; it must be more than 0")
    low, high = model.saturation_low, model.saturation_high
    if low is not None and high is not None and low >= high:
        raise ArgumentError(
            f"saturation_low = {low!r} is not below saturation_high = {high!r}; swap them"
        )


@checked
def frequency_response(model: Model, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex response at `frequency` in Hz, shape (m,), delay and scale factor included.

    Examples
    --------
    >>> model = Model(delay=0.0, scale_factor=2.0)
    >>> frequency_response(model, np.array([1.0])).tolist()
    [(2+0j)]
    """
    return response(model.system, numbers_of("frequency", frequency))


@checked
def simulate(
    model: Model,
    u: NDArray[np.float64],
    *,
    fs: float,
    intersample: Intersample,
    rng: np.random.Generator | int | None = None,
) -> NDArray[np.float64]:
    """Output of the unit for a sampled input, which stood at u[0] before.

    It is that of the linear part and, if the model has one, of its nonlinear part; without
    saturation, hold and rounding.

    It has the whole record at hand and so looks ahead between samples; `Model.simulate` steps
    through the whole chain, causally.

    Parameters
    ----------
    model : Model
        The model.
    u : ndarray, shape (n,)
        Input samples.
    fs : float
        Rate in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}
        What the input does between its samples.
    rng : numpy.random.Generator or int, optional
        Adds measurement noise drawn from it; none is added by default.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> model = Model(delay=0.02, scale_factor=2.0, bias=1.0)
    >>> simulate(model, np.array([0.0, 1.0, 1.0, 1.0]), fs=100.0, intersample="zoh").tolist()
    [1.0, 1.0, 1.0, 3.0]
    """
    if not (np.isfinite(fs) and fs > 0):
        raise ArgumentError(f"fs = {fs:g} Hz is not a sampling rate; give a positive number of Hz")
    if model.intersample == "sampled" or intersample == "sampled":
        return _run(replace(model, fs=fs, intersample="sampled"), numbers_of("u", u), rng)
    samples = np.atleast_1d(numbers_of("u", u))
    if samples.size < 2:
        raise ArgumentError(f"u has {samples.size} samples; give two or more")
    _check_ahead(model, fs, samples.size)
    part = model.nonlinear
    if part is not None and intersample != model.intersample:
        part = replace(part, between=intersample)
    linear, effect = _driven(model, part, samples, fs, intersample)
    y = _joined(model, linear, effect)
    if rng is not None:
        y = y + model.noise_std * generator(rng).standard_normal(y.size)
    return np.asarray(y)


def simulate_with_reach(
    model: Model, u: NDArray[np.float64], *, fs: float
) -> tuple[NDArray[np.float64], float]:
    """Output as `simulate` has it, (n,), and how far the input takes the nonlinear part.

    A force within the dynamics, which takes long to follow, is followed once for both.

    Raises
    ------
    ArgumentError
        If the model has no nonlinear part, or the dynamics are none in which it can act.
    """
    part = model.nonlinear
    if part is None:
        raise ArgumentError("the model has no nonlinear part; simulate it")
    if part.at == "command":
        reach = excursion(part, model.system, u, fs, model.intersample)
        return simulate(model, u, fs=fs, intersample=model.intersample), reach
    linear, effect = _driven(model, part, u, fs, model.intersample)
    return _joined(model, linear, effect), farthest(part, linear, effect)


def _driven(
    model: Model,
    part: NonlinearPart | None,
    samples: NDArray[np.float64],
    fs: float,
    intersample: Intersample,
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Output of the linear part without the bias, (n,), and what the nonlinear part adds."""
    if part is not None and part.kind == "rate_limit":
        samples = followed_command(part, samples, fs)
    source = prepare_input(samples, intersample)
    y = driven(model.system, source, fs)
    if part is None:
        return y, None
    return y, nonlinear_effect(part, model.system, samples, source, fs)


def _joined(
    model: Model, linear: NDArray[np.float64], effect: NDArray[np.float64] | None
) -> NDArray[np.float64]:
    return (linear if effect is None else linear + effect) + model.bias


def _run(
    model: Model, u: NDArray[np.float64], rng: np.random.Generator | int | None
) -> NDArray[np.float64]:
    """Output of the linear part of software."""
    bare = Model(
        delay=model.delay,
        scale_factor=model.scale_factor,
        numerator=model.numerator,
        denominator=model.denominator,
        bias=model.bias,
        noise_std=model.noise_std,
        intersample="sampled",
        fs=model.fs,
    )
    chain = bare.at_rate(float(model.fs or 0.0))
    return run_chain(chain, u, rng=None if rng is None else generator(rng))
