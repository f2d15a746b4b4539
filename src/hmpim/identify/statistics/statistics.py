"""Compressed records: enough to identify them, whatever their length."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isclose
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hmpim.arguments import checked, numbers_of, shown
from hmpim.equality import ByValue
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.statistics.reach import Reach
from hmpim.identify.statistics.run import Run, begun, continued, without_cubes
from hmpim.record import Intersample, Record, Signal, uniform
from hmpim.tables import shortened

__all__ = ["Statistics", "compress"]

_SHARE = 5
_LONGEST = 16_384
_SHORTEST = 32
"""The default window is a fifth of the record, between these limits."""

_MOST = 10_000_000
_FARTHEST = 1e15
"""Largest window, and sample of the last knot."""

_ROUNDING = 1e-9
"""Relative difference of rates that come from time stamps, by rounding."""

Sharing = Literal["own", "common"]


@dataclass(slots=True, kw_only=True, eq=False, repr=False)
class Statistics(ByValue):
    """A record, or several, compressed: products at a window of lags, and the ends of each run.

    Made by `compress`. `update` continues the run in place, as a hash does; ``a + b`` joins
    separate runs. Its size does not depend on the length of a run.

    Parameters
    ----------
    fs : float
        Rate in Hz.
    reach : Reach
        Lags and knots.
    runs : tuple of Run
        Each with its own beginning.
    names, units : (str, str)
        Of input and output.
    intersample : {'zoh', 'foh', 'bandlimited'} or None
        What the input does between its samples, where known.
    band : tuple of float or None
        Excited band in Hz, where known.
    bias : {'own', 'common'}
        Whether each run has a bias of its own.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u, y = rng.standard_normal((2, 1000))
    >>> record = Record.from_arrays({"u": u}, {"y": y}, fs=100.0)
    >>> first = compress(Record.from_arrays({"u": u[:300]}, {"y": y[:300]}, fs=100.0), lags=60)
    >>> first.update(u[300:], y[300:]).samples
    1000
    """

    fs: float
    reach: Reach
    runs: tuple[Run, ...]
    names: tuple[str, str] = ("u", "y")
    units: tuple[str, str] = ("", "")
    intersample: Intersample | None = None
    band: tuple[float, float] | None = None
    bias: Sharing = "own"

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        source, output = (shortened([name]) for name in self.names)
        runs = f"{len(self.runs)} run{'s' if len(self.runs) != 1 else ''}"
        return (
            f"Statistics({source} → {output}, {self.samples} samples in {runs} at {self.fs:g} Hz, "
            f"{self.lags} lags)"
        )

    @property
    def samples(self) -> int:
        """How many samples were read, in all runs."""
        return sum(run.samples for run in self.runs)

    @property
    def lags(self) -> int:
        """Longest lag of an impulse response, delay included, in samples."""
        return self.reach.lags

    @property
    def nbytes(self) -> int:
        """Size of all arrays."""
        return sum(
            getattr(run, name).nbytes
            for run in self.runs
            for name in Run.__dataclass_fields__
            if name != "samples"
        )

    def update(self, u: ArrayLike, y: ArrayLike) -> "Statistics":
        """Read the samples that follow, in place.

        Parameters
        ----------
        u, y : array_like, shape (n,)
            The input's and the output's samples after the last ones read.

        Returns
        -------
        Statistics
            This one.

        Raises
        ------
        ArgumentError
            If their numbers differ, a sample is not finite, or several runs were joined.
        """
        more_u, more_y = np.atleast_1d(numbers_of("u", u)), np.atleast_1d(numbers_of("y", y))
        if more_u.size != more_y.size:
            raise ArgumentError(f"u has {more_u.size} samples and y {more_y.size}; give as many")
        if len(self.runs) > 1:
            raise ArgumentError(
                f"{len(self.runs)} runs were joined, so that none can be continued; continue a run "
                "first, then add it"
            )
        if not more_u.size:
            return self
        run = self.runs[0] if self.runs else begun(self.reach, more_u[0], more_y[0])
        self.runs = (continued(run, self.reach, more_u, more_y),)
        return self

    def join(self, *others: "Statistics", bias: Sharing | None = None) -> "Statistics":
        """Join separate runs; each keeps its own beginning.

        Parameters
        ----------
        *others : Statistics
            Of the same input, output, rate and window.
        bias : {'own', 'common'}, optional
            Whether each run has its own bias or all share one; unchanged by default.

        Raises
        ------
        ArgumentError
            If they are not of one kind.
        """
        chosen = self.bias if bias is None else bias
        if chosen not in ("own", "common"):
            raise ArgumentError(f"bias = {chosen!r} is not one of 'own', 'common'")
        for other in others:
            self._check(other, bias is None)
        if chosen == "common" and self.reach.rows > 1:
            raise ArgumentError(
                f"a bias with {self.reach.rows} knots belongs to one run; take bias='own', or "
                "compress without knots"
            )
        every = (self, *others)
        runs = tuple(run for each in every for run in each.runs)
        reach = replace(self.reach, beyond=all(each.reach.beyond for each in every))
        if not reach.beyond:
            runs = tuple(without_cubes(run) for run in runs)
        return replace(self, reach=reach, runs=runs, bias=chosen)

    def __add__(self, other: object) -> "Statistics":
        if not isinstance(other, Statistics):
            return NotImplemented
        return self.join(other)

    def __radd__(self, other: object) -> "Statistics":
        return self if other == 0 else NotImplemented  # as in sum(list of statistics)

    def _check(self, other: "Statistics", biases: bool) -> None:
        """Refuse runs of another kind."""
        named = ["fs", "lags", "names", "units", "intersample"] + ["bias"] * biases
        for name in named:
            here, there = getattr(self, name), getattr(other, name)
            same = here == there or (name == "fs" and isclose(here, there, rel_tol=_ROUNDING))
            if not same:
                are = "are" if isinstance(here, tuple) else "is"
                raise ArgumentError(
                    f"{name} {are} {here!r} here and {there!r} there; only runs of one kind can be "
                    "joined, so compress both with the same settings"
                )
        if self.reach.knots != other.reach.knots:
            raise ArgumentError(
                f"the bias has {self.reach.rows} knots here and {other.reach.rows} there, or at "
                "other times; compress both with the same settings"
            )


@checked
def compress(
    record: Record,
    *,
    lags: int | None = None,
    channels: tuple[str, str] | None = None,
    knots: Sequence[float] = (),
    bias: Sharing = "own",
) -> Statistics:
    """Compress a record to what identification needs, in one pass.

    The result contains products of the samples at a window of lags, and the samples at either end:
    its size is the same for a second as for a week. `hmpim.identify` takes it in place of a record.

    Parameters
    ----------
    record : Record
        One test.
    lags : int, optional
        Window in samples: delay and settling time of the system must fit into it. A fifth of the
        record by default, at most 16 384.
    channels : (str, str), optional
        Names of input and output; needed where there are several.
    knots : sequence of float, optional
        Times in s from the beginning of a run at which a drifting bias has a value of its own; it
        is linear between them. A constant bias by default.
    bias : {'own', 'common'}
        Whether joined runs have a bias each, or one in common.

    Returns
    -------
    Statistics
        ``update`` continues the run, ``+`` joins it with others.

    Raises
    ------
    ArgumentError
        If a channel is not in the record, or the window is not valid.
    RecordError
        If the record has gaps.

    Notes
    -----
    With the impulse response h(θ) of any model, the sum of squared errors is
    y·y - 2hᵀr + hᵀRh, r the cross-correlation and R the Toeplitz matrix of the input's
    autocorrelation, less the part of the full convolution outside the samples that count. This is
    exact, and no matrix of lags by lags is made.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> u = rng.standard_normal(5000)
    >>> y = 2.0 * np.concatenate([np.zeros(3), u[:-3]]) + 0.1 * rng.standard_normal(5000)
    >>> statistics = compress(Record.from_arrays({"u": u}, {"y": y}, fs=100.0), lags=40)
    >>> statistics.samples, statistics.nbytes < 15_000
    (5000, True)
    """
    aligned = uniform(record)
    source = _named(aligned.inputs, channels and channels[0], "input")
    answer = _named(aligned.outputs, channels and channels[1], "output")
    for signal in (source, answer):
        if not bool(signal.valid.all()):
            raise RecordError(
                f"channel {signal.name!r} has {int((~signal.valid).sum())} samples missing; "
                "compress the stretches between the gaps one by one (--from, --to) and join them "
                "with + (hmpim compress a.h5 b.h5)"
            )
    if lags is None:
        lags = int(np.clip(aligned.samples // _SHARE, _SHORTEST, _LONGEST))
    elif not 1 <= lags <= _MOST:
        raise ArgumentError(
            f"lags = {lags} is not a window; give a number of samples from 1 to {_MOST}"
        )
    if not all(abs(knot) * aligned.fs < _FARTHEST for knot in knots):
        raise ArgumentError(f"knots = {shown(knots)} are no times in s; give finite numbers")
    places = tuple(round(knot * aligned.fs) for knot in knots)
    if any(b <= a for a, b in pairwise(places)):
        raise ArgumentError(f"knots = {list(knots)} do not increase; give times in s, in order")
    statistics = Statistics(
        fs=aligned.fs,
        reach=Reach(lags=lags, knots=places or (0,)),
        runs=(),
        names=(source.name, answer.name),
        units=(source.unit, answer.unit),
        intersample=aligned.intersample,
        band=record.band,
    )
    return statistics.join(bias=bias).update(source.values, answer.values)


def _named(signals: tuple[Signal, ...], name: str | None, role: str) -> Signal:
    """The named channel, or the only one."""
    known = ", ".join(repr(signal.name) for signal in signals)
    if name is None and len(signals) > 1:
        raise ArgumentError(
            f"the record has {len(signals)} {role}s ({known}); statistics are of one input and one "
            f"output, so name one of each with channels="
        )
    for signal in signals:
        if name is None or signal.name == name:
            return signal
    raise ArgumentError(f"the record has no {role} {name!r}; it has {known}")
