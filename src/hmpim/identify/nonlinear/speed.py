"""A command that the unit follows up to a limited speed.

Below its servo's greatest speed a unit is linear; above it, a ramp at that speed replaces the
command until the unit has caught up. With a known speed the rest of the model is linear, so that
the speed is one more parameter of the likelihood. It is profiled with the plain structures, on a
clock finer than the samples, since ramps begin between them.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import CLEARLY
from hmpim.identify.fitting.data import polished
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit, Problem, fit_structure
from hmpim.identify.fitting.sampled_rows import part_of
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.noise.autoregression import yule_walker
from hmpim.identify.noise.whiteness import is_white
from hmpim.identify.nonlinear.bends import bends
from hmpim.identify.nonlinear.mechanisms import LONGEST, LONGEST_AUTOREGRESSION, RATES
from hmpim.identify.result.digits import plus_minus
from hmpim.identify.worth import PART, TWICE
from hmpim.model.fine import FINE, finely, sampled
from hmpim.model.nonlinear import NonlinearPart
from hmpim.model.operators import rate_limited
from hmpim.model.sampled import prepare_input
from hmpim.record import Finding

__all__ = ["LimitedCommand", "limited_command", "speed_finding", "with_free_speed"]

_STEP = 0.01
"""Step in the speed for its curvature, over the greatest speed of the command."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LimitedCommand:
    """A command as a unit of limited speed follows it; speeds are in its unit per sample."""

    speed: float  # greatest speed of the unit
    std: float  # its standard deviation
    fastest: float  # greatest speed of the command
    values: Real  # (n,): what the unit follows, at the samples
    recorded: Real  # (n,): the command
    slope: Real  # (n,): partial derivative of the output by the speed, up to a factor

    def part(self, fs: float) -> NonlinearPart:
        """What a model needs of it, for samples at `fs` in Hz."""
        return NonlinearPart(
            kind="rate_limit",
            at="command",
            size=self.speed * fs,
            std=self.std * fs,
            reach=self.fastest * fs,
            between="bandlimited",
        )


def limited_command(u: Real, joint: JointFit) -> LimitedCommand | None:
    """Find the speed beyond which a command, (n,), is not followed.

    No limit is tried if the residual of a plain fit is white, or if a richer fit has less than 1/25
    of the best plain one's cost. None unless a limit explains more than the linear fit (odds of 400
    to 1), and more than any other kind of nonlinearity.
    """
    best, problem = joint.best, joint.problem
    known = best.fit.structure.name in PLAIN and is_white(best.fit.residual)
    plain = [trial for trial in joint.trials if trial.fit.structure.name in PLAIN]
    if known or not plain or u.size > LONGEST or best.fit.structure.sampled:
        return None
    start = min(plain, key=lambda trial: trial.criterion)
    if best.fit.cost < PART**2 * start.fit.cost:
        return None  # a limit makes harmonics, which poles cannot imitate that well
    command = _Followed.of(u, problem, start.fit)
    linear = fit_structure(problem, best.fit.structure, best.fit.theta)  # as those with a limit
    near = _nearest(command, linear)
    found = None if near is None else _profiled(u, command, *near)
    if found is None or _log_odds(problem, found[1], linear) <= CLEARLY:
        return None
    limited, fit = found
    plainly = fit_structure(problem, start.fit.structure, start.fit.theta)
    gained = 0.5 * problem.counted * float(np.log(plainly.cost / fit.cost))
    others = bends(u, problem, plainly, intersample=start.intersample)
    if any(other.kind != "rate_limit" and other.gain > gained for other in others):
        return None
    return limited


def _log_odds(problem: Problem, fit: Fit, best: Fit) -> float:
    """Log-odds of a fit with a limited speed to the best linear one.

    Both are in autoregressive noise; the limit counts as a parameter.
    """
    count = problem.counted
    with_limit = yule_walker(problem.masked(fit.residual), LONGEST_AUTOREGRESSION)[1]
    without = yule_walker(problem.masked(best.residual), LONGEST_AUTOREGRESSION)[1]
    if with_limit <= 0.0 or without <= 0.0:
        return -np.inf
    extra = fit.structure.parameters + 1 - best.structure.parameters
    return 0.5 * float(count * np.log(without / with_limit) - extra * np.log(count))


