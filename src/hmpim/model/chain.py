"""The whole chain of Fig. 1 at a rate: delay, dynamics, noise, saturation, hold, quantisation.

This is the arithmetic that exported programs carry, so that a model simulated here and its
export give the same numbers.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.causal import causal_filter
from hmpim.model.discrete import (
    ROW_DEGREE,
    TAPS,
    Discrete,
    RowPiece,
    discretise,
    is_exact_between,
    rows_between,
)
from hmpim.model.nonlinear import NonlinearPart
from hmpim.model.response import RationalDelay
from hmpim.model.stepped import SteppedPart, stepped_part
from hmpim.record import Intersample

__all__ = ["Chain", "Readout", "chain_of", "run_chain"]

_Real = NDArray[np.float64]

_EARLY = 8
"""Most samples that readings between samples take from the delay, for a band-limited input."""

_GRACE = 1e-9
"""Part of a sample by which an instant may come late and still count as in time."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Readout:
    """What happens to the output once the dynamics are through; None where nothing does.

    Parameters
    ----------
    bias, noise_std : float
        In the output's unit.
    saturation_low, saturation_high : float or None
        Range, in the output's unit.
    hold_period : float or None
        Interval in s at which the output is read and then held.
    hold_phase : float
        Instant in s of one reading.
    quantization_step : float or None
        In the output's unit.
    """

    bias: float = 0.0
    noise_std: float = 0.0
    saturation_low: float | None = None
    saturation_high: float | None = None
    hold_period: float | None = None
    hold_phase: float = 0.0
    quantization_step: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chain:
    """A model at a rate, ready to run here or to be written out as a program.

    Parameters
    ----------
    step : Discrete
        The linear part.
    level : float
        Output per input at rest; 0 for an integrator, whose rest is at input 0.
    integrates : bool
        Whether it is one.
    readout : Readout
        Noise, range, hold and rounding.
    pieces : tuple of RowPiece
        Output between samples; empty without a hold.
    over_outputs : bool
        Whether the rows of `pieces` act on the last outputs, newest first, and not on the state.
    error : float
        Greatest relative error of the response up to `step.band`.
    nonlinear : SteppedPart or None
        The nonlinear part.
    """

    step: Discrete
    level: float
    integrates: bool
    readout: Readout
    pieces: tuple[RowPiece, ...]
    over_outputs: bool
    error: float
    nonlinear: SteppedPart | None = None


def chain_of(
    system: RationalDelay,
    readout: Readout,
    *,
    fs: float,
    intersample: Intersample,
    band: float | None = None,
    nonlinear: NonlinearPart | None = None,
) -> Chain:
    """Put a model on a rate.

    Parameters
    ----------
    system : RationalDelay
        Delay, scale factor and dynamics.
    readout : Readout
        What comes after.
    fs : float
        Rate in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}
        What the input does between its samples.
    band : float, optional
        Frequency in Hz up to which a band-limited input has content.
    nonlinear : NonlinearPart, optional
        What is not linear.

    Raises
    ------
    ArgumentError
        If the delay would need input samples that are still to come, the rate is not positive,
        the hold's period is shorter than a fiftieth of a sample, or a held output is behind a
        nonlinearity other than of the command.
    """
    integrates = bool(system.denominator[0] == 0.0)
    level = 0.0 if integrates else float(system.numerator[0] / system.denominator[0])
    period = readout.hold_period
    if period is not None and not period * fs >= 0.02:
        raise ArgumentError(
            f"hold_period = {period!r} s is less than a fiftieth of a sample of {1 / fs:.6g} s and "
            "makes no difference; leave it None"
        )
    stepped = None
    if nonlinear is not None:
        stepped = stepped_part(
            nonlinear, system, fs=fs, intersample=intersample, held=period is not None
        )
    pieces: tuple[RowPiece, ...] = ()
    over_outputs = False
    between_error = 0.0
    if period is not None and not is_exact_between(system, intersample):
        early = min(max(int(system.delay * fs + _GRACE) - 1, 0), _EARLY)
        system = replace(system, delay=max(system.delay - early / fs, 0.0))
        step = discretise(system, fs=fs, intersample=intersample, band=band)
        piece, between_error = _outputs_between(early, step.band / fs)
        pieces, over_outputs = (piece,), True
    else:
        step = discretise(system, fs=fs, intersample=intersample, band=band)
        if period is not None:
            pieces = rows_between(step)
    return Chain(
        step=step,
        level=level,
        integrates=integrates,
        readout=readout,
        pieces=pieces,
        over_outputs=over_outputs,
        error=step.error + between_error,
        nonlinear=stepped,
    )


def _outputs_between(early: int, band: float) -> tuple[RowPiece, float]:
    """Rows that read a band-limited output between its samples, `early` samples late."""
    nodes = np.cos(np.pi * (np.arange(ROW_DEGREE + 1) + 0.5) / (ROW_DEGREE + 1))
    rows, error = [], 0.0
    for t in nodes:
        late = early + 0.5 + 0.5 * t
        found = causal_filter(
            lambda f, late=late: np.exp(-2j * np.pi * f * late),  # type: ignore[misc]
            lambda f: np.ones(f.size, dtype=np.complex128),
            ahead=early,
            band=band,
        )
        rows.append(found.taps)
        error = max(error, found.error)
    series = np.polynomial.chebyshev.chebfit(nodes, np.array(rows), ROW_DEGREE)
    powers = np.array([np.polynomial.chebyshev.cheb2poly(one) for one in series.T])
    return RowPiece(start=0.0, stop=1.0, coefficients=powers), error


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Played:
    """States before each sample, taps at it, and the output, all as deviations from rest."""

    states: _Real
    taps: _Real
    output: _Real


