"""What stands in a loop for a test adds gain and phase, and takes from the phase margin (V.B)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import ArgumentError
from hmpim.model.draws import draw_models
from hmpim.model.model import Model, frequency_response

__all__ = ["AddedPhase", "Margin", "add_to_loop"]

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Margin:
    """A figure of a loop with its 95 % interval; equal ends where nothing is uncertain.

    Parameters
    ----------
    value : float
        As found.
    ci95 : (float, float)
        Its interval.
    """

    value: float
    ci95: tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AddedPhase:
    """What test equipment adds to a loop.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        Hz.
    gain_db, phase : ndarray, shape (n,)
        Added gain in dB, and added phase in degrees, continuous from the lowest frequency on.
    gain_db_ci95, phase_ci95 : ndarray, shape (2, n)
        Lower and upper ends of their 95 % intervals.
    margin_without, margin_with : Margin
        Phase margin of the loop alone, and with the equipment in it, degrees.
    crossover_without, crossover_with : Margin
        Frequency at which the open loop's gain is 1, Hz.

    Examples
    --------
    >>> f = np.linspace(0.1, 10, 500)
    >>> added = add_to_loop((f, 2 * np.pi / (2j * np.pi * f)), [Model(delay=0.05, scale_factor=1)])
    >>> added.margin_without.value, round(added.margin_with.value, 2)  # 18 degrees less, at 1 Hz
    (90.0, 72.0)
    """

    frequency: FloatArray
    gain_db: FloatArray
    phase: FloatArray
    gain_db_ci95: FloatArray
    phase_ci95: FloatArray
    margin_without: Margin
    margin_with: Margin
    crossover_without: Margin
    crossover_with: Margin


def add_to_loop(
    loop: tuple[ArrayLike, ArrayLike],
    added: Sequence[Model],
    *,
    command_rate: float | None = None,
    draws: int = 500,
    rng: np.random.Generator | int | None = 0,
) -> AddedPhase:
    """Put identified equipment into a loop and say what it does to the phase margin.

    Gain 1 at DC is no part of what is added: a scale factor counts, a bias does not.

    Parameters
    ----------
    loop : (frequency, response)
        The open loop without the equipment: Hz, rising, shape (n,), and complex, shape (n,).
        Dense enough that gain and phase may be joined linearly over the logarithm of frequency;
        its lowest frequency where the phase is known to within half a turn.
    added : sequence of Model
        What stands in the loop, one after the other: table, projector, and so on. Of a model with
        a `hold_period` the hold counts too.
    command_rate : float or None
        Rate in Hz at which commands are held, where the first model was found behind that hold;
        None for none.
    draws : int
        Models drawn for the intervals, from those that have a spread.
    rng : numpy.random.Generator, int or None
        Source of the draws, or its seed.

    Returns
    -------
    AddedPhase

    Raises
    ------
    ArgumentError
        If the loop's gain does not fall through 1 within its frequencies, with the equipment or
        without, or shapes and values are not what they must be.

    Examples
    --------
    >>> f = np.linspace(0.1, 10, 500)
    >>> add_to_loop((f, 0.1 / (1j * f + 1)), [])
    Traceback (most recent call last):
    hmpim.errors.ArgumentError: the loop's gain does not fall through 1 between 0.1 and 10 Hz; ...
    """
    f, response = _checked(loop)
    held = np.ones(f.size, dtype=np.complex128)
    for period in (
        *([] if command_rate is None else [1.0 / command_rate]),
        *(model.hold_period for model in added if model.hold_period),
    ):
        held = held * _hold(f, period)
    middle = held.copy()
    for model in added:
        middle = middle * frequency_response(model, f)
    many = np.tile(held, (draws, 1)) if any(m.spread is not None for m in added) else middle[None]
    if len(many) > 1:
        generator = np.random.default_rng(rng)
        for model in added:
            if model.spread is None:
                many = many * frequency_response(model, f)
            else:
                drawn = draw_models(model, draws, rng=generator)
                many = many * np.array([frequency_response(one, f) for one in drawn])
    gain, phase = _decibels(middle), _degrees(middle)
    gains = np.array([_decibels(one) for one in many])
    # Each draw turns with the middle: whole turns between them are none.
    phases = np.array([phase + np.degrees(np.angle(one / middle)) for one in many])
    at, margin = _margin(f, _decibels(response), _degrees(response))
    whole_gain, whole_phase = _decibels(response), _degrees(response)
    pairs = [
        _margin(f, whole_gain + g, whole_phase + p) for g, p in zip(gains, phases, strict=True)
    ]
    at_with, margin_with = _margin(f, whole_gain + gain, whole_phase + phase)
    ends = np.percentile(pairs, [2.5, 97.5], axis=0)
    return AddedPhase(
        frequency=f,
        gain_db=gain,
        phase=phase,
        gain_db_ci95=np.percentile(gains, [2.5, 97.5], axis=0),
        phase_ci95=np.percentile(phases, [2.5, 97.5], axis=0),
        margin_without=Margin(value=margin, ci95=(margin, margin)),
        margin_with=Margin(value=margin_with, ci95=(float(ends[0, 1]), float(ends[1, 1]))),
        crossover_without=Margin(value=at, ci95=(at, at)),
        crossover_with=Margin(value=at_with, ci95=(float(ends[0, 0]), float(ends[1, 0]))),
    )


def _checked(loop: tuple[ArrayLike, ArrayLike]) -> tuple[FloatArray, ComplexArray]:
    try:
        f = np.asarray(loop[0], dtype=np.float64)
        response = np.asarray(loop[1], dtype=np.complex128)
    except (TypeError, ValueError, IndexError):
        raise ArgumentError("the loop must be (frequency, response): Hz, and complex") from None
    if f.ndim != 1 or f.size < 2 or response.shape != f.shape:
        raise ArgumentError(
            f"the loop has frequencies of shape {f.shape} and a response of shape "
            f"{response.shape}; give two or more of each, shape (n,)"
        )
    if not (np.all(np.isfinite(response)) and np.all(f > 0) and np.all(np.diff(f) > 0)):
        raise ArgumentError("the loop's frequencies must rise from above 0, its response be finite")
    if not np.all(response):
        raise ArgumentError("the loop's response is 0 somewhere; leave these frequencies out")
    return f, response


def _margin(f: FloatArray, gain_db: FloatArray, phase: FloatArray) -> tuple[float, float]:
    """Crossover in Hz and phase margin in degrees; the highest crossover counts."""
    down = np.flatnonzero((gain_db[:-1] >= 0.0) & (gain_db[1:] < 0.0))
    if not down.size or gain_db[-1] >= 0.0:
        raise ArgumentError(
            f"the loop's gain does not fall through 1 between {f[0]:g} and {f[-1]:g} Hz; give its "
            "open-loop response over a wider band"
        )
    k = int(down[-1])
    share = gain_db[k] / (gain_db[k] - gain_db[k + 1])
    at = float(np.exp((1 - share) * np.log(f[k]) + share * np.log(f[k + 1])))
    return at, float(180.0 + (1 - share) * phase[k] + share * phase[k + 1])


def _hold(f: FloatArray, period: float) -> ComplexArray:
    return np.asarray(np.sinc(f * period) * np.exp(-1j * np.pi * f * period))


def _decibels(response: ComplexArray) -> FloatArray:
    return np.asarray(20.0 * np.log10(np.abs(response)))


def _degrees(response: ComplexArray) -> FloatArray:
    return np.asarray(np.degrees(np.unwrap(np.angle(response))))
