"""The estimate so far, while samples arrive."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from hmpim.arguments import check_argument, numbers_of
from hmpim.errors import ArgumentError
from hmpim.identify.chance import FALSE_ALARM
from hmpim.identify.fitting.candidates import nested
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.fit import Fit
from hmpim.identify.fitting.start import starting_values
from hmpim.identify.fitting.trial import trial_of
from hmpim.identify.judgement import all_doubtful
from hmpim.identify.reading.figures import read_figures
from hmpim.identify.result import Parameters
from hmpim.identify.result.error_bars import noise_estimate
from hmpim.identify.statistics.fit import Compressed, Fitted, fit_briefly, follow, pulse
from hmpim.identify.statistics.misfit import Probes, misfit_of, probes_at
from hmpim.identify.statistics.products import Products
from hmpim.identify.statistics.reach import Reach
from hmpim.identify.statistics.run import shortened
from hmpim.identify.statistics.start import rough_of
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.worth import FEW, PAST
from hmpim.model.dynamics import STRUCTURES
from hmpim.record import Intersample
from hmpim.stimulus import Stimulus

__all__ = ["LiveEstimator", "Look", "only_told"]

_WINDOW = 1.0
"""Seconds that delay and settling may take."""

_FEWEST = 60
"""Samples before the first look."""

_PAUSE = 1.1
"""Growth of the record before another new start is tried."""

_EVALUATIONS, _FEWER = 2, 1
"""Evaluations of the fit at each look: where it is and a step from there. At a look that tests
whether the residual follows the input, there is no step."""

_TASTE, _FARTHER = 4, 12
"""Evaluations at a new start: from each starting value, and then from the best of them. A structure
that needs more is hardly determined by the record yet; later looks continue it."""

_BETWEEN = 1.05
"""Growth of the record before the residual is tested again."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What is known at one time.

    Parameters
    ----------
    time : float
        Seconds read.
    structure : str
        The fitted structure.
    parameters : Parameters
        Doubtful if the residual still follows the input, or if the natural frequency is below one
        over the time so far or beyond the excited band.
    """

    time: float
    structure: str
    parameters: Parameters


class LiveEstimator:
    """Estimate while a stimulus is played: the estimate so far, with its error bars.

    The output begins at rest. Each block is added to the statistics of the run, and the fit
    continues from its last state. A new start is made at the first look and whenever the residual
    follows the input.

    Parameters
    ----------
    stimulus : Stimulus
        The stimulus: its rate and its band are used.
    window : float
        Seconds that delay and settling may take together.
    intersample : {'zoh', 'foh', 'bandlimited'}
        What the input does between its samples.

    Examples
    --------
    >>> from hmpim.stimulus import Chirp
    >>> chirp = Chirp(band=(0.5, 20.0), duration=3.0)
    >>> stimulus = Stimulus(waveform=chirp, fs=200.0)
    >>> u = stimulus.position
    >>> y = np.concatenate([np.zeros(10), u[:-10]]) + 0.01 * np.sin(37.0 * np.arange(u.size) ** 2)
    >>> live = LiveEstimator(stimulus)
    >>> for block in np.split(np.arange(600), 30):
    ...     look = live.update(u[block], y[block])
    >>> round(look.parameters.delay.value, 3)
    0.05
    """

    def __init__(
        self,
        stimulus: Stimulus,
        *,
        window: float = _WINDOW,
        intersample: Intersample = "bandlimited",
    ) -> None:
        check_argument("stimulus", stimulus, Stimulus)
        check_argument("window", window, float)
        check_argument("intersample", intersample, Intersample)
        if intersample == "feedforward":
            intersample = "zoh"  # the statistics hold no derivatives of the command
        lags = round(window * stimulus.fs)
        if lags < 8:
            raise ArgumentError(
                f"window = {window!r} s is {lags} samples at {stimulus.fs:g} Hz; give the time "
                "that delay and settling take, 8 samples or more"
            )
        self._statistics = Statistics(
            fs=stimulus.fs,
            reach=Reach(lags=lags, beyond=False),  # a look has no time for cubes
            runs=(),
            intersample=intersample,
            band=stimulus.waveform.band,
        )
        low, high = self._statistics.band or (0.0, stimulus.fs / 2)
        self._highest = high
        self._band = low / stimulus.fs, high / stimulus.fs  # excited, in cycles per sample
        self._mode: Intersample = intersample
        self._pulse = pulse(self._statistics.reach, intersample)
        self._fitted: Fitted | None = None
        self._started_at = self._tested_at = self._starts = 0  # samples at the last start and test
        self._follows = True
        self._tested_last = self._probed_last = False
        self._probes: Probes | None = None
        self._look: Look | None = None

    @property
    def starts(self) -> int:
        """Number of new starts, which take longer than other updates."""
        return self._starts

    @property
    def statistics(self) -> Statistics:
        """All samples so far, compressed."""
        return self._statistics

    def update(self, u: ArrayLike, y: ArrayLike) -> Look | None:
        """Read the samples that follow, and look.

        Parameters
        ----------
        u, y : array_like, shape (n,)
            The input's and the output's samples after the last ones read.

        Returns
        -------
        Look or None
            None while there are too few samples to fit.
        """
        if not any(np.size(numbers_of(name, given)) for name, given in (("u", u), ("y", y))):
            return self._look
        self.read(u, y)
        return self.look()

    def read(self, u: ArrayLike, y: ArrayLike) -> None:
        """Read the samples that follow, as `update` does, without a look; this is fast."""
        self._statistics.update(u, y)

    def look(self) -> Look | None:
        """Return the estimate so far; None while there are too few samples to fit."""
        statistics = self._statistics
        if not statistics.runs:
            return None
        moves = bool(statistics.runs[0].uu[0] and statistics.runs[0].vv[-1, -1, 0])
        if statistics.samples < _FEWEST or not moves:
            return None
        problem = Compressed.of(Products(statistics, skipped=0), self._pulse)
        due = statistics.samples >= _BETWEEN * self._tested_at and not self._tested_last
        probed = due and self._has_moved()
        tested = due and not probed
        first, evaluations = self._fitted is None, _FEWER if due else _EVALUATIONS
        if self._fitted is None:
            fitted = self._begin(problem)
        else:
            fitted = follow(problem, self._fitted, evaluations=evaluations)
        if probed:  # the test follows at the next look, since both take long
            self._probes = self._probes_about(fitted)
        if tested or first:
            self._tested_at = statistics.samples
            self._follows = self._residual_follows(fitted)
            if self._follows and statistics.samples >= _PAUSE * self._started_at:
                fitted = self._begin(problem)
                self._probes = self._probes_about(fitted)
                self._follows = self._residual_follows(fitted)
        self._tested_last, self._probed_last = tested, probed
        self._fitted = fitted
        time, parameters = statistics.samples / statistics.fs, _figures(fitted, statistics)
        natural = parameters.natural_frequency
        outside = natural is not None and not 1.0 / time < natural.value < PAST * self._highest
        if self._follows or outside:
            parameters = all_doubtful(parameters)
        self._look = Look(time=time, structure=fitted.structure.name, parameters=parameters)
        return self._look

    def _has_moved(self) -> bool:
        """Whether the delay of the fit has moved away from probes that are older than a look."""
        if self._fitted is None or self._probes is None or self._probed_last:
            return False
        return abs(self._probes.delay - self._fitted.delay) * self._band[1] > FEW

    def _probes_about(self, fitted: Fitted) -> Probes:
        return probes_at(fitted.delay, self._band, fitted.products)

    def _residual_follows(self, fitted: Fitted) -> bool:
        """Whether the residual follows the input."""
        if self._probes is None:
            self._probes = self._probes_about(fitted)
        misfit = misfit_of(fitted, fitted.products, self._band, self._probes)
        return misfit.probability < FALSE_ALARM

    def _begin(self, problem: Compressed) -> Fitted:
        """A new start: every plain structure from the data alone."""
        self._started_at = self._statistics.samples
        self._starts += 1
        fit = _begun(self._statistics, self._mode)
        return follow(problem, fit, evaluations=_EVALUATIONS)


def _figures(fitted: Fitted, statistics: Statistics) -> Parameters:
    """The parameters themselves; a look has no time to read figures off the response."""
    vector = np.concatenate([fitted.theta, fitted.linear])
    freedom = max(fitted.products.counted - vector.size, 1)
    unit = statistics.units[1]
    parameters, _, _ = read_figures(
        fitted.structure,
        vector,
        fitted.covariance,
        fs=statistics.fs,
        highest=None,
        effective=freedom,
        noise=noise_estimate(fitted.objective, freedom=freedom, share=1.0, unit=unit),
        units=statistics.units,
    )
    return parameters


def _begun(statistics: Statistics, intersample: Intersample) -> Fit:
    """The likeliest plain structure for one run from rest, with white noise.

    This is a short form of the joint fit's search: a few steps from each start, and a few more from
    the best start of each structure. A fit that has not converged continues at later looks.
    """
    short = only_told(statistics)
    problem = Compressed.of(Products(short, skipped=0), pulse(short.reach, intersample))
    rough = rough_of(short)
    fits: list[Fitted] = []
    for structure in (STRUCTURES[name] for name in PLAIN):
        starts = starting_values(rough, structure)
        if structure.order == 2:  # the first-order fit is a special case
            starts.append(nested(fits[-1]))
        tried = [fit_briefly(problem, structure, start, evaluations=_TASTE) for start in starts]
        best = min(tried, key=lambda fit: fit.objective)
        if not best.converged:
            best = fit_briefly(problem, structure, best.theta, evaluations=_FARTHER)
        fits.append(best)
    count = problem.counted * min(fits, key=lambda fit: fit.objective).share
    return min(fits, key=lambda fit: trial_of(intersample, fit, count).criterion)


def only_told(statistics: Statistics) -> Statistics:
    """Statistics without the lags that are longer than the run."""
    reach = replace(statistics.reach, lags=min(statistics.lags, statistics.samples))
    runs = tuple(shortened(run, reach) for run in statistics.runs)
    return replace(statistics, reach=reach, runs=runs)
