"""Whether the system is linear, and if not, in which way and by how much.

A sweep answers the first question by its harmonics, a multisine by the lines it leaves out,
any other input by how much better a nonlinear trace explains the residual. Which way is for
`hmpim.identify.mechanisms`, asked only where there is something to explain. Dependence on
the amplitude takes several records: `hmpim.identify.levels`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import RecordError
from hmpim.identify.fit import Fit, Problem
from hmpim.identify.harmonics import Harmonics, any_harmonic, sweep_harmonics
from hmpim.identify.lines import Lines, detection_lines, find_period
from hmpim.identify.mechanisms import Mechanism, compare_mechanisms
from hmpim.identify.nonlinear_words import general, particular
from hmpim.identify.result import Estimate, HarmonicCurve, Nonlinearity
from hmpim.identify.signals import as_signal
from hmpim.identify.sweep_phase import SweepPhase, sweep_phase
from hmpim.record import Finding

__all__ = ["Inspection", "Shares", "inspect_nonlinearity"]

_CHANCE = 1e-5
"""Chance of a harmonic or a line from noise alone below which it counts."""

_WORTH_A_LOOK = 1e-3
"""Chance in the quick look at a white residual below which it is looked at in full."""

_GAIN = 12.0
"""Log-likelihood that a trace must bring; in linear systems the best of all reaches 7."""

_SMALLEST = 0.003
"""R.m.s. of the nonlinear part over that of the output from which it is worth a warning."""

_DOUBTFUL = 0.01
"""The same, from which parameters depend on the amplitude beyond their error bars."""

_NAMED = 0.25
"""Share of what is not noise in a sweep's residual that a kind must explain to be named."""

_APART = 10.0
"""Log-likelihood by which the next kind must be behind to be ruled out."""

