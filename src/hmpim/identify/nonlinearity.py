"""Whether the system is linear, and if not, in which way and by how much.

A sweep answers the first question by its harmonics, a multisine by the lines it leaves out,
any other input by how much better a nonlinear trace explains the residual. Which way is for
`hmpim.identify.mechanisms`, asked only where there is something to explain. Dependence on
the amplitude takes several records: `hmpim.identify.levels`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.errors import RecordError
from hmpim.identify.fit import Fit, Problem
from hmpim.identify.harmonics import Harmonics, sweep_harmonics
from hmpim.identify.levels import Level, LevelComparison, compare_levels
from hmpim.identify.lines import Lines, detection_lines, find_period
from hmpim.identify.mechanisms import Kind, Mechanism, compare_mechanisms
from hmpim.identify.signals import as_signal
from hmpim.record import Finding

__all__ = [
    "Harmonics",
    "Level",
    "LevelComparison",
    "Lines",
    "Mechanism",
    "Nonlinearity",
    "Shares",
    "compare_levels",
    "inspect_nonlinearity",
]

_CHANCE = 1e-5
"""Chance of a harmonic or a line from noise alone below which it counts."""

_GAIN = 12.0
"""Log-likelihood that a trace must bring; in linear systems the best of all reaches 7."""

_SMALLEST = 0.003
"""R.m.s. of the nonlinear part over that of the output from which it is worth a warning."""

_NAMED = 0.25
"""Share of what is not noise in a sweep's residual that a kind must explain to be named."""

_APART = 10.0
"""Log-likelihood by which the next kind must be behind to be ruled out."""

_WORDS: dict[Kind, str] = {
    "hardening": "a hardening spring",
    "softening": "a softening spring",
    "friction": "Coulomb friction",
    "backlash": "backlash",
    "rate_limit": "a rate limit",
    "saturation": "clipping",
    "asymmetry": "an asymmetric response",
    "curvature": "a scale factor that changes with the deflection",
}


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
class Nonlinearity:
    """What was found; None where the input does not allow it or there was nothing to ask.

    Parameters
    ----------
    harmonics : Harmonics or None
        For a sweep.
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
    """

    harmonics: Harmonics | None
    lines: Lines | None
    mechanisms: tuple[Mechanism, ...]
    shares: Shares
    rms: float
    findings: tuple[Finding, ...]


