"""Run a stimulus on a rig: limits first, then motion."""

import math

import numpy as np

from hmpim.errors import ArgumentError, HmpimError, LimitsError, RigError, UnitError
from hmpim.record import Record
from hmpim.rigs import Rig
from hmpim.stimulus import Limits, Stimulus
from hmpim.stimulus.limits import QUANTITIES
from hmpim.units import conversion_factor, rate_unit

__all__ = ["check_limits", "run"]

_ROUNDING = 1e-9  # a stimulus solved onto a limit may stand a rounding error beyond it


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
        check_limits(stimulus, rig.limits, name=rig.name)
    try:
        record = rig.play(stimulus, rng=np.random.default_rng(rng))
    except HmpimError:
        raise
    except Exception as error:  # a driver may raise anything
        raise RigError(f"rig {rig.name!r} failed: {type(error).__name__}: {error}") from error
    if not isinstance(record, Record):
        raise RigError(f"rig {rig.name!r} returned {type(record).__name__}; it must be a Record")
    return record


def check_limits(stimulus: Stimulus, limits: Limits, *, name: str = "rig") -> None:
    """Refuse a stimulus that goes beyond `limits`, converted to their unit.

    Parameters
    ----------
    stimulus : Stimulus
        Its true peaks are looked at, between the samples too, and the jumps that its samples
        command.
    limits : Limits
        What the rig bears.
    name : str
        Name of the rig, for the message.

    Raises
    ------
    LimitsError
        If a peak is beyond a limit.
    UnitError
        If one has a unit and the other has none, or the dimensions differ.

    Examples
    --------
    >>> from hmpim.stimulus import Ramp
    >>> ramp = Stimulus(waveform=Ramp(rate=2.0, duration=1.0), fs=10.0, unit="deg")
    >>> check_limits(ramp, Limits(velocity=1.0, unit="deg"))
    Traceback (most recent call last):
    hmpim.errors.LimitsError: peak velocity 2 deg/s is beyond the limit 1 deg/s of 'rig'; ...
    """
    # Pint takes no unit for rad; here it means that nobody said.
    if (stimulus.unit == "") != (limits.unit == ""):
        raise UnitError(
            f"the stimulus is in {stimulus.unit or 'no unit'!r} and the limits of {name!r} are in "
            f"{limits.unit or 'no unit'!r}; state the unit of both"
        )
    factor = conversion_factor(stimulus.unit, to=limits.unit)
    shares = []
    commanded = _commanded_peaks(stimulus)
    for order, quantity in enumerate(QUANTITIES):
        limit: float = getattr(limits, quantity)
        if math.isinf(limit):
            continue
        peak = factor * max(getattr(stimulus.peaks, quantity), commanded[order])
        shares.append((peak / limit, quantity, peak, limit, rate_unit(limits.unit, order)))
    share, quantity, peak, limit, unit = max(shares, default=(0.0, "", 0.0, 0.0, ""))
    if share > 1.0 + _ROUNDING:
        advice = (
            f"scale the stimulus by {_down(1 / share):.4g}, or design it within this limit"
            if math.isfinite(share)
            else "it jumps, so take one that starts and ends at rest, designed within this limit"
        )
        raise LimitsError(
            f"peak {quantity} {peak:.6g} {unit} is beyond the limit {limit:.6g} {unit} of "
            f"{name!r}; {advice}"
        )


def _commanded_peaks(stimulus: Stimulus) -> tuple[float, float, float, float]:
    """Peaks that the samples alone command: largest value and differences.

    The mean velocity between samples is never above the true peak, unless the motion jumps,
    as a step does, whose derivative is 0 wherever it has one. The first interval is left out of
    the second differences: the printed sweep (lead 0) starts there with a velocity step. Third
    differences would be all rounding: the jerk is that of the motion in closed form.
    """
    x = stimulus.position
    fs = stimulus.fs
    before = stimulus.motion(np.array([-1.0 / fs])).position
    noise = 4 * float(np.spacing(np.abs(x).max()))  # of a difference of rounded samples
    velocity = np.abs(np.diff(np.concatenate((before, x)))).max() - noise
    bend = np.abs(np.diff(x[1:], 2)).max() - 2 * noise if x.size > 3 else 0.0
    return float(np.abs(x).max()), float(velocity * fs), float(bend * fs * fs), 0.0


def _down(value: float) -> float:
    """Four digits of `value`, cut and not rounded, so that the advice does."""
    place = 10.0 ** (3 - math.floor(math.log10(value)))
    return math.floor(value * place) / place