_LONGEST = 131072
"""Samples of a sweep looked at one by one; longer records are averaged in blocks first."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Shares:
    """What the power of the residual is made of; the three add to 1.

    Parameters
    ----------
    noise : float
        Noise.
    linear : float
        What follows the input at its own frequency: dynamics left out, and the part of a
        nonlinearity that looks linear. 0 where it is not told from noise.
    nonlinear : float
        What no linear system makes.
    """

    noise: float
    linear: float
    nonlinear: float


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inspection:
    """What was found; None where the input does not allow it or there was nothing to ask.

    Parameters
    ----------
    harmonics : Harmonics or None
        For a sweep whose residual gave reason to look.
    lines : Lines or None
        For a periodic input with lines left out.
    mechanisms : tuple of Mechanism
        The likeliest first; empty where nothing nonlinear was seen.
    shares : Shares
        Of the residual's power.
    rms : float
        R.m.s. of the nonlinear part, in the output's unit.
    findings : tuple of Finding
        Code 'nonlinear' if it matters; then the code of the kind where it can be named:
        'hardening', 'softening', 'friction', 'backlash', 'rate_limit', 'saturation'.
    doubtful : bool
        Whether it is so large that the linear parameters hold at this amplitude only.
    summary : Nonlinearity
        The same, as the result keeps it.
    """

    harmonics: Harmonics | None
    lines: Lines | None
    mechanisms: tuple[Mechanism, ...]
    shares: Shares
    rms: float
    findings: tuple[Finding, ...]
    doubtful: bool
    summary: Nonlinearity


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Seen:
    """What the tests gave, before it is weighed."""

    harmonics: Harmonics | None = None
    lines: Lines | None = None
    mechanisms: tuple[Mechanism, ...] = ()
    rms: float = 0.0


def inspect_nonlinearity(
    u: ArrayLike,
    problem: Problem,
    fit: Fit,
    *,
    fs: float,
    white: bool = False,
    others: Sequence[NDArray[np.float64]] = (),
    floor: float = 0.0,
    unit: str = "",
) -> Inspection:
    """Look for nonlinearity in what a linear fit leaves over.

    Parameters
    ----------
    u : array_like, shape (n,)
        Input samples.
    problem, fit
        The data and the linear fit.
    fs : float
        Rate in Hz.
    white : bool
        Whether the residual passed for white: then a quick look decides whether to go on.
    others : sequence of ndarray, shape (n,)
        Other inputs that drove the output at the same time: then harmonics alone are asked.
    floor : float
        R.m.s. up to which nothing is said, in the output's unit: the error of rounding.
    unit : str
        The output's unit, for the sentences.

    Returns
    -------
    Inspection

    Raises
    ------
    RecordError
        For the wrong shape, unequal lengths, NaN or infinity.
    ArgumentError
        If `fs` is not positive.

    Examples
    --------
    >>> from hmpim.identify.fit import fit_structure
    >>> from hmpim.model import STRUCTURES, prepare_input
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = u - 0.1 * u**3 + 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> data = Problem(source=prepare_input(u, "bandlimited"), y=y, valid=None, longest_delay=9.0)
    >>> fit = fit_structure(data, STRUCTURES["static"], np.zeros(1))
    >>> found = inspect_nonlinearity(u, data, fit, fs=200.0)
    >>> found.mechanisms[0].kind, [finding.code for finding in found.findings]
    ('curvature', ['nonlinear'])
    """
    source = as_signal("u", u)
    if source.size != problem.y.size:
        raise RecordError(
            f"u has {source.size} samples and the output {problem.y.size}; give one for each"
        )
    counted = problem.y if problem.valid is None else problem.y[problem.valid]
    output = float(np.std(counted))
    power = fit.cost / max(problem.counted, 1)
    smallest = max(_SMALLEST * output, floor)
    block = -(-source.size // _LONGEST)
    sweep = sweep_phase(_thinned(source, block), fs / block)
    if sweep is not None:
        seen = _by_harmonics(sweep, block, problem, fit, others, fs, white, smallest)
    elif others:
        seen = _Seen()
    else:
        seen = _by_traces(source, problem, fit, fs, white)
    matters = seen.rms > smallest
    named = _named(seen) if matters else ()
    shares = _shares(seen, power)
    findings: list[Finding] = []
    if matters:
        findings.append(
            general(
                share=seen.rms / output,
                where=_where(seen),
                made_of=(shares.noise, shares.linear, shares.nonlinear),
                kinds=named,
                asked=not others,
            )
        )
        of_kind = particular(named[0], unit) if len(named) == 1 else None
        if of_kind is not None:
            findings.append(of_kind)
    return Inspection(
        harmonics=seen.harmonics,
        lines=seen.lines,
        mechanisms=seen.mechanisms,
        shares=shares,
        rms=seen.rms,
        findings=tuple(findings),
        doubtful=matters and seen.rms > _DOUBTFUL * output,
        summary=_summary(seen, named, shares, output, unit),
    )


def _thinned(x: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Means over blocks of samples; an incomplete one at the end is left out."""
    return x if block == 1 else x[: x.size // block * block].reshape(-1, block).mean(axis=1)


def _by_harmonics(
    sweep: SweepPhase,
    block: int,
    problem: Problem,
    fit: Fit,
    others: Sequence[NDArray[np.float64]],
    fs: float,
    white: bool,
    smallest: float,
) -> _Seen:
    """Ask a sweep for its harmonics, and if they matter, which kind makes them."""
    residual = _thinned(fit.residual, block)
    rate, delay = fs / block, fit.delay / fs
    if white and any_harmonic(residual, sweep, rate, delay=delay) > _WORTH_A_LOOK:
        return _Seen()
    phases = [sweep_phase(_thinned(other, block), rate) for other in others]
    harmonics = sweep_harmonics(
        sweep.phase,  # not looked at beside the sweep itself
        residual,
        rate,
        delay=delay,
        phase=sweep,
        others=[phase for phase in phases if phase is not None],
    )
    if harmonics is None:
        return _Seen()
    parts = [harmonics.rms(p) for p in (0, 1) if harmonics.probability(p) < _CHANCE]
    rms = float(np.sqrt(np.sum(np.square(parts))))
    asked = rms > smallest and not others
    return _Seen(
        harmonics=harmonics,
        mechanisms=compare_mechanisms(problem, fit, fs=fs) if asked else (),
        rms=rms,
    )


def _by_traces(u: NDArray[np.float64], problem: Problem, fit: Fit, fs: float, white: bool) -> _Seen:
    """Ask lines left out, if the input repeats, and whether any kind explains the residual."""
    lines = _lines(u, problem)
    levels = [] if lines is None else [v for v in lines.levels if v.probability < _CHANCE]
    if white and not levels and not _curved(fit, problem):
        return _Seen(lines=lines)
    found = tuple(m for m in compare_mechanisms(problem, fit, fs=fs) if m.gain > _GAIN)
    distortion = float(np.sqrt(sum(0.5 * v.lines * v.rms**2 for v in levels)))
    return _Seen(lines=lines, mechanisms=found, rms=max(distortion, found[0].rms if found else 0.0))


def _curved(fit: Fit, problem: Problem) -> bool:
    """Whether a white residual follows square, cube or direction of the linear model's output."""
    counted = slice(None) if problem.valid is None else problem.valid
    x = fit.prediction - fit.linear[-1]
    size = float(np.std(x))
    if size == 0:
        return False
    step = np.gradient(x)
    traces = np.stack([np.ones_like(x), x, step, x**2, x**3 / size, np.sign(step) * size])
    q, r = np.linalg.qr(traces[:, counted].T)
    e = fit.residual[counted]
    taken = (q.T @ e)[3:] ** 2
    told = np.abs(np.diag(r))[3:] > 1e-6 * np.abs(r).max()
    return bool(np.any(taken[told] > 2 * np.log(1 / _WORTH_A_LOOK) * float(e @ e) / e.size))


def _lines(u: NDArray[np.float64], problem: Problem) -> Lines | None:
    """Distortion at lines left out, if the input repeats; the first period may be transient."""
    if problem.valid is not None:
        return None
    period = find_period(u)
    if period is None or u.size < 3 * period:
        return None
    return detection_lines(u[period:], problem.y[period:], period=period)


def _shares(seen: _Seen, power: float) -> Shares:
    if power <= 0:
        return Shares(noise=0.0, linear=0.0, nonlinear=0.0)
    if seen.harmonics is None:
        nonlinear = min(seen.rms**2 / power, 1.0)
        return Shares(noise=1.0 - nonlinear, linear=0.0, nonlinear=nonlinear)
    parts = np.square([seen.harmonics.noise_rms, seen.harmonics.fundamental_rms, seen.rms])
    noise, linear, nonlinear = parts / parts.sum()
    return Shares(noise=float(noise), linear=float(linear), nonlinear=float(nonlinear))


def _named(seen: _Seen) -> tuple[Mechanism, ...]:
    """The kinds that the record leaves in question; one of them, if it tells which."""
    likely = [m for m in seen.mechanisms if m.gain > _GAIN]
    if seen.harmonics is not None:
        found = seen.harmonics
        explained = found.rms(0) ** 2 + found.rms(1) ** 2 + found.fundamental_rms**2
        likely = [m for m in likely if m.rms**2 > _NAMED * explained]
    if not likely:
        return ()
    return tuple(m for m in likely if m.likelihood > likely[0].likelihood - _APART)


def _where(seen: _Seen) -> list[str]:
    """In words: which harmonics, which lines, or which symmetry."""
    where = []
    if seen.harmonics is not None:
        where = [
            f"{name} harmonics of the sweep, {seen.harmonics.rms(parity):.2g}"
            for name, parity in (("odd", 1), ("even", 0))
            if seen.harmonics.probability(parity) < _CHANCE
        ]
    elif seen.mechanisms:
        even = seen.mechanisms[0].kind == "asymmetry"
        where = [f"{'even' if even else 'odd'} in the deflection"]
    if seen.lines is not None:
        where += [
            f"{100 * level.share:.2g} % at {level.parity} lines left out"
            for level in seen.lines.levels
            if level.probability < _CHANCE
        ]
    return where


def _summary(
    seen: _Seen, named: tuple[Mechanism, ...], shares: Shares, output: float, unit: str
) -> Nonlinearity:
    """What the result keeps."""
    even: float | None
    odd: float | None
    even = odd = 0.0
    curves: tuple[HarmonicCurve, ...] = ()
    if seen.harmonics is not None:
        even, odd = (seen.harmonics.rms(p) / output for p in (0, 1))
        curves = tuple(
            HarmonicCurve(order=h.order, frequency=h.frequency, amplitude=h.amplitude, std=h.std)
            for h in seen.harmonics.orders
        )
    elif seen.mechanisms:
        share = seen.mechanisms[0].rms / output
        even, odd = (share, 0.0) if seen.mechanisms[0].kind == "asymmetry" else (0.0, share)
    size = None
    if len(named) == 1:
        value, std = named[0].size, named[0].size_std
        measures = {"friction": unit, "backlash": unit, "saturation": unit}
        measures["rate_limit"] = f"{unit}/s" if unit else "1/s"
        size = Estimate(
            value=value,
            std=std,
            ci95=(value - 1.96 * std, value + 1.96 * std),
            unit=measures.get(named[0].kind, ""),
        )
    return Nonlinearity(
        share=seen.rms / output if output else 0.0,
        even=even,
        odd=odd,
        noise=shares.noise,
        linear=shares.linear,
        nonlinear=shares.nonlinear,
        kinds=tuple(m.kind for m in named),
        size=size,
        harmonics=curves,
    )
