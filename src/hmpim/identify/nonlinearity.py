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
from hmpim.identify.fit import Fit, Problem, jacobian
from hmpim.identify.harmonic_kinds import compare_harmonics
from hmpim.identify.harmonics import Harmonics, any_harmonic, sweep_harmonics
from hmpim.identify.lines import Lines, detection_lines, find_period
from hmpim.identify.mechanisms import Mechanism, compare_mechanisms
from hmpim.identify.nonlinear_words import general, particular
from hmpim.identify.result import Estimate, HarmonicCurve, Nonlinearity
from hmpim.identify.signals import as_signal
from hmpim.identify.sweep_phase import SweepPhase, sweep_phase
from hmpim.identify.whiteness import is_white
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

_DOUBTFUL = 0.005
"""The same, from which parameters may depend on the amplitude by per cents."""

_EFFECT = 0.01
"""R.m.s. of all that a kind does, what passes for linear too, over that of the output, likewise."""

_NAMED = 0.3
"""Share of what the harmonics hold beyond noise that a kind must explain to be named."""

_APART = 10.0
"""Log-likelihood by which the next kind must be behind to be ruled out."""

_APART_SHARE = 0.03
"""The same as a share of what the likeliest kind gains: no trace is exact."""

_ALIKE_SHARE = 0.3
"""The same between friction and backlash: slow motion against a spring with friction is play."""

_MOSTLY = 0.6
"""Share of what the harmonics tell, explained by one kind, that vouches for a plain structure."""

_CLEARER = 0.05
"""By how much that share must be above the one with a rich structure."""

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
    fit : Fit
        The linear fit that goes with it: the given one, or the plainer one where that and one
        kind of nonlinearity explain the output better.
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
    fit: Fit
    summary: Nonlinearity


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Look:
    """The record as it is looked at: in blocks of samples if it is long."""

    u: NDArray[np.float64]
    problem: Problem
    fs: float
    others: tuple[NDArray[np.float64], ...]
    sweep: SweepPhase | None
    block: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Seen:
    """What the tests gave for one linear fit, before it is weighed."""

    fit: Fit
    harmonics: Harmonics | None = None
    lines: Lines | None = None
    mechanisms: tuple[Mechanism, ...] = ()
    named: tuple[Mechanism, ...] = ()
    rms: float = 0.0

    @property
    def explained(self) -> float:
        """Share of what the harmonics tell that the likeliest kind explains."""
        if self.harmonics is None or not self.named:
            return 0.0
        return self.named[0].gain / max(self.harmonics.regression.evidence, _GAIN)

    @property
    def effect(self) -> float:
        """R.m.s. of all that the likeliest kind does, where harmonics vouch for its size."""
        if self.harmonics is None or not self.named:
            return self.rms
        return max(self.rms, self.named[0].effect)


