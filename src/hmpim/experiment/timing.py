"""How regular a run was: when each command went, against when it was due."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.record import Finding

__all__ = ["Timing", "judge_timing", "measure_timing"]

FloatArray = NDArray[np.float64]

TOO_IRREGULAR = 0.01
"""Error that irregular sending may make of the signal, as a share of it.

A sine of frequency f that is taken a random time of standard deviation σ late is wrong by 2πfσ of
its own r.m.s. value. One hundredth (-40 dB) is about the noise of the records that the method is
made for.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """Regularity of a run.

    Parameters
    ----------
    commands : int
        Commands that were awaited.
    period : float
        Between two of them, s.
    median, most, worst : float
        By how much a command was off its regular place, s: half, 99.9 % and all of them by no
        more than this.
    std : float
        Standard deviation of that, s.
    within_half : float
        Share of the periods that were longer or shorter by less than half a period.
    missed : int
        Commands that went a whole period or more late.

    Examples
    --------
    >>> due = np.arange(5) / 10
    >>> timing = measure_timing(due + np.array([0, 0, 0.1, 0, 0]), fs=10.0)
    >>> timing.missed, timing.within_half
    (1, 0.5)
    """

    commands: int
    period: float
    median: float
    most: float
    worst: float
    std: float
    within_half: float
    missed: int

    def words(self) -> str:
        """Say it in a sentence.

        Examples
        --------
        >>> print(measure_timing(np.arange(5) / 8, fs=8.0).words())
        Commands were sent within 0 ms of their due time (median; 99.9 %: 0 ms; worst: 0 ms), ...
        """
        return (
            f"Commands were sent within {_time(self.median)} of their due time (median; 99.9 %: "
            f"{_time(self.most)}; worst: {_time(self.worst)}), "
            f"{100 * self.within_half:.4g} % of the periods were right to within half a period, "
            f"and {self.missed} of {self.commands} commands were a period or more late."
        )


def measure_timing(sent: FloatArray, *, fs: float) -> Timing | None:
    """Measure how regularly commands went.

    Parameters
    ----------
    sent : ndarray, shape (n,)
        When each went, s from when the first was due; NaN where none was awaited.
    fs : float
        Commands a second.

    Returns
    -------
    Timing or None
        None where fewer than two were awaited.

    Examples
    --------
    >>> measure_timing(np.full(3, np.nan), fs=10.0) is None
    True
    """
    awaited = np.flatnonzero(np.isfinite(sent))
    if awaited.size < 2:
        return None
    period = 1.0 / fs
    late = sent[awaited] - awaited * period
    off = np.abs(late - np.median(late))
    lasted = np.diff(sent[awaited]) - np.diff(awaited) * period
    # A grace of rounding: half a period is not less than half a period.
    return Timing(
        commands=awaited.size,
        period=period,
        median=float(np.median(off)),
        most=float(np.quantile(off, 0.999)),
        worst=float(off.max()),
        std=float(np.std(late)),
        within_half=float(np.mean(np.abs(lasted) < 0.5 * period * (1.0 - 1e-9))),
        missed=int(np.count_nonzero(late >= period * (1.0 - 1e-9))),
    )


def judge_timing(
    timing: Timing, *, band: tuple[float, float] | None, stamped: bool
) -> tuple[Finding, ...]:
    """Say how regular a run was, and whether it was regular enough for its band.

    Parameters
    ----------
    timing : Timing
        As measured.
    band : tuple of float or None
        Excited band, Hz; None where it is not known: half the rate is taken then.
    stamped : bool
        Whether the rig stamps what it does with a clock of its own; irregular sending then does
        no harm to what is found.

    Returns
    -------
    tuple of Finding

    Examples
    --------
    >>> rough = measure_timing(np.arange(5) / 10 + np.array([0, 0, 0.1, 0, 0]), fs=10.0)
    >>> [f.severity for f in judge_timing(rough, band=(0.1, 2.0), stamped=False)]
    ['doubt']
    """
    highest = 0.5 / timing.period if band is None else band[1]
    share = math.tau * highest * timing.std
    if stamped or share <= TOO_IRREGULAR:
        return (Finding(code="timing", message=timing.words(), severity="info", parameters=()),)
    return (
        Finding(
            code="timing",
            message=(
                f"{timing.words()} That is too irregular for {highest:g} Hz: the jitter alone may "
                f"cause an error of {_in_percent(share)} there, and at most "
                f"{100 * TOO_IRREGULAR:g} % is acceptable. Run on a quieter computer, with "
                "real-time scheduling, or with a rig that stamps its own samples."
            ),
            severity="doubt",
            parameters=("delay", "noise_std"),
        ),
    )


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.3g} ms" if seconds < 0.9995 else f"{seconds:.3g} s"


def _in_percent(share: float) -> str:
    """A share of the signal; past all of it, how far is no figure to go by."""
    return f"{100.0 * share:.2g} %" if share < 0.995 else "100 % and more"
