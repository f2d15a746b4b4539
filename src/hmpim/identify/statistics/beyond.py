"""Nonlinearity and held outputs, detected from statistics.

An odd distortion of a sweep (friction, backlash, a dead zone, a limited speed, a cubic spring) adds
three times its frequency to the output, and so does the cube of the input. A score test (C. R. Rao,
Proc. Camb. Phil. Soc. 44, 1948) checks whether short responses to the cube explain the residual,
after all parameters of the model and the same responses to the input itself, which a linear system
may have. Under any linear system the gain is chi-squared. The cube of a binary input is the input
itself, so that nothing can be tested.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from hmpim.identify.arrays import Real
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.least_squares import added, explained, solved
from hmpim.identify.judgement.evidence import Evidence
from hmpim.identify.judgement.residual import moved_by
from hmpim.identify.noise.misfit import Misfit
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import MODELLED
from hmpim.identify.statistics.fit import Fitted
from hmpim.identify.statistics.misfit import TESTABLE, explained_by, probes_at
from hmpim.identify.statistics.products import Products, Responses
from hmpim.identify.statistics.run import STOOD, cubes_by, of_cubes
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.worth import FEW, MUCH
from hmpim.record import Finding

__all__ = ["TIMED", "beyond_of", "has_cubes", "held_for", "nonlinear_findings"]

_GROUPS = 5
"""Frequencies that are tested, from 0 to the highest of the cube."""

_TIMES = 3.0
"""The cube of a sinusoid has a part at three times its frequency, with a third of the amplitude."""

TIMED = tuple(name for name in MODELLED if name not in ("scale_factor", "bias"))
"""Figures of fast motion; a held output shows those of slow motion without error."""

_FEWEST = 10
"""Values that an output must have kept before it counts as held."""


def has_cubes(statistics: Statistics) -> bool:
    """Whether products of the cube are kept for every run."""
    return statistics.reach.beyond and all(run.cubed for run in statistics.runs)


def beyond_of(fitted: Fitted, products: Products, band: tuple[float, float]) -> Misfit:
    """Test whether the residual of a fit follows the cube of the input.

    The products are those that whiten the residual; the excited band is in cycles per sample.
    """
    statistics = replace(products.statistics, bias="own")
    reach, runs = statistics.reach, statistics.runs
    scale = max(float(run.scale[0]) for run in runs)
    thirds = replace(statistics, runs=tuple(of_cubes(run, reach, scale) for run in runs))
    inputs, cubes = products.alike(statistics), products.alike(thirds)
    highest = min(_TIMES * band[1], 0.5)
    rows = probes_at(fitted.delay, (0.0, highest), products, groups=_GROUPS).rows
    tested = _ending(np.vstack([rows, fitted.response]))
    linear = fitted.responses.and_also(_ending(rows))
    third, first = cubes.moments(tested), inputs.moments(linear)
    ends = products.to_the_end
    lags = np.sum([cubes_by(run, reach, scale, to_the_end=ends) for run in runs], axis=0)
    mixed = cubes.across(tested, inputs, linear, lags)
    count, weights = fitted.weights.size, fitted.weights
    cross = third.cross - mixed[:, :count] @ weights
    residual = first.cross - first.gram[:, :count] @ weights
    _, left, gain = added(first.gram, mixed, third.gram, residual, cross)
    cost = first.energy - float(weights @ (first.cross[:count] + residual[:count]))
    cost -= float(residual @ solved(first.gram, residual))
    size = np.where(np.diag(third.gram) > 0.0, np.diag(third.gram), 1.0)
    almost_binary = float(np.mean(np.diag(left) / size)) < MUCH  # its edges are between the samples
    power, determined = explained(left, gain, least=TESTABLE, size=size)
    if almost_binary or not determined or cost <= 0.0:
        return Misfit()
    freedom = products.counted - linear.rows.shape[0] - int(determined)
    return explained_by(float(power), int(determined), cost, freedom)


def _ending(rows: Real) -> Responses:
    return Responses.ending(rows, np.zeros(rows.shape[0]))  # each run has its own bias


def held_for(statistics: Statistics) -> float | None:
    """Samples for which an output keeps each of its values, if a slower clock updates it.

    Such an output changes at most every second sample, and each value lasts the same number of
    samples, or one more. Noise repeats no value, and rounding repeats values for as long as the
    output is slow.
    """
    counts = np.sum([run.stood[1:] for run in statistics.runs], axis=0)
    total = float(counts.sum())
    if total < _FEWEST:
        return None
    shortest = int(np.searchsorted(np.cumsum(counts), FEW * total)) + 1
    near = slice(shortest - 1, shortest + 1)
    steady = float(counts[near].sum())
    if shortest == 1 or shortest == STOOD or steady < (1.0 - FEW) * total:
        return None
    return float(counts[near] @ np.arange(1, STOOD + 1)[near]) / steady


def nonlinear_findings(
    statistics: Statistics, found: Misfit | None, evidence: Evidence
) -> Iterator[Finding]:
    """Report a held output, and a residual that follows the cube of the input.

    A linear fit absorbs the part of a distortion at the input's own frequency, which is `_TIMES`
    its harmonic, for the cube as for friction. Figures that this may move by a hundredth are
    doubted. Nothing is reported where no cube is kept and `found` is None.
    """
    if found is None:
        return
    period = held_for(statistics)
    if period is not None:
        yield Finding(
            code="held_output",
            message=f"The output keeps each of its values for {period:.3g} samples "
            f"({period / statistics.fs:.3g} s): it is updated by a slower clock. Statistics do "
            "not record the update times, so delay and dynamics include the hold. Identify "
            "the record itself.",
            severity="doubt",
            parameters=TIMED,
        )
    if found.probability < FALSE_ALARM:
        size = float(np.sqrt(found.share)) * evidence.unexplained
        moved = moved_by(evidence, _TIMES**2 * found.share)
        yield Finding(
            code="nonlinear",
            message="The residual is correlated with the cube of the input, which no linear "
            f"system causes. Odd harmonics are {percent(size)} % of the output (r.m.s.); the "
            "linear model absorbs several times as much distortion. It may be friction, "
            "backlash, a dead zone, a limited speed or clipping. Identify the record itself to "
            "see which.",
            severity="doubt" if moved else "info",
            parameters=moved or MODELLED,
        )
