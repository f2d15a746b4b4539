"""A model of one input-output pair: what a simulation needs, ready to run."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.response import RationalDelay, response
from hmpim.model.sampled import delayed_response, prepare_input
from hmpim.record import Intersample

__all__ = ["Model", "frequency_response", "simulate"]


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
        A denominator that ends in 0 integrates.
    bias : float
        Output at zero input.
    noise_std : float
        Standard deviation of the measurement noise, in the output's unit.
    input, output, input_unit, output_unit : str
        Names and units of the channels.

    Raises
    ------
    ArgumentError
        If the denominator is empty, ends in 0, or has a pole that is not in the left half plane.
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

    def __post_init__(self) -> None:
        if not any(self.denominator[-2:]):
            raise ArgumentError(
                f"denominator {self.denominator} integrates more than once; one of its last two "
                "coefficients must not be 0"
            )
        if len(self.numerator) > max(len(self.denominator) - 1, 1):
            raise ArgumentError(
                f"numerator of degree {len(self.numerator) - 1} over denominator of degree "
                f"{len(self.denominator) - 1} is not strictly proper; leave out its highest power"
            )
        poles = np.roots(self.denominator)
        if np.any(poles[np.abs(poles) > 0].real >= 0):
            raise ArgumentError(
                f"denominator {self.denominator} has a pole at {poles[np.argmax(poles.real)]:.4g}; "
                "only stable dynamics can be simulated"
            )


def _rational(model: Model) -> RationalDelay:
    """Rising powers of s, scale factor included, the first that is not 0 of A made 1."""
    constant = model.denominator[-1] or model.denominator[-2]
    return RationalDelay(
        delay=model.delay,
        numerator=model.scale_factor * np.asarray(model.numerator[::-1]) / constant,
        denominator=np.asarray(model.denominator[::-1]) / constant,
    )


def frequency_response(model: Model, frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Complex response at `frequency` in Hz, shape (m,), delay and scale factor included.

    Examples
    --------
    >>> model = Model(delay=0.0, scale_factor=2.0)
    >>> frequency_response(model, np.array([1.0])).tolist()
    [(2+0j)]
    """
    return response(_rational(model), frequency)


def simulate(
    model: Model,
    u: NDArray[np.float64],
    *,
    fs: float,
    intersample: Intersample,
    rng: np.random.Generator | None = None,
) -> NDArray[np.float64]:
    """Output of the model for a sampled input; before the record the input stood at u[0].

    Parameters
    ----------
    model : Model
        The model.
    u : ndarray, shape (n,)
        Input samples.
    fs : float
        Rate in Hz.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What the input does between its samples.
    rng : numpy.random.Generator, optional
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
    system = _rational(model)
    source = prepare_input(np.asarray(u, dtype=np.float64), intersample)
    powers = system.numerator.size
    rows = delayed_response(
        source,
        delay=system.delay * fs,
        denominator=system.denominator * fs ** np.arange(system.denominator.size),
        powers=powers,
    )
    weights = system.numerator * fs ** np.arange(powers)
    level: float | NDArray[np.float64] = model.scale_factor * source.first
    if system.denominator[0] == 0:
        level = level * np.maximum(np.arange(source.samples) / fs - system.delay, 0.0)
    y = weights @ rows + level + model.bias
    if rng is not None:
        y = y + model.noise_std * rng.standard_normal(y.size)
    return np.asarray(y)
