"""Whether records are of one test: repeats, one stimulus at several levels, or one record twice."""

from collections.abc import Sequence

import numpy as np

from hmpim.errors import RecordError
from hmpim.identify.worth import FEW
from hmpim.record import Record, uniform

__all__ = ["check_alike", "check_apart", "check_channels", "same_at_levels"]

_SAME_RATE = 1e-3
"""Relative difference up to which the rates of two clocks are the same."""


def same_at_levels(records: Sequence[Record]) -> bool:
    """Whether records are of one stimulus at several amplitudes, rather than repeats of it.

    Parameters
    ----------
    records : sequence of Record
        With the same channels.

    Returns
    -------
    bool
        True if the inputs are the same but for a factor, and that factor is not 1 for all.

    Examples
    --------
    >>> u = np.sin(np.arange(100.0) ** 2 / 300)
    >>> small, large = (Record.from_arrays({"u": k * u}, {"y": u}, fs=9.0) for k in (1, 3))
    >>> same_at_levels([small, large]), same_at_levels([small, small])
    (True, False)
    """
    aligned = [uniform(record) for record in records]
    changed = False
    for other in aligned[1:]:
        if len(other.inputs) != len(aligned[0].inputs):
            return False
        for one, two in zip(aligned[0].inputs, other.inputs, strict=True):
            length = min(one.values.size, two.values.size)
            first, second = (x.values[:length] - x.values[:length].mean() for x in (one, two))
            power = float(first @ first)
            factor = float(first @ second) / power if power else 0.0
            rest = float(np.linalg.norm(second - factor * first))
            if not factor > 0 or rest > FEW * float(np.linalg.norm(second)):
                return False
            changed = changed or abs(factor - 1) > FEW
    return changed


def check_channels(records: Sequence[Record]) -> None:
    """Refuse records whose channels or units differ from the first one's."""
    first, *others = [(*r.inputs, *r.outputs) for r in records]
    for k, own in enumerate(others, start=1):
        names, known = [c.name for c in own], [c.name for c in first]
        if names != known:
            raise RecordError(
                f"record {k} has channels {', '.join(names)} and record 0 has "
                f"{', '.join(known)}; give the same channels in the same order"
            )
        for one, other in zip(first, own, strict=True):
            if one.unit and other.unit and one.unit != other.unit:
                raise RecordError(
                    f"{one.name!r} is in {other.unit!r} in record {k} and in {one.unit!r} in "
                    "record 0; units are not converted, give records in the same units"
                )


def check_alike(records: tuple[Record, ...]) -> None:
    """Refuse records that are no repeats: other channels, rates or inputs."""
    check_channels(records)
    first = records[0]
    aligned = [uniform(record) for record in records]
    for k, record in enumerate(records[1:], start=1):
        if abs(record.fs / first.fs - 1) > _SAME_RATE:
            raise RecordError(
                f"record {k} is at {record.fs:g} Hz and record 0 at {first.fs:g} Hz; resample one"
            )
        for one, other in zip(aligned[0].inputs, aligned[k].inputs, strict=True):
            length = min(one.values.size, other.values.size)
            apart = float(np.std(one.values[:length] - other.values[:length]))
            size = float(np.std(one.values[:length]))
            if apart > FEW * size:
                raise RecordError(
                    f"input {one.name!r} of record {k} differs from that of record 0 by "
                    f"{100 * apart / size if size else np.inf:.3g} % (r.m.s.); repeats need one "
                    "stimulus, from the same start"
                )


def check_apart(records: tuple[Record, ...]) -> None:
    """Refuse one record given twice: it shows nothing of repeatability."""
    known: dict[bytes, int] = {}
    for k, record in enumerate(records):
        measured = b"".join(channel.values.tobytes() for channel in record.outputs)
        if measured in known:
            raise RecordError(
                f"records {known[measured]} and {k} hold the same samples; one record given twice "
                "is not two repeats, so repeat the test"
            )
        known[measured] = k
