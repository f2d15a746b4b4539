"""A model stepped at a rate: state, delay line and taps that a program can run, exact and causal.

A held or linear input is answered exactly: between two samples it is a polynomial, and the
state's answer to a polynomial is one matrix exponential (C. Van Loan, Computing integrals
involving the matrix exponential, IEEE TAC, 1978). A delay that is no whole number of samples
splits the sample in two. A band-limited input goes through a short filter first, which makes
the response that of the model over the excited band (`hmpim.model.causal`).

Time is counted in samples here.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.errors import ArgumentError
from hmpim.model.causal import causal_filter
from hmpim.model.filters import in_z
from hmpim.model.fractions import modal_form
from hmpim.model.response import RationalDelay, per_step, response
from hmpim.model.sampled import check_fed_forward
from hmpim.record import Intersample, is_held

__all__ = [
    "TAPS",
    "Discrete",
    "RowPiece",
    "discretise",
    "fed_forward_response",
    "is_exact_between",
    "realised",
    "rows_between",
]

_Real = NDArray[np.float64]
_Complex = NDArray[np.complex128]

TAPS = 3
"""Input samples that one step looks at: a fraction of a sample reaches over three of them."""

LOOKAHEAD = 32
"""Most samples of the delay that a band-limited input's filter may use to look both ways.

One sample is left alone: what is late by a sample or more never depends on the newest input, so
that a loop can be closed over it.
"""

_NOUGHT = 1e-13
"""Share of the largest coefficient of a filter below which one is what rounding left of 0."""

_WHOLE = 1e-9
"""Part of a sample below which a delay counts as whole."""

ROW_DEGREE = 12
"""Degree of the polynomial that follows the state's answer within a part of a sample."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Discrete:
    """A linear model at a rate, strictly causal in its arithmetic.

    With ``c[k] = Σ prefilter[i] u[k-i]`` and ``v = [c[k-delay], c[k-delay-1], c[k-delay-2]]``::

        x = transition x + drive v
        y = output x + feed v

    Parameters
    ----------
    fs : float
        Rate in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}
        What the input does between its samples.
    prefilter : ndarray, shape (p,)
        Taps on the input; [1] unless the input is band-limited, or its derivatives are held too.
    delay : int
        Whole samples, those that the prefilter takes left out.
    fraction : float
        Rest of the delay in samples, 0 <= fraction < 1; it is in `drive` and `feed`.
    early : int
        Samples by which the whole comes sooner: 1 for a held input that moves less than a sample
        before it is taken, a delay of fraction - 1; it is in `drive` and `feed`. Else 0.
    transition : ndarray, shape (n, n)
        Of the state over one sample.
    drive : ndarray, shape (n, 3)
        What three input samples add to it.
    output : ndarray, shape (n,)
        Output per state.
    feed : ndarray, shape (3,)
        Output per input sample.
    generator, entry : ndarray, shapes (n, n) and (n,)
        The continuous state's matrix and its input's column, per sample.
    through : float
        Output per input, at once.
    error : float
        Greatest error of the response up to `band`, over the response; 0 where it is exact.
    gain : float
        Greatest gain of the prefilter at any frequency.
    band : float
        Frequency in Hz up to which `error` holds.
    """

    fs: float
    intersample: Intersample
    prefilter: _Real
    delay: int
    fraction: float
    early: int = 0
    transition: _Real
    drive: _Real
    output: _Real
    feed: _Real
    generator: _Real
    entry: _Real
    through: float
    error: float
    gain: float
    band: float

    @property
    def order(self) -> int:
        """States."""
        return int(self.output.size)

    def response(self, frequency: _Real) -> NDArray[np.complex128]:
        """Response at `frequency` in Hz, shape (m,), from input samples to output samples."""
        z = np.exp(2j * np.pi * np.asarray(frequency) / self.fs)
        taps = z[:, None] ** -np.arange(self.prefilter.size)
        before = (taps @ self.prefilter) * z**-self.delay
        return np.asarray(before * _response(self, z))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowPiece:
    """Output between two samples, for ages from `start` to `stop` (in samples, 0 newest).

    The output ``age`` before sample k is ``rows(age) [x[k-1], v]``; each of the n + 3 numbers is
    ``Σ coefficients[:, i] tⁱ`` with t from -1 at `start` to 1 at `stop`.
    """

    start: float
    stop: float
    coefficients: _Real


