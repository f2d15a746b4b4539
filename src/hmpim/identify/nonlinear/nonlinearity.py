"""Whether the system is linear, and if not, in which way and by how much.

A sweep answers the first question by its harmonics, a multisine by the lines it leaves out,
any other input by how much better a nonlinear trace explains the residual. Which way is for
`hmpim.identify.nonlinear.mechanisms`, asked only where there is something to explain. Dependence on
the amplitude takes several records: `hmpim.identify.records.levels`.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM, HALF
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.nonlinear.evidence import Look, Seen, look_at, plainer_of, thinned
from hmpim.identify.nonlinear.harmonic_regression import SweepView
from hmpim.identify.nonlinear.mechanisms import Mechanism
from hmpim.identify.nonlinear.sweep_phase import sweep_phase
from hmpim.identify.nonlinear.words import general, particular
from hmpim.identify.result import Estimate, HarmonicCurve, Nonlinearity
from hmpim.identify.result.digits import percent
from hmpim.identify.signals import as_pair
from hmpim.identify.worth import MATERIAL, WORTH
from hmpim.record import Finding

__all__ = ["Inspection", "inspect_nonlinearity"]

_LONGEST = 32768
"""Samples of a sweep looked at one by one; longer records are averaged in blocks first."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Inspection:
    """What was found.

    Parameters
    ----------
    seen : Seen
        Results of the tests: harmonics, if the input is a sweep and the residual gives reason to
        look for them; lines, if the input is periodic with lines left out; the likeliest kinds.
    findings : tuple of Finding
        Code 'nonlinear' if it matters; then the code of the kind where it can be named:
        'hardening', 'softening', 'friction', 'backlash', 'rate_limit', 'saturation'.
    fit : Fit
        The linear fit that goes with it: the given one, or the plainer one where that and one
        kind of nonlinearity explain the output better.
    summary : Nonlinearity
        The same, as the result keeps it.
    """

    seen: Seen
    findings: tuple[Finding, ...]
    fit: Fit
    summary: Nonlinearity