def inspect_nonlinearity(
    u: ArrayLike,
    problem: Problem,
    fit: Fit,
    *,
    fs: float,
    plain: Fit | None = None,
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
    plain : Fit, optional
        Of a plainer structure, to be weighed against `fit` if there is a nonlinearity: a rich
        structure may have been taken for the sake of what is not linear.
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
    block = -(-source.size // _LONGEST)
    sweep = sweep_phase(_thinned(source, block), fs / block)
    look = _Look(u=source, problem=problem, fs=fs, others=tuple(others), sweep=sweep, block=block)
    seen = _seen(look, fit)
    if plain is not None and seen.rms > 0:
        seen = _plainer(look, seen, _seen(look, plain))
    matters = seen.effect > _SMALLEST * output and seen.rms > floor
    named = seen.named if matters else ()
    shares = _shares(seen, seen.fit.cost / max(problem.counted, 1))
    findings: list[Finding] = []
    if matters:
        findings.append(
            general(
                share=seen.rms / output,
                where=_where(seen),
                made_of=(shares.noise, shares.linear, shares.nonlinear),
                kinds=named,
                effect=seen.effect / output,
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
        doubtful=matters and (seen.rms > _DOUBTFUL * output or seen.effect > _EFFECT * output),
        fit=seen.fit if matters else fit,
        summary=_summary(seen, named, shares, output, unit),
    )


def _thinned(x: NDArray[np.float64], block: int) -> NDArray[np.float64]:
    """Means over blocks of samples; an incomplete one at the end is left out."""
    if block == 1:
        return x
    return np.asarray(x[: x.size // block * block].reshape(-1, block).mean(axis=1))


def _seen(look: _Look, fit: Fit) -> _Seen:
    """All tests that the input allows; a quick look first if the residual is white."""
    counted = slice(None) if look.problem.valid is None else look.problem.valid
    white = is_white(fit.residual[counted])
    if look.sweep is not None:
        return _by_harmonics(look, look.sweep, fit, white)
    return _Seen(fit=fit) if look.others else _by_traces(look, fit, white)


def _by_harmonics(look: _Look, sweep: SweepPhase, fit: Fit, white: bool) -> _Seen:
    """Ask a sweep for its harmonics, and which kind makes them."""
    residual = _thinned(fit.residual, look.block)
    rate, delay = look.fs / look.block, fit.delay / look.fs
    if (
        white
        and any_harmonic(residual, sweep, rate, delay=delay) > _WORTH_A_LOOK
        and not _curved(fit, look.problem)
    ):
        return _Seen(fit=fit)
    phases = [sweep_phase(_thinned(other, look.block), rate) for other in look.others]
    harmonics = sweep_harmonics(
        _thinned(look.u, look.block),
        residual,
        rate,
        delay=delay,
        phase=sweep,
        others=[phase for phase in phases if phase is not None],
    )
    if harmonics is None:
        return _Seen(fit=fit)
    parts = [harmonics.rms(p) for p in (0, 1) if harmonics.probability(p) < _CHANCE]
    kinds: tuple[Mechanism, ...] = ()
    if not look.others and np.ptp(fit.prediction) > 0:
        powers = np.arange(fit.denominator.size)
        kinds = compare_harmonics(
            harmonics.regression,
            _thinned(fit.prediction - fit.linear[-1], look.block),
            fit.denominator / float(look.block) ** powers,
            fs=rate,
        )
    named = _likely(kinds, harmonics.regression.evidence)
    if not parts and not named:
        return _Seen(fit=fit, harmonics=harmonics)
    rms = float(np.sqrt(np.sum(np.square(parts)))) if parts else named[0].rms
    return _Seen(fit=fit, harmonics=harmonics, mechanisms=kinds, named=named, rms=rms)


def _by_traces(look: _Look, fit: Fit, white: bool) -> _Seen:
    """Ask lines left out, if the input repeats, and whether any kind explains the residual."""
    lines = _lines(look.u, look.problem)
    levels = [] if lines is None else [v for v in lines.levels if v.probability < _CHANCE]
    if white and not levels and not _curved(fit, look.problem):
        return _Seen(fit=fit, lines=lines)
    found = tuple(m for m in compare_mechanisms(look.problem, fit, fs=look.fs) if m.gain > _GAIN)
    distortion = float(np.sqrt(sum(0.5 * v.lines * v.rms**2 for v in levels)))
    return _Seen(
        fit=fit,
        lines=lines,
        mechanisms=found,
        named=_likely(found, 0.0),
        rms=max(distortion, found[0].rms if found else 0.0),
    )


def _likely(kinds: tuple[Mechanism, ...], evidence: float) -> tuple[Mechanism, ...]:
    """The kinds that the record leaves in question; one of them, if it tells which.

    `evidence` is the log-likelihood that all harmonics gain beyond what noise would.
    """
    if not kinds or kinds[0].gain < max(_GAIN, _NAMED * evidence):
        return ()
    first = kinds[0]

    def behind(other: Mechanism) -> float:
        alike = {first.kind, other.kind} == {"friction", "backlash"}
        return max(_APART, (_ALIKE_SHARE if alike else _APART_SHARE) * first.gain)

    return tuple(m for m in kinds if m.likelihood > first.likelihood - behind(m))


def _plainer(look: _Look, rich: _Seen, plain: _Seen) -> _Seen:
    """The plain fit if one kind beside it explains the harmonics clearly better, or all better."""
    if plain.explained > max(_MOSTLY, rich.explained + _CLEARER):
        return plain
    return min(rich, plain, key=lambda one: _criterion(look, one))


def _criterion(look: _Look, seen: _Seen) -> float:
    """Bayesian criterion of a linear fit with the likeliest kind beside it, if there is one."""
    e = _thinned(seen.fit.residual, look.block)
    unknown, cost = seen.fit.structure.parameters, float(e @ e)
    if seen.named and seen.named[0].trace.size == e.size:
        valid = look.problem.valid
        trace = seen.named[0].trace
        if valid is not None:
            trace = trace * _thinned(valid.astype(np.float64), look.block)
        rows = [_thinned(row, look.block) for row in jacobian(look.problem, seen.fit)]
        basis = np.linalg.qr(np.stack([*rows, trace]).T)[0]
        cost -= float(np.sum((basis.T @ e) ** 2))
        unknown += 1
    return e.size * float(np.log(max(cost, np.finfo(float).tiny))) + unknown * float(np.log(e.size))


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
