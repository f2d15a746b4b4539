"""Nonlinearity and held outputs, detected from statistics: a score test, and how long values stay.

An odd distortion of a sweep (friction, backlash, a dead zone, a limited speed, a cubic spring) puts
what has three times its frequency into the output, and so does the cube of the input. Short
responses to the cube are asked for beside all parameters of the model, and beside the same
responses to the input itself, since a linear system may have those (C. R. Rao, Proc. Camb. Phil.
Soc. 44, 1948). Under a linear system of any kind what they gain is chi-squared. The cube of a
binary input is the input: it leaves nothing to ask.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.least_squares import solved
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.residual import moved_by
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import MODELLED
from hmpim.identify.statistics.fit import Fitted
from hmpim.identify.statistics.misfit import asked_of
from hmpim.identify.statistics.products import Products, Responses
from hmpim.identify.statistics.run import STOOD, cubes_by, of_cubes
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.worth import FEW, MUCH
from hmpim.record import Finding

__all__ = ["UNDELAYED", "Beyond", "beyond_of", "held_for", "is_told", "said_beyond"]

_GROUPS = 5
"""Frequencies that are asked for, from 0 to the cube's highest."""

_TIMES = 3.0
"""The cube of a sinusoid has so many times its frequency, and a third of the amplitude there."""

_SEEN = 1e-6
"""Share of a direction that the input's own responses leave, below which it is not asked for."""

UNDELAYED = ("scale_factor", "bias")
"""Figures of slow motion, which an output that is held shows as it is."""

_FEWEST = 10
"""Values that an output must have kept before it counts as held."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Beyond:
    """What responses to the cube of the input explain beyond chance.

    Parameters
    ----------
    share : float
        Of the residual's power.
    probability : float
        That a linear system does as much.
    """

    share: float
    probability: float


def is_told(statistics: Statistics) -> bool:
    """Whether products of the cube are kept of every run."""
    return statistics.reach.beyond and all(run.cubed for run in statistics.runs)


def beyond_of(fitted: Fitted, products: Products, band: tuple[float, float]) -> Beyond:
    """Test whether the residual of a fit follows the cube of the input.

    Parameters
    ----------
    fitted : Fitted
        The fit.
    products : Products
        With what the fit leaves over whitened.
    band : (float, float)
        Excited band, in cycles per sample.
    """
    statistics = replace(products.statistics, bias="own")
    reach, runs = statistics.reach, statistics.runs
    scale = max(float(run.scale[0]) for run in runs)
    thirds = replace(statistics, runs=tuple(of_cubes(run, reach, scale) for run in runs))
    inputs, cubes = (products.alike(one) for one in (statistics, thirds))
    highest = min(_TIMES * band[1], 0.5)
    rows = asked_of(fitted.delay, (0.0, highest), products, groups=_GROUPS).rows
    asked = _ending(np.vstack([rows, fitted.response]))
    beside = fitted.responses.and_also(_ending(rows))
    third, first = cubes.moments(asked), inputs.moments(beside)
    ends = products.to_the_end
    lags = np.sum([cubes_by(run, reach, scale, to_the_end=ends) for run in runs], axis=0)
    mixed = cubes.across(asked, inputs, beside, lags)
    count, linear = fitted.weights.size, fitted.weights
    cross = third.cross - mixed[:, :count] @ linear
    left_first = first.cross - first.gram[:, :count] @ linear
    shift = -solved(first.gram, mixed.T)
    gain, left = cross + shift.T @ left_first, third.gram + mixed @ shift
    cost = first.energy - float(linear @ (first.cross[:count] + left_first[:count]))
    cost -= float(left_first @ solved(first.gram, left_first))
    size = np.sqrt(np.where(np.diag(third.gram) > 0.0, np.diag(third.gram), 1.0))
    left = left / np.outer(size, size)
    if float(np.mean(np.diag(left))) < MUCH:  # all but binary: its edges lie between the samples
        return Beyond(share=0.0, probability=1.0)
    values, vectors = np.linalg.eigh(left)
    kept = values > _SEEN
    freedom = int(kept.sum())
    if not freedom or cost <= 0.0:
        return Beyond(share=0.0, probability=1.0)
    power = float(np.sum((vectors.T @ (gain / size))[kept] ** 2 / values[kept]))
    variance = cost / max(products.counted - beside.rows.shape[0] - freedom, 1)
    return Beyond(
        share=max((power - freedom * variance) / cost, 0.0),
        probability=float(scipy.special.chdtrc(freedom, power / variance)),
    )


def _ending(rows: Real) -> Responses:
    return Responses.ending(rows, np.zeros(rows.shape[0]))  # each run has a bias of its own


def held_for(statistics: Statistics) -> float | None:
    """Samples for which an output keeps each of its values, where it is updated by a slower clock.

    Such an output changes at most every second sample, and each value lasts the same number of
    samples, or one more. Noise repeats no value, and rounding repeats them for as long as the
    output is slow.
    """
    counts = np.sum([run.stood[1:] for run in statistics.runs], axis=0)
    total = float(counts.sum())
    if total < _FEWEST:
        return None
    shortest = int(np.searchsorted(np.cumsum(counts), FEW * total)) + 1
    steady = float(counts[shortest - 1 : shortest + 1].sum())
    if shortest == 1 or shortest == STOOD or steady < (1.0 - FEW) * total:
        return None
    lengths = np.arange(1, STOOD + 1)
    near = slice(shortest - 1, shortest + 1)
    return float(counts[near] @ lengths[near]) / steady


def said_beyond(
    statistics: Statistics, found: Beyond | None, evidence: Evidence
) -> tuple[Finding, ...]:
    """Say what no linear system does.

    A linear fit absorbs the part of a distortion at the input's own frequency, which is `_TIMES`
    its harmonic, of the cube as of friction. Doubted are the figures that so much may move by a
    hundredth.

    Parameters
    ----------
    statistics : Statistics
        What was read.
    found : Beyond or None
        Of the cube of the input; None where it is not kept, and nothing is said.
    evidence : Evidence
        Of the fit.
    """
    if found is None:
        return ()
    findings = []
    period = held_for(statistics)
    if period is not None:
        findings.append(
            Finding(
                code="held_output",
                message=f"The output keeps each of its values for {period:.3g} samples "
                f"({period / statistics.fs:.3g} s): it is updated by a slower clock. Statistics do "
                "not record the update times, so delay and dynamics include the hold. Identify "
                "the record itself.",
                severity="doubt",
                parameters=tuple(name for name in MODELLED if name not in UNDELAYED),
            )
        )
    if found.probability < FALSE_ALARM:
        size = float(np.sqrt(found.share)) * evidence.unexplained
        moved = moved_by(evidence, _TIMES**2 * found.share)
        findings.append(
            Finding(
                code="nonlinear",
                message="The residual is correlated with the cube of the input, which no linear "
                f"system causes. Odd harmonics are {percent(size)} % of the output (r.m.s.); the "
                "linear model absorbs several times as much distortion. It may be friction, "
                "backlash, a dead zone, a limited speed or clipping. Identify the record itself to "
                "see which.",
                severity="doubt" if moved else "info",
                parameters=moved or MODELLED,
            )
        )
    return tuple(findings)
