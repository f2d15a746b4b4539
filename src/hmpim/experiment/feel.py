"""Feel before you push: an unknown rig is moved a little first, then more, step by step.

The stimulus is played at a small share of its amplitude, then at a larger one, and so on. Each
time what came back says what the next share would bring: measured positions grow with the
amplitude as long as the rig is linear. A share that would bring a measured position beyond its
limit is not played, nor one after the rig has stopped to answer in proportion.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hmpim.errors import ArgumentError, RigError
from hmpim.record import Channel, Finding, Record
from hmpim.stimulus import Limits, Stimulus, scaled_stimulus
from hmpim.units import conversion_factor

__all__ = ["Feel", "Felt", "feel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feel:
    """How carefully an unknown rig is moved first.

    Parameters
    ----------
    shares : tuple of float
        Of the stimulus's amplitude, rising, each more than 0 and less than 1.
    departure : float
        How far a response may be from the one before in proportion, as a share of it, before
        the rig counts as no longer linear.
    margin : float
        Share of the limit to which a measured position may be expected to go.

    Raises
    ------
    ArgumentError
        If the shares do not rise between 0 and 1.

    Examples
    --------
    >>> Feel().shares
    (0.05, 0.2, 0.5)
    """

    shares: tuple[float, ...] = (0.05, 0.2, 0.5)
    departure: float = 0.25
    margin: float = 0.95

    def __post_init__(self) -> None:
        ladder = (0.0, *self.shares, 1.0)
        if not self.shares or any(b <= a for a, b in pairwise(ladder)):
            raise ArgumentError(f"shares = {self.shares} must rise, between 0 and 1")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Felt:
    """The amplitude that a rig can be given.

    Parameters
    ----------
    share : float
        Share of the stimulus's amplitude that limits and linearity allow; 1 for all of it.
    findings : tuple of Finding
        Why it is less than 1, or that the rig was first moved at small amplitudes.
    """

    share: float
    findings: tuple[Finding, ...]


def feel(
    play: Callable[[Mapping[str, Stimulus]], Record],
    stimuli: Mapping[str, Stimulus],
    limits: Mapping[str, Limits | None],
    *,
    how: Feel,
) -> Felt:
    """Find the share of a stimulus's amplitude that a rig can be given, in steps from a small one.

    Parameters
    ----------
    play : callable
        Plays stimuli and returns the record.
    stimuli : mapping of axis to Stimulus
        At full amplitude.
    limits : mapping of axis to Limits or None
        Of each axis.
    how : Feel
        Steps, and what counts as linear.

    Raises
    ------
    RigError
        If the rig does not answer at all at the smallest share.
    """
    before: tuple[float, Record] | None = None
    allowed = how.shares[0]
    for share in (*how.shares, 1.0):
        if before is not None:
            grown = _growth(before[1], limits)
            if grown * share / before[0] > how.margin:
                least = how.margin / grown * before[0]
                return _less(
                    min(least, 1.0),
                    f"at {100 * before[0]:.3g} % of the amplitude the largest measured position "
                    f"is {100 * grown:.3g} % of its limit, and {100 * share:.3g} % would bring it "
                    f"to {100 * grown * share / before[0]:.3g} %",
                )
        allowed = share
        if share == 1.0:
            break
        record = play({axis: scaled_stimulus(s, share) for axis, s in stimuli.items()})
        if before is None:
            _answers(record)
        else:
            departed = _departure(before, (share, record))
            if departed > how.departure:
                return _less(
                    before[0],
                    f"between {100 * before[0]:.3g} and {100 * share:.3g} % of the amplitude the "
                    f"response departs from proportion by {100 * departed:.3g} %",
                )
        before = (share, record)
    words = ", ".join(f"{100 * share:.3g} %" for share in how.shares)
    return Felt(
        share=allowed,
        findings=(
            Finding(
                code="felt",
                message=(
                    f"The rig was first moved at {words} of the amplitude; it stayed linear and "
                    "inside its limits."
                ),
                severity="info",
                parameters=(),
            ),
        ),
    )


def _less(share: float, why: str) -> Felt:
    return Felt(
        share=share,
        findings=(
            Finding(
                code="felt",
                message=f"Played at {100 * share:.3g} % of the requested amplitude: {why}.",
                severity="info",
                parameters=(),
            ),
        ),
    )


def _swing(channel: Channel) -> float:
    """Largest distance from where it began; the median of the first samples, against spikes."""
    begun = float(np.median(channel.values[: max(3, channel.values.size // 100)]))
    return float(np.quantile(np.abs(channel.values - begun), 0.999))


def _growth(record: Record, limits: Mapping[str, Limits | None]) -> float:
    """Largest measured position as a share of its limit."""
    shares = [0.0]
    only = next(iter(limits.values())) if len(limits) == 1 else None
    for channel in record.outputs:
        axis = channel.name.removesuffix(".position")
        bound = limits.get(axis, only)
        if bound is None or not np.isfinite(bound.position) or channel.unit == "":
            continue
        try:
            factor = conversion_factor(channel.unit, to=bound.unit)
        except ArgumentError:
            continue  # a sensor's output, and no position
        shares.append(factor * _swing(channel) / bound.position)
    return max(shares)


def _answers(record: Record) -> None:
    for channel in record.outputs:
        if np.ptp(channel.values) > 0.0:
            return
    names = ", ".join(channel.name for channel in record.outputs)
    raise RigError(
        f"{names} did not change when the rig was moved a little; is it switched on, and are these "
        "its sensors?"
    )


def _departure(before: tuple[float, Record], now: tuple[float, Record]) -> float:
    """How far responses are from proportion, beyond noise, as a share of the response.

    Compared as frequency responses, output over input, so that it does not matter where in a
    sampling interval either record began.
    """
    worst = 0.0
    for k, (first, second) in enumerate(zip(before[1].outputs, now[1].outputs, strict=True)):
        ours = min(k, len(now[1].inputs) - 1)
        apart, power, noise = _compared(
            (before[1].inputs[ours], first), (now[1].inputs[ours], second)
        )
        if power > 4.0 * noise:  # else the small motion is lost in the noise, and tells nothing
            worst = max(worst, float(np.sqrt(max(apart - noise, 0.0) / power)))
    return worst


def _compared(
    low: tuple[Channel, Channel], high: tuple[Channel, Channel]
) -> tuple[float, float, float]:
    """Power of the difference of two responses, of the second, and of the noise in the first."""
    count = min(c.values.size for c in (*low, *high))
    # Without what stands still: a rig may rest anywhere, and noise there counts for nothing.
    spectra = [np.fft.rfft(c.values[:count])[1:] for c in (*low, *high)]
    u_low, y_low, u_high, y_high = spectra
    driven = np.abs(u_high) > 0.05 * np.abs(u_high).max()
    ratio = u_high[driven] / u_low[driven]
    expected = y_low[driven] * ratio
    noise = count * (
        _noise(low[1].values) ** 2 * float(np.sum(np.abs(ratio) ** 2))
        + _noise(high[1].values) ** 2 * np.count_nonzero(driven)
    )
    apart = float(np.sum(np.abs(expected - y_high[driven]) ** 2))
    return apart, float(np.sum(np.abs(y_high[driven]) ** 2)), noise


def _noise(values: NDArray[np.float64]) -> float:
    """Standard deviation of what changes from sample to sample: third differences."""
    differences = np.diff(values, 3)
    return float(np.median(np.abs(differences)) / 0.6745 / np.sqrt(20.0))
