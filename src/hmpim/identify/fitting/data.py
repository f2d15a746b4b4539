"""The data that all trials of one joint fit share, and refits to other data."""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import FALSE_ALARM, SEARCHED
from hmpim.identify.fitting.fit import CONVERGED, Fit, Problem, delayed, fit_structure
from hmpim.identify.fitting.growth import HiddenPole, hidden_pole
from hmpim.identify.fitting.rows import STAMPED_LATE
from hmpim.identify.fitting.start import RoughResponse, rough_response
from hmpim.identify.fitting.unrelated import is_unexplainable
from hmpim.identify.kept import kept
from hmpim.identify.noise.autoregression import autoregression
from hmpim.identify.noise.level import level_of
from hmpim.identify.noise.misfit import Misfit, misfit
from hmpim.identify.signals import longest_lag
from hmpim.identify.worth import TWICE
from hmpim.model.dynamics import Structure
from hmpim.model.sampled import PRECISION, SampledInput, prepare_input
from hmpim.record import Intersample, is_held

__all__ = [
    "RETURNS",
    "TASTE",
    "Counted",
    "Data",
    "Fits",
    "follows",
    "hopeless_beside",
    "polished",
    "prepared",
    "refit",
    "refit_all",
    "shifted",
]

RETURNS = 12
"""Most steps from where a fit ended, when the data have changed."""

TASTE = 4
"""Steps from each start before the best one is fitted to convergence."""

Fits = list[tuple[Intersample, Fit]]
"""Fits, each with its assumption between the samples."""

prepared = kept(prepare_input)
"""`hmpim.model.sampled.prepare_input`, its results kept."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Counted:
    """Which samples count, and from which sample an unknown initial state is fitted."""

    valid: Mask | None
    begins: int | None

    @property
    def first(self) -> int | None:
        """First sample that counts from `begins` on; None for a record that begins at rest.

        A free response that began earlier would grow without bound backwards in time.
        """
        if self.begins is None or self.valid is None:
            return self.begins
        return self.begins + int(np.argmax(self.valid[self.begins :]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Data:
    """The data of every trial; the input is prepared for an assumption when first needed.

    The search examines residuals through these methods alone, so that `CompressedData` can do so
    without samples.
    """

    u: Real
    y: Real
    sources: dict[tuple[Intersample, bool], SampledInput]
    rough: RoughResponse
    nuisance: Real | None
    noise: Real | None = None
    level: Real | None = None
    precision: float = PRECISION
    small: int = 0  # last rows of `nuisance` that explain little

    def problem(self, mode: Intersample, seen: Counted) -> Problem:
        """The data under one assumption, with the samples that count."""
        rest = seen.begins is None
        if (mode, rest) not in self.sources:
            self.sources[mode, rest] = prepared(self.u, mode, rest=rest, precision=self.precision)
        problem = Problem(
            source=self.sources[mode, rest],
            y=self.y,
            valid=seen.valid,
            longest_delay=longest_lag(self.y.size) + 2.0,
            shortest_delay=min(self.rough.earliest, STAMPED_LATE),
            nuisance=self.nuisance,
            begins=seen.first,
        )
        return problem if self.noise is None else problem.coloured(self.noise, self.level)

    @property
    def plain(self) -> Self:
        """The same with noise assumed white and of constant level."""
        return replace(self, noise=None, level=None)

    @property
    def keeps_samples(self) -> bool:
        """Whether there are samples; a compressed record has none."""
        return self.u.size > 0

    @property
    def band(self) -> tuple[float, float]:
        """Band of the rough response, in cycles per sample."""
        omega = self.rough.omega
        return float(omega[0] / (2 * np.pi)), float(omega[-1] / (2 * np.pi))

    def misfit(self, fit: Fit) -> Misfit:
        """How much of a fit's residual still follows the input."""
        return misfit(self.u, fit.residual, delay=fit.delay, band=self.band)

    def noise_left(self, problem: Problem, fit: Fit) -> Real:
        """Autoregression of a fit's residual, 1 first; 1 alone where it is white."""
        return autoregression(fit.residual, problem.valid)

    def level_left(self, problem: Problem, fit: Fit, noise: Real) -> Real | None:
        """Level of the innovations at each sample; None where it is steady."""
        return level_of(problem.coloured(noise).innovations(fit.prediction, fit.residual))

    def rough_left(self, fit: Fit) -> RoughResponse:
        """Rough response of a fit's residual."""
        return rough_response(self.u, fit.residual, longest_delay=0, lag=self.rough.lag)

    def is_unexplainable(self, problem: Problem, fit: Fit, *, least: float = SEARCHED) -> bool:
        """Whether no model can be expected to explain an output that this fit does not."""
        return is_unexplainable(self.u, problem, fit, self.band, least=least)

    def hidden_pole(self, problem: Problem, fit: Fit) -> HiddenPole:
        """Test a fit for one more pole."""
        return hidden_pole(problem, fit)


def follows(data: Data, fit: Fit) -> bool:
    """Whether a fit's residual still follows the input."""
    return data.misfit(fit).probability < FALSE_ALARM


def shifted(theta: Real, origin: Intersample, mode: Intersample) -> Real:
    """Parameters as a start under another assumption: a held input has half a sample less delay."""
    sooner = 0.5 * (float(is_held(origin)) - float(is_held(mode)))
    return delayed(theta, sooner)


def polished(problem: Problem, fit: Fit, *, hopeless: float = np.inf) -> Fit:
    """The same fit at the final precision; given up once it cannot get below `hopeless`."""
    return refit(problem, fit, precision=problem.final, hopeless=hopeless)


def refit_all(
    data: Data,
    fitted: Fits,
    seen: Counted,
    *,
    hopeful: float = np.inf,
    precision: float = CONVERGED,
) -> Fits:
    """Fit all structures to other data, from where they ended, the leading one first.

    A fit that promises a much larger residual than that one, or no smaller one than a plainer fit
    with a white residual, is given up. A fit whose objective was `hopeful` or more is only
    evaluated.
    """
    leading = min(range(len(fitted)), key=lambda i: fitted[i][1].objective)
    by_size = sorted(range(len(fitted)), key=lambda i: fitted[i][1].structure.parameters)
    problems = {mode: data.problem(mode, seen) for mode in dict.fromkeys(m for m, _ in fitted)}
    done: dict[int, Fit] = {}
    for i in dict.fromkeys([leading, *by_size]):
        mode, fit = fitted[i]
        done[i] = fit_structure(
            problems[mode],
            fit.structure,
            fit.theta,
            iterations=RETURNS if fit.objective < hopeful else 0,
            precision=precision,
            hopeless=hopeless_beside(fit.structure, list(done.values())),
        )
    return [(mode, done[i]) for i, (mode, _) in enumerate(fitted)]


def hopeless_beside(structure: Structure, rivals: list[Fit]) -> float:
    """Sum of squares from which on a structure has no chance against others."""
    least = min((fit.objective for fit in rivals), default=np.inf)
    plainer = [fit for fit in rivals if fit.structure.parameters < structure.parameters]
    white = [fit.objective for fit in plainer if fit.objective < TWICE * least and fit.is_white]
    return min([TWICE * least, *white])


def refit(
    problem: Problem, fit: Fit, *, precision: float = CONVERGED, hopeless: float = np.inf
) -> Fit:
    """Fit the same structure to other data, from where it ended, as `fit_structure` does."""
    return fit_structure(problem, fit.structure, fit.theta, precision=precision, hopeless=hopeless)
