"""What an input does between its samples: closed form, held, joined, or band-limited."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hmpim.record import Intersample, is_held

__all__ = ["ContinuousInput", "between_samples"]

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContinuousInput:
    """An input that is known at any time, at rest at `rest` before time 0.

    Parameters
    ----------
    at : callable
        Values at times (s, shape (n,)).
    rest : float
        Value before time 0.
    breaks : ndarray, shape (m,), or None
        All times in s at which it jumps or bends, rising; None where they are not known.
    """

    at: Callable[[FloatArray], FloatArray]
    rest: float
    breaks: FloatArray | None


def between_samples(values: FloatArray, fs: float, intersample: Intersample) -> ContinuousInput:
    """Make a continuous input of samples taken at k/fs.

    Parameters
    ----------
    values : ndarray, shape (n,)
        Samples.
    fs : float
        Rate in Hz.
    intersample : {'zoh', 'foh', 'bandlimited'}
        Held, joined linearly, or smooth. 'bandlimited' is a spline of degree 7 through the
        samples; it errs by less than 1e-6 of the amplitude up to an eighth of the rate,
        some samples away from either end.

    Examples
    --------
    >>> import numpy as np
    >>> u = between_samples(np.array([0.0, 2.0, 4.0]), 1.0, "foh")
    >>> u.at(np.array([-1.0, 0.5, 9.0])).tolist()
    [0.0, 1.0, 4.0]
    """
    time = np.arange(values.size) / fs
    at: Callable[[FloatArray], FloatArray]
    if is_held(intersample):
        breaks = time

        def at(t: FloatArray) -> FloatArray:
            # A thousandth of a millionth of a sample of grace: k/fs belongs to sample k.
            index = np.floor(t * fs + 1e-9).astype(np.int64)
            return np.asarray(values[np.clip(index, 0, values.size - 1)])

    elif intersample == "foh":
        breaks = time

        def at(t: FloatArray) -> FloatArray:
            return np.interp(t, time, values)

    else:
        breaks = time[[0, -1]]
        spline = scipy.interpolate.make_interp_spline(
            time, values, k=min(7, 2 * ((values.size - 2) // 2) + 1)
        )

        def at(t: FloatArray) -> FloatArray:
            return np.asarray(spline(np.clip(t, 0.0, time[-1])))

    return ContinuousInput(at=at, rest=float(values[0]), breaks=breaks)
