r"""How accurate an identification will be: Fisher information, and the error bars it allows.

With white noise of standard deviation σ the information on the parameters is JᵀJ/σ², J the
derivatives of the noise-free output (L. Ljung, System Identification, 2nd ed., 1999, section
7.4), and no unbiased estimator scatters less than its inverse, the Cramér-Rao bound. The
joint fit of `hmpim.identify` reaches it.

For the output K e^{-sτ} / A(s) · u + bias, A = 1 + 2ζs/ω + s²/ω², the derivatives are
analytic. They are computed on two routes that share nothing but the formula: by a fast
Fourier transform of the stimulus, padded so that nothing wraps around, and by the recursive
filters of `hmpim.model` that the fit itself uses.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model import delayed_response, prepare_input, second_order_coefficients
from hmpim.optimal.wish import Z95, RoughModel
from hmpim.stimulus import Stimulus

__all__ = ["Errors", "fisher_information", "predict_errors", "responses", "sensitivities"]

FloatArray = NDArray[np.float64]
Route = Literal["frequency", "time"]

_FORGOTTEN = 20.0  # time constants after which a response is below rounding


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Predicted standard deviation of each parameter; infinite where the stimulus is blind.

    Parameters
    ----------
    delay : float
        In s.
    natural_frequency : float
        In Hz.
    damping_ratio : float
        No unit.
    scale_factor, bias : float
        Output unit per stimulus unit; output unit.

    Examples
    --------
    >>> errors = Errors(delay=1e-3, natural_frequency=0.1, damping_ratio=0.02,
    ...                 scale_factor=0.01, bias=0.002)
    >>> round(errors.ci95("delay"), 5)
    0.00196
    """

    delay: float
    natural_frequency: float
    damping_ratio: float
    scale_factor: float
    bias: float

    def ci95(self, name: str) -> float:
        """Half width of the 95 % interval of a parameter."""
        value: float = getattr(self, name)
        return Z95 * value


