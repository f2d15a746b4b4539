"""Arguments and records that are refused, each in one sentence."""

from collections.abc import Sequence
from typing import cast, get_args

import numpy as np

from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.fitting.enrich import MODES
from hmpim.identify.fitting.feedforward_rows import may_be_fed_forward
from hmpim.model.dynamics import FILTERS, STRUCTURES, StructureName
from hmpim.record import Aligned, Intersample, Record

__all__ = [
    "check_moves",
    "check_samples",
    "check_statistics",
    "checked_intersample",
    "checked_structures",
]

_FEWEST_SAMPLES = 50

_LARGEST = 1e75
"""Largest sample, and one over the smallest range: fourth powers must be representable."""


def checked_intersample(intersample: str, stated: Intersample | None) -> Intersample | None:
    """Return what the input does between its samples; None if that is to be found."""
    if intersample == "auto":
        return stated
    if intersample not in get_args(Intersample):
        raise ArgumentError(
            f"intersample {intersample!r} is not known; choose one of auto, zoh, foh, "
            "bandlimited, feedforward, sampled"
        )
    return cast(Intersample, intersample)


def checked_structures(
    structures: Sequence[str] | None, intersample: Intersample | None
) -> tuple[StructureName, ...]:
    """Return the structures to try; for software, filters."""
    known = list(FILTERS) if intersample == "sampled" else list(STRUCTURES)
    if intersample == "feedforward":
        known = [n for n, s in STRUCTURES.items() if not s.zeros or may_be_fed_forward(s)]
    wanted = tuple(structures) if structures is not None else tuple(known)
    for name in wanted:
        if name not in known:
            every = ", ".join(known).replace(", ".join(MODES[:-1]), "…")
            if name in STRUCTURES and intersample == "feedforward":
                raise ArgumentError(
                    f"structure {str(name)!r} has zeros that feedforward does not make; choose "
                    f"one of {every}, or state intersample='zoh'"
                )
            raise ArgumentError(f"structure {str(name)!r} is not known; choose one of {every}")
    return cast(tuple[StructureName, ...], wanted)


def check_statistics(intersample: Intersample | None, reference: str | None) -> None:
    """Refuse what the statistics do not keep."""
    if intersample == "sampled":
        raise ArgumentError(
            "statistics do not know software (intersample='sampled'); identify the record"
        )
    if reference is not None:
        raise ArgumentError(
            f"statistics contain no reference, but reference={reference!r} is given; identify "
            "the record"
        )


def check_samples(record: Record) -> None:
    """Refuse too few samples, and numbers whose products would overflow or underflow."""
    channels = (*record.inputs, *record.outputs)
    for channel in channels:
        if channel.values.size < _FEWEST_SAMPLES:
            raise RecordError(
                f"channel {channel.name!r} has {channel.values.size} samples; at least "
                f"{_FEWEST_SAMPLES} are needed to distinguish dynamics from noise, so record longer"
            )
    for channel in channels:
        largest, span = float(np.abs(channel.values).max()), float(np.ptp(channel.values / 2))
        if largest > _LARGEST or 0.0 < span < 1 / _LARGEST:
            raise RecordError(
                f"channel {channel.name!r} reaches {largest:.3g}, outside the range from "
                f"{1 / _LARGEST:g} to {_LARGEST:g} that can be computed; give it in another "
                "unit, or look for damaged samples"
            )
    if not 1 / _LARGEST < record.fs < _LARGEST:
        raise RecordError(
            f"the record runs at {record.fs:.3g} Hz; check the unit of its time stamps, which are "
            "seconds"
        )


def check_moves(aligned: Aligned) -> None:
    """Refuse an input that is constant, and a record in which no output moves."""
    for signal in aligned.inputs:
        if np.ptp(signal.values) == 0:
            raise RecordError(
                f"input {signal.name!r} is constant at {signal.values[0]:g}; nothing can be "
                "identified from an input that does not move"
            )
    dead = [s for s in aligned.outputs if np.ptp(s.values[s.valid]) == 0]
    if len(dead) == len(aligned.outputs):
        raise RecordError(
            f"output {dead[0].name!r} is constant at {dead[0].values[0]:g}; the sensor is dead, "
            "stuck or not connected, or the wrong column is taken as output"
        )