def _play(step: Discrete, u: _Real) -> _Played:
    """Run the linear part from rest, over deviations from rest, shape (n,)."""
    filtered = np.asarray(scipy.signal.lfilter(step.prefilter, [1.0], u))
    reach = step.delay + TAPS
    padded = np.concatenate([np.zeros(reach), filtered])
    taps = np.stack([padded[TAPS - i : TAPS - i + u.size] for i in range(TAPS)])
    states = _recursion(step.transition, step.drive @ taps)
    output = step.output @ states + step.feed @ taps
    before = np.concatenate([np.zeros((step.order, 1)), states[:, :-1]], axis=1)
    return _Played(states=before, taps=taps, output=np.asarray(output))


def _recursion(transition: _Real, driven: _Real) -> _Real:
    """Return x[k] = transition x[k-1] + driven[k], from zero, one filter a state.

    Schur's form makes the states follow one another, however close the poles are together.
    """
    if not transition.size:
        return np.zeros_like(driven)
    triangle, basis = scipy.linalg.schur(transition, output="complex")
    incoming = basis.conj().T @ driven
    turned = np.zeros_like(incoming)
    for i in range(transition.shape[0] - 1, -1, -1):
        drive = incoming[i].copy()
        drive[1:] += triangle[i, i + 1 :] @ turned[i + 1 :, :-1]
        turned[i] = scipy.signal.lfilter([1.0], [1.0, -triangle[i, i]], drive)
    return np.asarray((basis @ turned).real)


def run_chain(chain: Chain, u: _Real, *, rng: np.random.Generator | None = None) -> _Real:
    """Output of the whole chain, shape (n,), noise drawn from `rng` if there is one.

    Parameters
    ----------
    chain : Chain
        From `chain_of`.
    u : ndarray, shape (n,)
        Input samples at the chain's rate.
    rng : numpy.random.Generator, optional
        Source of the noise, one value a reading.

    Examples
    --------
    A sensor that is read every second sample only:

    >>> late = RationalDelay(delay=0.01, numerator=np.ones(1), denominator=np.ones(1))
    >>> chain = chain_of(late, Readout(hold_period=0.02), fs=100.0, intersample="zoh")
    >>> run_chain(chain, np.array([0.0, 1.0, 2.0, 3.0, 4.0])).tolist()
    [0.0, 0.0, 1.0, 1.0, 3.0]
    """
    readout, nonlinear = chain.readout, chain.nonlinear
    if nonlinear is not None:
        u = nonlinear.entered(u)
    rest = 0.0 if chain.integrates else float(u[0])
    played = _play(chain.step, u - rest)
    base = chain.level * rest + readout.bias
    index: NDArray[np.int64] | None = None
    if readout.hold_period is None:
        reading = base + played.output
        if nonlinear is not None:
            x = reading - readout.bias
            reading = reading + nonlinear.effect(u, x, chain.level * rest)
    else:
        newest, index = _readings(chain, u.size)
        reading = base + _between(chain, played, newest)
    if rng is not None:
        reading = reading + readout.noise_std * rng.standard_normal(reading.size)
    if readout.saturation_low is not None or readout.saturation_high is not None:
        reading = np.clip(reading, readout.saturation_low, readout.saturation_high)
    shown = reading if index is None else reading[index]
    if readout.quantization_step is not None:
        shown = readout.quantization_step * np.rint(shown / readout.quantization_step)
    return np.asarray(shown)


def _readings(chain: Chain, samples: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Instants of the readings in samples, and which reading each sample shows."""
    period = (chain.readout.hold_period or 1.0) * chain.step.fs
    phase = chain.readout.hold_phase * chain.step.fs
    number = np.floor((np.arange(samples) - phase) / period + _GRACE).astype(np.int64)
    shown, index = np.unique(number, return_inverse=True)
    return phase + shown * period, index.astype(np.int64)


def _between(chain: Chain, played: _Played, instants: _Real) -> _Real:
    """Deviation from rest at instants in samples, shape (m,)."""
    at = np.ceil(instants - _GRACE).astype(np.int64)
    age = np.clip(at - instants, 0.0, 1.0)
    known = at >= 0  # a reading before the record shows the rest
    out = np.zeros(instants.size)
    where, ages = at[known], age[known]
    if chain.over_outputs:
        count = chain.pieces[0].coefficients.shape[0]
        padded = np.concatenate([np.zeros(count - 1), played.output])
        columns = padded[where[None, :] + (count - 1) - np.arange(count)[:, None]]
    else:
        columns = np.concatenate([played.states[:, where], played.taps[:, where]])
    values = np.zeros(where.size)
    for piece in chain.pieces:
        after = -1.0 if chain.over_outputs else piece.start + _GRACE
        inside = (ages > after) & (ages <= piece.stop + _GRACE)
        t = 2.0 * (ages[inside] - piece.start) / (piece.stop - piece.start) - 1.0
        powers = t[None, :] ** np.arange(piece.coefficients.shape[1])[:, None]
        values[inside] = np.sum((piece.coefficients @ powers) * columns[:, inside], axis=0)
    if not chain.over_outputs:  # at the sample itself a held input has its new value already
        values[ages <= _GRACE] = played.output[where[ages <= _GRACE]]
    out[known] = values
    return out
