"""A command that the unit follows at no more than a fixed speed.

Below its servo's greatest speed a unit is linear; beyond, a ramp of that speed takes the place of
the command until it has caught up. With the speed known all else is linear, so that it is one more
parameter of the likelihood: it is profiled with the plain structures, on a clock finer than the
samples, since ramps begin between them.
"""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.bends import bends
from hmpim.identify.nonlinear.mechanisms import LONGEST_AUTOREGRESSION, RATES, rate_limited
from hmpim.identify.result.digits import plus_minus
from hmpim.identify.worth import PART, TWICE
from hmpim.model.sampled import MARGIN, delayed_response, prepare_input
from hmpim.record import Finding, Intersample

__all__ = ["LimitedCommand", "beside_speed", "explains_more", "limited_command", "speed_finding"]

_FINE = 8
"""Steps of the finer clock to a sample."""

_LONGEST = 32768
"""Samples up to which it is asked: ramps are followed one step after the other."""

_SMOOTH: tuple[Intersample, ...] = ("bandlimited", "foh")
"""What the command may do between its samples; a held one jumps, at any speed."""

_STEP = 0.01
"""Step in the speed, over the command's fastest, between which the curvature is read."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LimitedCommand:
    """What a unit of limited speed makes of its command.

    Parameters
    ----------
    speed, std : float
        Greatest speed and its standard deviation, input's unit per sample.
    fastest : float
        Greatest speed of the command, in the same unit.
    values : ndarray, shape (n,)
        What the unit follows, at the samples.
    recorded : ndarray, shape (n,)
        The command.
    slope : ndarray, shape (n,)
        Derivative of the output with the speed, all other parameters kept, to a factor.
    """

    speed: float
    std: float
    fastest: float
    values: Real
    recorded: Real
    slope: Real


def limited_command(u: Real, joint: JointFit) -> LimitedCommand | None:
    """Find the speed beyond which a command, (n,), is not followed.

    Nothing is asked if a plain fit leaves white noise, or a richer one less than 1/25 of what the
    best plain one leaves. None where a limit does not explain more than the linear fit (odds of 400
    to 1), or than another kind of nonlinearity.

    Examples
    --------
    >>> from hmpim.identify.fitting.joint import joint_fit
    >>> t = np.arange(600) / 100
    >>> u = np.sin(2 * np.pi * (0.1 * t + 0.067 * t**2))
    >>> y = np.convolve(rate_limited(u, 0.04), np.ones(5) / 5)[:600]
    >>> y += 0.01 * np.random.default_rng(0).standard_normal(600)
    >>> round(limited_command(u, joint_fit(u, y)).speed, 3)
    0.04
    """
    best, problem = joint.best, joint.problem
    known = best.fit.structure.name in PLAIN and is_white(best.fit.residual)
    plain = [trial for trial in joint.trials if trial.fit.structure.name in PLAIN]
    if known or not plain or u.size > _LONGEST or best.fit.structure.sampled:
        return None
    start = min(plain, key=lambda trial: trial.criterion)
    if best.fit.cost < PART**2 * start.fit.cost:
        return None  # a limit makes harmonics, which poles cannot imitate that well
    smooth, joined = _SMOOTH
    command = _Followed.of(u, smooth, problem, start.fit)
    linear = fit_structure(problem, best.fit.structure, best.fit.theta)  # as those with a limit are
    near = _nearest(command, linear)
    if near is None:
        return None
    found = _profiled(u, command, *near)
    speed, least = near if found is None else (found[0].speed / _FINE, found[1])
    other = _Followed.of(u, joined, problem, start.fit)
    if other.fit(speed, least).cost < TWICE * least.cost:
        tried = (found, _profiled(u, other, speed, least))
        found = min((one for one in tried if one), key=lambda one: one[1].cost, default=None)
    if found is None or not explains_more(problem, found[1], problem, linear):
        return None
    limited, fit = found
    plainly = linear
    if start is not best:
        plainly = fit_structure(problem, start.fit.structure, start.fit.theta)
    gained = 0.5 * problem.counted * float(np.log(plainly.cost / fit.cost))
    others = bends(u, problem, plainly, intersample=start.intersample, fs=1.0)
    if any(one.kind != "rate_limit" and one.gain > gained for one in others):
        return None
    return limited


def explains_more(limited: Problem, fit: Fit, linear: Problem, best: Fit) -> bool:
    """Whether a fit with a limit of speed is likelier than the best linear one by 400 to 1.

    Each to its own data. Both in noise that is an autoregression, the limit for the price of a
    parameter.
    """
    return _likelier(limited, fit, linear, best) > CLEARLY


def _likelier(limited: Problem, fit: Fit, linear: Problem, best: Fit) -> float:
    """Logarithm of those odds."""
    count = limited.counted
    one, other = (
        yule_walker(p.masked(f.residual), LONGEST_AUTOREGRESSION)[1]
        for p, f in ((limited, fit), (linear, best))
    )
    if one <= 0.0 or other <= 0.0:
        return -np.inf
    extra = fit.structure.parameters + 1 - best.structure.parameters
    return 0.5 * float(count * np.log(other / one) - extra * np.log(count))


def speed_finding(limited: LimitedCommand, fs: float, unit: str) -> Finding:
    """Say how fast the unit follows at most."""
    per = f" {unit}/s" if unit else " per s"
    return Finding(
        code="rate_limit",
        message=f"The unit follows its command at no more than "
        f"{plus_minus(limited.speed * fs, limited.std * fs)}{per}; the command moves at up to "
        f"{limited.fastest * fs:.4g}{per}. The figures are those of the linear part. Keep the "
        "stimulus below this speed to measure them directly.",
        severity="info",
        parameters=(),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Followed:
    """A command on the finer clock, and the data and the plain fit to it.

    `fastest` is its greatest speed, in the input's unit per fine step.
    """

    fine: Real
    fastest: float
    problem: Problem
    start: Fit

    @classmethod
    def of(cls, u: Real, mode: Intersample, problem: Problem, start: Fit) -> "_Followed":
        """From its samples."""
        fine = _finely(u, mode)
        fastest = float(np.max(np.abs(np.diff(fine))))
        return cls(fine=fine, fastest=fastest, problem=problem, start=start)

    def at(self, speed: float) -> Problem:
        """The data with what is followed at this speed in the command's place."""
        rest = self.problem.begins is None
        source = prepare_input(_followed(self.fine, speed), "bandlimited", rest=rest)
        return replace(self.problem, source=source, told=None)

    def fit(self, speed: float, *starts: Fit, hopeless: float = np.inf) -> Fit:
        """The best fit to it from any of the starts."""
        data, structure = self.at(speed), self.start.structure
        fits = (fit_structure(data, structure, one.theta, hopeless=hopeless) for one in starts)
        return min(fits, key=lambda fit: fit.cost)

    def slope(self, speed: float, fit: Fit) -> Real:
        """Derivative of the output with the speed, to a factor."""
        step = _STEP * self.fastest
        change = _followed(self.fine, speed + step) - _followed(self.fine, speed - step)
        moved = replace(self.problem, source=prepare_input(change, "bandlimited"), begins=None)
        return np.asarray(fit.linear[:-1] @ part_of(moved, fit.structure, fit.theta).rows)


