"""The estimate so far, while samples come."""

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
from hmpim.identify.result import Identification, Parameters
from hmpim.identify.result.error_bars import noise_estimate
from hmpim.identify.statistics.describe import identify_statistics
from hmpim.identify.statistics.fit import Compressed, Fitted, fit_briefly, follow, pulse
from hmpim.identify.statistics.misfit import Asked, asked_of, misfit_of
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
"""Of the fit, at each look: where it is and a step from there; at a look that asks whether the
residual follows the input, where it is alone."""

_TASTE, _FARTHER = 4, 12
"""Evaluations at a new start: from each starting value, and then from the best of them. A structure
that needs more is hardly determined by the record yet; later looks continue it."""

_BETWEEN = 1.05
"""Growth of the record before it is asked again whether the residual follows the input."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What is known at one time.

    Parameters
    ----------
    time : float
        Seconds read.
    structure : str
        What was fitted.
    parameters : Parameters
        Doubtful where the residual still follows the input, where a frequency is below one over
        the time so far, or where it lies beyond what was excited.
    """

    time: float
    structure: str
    parameters: Parameters


class LiveEstimator:
    """Estimate while a stimulus is played: the estimate so far, with its error bars.

    The output begins at rest. Each block is added to the statistics of the run; the fit goes on
    from where it was. A new start is made at the first look and whenever the residual follows
    the input.

    Parameters
    ----------
    stimulus : Stimulus
        What is played: its rate and its band are used.
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
        lags = round(window * stimulus.fs)
        if lags < 8:
            raise ArgumentError(
                f"window = {window!r} s is {lags} samples at {stimulus.fs:g} Hz; give the time "
                "that delay and settling take, 8 samples or more"
            )
        self._statistics = Statistics(
            fs=stimulus.fs,
            reach=Reach(lags=lags, beyond=False),  # a look has no time for it
            runs=(),
            units=("", ""),  # that of the output is unknown
            intersample=intersample,
            band=stimulus.waveform.band,
        )
        low, high = self._statistics.band or (0.0, stimulus.fs / 2)
        self._highest = high
        self._band = low / stimulus.fs, high / stimulus.fs  # cycles a sample that are excited
        self._mode: Intersample = intersample
        self._pulse = pulse(self._statistics.reach, intersample)
        self._fitted: Fitted | None = None
        self._tried = self._asked = self._starts = 0
        self._follows = True
        self._asked_last = self._made = False
        self._asks: Asked | None = None
        self._look: Look | None = None

    @property
    def starts(self) -> int:
        """How often a new start was made; it takes longer than other updates do."""
        return self._starts

    @property
    def statistics(self) -> Statistics:
        """All that was read, compressed."""
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
            None while there is too little to fit.
        """
        if not any(np.size(numbers_of(name, given)) for name, given in (("u", u), ("y", y))):
            return self._look
        self.read(u, y)
        return self.look()

    def read(self, u: ArrayLike, y: ArrayLike) -> None:
        """Read the samples that follow, without a look: that costs next to nothing.

        Parameters
        ----------
        u, y : array_like, shape (n,)
            As for `update`.
        """
        self._statistics.update(u, y)

    def look(self) -> Look | None:
        """Look at what was read so far; None while there is too little to fit."""
        statistics = self._statistics
        if not statistics.runs:
            return None
        moves = bool(statistics.runs[0].uu[0] and statistics.runs[0].vv[-1, -1, 0])
        if statistics.samples < _FEWEST or not moves:
            return None
        problem = Compressed.of(Products(statistics, skipped=0), self._pulse)
        due = statistics.samples >= _BETWEEN * self._asked and not self._asked_last
        made = due and self._is_elsewhere(self._fitted)
        asks = due and not made
        evaluations = _FEWER if due else _EVALUATIONS
        before = self._fitted
        fitted = (
            self._begin(problem)
            if before is None
            else follow(problem, before, evaluations=evaluations)
        )
        if made:  # and asked at the next look, since each takes long enough
            self._asks = self._asked_about(fitted)
        if asks or self._fitted is None:
            self._asked = statistics.samples
            self._follows = self._lacks(fitted)
            if self._follows and statistics.samples >= _PAUSE * self._tried:
                fitted = self._begin(problem)
                self._asks = self._asked_about(fitted)
                self._follows = self._lacks(fitted)
        self._asked_last, self._made = asks, made
        self._fitted = fitted
        time = statistics.samples / statistics.fs
        parameters = _figures(fitted, statistics)
        self._look = Look(
            time=time,
            structure=fitted.structure.name,
            parameters=_doubted(parameters, time, self._highest, follows=self._follows),
        )
        return self._look

    def _is_elsewhere(self, fitted: Fitted | None) -> bool:
        """Whether a fit's delay has moved away from what is asked for, made before this look."""
        if fitted is None or self._asks is None or self._made:
            return False
        return abs(self._asks.delay - fitted.delay) * self._band[1] > FEW

    def _asked_about(self, fitted: Fitted) -> Asked:
        return asked_of(fitted.delay, self._band, fitted.products)

    def _lacks(self, fitted: Fitted) -> bool:
        """Whether what is left over follows the input."""
        if self._asks is None:
            self._asks = self._asked_about(fitted)
        misfit = misfit_of(fitted, fitted.products, self._band, asked=self._asks)
        return misfit.probability < FALSE_ALARM

    def identification(self) -> Identification:
        """The whole identification of what was read, with every structure and every check."""
        return identify_statistics(self._statistics, intersample=self._mode)

    def _begin(self, problem: Compressed) -> Fitted:
        """A new start: every plain structure from the data alone."""
        self._tried = self._statistics.samples
        self._starts += 1
        fit = _begun(self._statistics, self._mode)
        return follow(problem, fit, evaluations=_EVALUATIONS)


