"""Delay and lag of a weak coupling, where the record hardly tells one from the other.

At low frequencies a delay and a first-order lag turn the phase alike, and a weak coupling is
told at low frequencies best. The likeliest split of the two then says little, and bars around
it less: a lag of zero looks certain where it is only not seen. So the likelihood is summed over
all lags, each with its own best delay (a flat prior on the lag: Sivia and Skilling, Data
Analysis, 2nd ed., Oxford 2006, ch. 3).
"""

from dataclasses import dataclass

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.fit import Fit, Problem
from hmpim.identify.worth import FEW
from hmpim.model.sampled import delayed_response

__all__ = ["Lag", "lag_of"]

_POINTS = 16
_EARLIEST = -1.0
"""Least delay of a coupling, in samples: causal, to the sample that stamps may be off."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Lag:
    """What the record says of delay and lag together, in samples: mean and deviation over lags."""

    delay: float
    delay_std: float
    time_constant: float
    time_constant_std: float


def lag_of(problem: Problem, fit: Fit, others: Real) -> Lag | None:
    """Sum the likelihood over lags of a static or first-order fit; None if no lag gives a delay.

    The problem's output is what the other inputs leave over; `others`, (k, n), are the derivatives
    by all other parameters, whitened, which are free to give way.
    """
    basis, _ = np.linalg.qr(others.T)

    def clean(rows: Real) -> Real:
        counted = problem.masked(rows)
        return np.asarray(counted - (counted @ basis) @ basis.T)

    y = clean(problem.y)
    total = fit.delay + (float(np.exp(fit.theta[1])) if fit.theta.size > 1 else 0.0)
    top = max(2.0 * total, 4.0)
    found: list[tuple[float, float, float, float]] = []
    for _ in range(2):  # the second time no further than the first had anything
        found = []
        for lag in top * (np.arange(_POINTS) / (_POINTS - 1.0)):
            held = max(float(lag), FEW)
            delay = total - float(lag)
            rows = _answers(problem, delay, held)
            seen = clean(rows)
            gram = seen @ seen.T
            if not np.linalg.cond(gram / np.sqrt(np.outer(np.diag(gram), np.diag(gram)))) < 1e10:
                continue
            gain, slope = np.linalg.solve(gram, seen @ y)
            left = y - np.array([gain, slope]) @ seen
            shift = -slope / gain
            variance = float(np.linalg.inv(gram)[1, 1]) / gain**2
            found.append((float(lag), delay + shift, variance, float(left @ left)))
        likely = [p for p in found if p[1] >= _EARLIEST]
        if not likely:
            return None
        costs = np.array([p[3] for p in likely])
        sigma2 = float(costs.min()) / max(problem.counted - others.shape[0] - 3, 1)
        weight = np.exp(-0.5 * (costs - costs.min()) / sigma2)
        reached = max(p[0] for p, w in zip(likely, weight, strict=True) if w > FALSE_ALARM)
        top = min(1.3 * reached + FEW, top)
    lags = np.array([p[0] for p in likely])
    delays = np.array([p[1] for p in likely])
    variances = sigma2 * np.array([p[2] for p in likely])
    weight /= weight.sum()
    delay, lag = float(weight @ delays), float(weight @ lags)
    step = lags[1] - lags[0] if lags.size > 1 else 0.0
    return Lag(
        delay=delay,
        delay_std=float(np.sqrt(weight @ (variances + (delays - delay) ** 2) + step**2 / 12)),
        time_constant=lag,
        time_constant_std=float(np.sqrt(weight @ (lags - lag) ** 2 + step**2 / 12)),
    )


def _answers(problem: Problem, delay: float, lag: float) -> Real:
    """Responses of e^(-sτ)/(1 + Ts) and of s times that, the level before the record included."""
    rows = delayed_response(problem.source, delay=delay, denominator=np.array([1.0, lag]), powers=2)
    rows[0] += problem.source.first
    return rows