def _nearest(command: _Followed, best: Fit) -> tuple[float, Fit] | None:
    """Of the speeds tried the one that leaves least; None where no limit is near it.

    A fit that is to leave more than another kind of model is not followed to its end. Beside the
    derivative with the speed, as in C. R. Rao's score test (Proc. Cambridge Phil. Soc. 44, 1948),
    what is left shows what the speeds between those tried can explain.
    """
    start, hopeless = command.start, TWICE**2 * best.cost
    speed, least = command.fastest, start
    for share in reversed(RATES):
        tried = share * command.fastest
        starts = (start,) if least is start else (start, least)
        fit = command.fit(tried, *starts, hopeless=hopeless)
        if fit.cost < least.cost or least is start:
            speed, least = tried, fit
        elif fit.cost > TWICE**2 * least.cost:
            break  # slower ones leave still more
    if least.cost > min(TWICE * best.cost, start.cost):
        return None
    problem = command.at(speed)
    free = _beside(problem, command.slope(speed, least))
    beside = fit_structure(free, least.structure, least.theta)
    if max(_likelier(problem, one, command.problem, best) for one in (least, beside)) <= 0.0:
        return None
    return speed, least


def _profiled(
    u: Real, command: _Followed, near: float, least: Fit
) -> tuple[LimitedCommand, Fit] | None:
    """The speed at which the sum of squares is least, and the fit; None where none is near."""
    fastest = command.fastest
    at = near / fastest
    found = scipy.optimize.minimize_scalar(
        lambda share: command.fit(share * fastest, least).cost,
        bounds=(at - 10 * _STEP, max(min(at + 10 * _STEP, 1.0), at)),
        method="bounded",
        options={"xatol": _STEP**2},
    )
    share = float(found.x)
    fit = command.fit(share * fastest, least)
    slower, faster = (command.fit((share + step) * fastest, fit) for step in (-_STEP, _STEP))
    curvature = (slower.cost + faster.cost - 2.0 * fit.cost) / _STEP**2
    if curvature <= 0.0:
        return None
    limited = LimitedCommand(
        speed=_FINE * share * fastest,
        std=_FINE * fastest * float(np.sqrt(2.0 * fit.cost / command.problem.counted / curvature)),
        fastest=_FINE * fastest,
        values=_followed(command.fine, share * fastest),
        recorded=u,
        slope=command.slope(share * fastest, fit),
    )
    return limited, fit