def speed_finding(limited: LimitedCommand, fs: float, unit: str) -> Finding:
    """Report the greatest speed of the unit."""
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
    """A command on the finer clock, and the data with a plain fit to them."""

    fine: Real
    fastest: float  # greatest speed of the command, in the input's unit per fine step
    problem: Problem
    start: Fit

    @classmethod
    def of(cls, u: Real, problem: Problem, start: Fit) -> "_Followed":
        """Take the command from its first sample to its last; between them it is band-limited."""
        fine = finely(u, "bandlimited")
        fastest = float(np.max(np.abs(np.diff(fine))))
        return cls(fine=fine, fastest=fastest, problem=problem, start=start)

    def at(self, speed: float) -> Problem:
        """The data, with the command as it is followed at this speed."""
        rest = self.problem.begins is None
        source = prepare_input(_followed(self.fine, speed), "bandlimited", rest=rest)
        return replace(self.problem, source=source, past_known=None)

    def fit(self, speed: float, *starts: Fit, hopeless: float = np.inf) -> Fit:
        """The best fit at this speed from any of the starts."""
        data, structure = self.at(speed), self.start.structure
        fits = (fit_structure(data, structure, start.theta, hopeless=hopeless) for start in starts)
        return min(fits, key=lambda fit: fit.cost)

    def slope(self, speed: float, fit: Fit) -> Real:
        """Derivative of the output by the speed, up to a factor."""
        step = _STEP * self.fastest
        change = _followed(self.fine, speed + step) - _followed(self.fine, speed - step)
        moved = replace(self.problem, source=prepare_input(change, "bandlimited"), begins=None)
        return np.asarray(fit.linear[:-1] @ part_of(moved, fit.structure, fit.theta).rows)


def _nearest(command: _Followed, best: Fit) -> tuple[float, Fit] | None:
    """The best of the speeds to try, and its fit; None if there is no limit near it.

    A fit stops early if its cost will stay far above that of the linear model. A fit that includes
    the derivative by the speed, as in C. R. Rao's score test (Proc. Cambridge Phil. Soc. 44, 1948),
    shows what speeds between those of the list can explain.
    """
    start, hopeless = command.start, TWICE**2 * best.cost
    speed, least = command.fastest, start
    for share in reversed(RATES):
        tried = share * command.fastest
        same = np.array_equal(least.theta, start.theta)
        starts = (start,) if same else (start, least)
        fit = command.fit(tried, *starts, hopeless=hopeless)
        if fit.cost < least.cost or least is start:
            speed, least = tried, fit
        elif fit.cost > TWICE**2 * least.cost:
            break  # slower ones are worse still
    if least.cost > min(TWICE * best.cost, start.cost):
        return None
    problem = command.at(speed)
    free = problem.with_row(command.slope(speed, least))
    fits = (least, fit_structure(free, least.structure, least.theta))
    if max(_log_odds(problem, fit, best) for fit in fits) <= 0.0:
        return None
    return speed, least


def _profiled(
    u: Real, command: _Followed, near: float, least: Fit
) -> tuple[LimitedCommand, Fit] | None:
    """The speed with the least sum of squares, and its fit; None without a minimum nearby."""
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
        speed=FINE * share * fastest,
        std=FINE * fastest * float(np.sqrt(2.0 * fit.cost / command.problem.counted / curvature)),
        fastest=FINE * fastest,
        values=_followed(command.fine, share * fastest),
        recorded=u,
        slope=command.slope(share * fastest, fit),
    )
    return limited, fit


def with_free_speed(joint: JointFit, slope: Real) -> JointFit:
    """The joint fit with the speed as one more free parameter, so that error bars include it.

    It fits the followed command; `slope`, (n,), is the derivative of the output by the speed.
    """
    problem = joint.problem.with_row(slope)
    weighed = replace(joint.weighed, nuisance=problem.nuisance)
    free = joint.with_fit(polished(weighed, joint.best.fit))
    return replace(free, problem=problem, weighed=weighed)


def _followed(fine: Real, step: float) -> Real:
    """The command at the samples, as followed at `step` per fine step, low-passed."""
    return sampled(rate_limited(fine, step))