def inspect_nonlinearity(
    u: ArrayLike,
    problem: Problem,
    fit: Fit,
    *,
    fs: float,
    smallest: float = _SMALLEST,
    unit: str = "",
) -> Nonlinearity:
    """Look for nonlinearity in what a linear fit leaves over.

    Parameters
    ----------
    u : array_like, shape (n,)
        Input samples.
    problem, fit
        The data and the linear fit.
    fs : float
        Rate in Hz.
    smallest : float
        R.m.s. of the nonlinear part over that of the output below which nothing is said.
    unit : str
        The output's unit, for the sentences.

    Returns
    -------
    Nonlinearity

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
    harmonics = sweep_harmonics(source, fit.residual, fs, delay=fit.delay / fs)
    lines = None if harmonics is not None else _lines(source, problem)
    mechanisms: tuple[Mechanism, ...] = ()
    if harmonics is not None:
        rms = _seen(harmonics)
        if rms > smallest * output:
            mechanisms = compare_mechanisms(problem, fit, fs=fs)
    else:
        mechanisms = tuple(m for m in compare_mechanisms(problem, fit, fs=fs) if m.gain > _GAIN)
        rms = mechanisms[0].rms if mechanisms else 0.0
    matters = rms > smallest * output
    named = _named(harmonics, mechanisms) if matters else ()
    findings: list[Finding] = []
    if matters:
        findings.append(_general(harmonics, lines, mechanisms, named, rms / output))
        particular = _particular(named[0], unit) if len(named) == 1 else None
        if particular is not None:
            findings.append(particular)
    return Nonlinearity(
        harmonics=harmonics,
        lines=lines,
        mechanisms=mechanisms,
        shares=_shares(harmonics, rms, power),
        rms=rms,
        findings=tuple(findings),
    )


def _lines(u: NDArray[np.float64], problem: Problem) -> Lines | None:
    """Distortion at lines left out, if the input repeats; the first period may be transient."""
    if problem.valid is not None:
        return None
    period = find_period(u)
    if period is None or u.size < 3 * period:
        return None
    return detection_lines(u[period:], problem.y[period:], period=period)


def _seen(harmonics: Harmonics) -> float:
    """R.m.s. of the harmonics that are no chance."""
    parts = [harmonics.rms(p) for p in (0, 1) if harmonics.probability(p) < _CHANCE]
    return float(np.sqrt(np.sum(np.square(parts))))


def _shares(harmonics: Harmonics | None, rms: float, power: float) -> Shares:
    if power <= 0:
        return Shares(noise=0.0, linear=0.0, nonlinear=0.0)
    if harmonics is None:
        nonlinear = min(rms**2 / power, 1.0)
        return Shares(noise=1.0 - nonlinear, linear=0.0, nonlinear=nonlinear)
    parts = np.square([harmonics.noise_rms, harmonics.fundamental_rms, rms])
    noise, linear, nonlinear = parts / parts.sum()
    return Shares(noise=float(noise), linear=float(linear), nonlinear=float(nonlinear))


def _named(harmonics: Harmonics | None, mechanisms: tuple[Mechanism, ...]) -> tuple[Mechanism, ...]:
    """The kinds that the record leaves in question; one of them, if it tells which."""
    likely = [m for m in mechanisms if m.gain > _GAIN]
    if harmonics is not None:
        explained = harmonics.rms(0) ** 2 + harmonics.rms(1) ** 2 + harmonics.fundamental_rms**2
        likely = [m for m in likely if m.rms**2 > _NAMED * explained]
    if not likely:
        return ()
    return tuple(m for m in likely if m.likelihood > likely[0].likelihood - _APART)


def _general(
    harmonics: Harmonics | None,
    lines: Lines | None,
    mechanisms: tuple[Mechanism, ...],
    named: tuple[Mechanism, ...],
    share: float,
) -> Finding:
    """That it is nonlinear, how much, even or odd, and what it may be."""
    about = ""
    if harmonics is not None:
        parts = [
            f"{name} harmonics"
            for name, parity in (("odd", 1), ("even", 0))
            if harmonics.probability(parity) < _CHANCE
        ]
        about = f", in {' and '.join(parts)} of the sweep"
    elif mechanisms:
        even = mechanisms[0].kind == "asymmetry"
        about = f", {'even' if even else 'odd'} in the deflection"
    if lines is not None:
        about += "".join(
            f"; {100 * level.share:.2g} % at {level.parity} lines left out"
            for level in lines.levels
            if level.probability < _CHANCE
        )
    if len(named) == 1:
        guess = f"It looks like {_WORDS[named[0].kind]}."
    elif named:
        kinds = " or ".join(_WORDS[m.kind] for m in named)
        guess = f"It may be {kinds}; this record cannot tell which."
    else:
        guess = "It fits no single one of the kinds that are tried."
    return Finding(
        code="nonlinear",
        message=f"{100 * share:.2g} % of the output (r.m.s.) is nonlinear{about}. {guess} "
        "Identify at several amplitudes to see where the linear model holds.",
    )


def _particular(found: Mechanism, unit: str) -> Finding | None:
    """What the kind means, with its number, and what to do about it."""
    of = f" {unit}" if unit else ""
    percent = f"{100 * found.size:.2g} ± {100 * found.size_std:.1g} %"
    size = f"{found.size:.2g} ± {found.size_std:.1g}{of}"
    match found.kind:
        case "hardening" | "softening":
            way, moves = ("above", "higher") if found.kind == "hardening" else ("below", "lower")
            message = (
                f"The restoring force is {percent} {way} proportion at the largest deflection, "
                f"so the natural frequency there is about {37.5 * found.size:.2g} % {moves} than "
                "for small motion. Use a smaller amplitude for the linear model."
            )
        case "friction":
            message = (
                f"Coulomb friction holds like a deflection of {size}. Motions of that size hardly "
                "show in the output; use larger ones, or put friction into the model."
            )
        case "backlash":
            message = (
                f"There is play of about {2 * found.size:.2g}{of} in all (half: {size}). Look at "
                "gears and couplings, or put backlash into the model."
            )
        case "rate_limit":
            message = (
                f"The speed seems limited to about {size}{'/s' if unit else ' per second'}. "
                "Keep the stimulus's velocity below it."
            )
        case "saturation":
            message = (
                f"The output seems clipped about {size} from its bias. Drive it less hard, or "
                "look for a stop."
            )
        case _:
            return None
    return Finding(code=found.kind, message=message)