def discretise(
    system: RationalDelay,
    *,
    fs: float,
    intersample: Intersample,
    band: float | None = None,
) -> Discrete:
    """Turn a continuous model into one that is stepped at a rate.

    Parameters
    ----------
    system : RationalDelay
        The model, in seconds; its delay at least 0, for a held input above -1 sample.
    fs : float
        Rate in Hz.
    intersample : {'zoh', 'foh', 'bandlimited', 'feedforward'}
        What the input does between its samples.
    band : float, optional
        Frequency in Hz up to which a band-limited input has content; a fifth of the rate by
        default.

    Raises
    ------
    ArgumentError
        If the delay would need input samples that are still to come, or the rate is not positive.

    Examples
    --------
    >>> lag = RationalDelay(delay=0.025, numerator=np.ones(1), denominator=np.array([1.0, 0.1]))
    >>> step = discretise(lag, fs=100.0, intersample="zoh")
    >>> step.delay, round(step.fraction, 9), round(float(step.transition[0, 0]), 6)
    (2, 0.5, 0.904837)
    """
    if not (np.isfinite(fs) and fs > 0):
        raise ArgumentError(f"fs = {fs!r} Hz is not a rate; give a positive number")
    total, early = _samples_late(system, fs, intersample)
    if system.step is not None:
        return _filter(system, fs)
    reach = min(band, 0.45 * fs) if band else 0.2 * fs
    ahead = 0
    exactly = is_exact_between(system, intersample)
    if not exactly:
        ahead = min(max(int(total + _WHOLE) - 1, 0), LOOKAHEAD)
    rest = total - ahead
    whole = int(rest + _WHOLE)
    fraction = max(rest - whole, 0.0)
    generator, entry, output, through = realised(system, fs)
    between: Intersample = "zoh" if is_held(intersample) else "foh"
    row = _row(generator, entry, output, through, fraction, 0.0, between)
    n = output.size
    transition, drive = _reached(generator, entry, fraction, 1.0, between)
    plain = Discrete(
        fs=fs,
        intersample=intersample,
        prefilter=np.ones(1),
        delay=whole,
        fraction=fraction,
        early=early,
        transition=transition,
        drive=_sooner(drive, early),
        output=output,
        feed=_sooner(row[n:] - output @ drive, early),
        generator=generator,
        entry=entry,
        through=through,
        error=0.0,
        gain=1.0,
        band=reach,
    )
    if exactly:
        return plain
    if intersample == "feedforward":
        return _prefiltered(plain, partial(fed_forward_response, system, fs=fs), ahead)
    if not n and fraction == 0.0:  # a gain and whole samples: nothing lies between
        return replace(plain, delay=whole + ahead)
    return _prefiltered(plain, partial(response, system), ahead)


def is_exact_between(system: RationalDelay, intersample: Intersample) -> bool:
    """Whether past samples determine what the input does between samples.

    Not for a band-limited input, nor for derivatives of a command, which are computed from it.
    """
    if intersample == "feedforward":
        return system.numerator.size == 1
    return intersample != "bandlimited"


def fed_forward_response(system: RationalDelay, frequency: _Real, *, fs: float) -> _Complex:
    """Response from samples to samples if B(s) acts on a command before it is held.

    Velocity and acceleration of the command are then held too, and only 1/A(s) and the delay are
    behind the hold.

    Parameters
    ----------
    system : RationalDelay
        The model, in seconds.
    frequency : ndarray, shape (m,)
        In Hz.
    fs : float
        Rate in Hz.

    Returns
    -------
    complex ndarray, shape (m,)
    """
    check_fed_forward(system.numerator)
    behind = discretise(replace(system, numerator=np.ones(1)), fs=fs, intersample="zoh")
    before = np.polynomial.polynomial.polyval(system.variable(frequency), system.numerator)
    return np.asarray(before * behind.response(frequency))


def _samples_late(system: RationalDelay, fs: float, intersample: Intersample) -> tuple[float, int]:
    """Delay in samples as it is stepped, 0 or more, and the samples by which all comes sooner.

    A held input that moves between two samples is known from the next one on, which is the first
    that answers it: of a delay above -1 sample no step needs a sample that is still to come.
    """
    total = system.delay * fs
    if total >= -_WHOLE:
        return max(total, 0.0), 0
    if is_held(intersample) and total > _WHOLE - 1.0:
        return total + 1.0, 1
    raise ArgumentError(
        f"delay {system.delay:.6g} s is negative; no program can run ahead of its input, so "
        "take the delay as 0, or add one"
    )


def _sooner(taps: _Real, early: int) -> _Real:
    """Taps (newest first, on the last axis) that act a sample sooner; the newest then is 0."""
    return np.concatenate([taps[..., early:], np.zeros_like(taps[..., :early])], axis=-1)


