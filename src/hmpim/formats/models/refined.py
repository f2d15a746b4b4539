"""How right a linear simulator is on a finer grid, and a Padé approximation on a band.

Tools that simulate continuous systems know no delay, or only whole steps. Their exports shift
the input by the exact delay, interpolate it on a grid `REFINE` times finer, and hand that over.
"""

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hmpim.formats.models.source import Source
from hmpim.model.discrete import discretise, fed_forward_response, is_exact_between
from hmpim.model.fractions import modal_form
from hmpim.model.response import per_step
from hmpim.record import is_held

__all__ = [
    "REFINE",
    "modal_matrices",
    "pade_error",
    "pade_order",
    "refined_error",
    "refined_values",
    "refined_words",
]

StateMatrices = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], float]

REFINE = 20
"""Steps of the finer grid for each sample."""

_PADE_RIGHT = 0.01
_PADE_ORDERS = range(1, 21)


def refined_error(source: Source) -> float:
    """Relative error of the response up to the band's end, for a band-limited input.

    Notes
    -----
    A cubic spline's image is at most 2 (f / (fs - f))⁴ of the signal (Unser 1999, eq. 12); an
    input joined over the fine steps loses 1 - sinc² of the gain.
    """
    fs = source.fs
    f = min(source.model.band or 0.2 * fs, 0.45 * fs)
    spline = 2.0 * (f / (fs - f)) ** 4
    lost = float(np.sinc(f / (REFINE * fs)))
    return spline + 1.0 - lost**2


def refined_words(source: Source) -> str:
    """Say how right the simulation of an export is."""
    fs = source.fs
    f = min(source.model.band or 0.2 * fs, 0.45 * fs)
    if source.intersample == "bandlimited":
        return (
            f"simulate: for a band-limited input at {fs:.9g} Hz or more, response within "
            f"{refined_error(source):.1e} of the model up to {f:.4g} Hz; response "
            "itself is exact."
        )
    kind = "held" if is_held(source.intersample) else "linear"
    aliased = ""
    if not is_exact_between(source.model.system, source.intersample):
        aliased = (
            " It neglects that velocity and acceleration commands are held too: an error of up to "
            f"{_error_without_held_derivatives(source, f):.1e} of the response up to {f:.4g} Hz."
        )
    return (
        f"simulate: for a {kind} input, the delay is right to 1/{2 * REFINE} of a sample; "
        f"response itself is exact.{aliased}"
    )


def _error_without_held_derivatives(source: Source, highest: float) -> float:
    """Relative difference between derivatives of a held command, and held derivatives of it."""
    frequency = highest * np.arange(1, 201) / 200
    system = source.causal().system
    held = discretise(system, fs=source.fs, intersample="zoh").response(frequency)
    fed = fed_forward_response(system, frequency, fs=source.fs)
    return float(np.max(np.abs(held / fed - 1.0)))


def refined_values(source: Source) -> dict[str, Any]:
    """Return what the scripts of all such tools say of a model, by its name in their templates.

    Raises
    ------
    ArgumentError
        If the output is ahead of the input.
    """
    model, seen = source.causal(), source.pair.frequency_response
    top, below = model.system.numerator, model.system.denominator
    integrates = bool(below[0] == 0.0)
    return {
        "said": refined_words(source),
        "delay": model.delay,
        "numerator": top[::-1],
        "denominator": below[::-1],
        "level": 0.0 if integrates else float(top[0] / below[0]),
        "integrates": integrates,
        "modal": modal_matrices(source),
        "bias": model.bias,
        "noise_std": model.noise_std,
        "low": model.saturation_low,
        "high": model.saturation_high,
        "hold_period": model.hold_period,
        "quantum": model.quantization_step,
        "intersample": "zoh" if is_held(source.intersample) else source.intersample,
        "fs": source.fs,
        "refine": REFINE,
        "frequency": seen.frequency,
        "real": seen.response.real,
        "imag": seen.response.imag,
        "std": seen.std,
        "bent": model.nonlinear,
    }


def modal_matrices(source: Source) -> StateMatrices | None:
    """State matrices of a model of many poles in s, each mode a block of its own.

    None of up to six poles, whose transfer function keeps its digits.

    Returns
    -------
    generator, entry, output : ndarray, shapes (n, n), (n,) and (n,)
    through : float
    """
    system, fs = source.causal().system, source.fs
    parts = modal_form(per_step(system.numerator, fs), per_step(system.denominator, fs))
    if parts is None:
        return None
    generator, entry, output, through = parts
    return generator * fs, entry * fs, output, through


def pade_error(order: int, turn: float) -> float:
    """Greatest error of a Padé approximation of a delay, |P - e^(-jωτ)|, for ωτ up to `turn`.

    Examples
    --------
    >>> pade_error(1, 0.1) < 1e-4 < pade_error(1, 1.0)
    True
    """
    n = order
    terms = [
        factorial(2 * n - k) * factorial(n) / (factorial(2 * n) * factorial(k) * factorial(n - k))
        for k in range(n + 1)
    ]
    x = 1j * np.linspace(0.0, turn, 400)
    below = np.polynomial.polynomial.polyval(x, terms)
    return float(np.max(np.abs(below.conj() / below - np.exp(-x))))


def pade_order(source: Source) -> int:
    """Least order within 1 % up to the band's end; 20 where none is."""
    turn = 2 * np.pi * source.model.delay * (source.model.band or 0.2 * source.fs)
    for order in _PADE_ORDERS:
        if pade_error(order, turn) <= _PADE_RIGHT:
            return order
    return _PADE_ORDERS[-1]
