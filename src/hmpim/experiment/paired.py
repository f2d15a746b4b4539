"""An input and an output on one clock, while samples come."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import RecordError
from hmpim.record import Record, Series, uniform
from hmpim.record.mend import mend
from hmpim.rigs import Samples

__all__ = ["Paired"]

Real = NDArray[np.float64]

_BACK = 8  # samples held back where channels must be interpolated: the next ones change them
_HOLE = 10  # samples missing in a row after which nothing is claimed any more
_EVEN = 0.1  # of an interval by which stamps of one clock may be uneven


class Paired:
    """Samples of an input and an output, put on one uniform clock as they come.

    Parameters
    ----------
    names : (str, str)
        Of the input and the output.
    fs : float
        Rate of the clock, Hz.

    Examples
    --------
    >>> pair = Paired(("u", "y"), fs=100.0)
    >>> part = Samples(time=np.arange(50) / 100.0, values=np.arange(50.0))
    >>> pair.add({"u": part, "y": part})
    >>> [values.size for values in pair.fresh()], [values.size for values in pair.fresh()]
    ([50, 50], [0, 0])
    """

    def __init__(self, names: tuple[str, str], *, fs: float) -> None:
        self._names, self._fs = names, fs
        self._parts: dict[str, list[Samples]] = {name: [] for name in names}
        self._given = 0
        self.whole = True
        """Whether no more than a few samples are missing."""

    def add(self, samples: Mapping[str, Samples]) -> None:
        """Take what has come."""
        for name in self._names:
            part = samples.get(name)
            if part is None or not part.time.size:
                continue
            self._parts[name].append(part)

    def fresh(self) -> tuple[Real, Real]:
        """Samples of both that were not given before."""
        whole = [Samples.joined(self._parts[name]) for name in self._names if self._parts[name]]
        if len(whole) < 2 or min(part.time.size for part in whole) < 4 * _BACK:
            return np.empty(0), np.empty(0)
        u, y = whole
        same = u.time.size == y.time.size and np.array_equal(u.time, y.time)
        if same and self._even(u.time) and np.isfinite((u.values, y.values)).all():
            values, known = (u.values, y.values), u.time.size
        else:
            try:
                aligned = uniform(self._record(u, y))
            except RecordError:  # what is wrong with them is said when the run is over
                self.whole = False
                return np.empty(0), np.empty(0)
            one, other = aligned.inputs[0], aligned.outputs[0]
            self._look_for_holes(one.valid & other.valid)
            values, known = (one.values, other.values), aligned.samples - _BACK
        fresh = slice(self._given, max(known, self._given))
        self._given = fresh.stop
        return values[0][fresh], values[1][fresh]

    def _even(self, time: Real) -> bool:
        return bool(np.abs(np.diff(time) * self._fs - 1.0).max() < _EVEN)

    def _record(self, u: Samples, y: Samples) -> Record:
        """Both, mended; a clock of its own far from the run's begins with its first sample."""
        late = float(y.time[0] - u.time[0])
        shift = late if abs(late) > 1.0 else 0.0
        source, answer = mend(
            [
                Series(name=name, time=part.time - by, values=part.values)
                for name, part, by in zip(("u", "y"), (u, y), (0.0, shift), strict=True)
            ]
        ).channels
        return Record(inputs=(source,), outputs=(answer,), fs=self._fs)

    def _look_for_holes(self, valid: NDArray[np.bool_]) -> None:
        edges = np.flatnonzero(np.diff(np.concatenate(([True], valid, [True])).astype(np.int8)))
        if edges.size and int(np.diff(edges.reshape(-1, 2), axis=1).max()) > _HOLE:
            self.whole = False
