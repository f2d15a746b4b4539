"""Run a stimulus on a rig: limits first, then motion."""

import numpy as np

from hmpim.errors import ArgumentError, HmpimError, RigError
from hmpim.record import Record
from hmpim.rigs import Rig
from hmpim.stimulus import Stimulus, check_inside

__all__ = ["run"]


def run(rig: Rig, stimulus: Stimulus, *, rng: np.random.Generator | int | None = None) -> Record:
    """Play a stimulus on a rig and return the record.

    Nothing moves unless the stimulus keeps every limit of the rig.

    Parameters
    ----------
    rig : Rig
        The unit under test.
    stimulus : Stimulus
        What to play.
    rng : numpy.random.Generator, int or None
        Source of what is random in a simulated unit, or its seed; None draws fresh.

    Returns
    -------
    Record

    Raises
    ------
    LimitsError
        If a true peak of the stimulus, between samples too, is beyond a limit of the rig; the
        message says which, by how much, and what would do.
    UnitError
        If the units of stimulus and limits cannot be compared.
    RigError
        If the unit fails.

    Examples
    --------
    >>> from hmpim.rigs import Sensor
    >>> from hmpim.stimulus import Limits, design
    >>> limits = Limits(position=10, velocity=1000, acceleration=40000, unit="deg")
    >>> stimulus = design(band=(0.1, 20), duration=10, fs=200, limits=limits)
    >>> record = run(Sensor(delay=0.15, noise_std=0.1), stimulus, rng=1)
    >>> record.fs, record.inputs[0].unit
    (200.0, 'deg')
    """
    if not isinstance(rig, Rig):
        raise ArgumentError(
            f"{rig!r} is no rig; a rig has name, limits and play(stimulus, rng=...), "
            "and a plain function becomes one with FunctionRig(function=...)"
        )
    if not isinstance(stimulus, Stimulus):
        raise ArgumentError(
            f"{stimulus!r} is no Stimulus; make one with design(...) or Stimulus(waveform=...)"
        )
    if rig.limits is not None:
        check_inside(stimulus, rig.limits, whose=repr(rig.name))
    try:
        record = rig.play(stimulus, rng=np.random.default_rng(rng))
    except HmpimError:
        raise
    except Exception as error:  # a driver may raise anything
        raise RigError(f"rig {rig.name!r} failed: {type(error).__name__}: {error}") from error
    if not isinstance(record, Record):
        raise RigError(f"rig {rig.name!r} returned {type(record).__name__}; it must be a Record")
    return record