def _filter(system: RationalDelay, fs: float) -> Discrete:
    """A filter in z at its own rate: its poles in the state, or its taps before a plain gain."""
    if system.step is None or abs(system.step * fs - 1.0) > 1e-6:
        rate = 0.0 if system.step is None else 1.0 / system.step
        raise ArgumentError(
            f"fs = {fs:g} Hz is not the rate of this software, {rate:g} Hz; it is the same at no "
            "other rate, so give that one"
        )
    below = in_z(system.denominator)
    above, below = in_z(system.numerator) / below[0], below / below[0]
    n = int(np.flatnonzero(np.abs(below) > _NOUGHT * np.abs(below).max())[-1])
    below = below[: n + 1]
    if 0 < n < above.size - 1:  # poles at z = 0 were cut off; the state holds what B takes of them
        n = above.size
        below = np.concatenate([below, np.zeros(n + 1 - below.size)])
    taps, direct = np.ones(1), 0.0
    output = np.zeros(n)
    if n == 0:
        taps, direct = above, 1.0
    else:  # B = direct A + Σ output[i] z^-i, so that the state holds what it takes
        above = np.concatenate([above, np.zeros(max(n + 1 - above.size, 0))])
        direct = float(above[n] / below[n]) if below[n] else 0.0
        output = (above - direct * below)[:n]
    transition = np.eye(n, k=-1)
    transition[:1] = -below[1:]
    entry = np.eye(n)[:, 0] if n else np.zeros(0)
    return Discrete(
        fs=fs,
        intersample="sampled",
        prefilter=taps,
        delay=round(system.delay * fs),
        fraction=0.0,
        transition=transition,
        drive=np.outer(entry, [1.0, 0.0, 0.0]),
        output=output,
        feed=np.array([direct, 0.0, 0.0]),
        generator=np.zeros((n, n)),
        entry=entry,
        through=direct,
        error=0.0,
        gain=float(np.abs(taps).sum()),
        band=0.5 * fs,
    )


def _prefiltered(plain: Discrete, exact: Callable[[_Real], _Complex], ahead: int) -> Discrete:
    """A step with a filter on its input that makes the response the exact one, by frequency."""

    def wanted(f: _Real) -> _Complex:
        return exact(f * plain.fs)

    def bare(f: _Real) -> _Complex:
        return plain.response(f * plain.fs)

    designed = causal_filter(wanted, bare, ahead=ahead, band=plain.band / plain.fs)
    return replace(plain, prefilter=designed.taps, error=designed.error, gain=designed.gain)