def beside_speed(joint: JointFit, slope: Real) -> JointFit:
    """The joint fit with the speed free to move too, so that error bars have room for it.

    It is the fit to the command as it is followed; `slope`, (n,), is the derivative of the output
    with the speed.
    """
    problem = _beside(joint.problem, slope)
    weighed = replace(joint.weighed, nuisance=problem.nuisance)
    structure, theta = joint.best.fit.structure, joint.best.fit.theta
    fit = fit_structure(weighed, structure, theta, precision=weighed.final)
    best = replace(joint.best, fit=fit)
    return replace(
        joint,
        problem=problem,
        weighed=weighed,
        best=best,
        trials=tuple(best if trial is joint.best else trial for trial in joint.trials),
    )


def _beside(problem: Problem, slope: Real) -> Problem:
    """The data with one more row that is free to move."""
    known = problem.nuisance
    rows = slope[None] if known is None else np.vstack([known, slope])
    return replace(problem, nuisance=rows)


def _finely(u: Real, mode: Intersample) -> Real:
    """A command on the finer clock, from its first sample to its last."""
    source = prepare_input(u, mode)
    still = np.ones(1)
    steps = [delayed_response(source, delay=-k / _FINE, denominator=still)[0] for k in range(_FINE)]
    return np.asarray(source.first + np.stack(steps, axis=1).ravel()[: 1 - _FINE])


@cache
def _below_half_the_rate() -> Real:
    """Windowed sinc on the finer clock that keeps what the samples can tell."""
    size = 2 * MARGIN * _FINE + 1
    return np.asarray(scipy.signal.firwin(size, 1.0 / _FINE, window=("kaiser", 12.0)))


def _followed(fine: Real, step: float) -> Real:
    """What is followed at so much a fine step, below half the rate, at the samples."""
    out = rate_limited(fine, step)
    reach = min(MARGIN * _FINE, out.size - 1)
    longer = np.pad(out, reach, mode="reflect", reflect_type="odd")
    smooth = scipy.signal.oaconvolve(longer, _below_half_the_rate(), mode="same")
    return np.asarray(smooth[reach : reach + out.size : _FINE])