def inspect_nonlinearity(
    u: ArrayLike,
    problem: Problem,
    fit: Fit,
    *,
    fs: float,
    plain: Fit | None = None,
    others: Sequence[Real] = (),
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
    >>> from hmpim.identify.fitting.fit import fit_structure
    >>> from hmpim.model import STRUCTURES, prepare_input
    >>> t = np.arange(2000) / 200
    >>> u = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> y = u - 0.1 * u**3 + 0.01 * np.random.default_rng(0).standard_normal(2000)
    >>> data = Problem(source=prepare_input(u, "bandlimited"), y=y, valid=None, longest_delay=9.0)
    >>> fit = fit_structure(data, STRUCTURES["static"], np.zeros(1))
    >>> found = inspect_nonlinearity(u, data, fit, fs=200.0)
    >>> found.seen.mechanisms[0].kind, [finding.code for finding in found.findings]
    ('curvature', ['nonlinear'])
    """
    source, _ = as_pair(u, problem.y, names=("u", "the output"))
    counted = problem.y if problem.valid is None else problem.y[problem.valid]
    output = float(np.std(counted))
    block = -(-source.size // _LONGEST)
    sweep = sweep_phase(thinned(source, block), fs / block)
    look = Look(u=source, problem=problem, fs=fs, others=tuple(others), sweep=sweep, block=block)
    seen = look_at(look, fit)
    if plain is not None and seen.rms > 0:
        seen = plainer_of(look, seen, look_at(look, plain))
    matters = seen.effect > WORTH * output and seen.rms > floor
    named = seen.named if matters else ()
    shares = _shares(seen, seen.fit.cost / max(problem.counted, 1))
    findings: list[Finding] = []
    if matters:
        findings.append(
            general(
                share=seen.rms / output,
                where=_where(seen, output),
                made_of=shares,
                kinds=named,
                effect=seen.effect / output,
                asked=not others,
                swept=seen.harmonics is not None,
                doubt=_is_large(seen, output),
            )
        )
        of_kind = particular(named[0], unit) if len(named) == 1 else None
        if of_kind is not None:
            findings.append(of_kind)
    return Inspection(
        seen=seen,
        findings=tuple(findings),
        fit=seen.fit if matters else fit,
        summary=_summary(look, seen, shares, output, unit=unit, named=named),
    )


def _is_large(seen: Seen, output: float) -> bool:
    """Whether the linear parameters hold at this amplitude only."""
    return seen.effect > MATERIAL * output


def _shares(seen: Seen, power: float) -> tuple[float, float, float]:
    """Noise, what follows the input at its own frequency, and what no linear system makes."""
    if power <= 0:
        return 0.0, 0.0, 0.0
    if seen.harmonics is None:
        nonlinear = min(seen.rms**2 / power, 1.0)
        return 1.0 - nonlinear, 0.0, nonlinear
    parts = np.square([seen.harmonics.noise_rms, seen.harmonics.fundamental_rms, seen.rms])
    noise, linear, nonlinear = parts / parts.sum()
    return float(noise), float(linear), float(nonlinear)


def _where(seen: Seen, output: float) -> list[str]:
    """In words: which harmonics, which lines, or which symmetry."""
    where = []
    if seen.harmonics is not None:
        where = [
            f"{percent(seen.harmonics.rms(parity) / output)} % in {name} harmonics of the sweep"
            for name, parity in (("odd", 1), ("even", 0))
            if seen.harmonics.probability(parity) < FALSE_ALARM
        ]
    elif seen.mechanisms:
        even = seen.mechanisms[0].kind == "asymmetry"
        where = [f"{'even' if even else 'odd'} in the deflection"]
    if seen.lines is not None:
        where += [
            f"{percent(level.share)} % at {level.parity} lines left out"
            for level in seen.lines.levels
            if level.probability < FALSE_ALARM
        ]
    return where


def _summary(
    look: Look,
    seen: Seen,
    shares: tuple[float, float, float],
    output: float,
    *,
    unit: str,
    named: tuple[Mechanism, ...],
) -> Nonlinearity:
    """What the result keeps."""
    even: float | None
    odd: float | None
    even = odd = 0.0
    curves: tuple[HarmonicCurve, ...] = ()
    if seen.harmonics is not None:
        even, odd = (seen.harmonics.rms(p) / output for p in (0, 1))
        curves = (
            _own_amplitude(
                seen.harmonics.regression.view,
                thinned(seen.fit.prediction, look.block),
                look.fs / look.block,
            ),
            *(
                HarmonicCurve(
                    order=h.order, frequency=h.frequency, amplitude=h.amplitude, std=h.std
                )
                for h in seen.harmonics.orders
            ),
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
            ci95=(value - HALF * std, value + HALF * std),
            unit=measures.get(named[0].kind, ""),
        )
    noise, linear, nonlinear = shares
    return Nonlinearity(
        share=seen.rms / output if output else 0.0,
        even=even,
        odd=odd,
        noise=noise,
        linear=linear,
        nonlinear=nonlinear,
        kinds=tuple(m.kind for m in named),
        size=size,
        harmonics=curves,
    )


def _own_amplitude(view: SweepView, x: Real, fs: float) -> HarmonicCurve:
    """Amplitude of the linear model's output along the sweep, where the harmonics are told."""
    frequency, amplitude = [], []
    for place in range(view.places + 1):
        near = view.index[np.abs(view.along - place) < 0.5]
        if near.size:
            frequency.append(fs * float(np.interp(place, view.along, view.rate)))
            amplitude.append(float(np.std(x[near]) * np.sqrt(2.0)))
    return HarmonicCurve(
        order=1,
        frequency=tuple(frequency),
        amplitude=tuple(amplitude),
        std=(0.0,) * len(frequency),
    )