def _figures(fitted: Fitted, statistics: Statistics) -> Parameters:
    """The parameters themselves; what is read off the response costs more than a look may take."""
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


def _doubted(parameters: Parameters, time: float, highest: float, *, follows: bool) -> Parameters:
    """Nothing is claimed below 1/time, beyond the band, or while the residual follows the input."""
    natural = parameters.natural_frequency
    outside = natural is not None and not 1.0 / time < natural.value < PAST * highest
    if not (follows or outside):
        return parameters
    return all_doubtful(parameters)


def _begun(statistics: Statistics, intersample: Intersample) -> Fit:
    """The likeliest plain structure, of one run from rest; its noise is taken for white.

    This is the joint fit's search in little time: a few steps from each start, and a few more from
    the best one of each structure. A fit that has not converged then continues at later looks.
    """
    short = only_told(statistics)
    problem = Compressed.of(Products(short, skipped=0), pulse(short.reach, intersample))
    rough = rough_of(short)
    fits: list[Fitted] = []
    for structure in (STRUCTURES[name] for name in PLAIN):
        starts = starting_values(rough, structure)
        if structure.order == 2:  # it is a first-order one too
            starts.append(nested(fits[-1]))
        tried = [fit_briefly(problem, structure, one, evaluations=_TASTE) for one in starts]
        best = min(tried, key=lambda fit: fit.objective)
        if not best.converged:
            best = fit_briefly(problem, structure, best.theta, evaluations=_FARTHER)
        fits.append(best)
    count = problem.counted * min(fits, key=lambda fit: fit.objective).share
    return min(fits, key=lambda fit: trial_of(intersample, fit, count).criterion)


def only_told(statistics: Statistics) -> Statistics:
    """The same without lags longer than the run, which says nothing about them."""
    reach = replace(statistics.reach, lags=min(statistics.lags, statistics.samples))
    runs = tuple(shortened(run, reach) for run in statistics.runs)
    return replace(statistics, reach=reach, runs=runs)