def _response(step: Discrete, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    taps = z[:, None] ** -np.arange(TAPS)
    direct = taps @ step.feed
    if not step.order:
        return np.asarray(direct)
    pencil = np.eye(step.order) - step.transition / z[:, None, None]
    driven = (taps @ step.drive.T).astype(np.complex128)
    states = np.linalg.solve(pencil, driven[:, :, None])[:, :, 0]
    return np.asarray(states @ step.output + direct)


def realised(system: RationalDelay, fs: float) -> tuple[_Real, _Real, _Real, float]:
    """State matrices per sample, scaled so that their entries are alike in size."""
    a = np.trim_zeros(per_step(system.denominator, fs), "b")
    b = per_step(system.numerator, fs)
    if a.size == 1:
        return np.zeros((0, 0)), np.zeros(0), np.zeros(0), float(b[0] / a[0])
    modal = modal_form(b, a)
    if modal is not None:
        return modal
    n, most = a.size - 1, float(np.abs(b).max()) or 1.0  # of any unit
    below = a[::-1] / a[-1]
    above = np.pad(b, (0, n + 1 - b.size))[::-1] / most / a[-1]
    companion = np.eye(n, k=-1)
    companion[0] = -below[1:]
    balanced, (scale, _) = scipy.linalg.matrix_balance(companion, permute=False, separate=True)
    entry = np.eye(n)[0] / scale
    output = (above[1:] - above[0] * below[1:]) * most * scale
    size = np.abs(entry).max()  # the state counts in units of what comes in
    through = float(above[0] * most)
    return np.asarray(balanced), np.asarray(entry / size), np.asarray(output * size), through


def _advance(generator: _Real, entry: _Real, span: float) -> tuple[_Real, _Real, _Real]:
    """Transition over `span`, and what an input that stands at 1, or grows as s, adds."""
    n = entry.size
    wide = np.zeros((n + 2, n + 2))
    wide[:n, :n] = generator
    wide[:n, n] = entry
    wide[n, n + 1] = 1.0
    moved = scipy.linalg.expm(wide * span)
    return moved[:n, :n], moved[:n, n], moved[:n, n + 1]


def _ramps(begin: float, between: Intersample) -> tuple[_Real, _Real]:
    """Input over a piece that begins `begin` into its sample: value and slope per older, newer."""
    if between == "zoh":
        return np.array([1.0, 0.0]), np.zeros(2)
    return np.array([1.0 - begin, begin]), np.array([-1.0, 1.0])


def _reached(
    generator: _Real, entry: _Real, fraction: float, until: float, between: Intersample
) -> tuple[_Real, _Real]:
    """Transition and taps (newest first) from sample k-1 to `until` into the sample after it.

    The delayed input is in its older sample up to `fraction`, then in the newer one.
    """
    n = entry.size
    drive = np.zeros((n, TAPS))
    first = min(until, fraction)
    transition, still, growing = _advance(generator, entry, first)
    value, slope = _ramps(1.0 - fraction, between)
    drive[:, 2] = still * value[0] + growing * slope[0]
    drive[:, 1] = still * value[1] + growing * slope[1]
    if until > fraction:
        onward, still, growing = _advance(generator, entry, until - fraction)
        transition, drive = onward @ transition, onward @ drive
        value, slope = _ramps(0.0, between)
        drive[:, 1] += still * value[0] + growing * slope[0]
        drive[:, 0] += still * value[1] + growing * slope[1]
    return transition, drive


def _row(
    generator: _Real,
    entry: _Real,
    output: _Real,
    through: float,
    fraction: float,
    age: float,
    between: Intersample,
) -> _Real:
    """Output `age` samples before sample k, per state at k-1 and input tap, shape (n + 3,)."""
    until = 1.0 - age
    transition, drive = _reached(generator, entry, fraction, until, between)
    held = np.zeros(TAPS)  # the delayed input itself, then
    late = until - fraction
    if between == "zoh":
        # At a sample the new value counts, if the delay is whole.
        held[0 if late >= 1.0 - _WHOLE else (1 if late >= 0 else 2)] = 1.0
    elif late >= 0:
        held[:2] = late, 1.0 - late
    else:
        held[1:] = 1.0 + late, -late
    return np.concatenate([output @ transition, output @ drive + through * held])


def rows_between(step: Discrete) -> tuple[RowPiece, ...]:
    """Output between samples, as polynomials of the age: for a sensor that reads by its own clock.

    Parameters
    ----------
    step : Discrete
        For a held or linear input.

    Returns
    -------
    tuple of RowPiece
        One or two pieces that cover ages from 0 to 1: the answer bends where the delayed input
        comes to its next sample.

    Examples
    --------
    A gain that is late by half a sample shows an older input from half a sample on:

    >>> late = RationalDelay(delay=0.005, numerator=np.ones(1), denominator=np.ones(1))
    >>> pieces = rows_between(discretise(late, fs=100.0, intersample="zoh"))
    >>> [(p.start, p.stop, p.coefficients[:, 0].round(9).tolist()) for p in pieces]
    [(0.0, 0.5, [0.0, 1.0, 0.0]), (0.5, 1.0, [0.0, 0.0, 1.0])]
    """
    if step.intersample == "sampled":  # it is read when it has been calculated, as it then is
        now = np.concatenate([step.output @ step.transition, step.output @ step.drive + step.feed])
        return (RowPiece(start=0.0, stop=1.0, coefficients=now[None, :]),)
    between: Intersample = "zoh" if is_held(step.intersample) else "foh"
    bend = 1.0 - step.fraction
    edges = [0.0, bend, 1.0] if _WHOLE < bend < 1.0 - _WHOLE else [0.0, 1.0]
    pieces = []
    nodes = np.cos(np.pi * (np.arange(ROW_DEGREE + 1) + 0.5) / (ROW_DEGREE + 1))
    for start, stop in pairwise(edges):
        ages = 0.5 * (start + stop) + 0.5 * (stop - start) * nodes
        rows = np.array(
            [
                _row(
                    step.generator,
                    step.entry,
                    step.output,
                    step.through,
                    step.fraction,
                    float(age),
                    between,
                )
                for age in ages
            ]
        )
        rows[:, -TAPS:] = _sooner(rows[:, -TAPS:], step.early)
        series = np.polynomial.chebyshev.chebfit(nodes, rows, ROW_DEGREE)
        powers = np.zeros_like(series.T)
        for i, one in enumerate(series.T):
            plain = np.polynomial.chebyshev.cheb2poly(one)
            powers[i, : plain.size] = plain
        powers[np.abs(powers) < 1e-15 * max(np.abs(powers).max(), 1e-300)] = 0.0
        pieces.append(RowPiece(start=start, stop=stop, coefficients=powers))
    return tuple(pieces)