def responses(model: RoughModel, s: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Derivatives of the frequency response by delay, frequency, damping, scale factor.

    Parameters
    ----------
    model : RoughModel
        Where they are taken.
    s : ndarray of complex, shape (m,)
        jω in rad/s.

    Returns
    -------
    ndarray of complex, shape (4, m)
        In the order of `hmpim.optimal.PARAMETERS`; natural frequency in Hz.

    Examples
    --------
    >>> still = responses(RoughModel(natural_frequency=10, damping_ratio=0.4), np.zeros(1, complex))
    >>> still[3].real.tolist()
    [1.0]
    """
    omega, zeta = model.omega, model.damping_ratio
    below = s * s + 2.0 * zeta * omega * s + omega * omega
    unit = omega * omega / below * np.exp(-s * model.delay)
    response = model.scale_factor * unit
    by_omega = response * (2.0 / omega - (2.0 * zeta * s + 2.0 * omega) / below)
    return np.array(
        [-s * response, 2.0 * math.pi * by_omega, -2.0 * omega * s * response / below, unit]
    )


def sensitivities(
    position: FloatArray, *, model: RoughModel, fs: float, route: Route = "frequency"
) -> FloatArray:
    """Derivatives of the output by each parameter, while the record lasts.

    Parameters
    ----------
    position : ndarray, shape (n,) or (k, n)
        Samples of one stimulus or several; at rest at 0 before and after.
    model : RoughModel
        The unit.
    fs : float
        Hz.
    route : {'frequency', 'time'}
        Fourier transform, or the model's recursive filters (one stimulus only).

    Returns
    -------
    ndarray, shape (4, n) or (4, k, n)
        By delay (s), natural frequency (Hz), damping ratio, scale factor; that by the bias
        is 1 throughout.

    Examples
    --------
    >>> rough = RoughModel(delay=0.02, natural_frequency=10, damping_ratio=0.4)
    >>> bump = np.hanning(50)
    >>> by_fft = sensitivities(bump, model=rough, fs=200.0)
    >>> by_filter = sensitivities(bump, model=rough, fs=200.0, route="time")
    >>> bool(np.allclose(by_fft, by_filter, atol=1e-4 * np.abs(by_fft).max(axis=1, keepdims=True)))
    True
    """
    n = position.shape[-1]
    if route == "time":
        return _by_filters(position, model, fs)
    pad = math.ceil((model.delay + _FORGOTTEN * model.settling) * fs)
    length = scipy.fft.next_fast_len(n + pad, real=True)
    s = np.asarray(2j * np.pi * scipy.fft.rfftfreq(length, 1.0 / fs), dtype=np.complex128)
    spectrum = scipy.fft.rfft(position, length)
    factors = responses(model, s)
    if position.ndim == 2:
        factors = factors[:, None, :]
    return np.asarray(scipy.fft.irfft(factors * spectrum, length)[..., :n])


def _by_filters(position: FloatArray, model: RoughModel, fs: float) -> FloatArray:
    """All four from the responses of s^i / A², i = 0 to 3, with time in samples."""
    a1, a2 = second_order_coefficients(model.natural_frequency, model.damping_ratio)
    a1, a2 = a1 * fs, a2 * fs * fs
    once = np.array([1.0, a1, a2])
    source = prepare_input(position, "bandlimited")
    r = delayed_response(
        source, delay=model.delay * fs, denominator=np.convolve(once, once), powers=4
    )
    r[0] += source.first
    K, omega, zeta = model.scale_factor, model.omega, model.damping_ratio
    by_a1, by_a2 = -K * r[1], -K * r[2]  # d(1/A)/da_k = -s^k/A²
    by_omega = -2.0 * zeta / omega**2 * fs * by_a1 - 2.0 / omega**3 * fs * fs * by_a2
    return np.array(
        [
            -K * fs * (once @ r[1:4]),
            2.0 * math.pi * by_omega,
            2.0 / omega * fs * by_a1,
            once @ r[:3],
        ]
    )


def fisher_information(
    position: FloatArray,
    *,
    model: RoughModel,
    noise_std: float,
    fs: float,
    route: Route = "frequency",
) -> FloatArray:
    """Fisher information on delay, natural frequency, damping, scale factor and bias.

    Parameters
    ----------
    position : ndarray, shape (n,)
        Samples of the stimulus.
    model : RoughModel
        The unit.
    noise_std : float
        Standard deviation of white noise, in the output's unit.
    fs : float
        Hz.
    route : {'frequency', 'time'}
        As in `sensitivities`.

    Returns
    -------
    ndarray, shape (5, 5)

    Examples
    --------
    >>> rough = RoughModel(natural_frequency=10, damping_ratio=0.4)
    >>> information = fisher_information(np.hanning(50), model=rough, noise_std=0.5, fs=200.0)
    >>> round(float(information[4, 4]), 9)  # fifty readings of the bias
    200.0
    """
    rows = sensitivities(position, model=model, fs=fs, route=route)
    rows = np.vstack([rows, np.ones(position.size)])
    return np.asarray(rows @ rows.T / noise_std**2)


def predict_errors(
    stimulus: Stimulus | FloatArray,
    *,
    model: RoughModel,
    noise_std: float,
    fs: float | None = None,
    route: Route = "frequency",
) -> Errors:
    """Predict the standard deviation of each parameter before the test is run.

    Parameters
    ----------
    stimulus : Stimulus, or ndarray of shape (n,)
        What will be played; an array needs `fs`.
    model : RoughModel
        What is roughly known of the unit.
    noise_std : float
        Standard deviation of white noise, in the output's unit.
    fs : float, optional
        Hz, for an array.
    route : {'frequency', 'time'}
        As in `sensitivities`.

    Raises
    ------
    ArgumentError
        If an array comes without `fs`.

    Examples
    --------
    The paper's Fig. 17, with the waveform as printed:

    >>> from hmpim.stimulus import Limits, design
    >>> printed = design(band=(0.1, 20), duration=10, fs=200, limits=Limits(position=10),
    ...                  extinction=1.0, lead=0)
    >>> rough = RoughModel(delay=0.15, natural_frequency=10, damping_ratio=0.4)
    >>> errors = predict_errors(printed, model=rough, noise_std=0.1)
    >>> round(1e3 * errors.delay, 3), round(errors.natural_frequency, 3)
    (0.096, 0.03)
    """
    if isinstance(stimulus, Stimulus):
        position, rate = stimulus.position, stimulus.fs
    elif fs is None:
        raise ArgumentError("fs is not given; an array of samples needs its rate in Hz")
    else:
        position, rate = np.asarray(stimulus, dtype=np.float64), fs
    information = fisher_information(
        position, model=model, noise_std=noise_std, fs=rate, route=route
    )
    delay, natural, damping, scale, bias = standard_deviations(information).tolist()
    return Errors(
        delay=delay,
        natural_frequency=natural,
        damping_ratio=damping,
        scale_factor=scale,
        bias=bias,
    )


def standard_deviations(information: FloatArray) -> FloatArray:
    """Root of the diagonal of the inverse, infinite throughout where there is none.

    Examples
    --------
    >>> standard_deviations(np.array([[4.0, 0.0], [0.0, 25.0]])).tolist()
    [0.5, 0.2]
    """
    scale = np.sqrt(np.diag(information))
    if not np.all(np.isfinite(scale)) or scale.min() <= 0.0:
        return np.full(scale.size, np.inf)
    scaled = information / np.outer(scale, scale)
    if np.linalg.cond(scaled) > 1e13:
        return np.full(scale.size, np.inf)
    return np.asarray(np.sqrt(np.diag(np.linalg.inv(scaled))) / scale)
