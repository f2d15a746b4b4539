"""A sensor at the far end of a wire, on an axis of its own that follows every order exactly."""

import math
from collections import deque

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.rigs.dynamics import state_after_impulse
from hmpim.rigs.sensor import Sensor
from hmpim.rigs.wire.farend import Order
from hmpim.rigs.wire.hello import Hello
from hmpim.stimulus import Limits
from hmpim.stimulus.quintic import coefficients_between

__all__ = ["SensorPlant", "sensor_hello"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_AXIS = "motion"
_NODES = tuple(np.polynomial.legendre.leggauss(24))
_FASTEST = 8.0  # a pole's own angle in a tick, up to which those nodes are exact to 1e-9


class SensorPlant:
    """A simulated sensor, read once a tick while its axis goes from order to order.

    The axis is where each order says at its tick; in between it follows the polynomial of fifth
    degree through positions, velocities and accelerations. The sensor's response to each piece
    is an integral, the same at every tick, and so is made once.

    Parameters
    ----------
    sensor : Sensor
        What is read. It measures the position itself, and its noise is white.
    rate : float
        Ticks a second, Hz.
    rng : numpy.random.Generator
        Source of the noise.

    Raises
    ------
    ArgumentError
        If the sensor holds its output, has coloured noise, measures something else than the
        position, or has poles that are too fast for the rate.

    Examples
    --------
    >>> plant = SensorPlant(Sensor(delay=0.01, bias=0.5), rate=200.0, rng=np.random.default_rng(0))
    >>> at = [Order(position=np.array([p]), velocity=np.zeros(1), acceleration=np.zeros(1))
    ...       for p in (0.0, 1.0, 1.0, 1.0)]
    >>> [round(float(plant.advance(order)[0]), 3) for order in at]  # 0.01 s are two ticks
    [0.5, 0.5, 0.5, 1.5]
    """

    def __init__(self, sensor: Sensor, *, rate: float, rng: np.random.Generator) -> None:
        given = {
            "hold_period": sensor.hold_period is not None,
            "noise_colour": sensor.noise_colour != 0.0,
            "measures": sensor.measures != "position",
            "command": sensor.command != "continuous",
        }
        for name, there in given.items():
            if there:
                raise ArgumentError(
                    f"{name} = {getattr(sensor, name)!r} is not simulated over a wire; leave it out"
                )
        poles = sensor.poles
        self._sensor, self._rng = sensor, rng
        self._gain = 1.0 if poles is None else poles.gain
        late = math.floor(sensor.delay * rate + 1e-9)
        self._step, self._weights = _pieces(sensor, rate, sensor.delay * rate - late)
        self._orders: deque[FloatArray] = deque([np.zeros(3)] * (late + 3), maxlen=late + 3)
        self._scale = np.array([1.0, 1.0 / rate, 1.0 / rate**2])
        self._state = np.zeros(self._step.shape[0], dtype=np.complex128)

    def advance(self, order: Order) -> FloatArray:
        """Read the sensor at this tick, at which the axis is where the order says."""
        now = np.array([order.position[0], order.velocity[0], order.acceleration[0]])
        self._orders.append(self._scale * now)
        seen = np.concatenate([self._orders[k] for k in range(3)])
        self._state = self._step @ self._state + self._weights @ seen
        sensor = self._sensor
        read = sensor.scale_factor * self._gain * self._state[0].real + sensor.bias
        read += sensor.noise_std * float(self._rng.standard_normal())
        return sensor.digitised(np.array([read]))

    def truth(self) -> FloatArray:
        """Where the axis truly is."""
        return np.asarray(self._orders[-1][:1])


def sensor_hello(sensor: Sensor, *, rate: float, watchdog: float, limits: Limits) -> Hello:
    """Return what a served sensor states.

    Parameters
    ----------
    sensor : Sensor
        What is served.
    rate, watchdog : float
        Ticks a second, Hz; silence in s after which the axis brakes.
    limits : Limits
        Of its axis: position, velocity and acceleration must be finite.

    Raises
    ------
    ArgumentError
        If a limit that braking needs is not stated.

    Examples
    --------
    >>> limits = Limits(position=1, velocity=130, acceleration=17000, unit="deg")
    >>> sensor_hello(Sensor(), rate=200.0, watchdog=0.08, limits=limits).axes
    ('motion',)
    """
    for name in ("position", "velocity", "acceleration"):
        if math.isinf(getattr(limits, name)):
            raise ArgumentError(
                f"no {name} limit is stated for {sensor.name!r}; its axis cannot be stopped inside "
                "limits that are not stated: state position, velocity and acceleration "
                "under [limits]"
            )
    return Hello(
        name=sensor.name,
        axes=(_AXIS,),
        units=(limits.unit,),
        rate=rate,
        limits={_AXIS: limits},
        watchdog=watchdog,
        intersample="bandlimited",
        source=f"simulated {sensor.name} over a wire",
    )


def _pieces(sensor: Sensor, rate: float, part: float) -> tuple[ComplexArray, ComplexArray]:
    """Step of the state, and what three orders (9 numbers) add to it, in ticks.

    `part` is what the delay is more than whole ticks: a tick of the delayed motion then begins in
    the piece between the first two orders, and ends in that between the last two.
    """
    poles = sensor.poles
    if poles is None:
        weights = np.zeros((1, 9), dtype=np.complex128)
        weights[0, 3:] = _quintic(np.array([1.0 - part]))[:, 0]
        return np.zeros((1, 1), dtype=np.complex128), weights
    fastest = abs(poles.slow if poles.fast is None else poles.fast) / rate
    if fastest > _FASTEST:
        raise ArgumentError(
            f"the sensor's poles lie at {fastest * rate / math.tau:.4g} Hz, too fast to be stepped "
            f"at {rate:g} Hz; serve it at {fastest * rate / _FASTEST:.4g} Hz or faster"
        )
    step = 1.0 / rate
    nodes, node_weights = 0.5 * (_NODES[0] + 1.0), 0.5 * _NODES[1]
    order = 1 if poles.fast is None else 2
    weights = np.zeros((order, 9), dtype=np.complex128)
    for first, begin, end in ((0, 0.0, part), (3, part, 1.0)):
        at = begin + (end - begin) * nodes
        kernel = state_after_impulse(poles, step * (1.0 - at)) * node_weights * (end - begin) * step
        weights[:, first : first + 6] += kernel @ _quintic(at - part + (first == 0)).T
    matrix = np.zeros((order, order), dtype=np.complex128)
    matrix[0, 0] = np.exp(poles.slow * step)
    if poles.fast is not None:
        matrix[0, 1] = state_after_impulse(poles, np.array([step]))[0, 0]
        matrix[1, 1] = np.exp(poles.fast * step)
    return matrix, weights


def _quintic(s: FloatArray) -> FloatArray:
    """Share of position, velocity and acceleration at either end, shape (6, n); time in ticks."""
    ends = np.eye(6)
    powers = np.stack(coefficients_between(ends[:3], ends[3:], duration=1.0))
    return np.asarray(np.polynomial.polynomial.polyval(s, powers))
