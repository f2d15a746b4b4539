"""The least scatter that any unbiased estimator can have, from the physics alone.

The record is differentiated by stepping the simulated sensor itself, so that the bound owes
nothing to the model or to the fit that it is held against.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.experiment import run
from hmpim.rigs import Sensor
from hmpim.stimulus import Stimulus

__all__ = ["Bound", "cramer_rao", "phase90", "resonance_db"]

_NAMES = ("delay", "scale_factor", "bias", "natural_frequency", "damping_ratio")
_STEP = 1e-4  # relative; central differences then err by about 1e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """Cramér-Rao bounds, as standard deviations; times in s, frequencies in Hz."""

    delay: float
    scale_factor: float
    bias: float
    natural_frequency: float
    damping_ratio: float
    noise_std: float
    bandwidth_phase90: float
    peak_gain_db: float


def phase90(delay: float, natural_frequency: float, damping_ratio: float) -> float:
    """Return the frequency in Hz at which delay and quadratic lag together lag by 90°.

    Parameters
    ----------
    delay : float
        In s.
    natural_frequency : float
        In Hz.
    damping_ratio : float
        Without unit.

    Examples
    --------
    >>> round(phase90(0.15, 10.0, 0.4), 4), round(phase90(0.0, 10.0, 0.4), 4)
    (1.534, 10.0)
    """

    def margin(f: float) -> float:
        share = f / natural_frequency
        lag = math.atan2(2.0 * damping_ratio * share, 1.0 - share * share)
        return 0.5 * math.pi - 2.0 * math.pi * f * delay - lag

    # the quadratic lag alone reaches 90° at its natural frequency
    return float(scipy.optimize.brentq(margin, 0.0, natural_frequency, xtol=1e-12))


def resonance_db(damping_ratio: float) -> float:
    """Return the hump of a quadratic lag, 1/(2ζ√(1-ζ²)), in dB; 0 where there is none.

    Examples
    --------
    >>> round(resonance_db(0.4), 3)
    2.695
    """
    if damping_ratio >= math.sqrt(0.5):
        return 0.0
    return -20.0 * math.log10(2.0 * damping_ratio * math.sqrt(1.0 - damping_ratio**2))


def cramer_rao(sensor: Sensor, stimulus: Stimulus) -> Bound:
    """Return the Cramér-Rao bound of a second-order sensor under white noise.

    σ² (JᵀJ)⁻¹, J the derivatives of the noise-free output (L. Ljung, System Identification,
    2nd ed., 1999, section 7.4); what follows from the parameters by first-order propagation.

    Parameters
    ----------
    sensor : Sensor
        With second-order dynamics and noise.
    stimulus : Stimulus
        What it is tested with.

    Raises
    ------
    ArgumentError
        If the sensor has no second-order dynamics.

    Examples
    --------
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, unit="deg")
    >>> stimulus = design(
    ...     band=(0.1, 20), duration=10, fs=200, limits=limits, extinction=1.0, lead=0)
    >>> sensor = Sensor(
    ...     delay=0.15, natural_frequency=10, damping_ratio=0.4, bias=0.6, noise_std=0.1)
    >>> round(1e3 * cramer_rao(sensor, stimulus).delay, 3)  # milliseconds
    0.096
    """
    natural, damping = sensor.natural_frequency, sensor.damping_ratio
    if natural is None or damping is None:
        raise ArgumentError(f"sensor {sensor.name!r} has no second-order dynamics to bound")
    still = replace(sensor, noise_std=0.0)
    rows = np.array([_derivative(still, stimulus, name) for name in _NAMES])
    covariance = sensor.noise_std**2 * np.linalg.inv(rows @ rows.T)
    std = dict(zip(_NAMES, np.sqrt(np.diag(covariance)).tolist(), strict=True))

    at = (sensor.delay, natural, damping)
    slope = np.zeros(len(_NAMES))
    for k, name in enumerate(("delay", "natural_frequency", "damping_ratio")):
        step = _STEP * at[k]
        up = [value + (step if j == k else 0.0) for j, value in enumerate(at)]
        down = [value - (step if j == k else 0.0) for j, value in enumerate(at)]
        slope[_NAMES.index(name)] = (phase90(*up) - phase90(*down)) / (2.0 * step)
    hump = (resonance_db(damping + _STEP) - resonance_db(damping - _STEP)) / (2.0 * _STEP)
    return Bound(
        **std,
        noise_std=sensor.noise_std / math.sqrt(2.0 * stimulus.samples),
        bandwidth_phase90=float(np.sqrt(slope @ covariance @ slope)),
        peak_gain_db=abs(hump) * std["damping_ratio"],
    )


def _derivative(sensor: Sensor, stimulus: Stimulus, name: str) -> NDArray[np.float64]:
    value: float = getattr(sensor, name)
    step = _STEP * (abs(value) or 1.0)
    up = _output(sensor, stimulus, name, value + step)
    down = _output(sensor, stimulus, name, value - step)
    return (up - down) / (2.0 * step)


def _output(sensor: Sensor, stimulus: Stimulus, name: str, value: float) -> NDArray[np.float64]:
    changed = replace(
        sensor,
        delay=value if name == "delay" else sensor.delay,
        scale_factor=value if name == "scale_factor" else sensor.scale_factor,
        bias=value if name == "bias" else sensor.bias,
        natural_frequency=value if name == "natural_frequency" else sensor.natural_frequency,
        damping_ratio=value if name == "damping_ratio" else sensor.damping_ratio,
    )
    # without noise nothing is drawn
    record = run(changed, stimulus, rng=0)
    return np.asarray(record.outputs[0].values)
