"""Several axes at once: stimuli that one record can distinguish, and how well it can.

At each frequency a record of several axes is a set of linear equations, one for each
neighbouring bin of the spectra. Stimuli that pass a frequency at different times turn their
phases differently from bin to bin, and multisines that share no line are not there together;
either way the equations can be solved. The condition number of the input spectra over the
neighbouring bins says how well: 1 at best, infinite for stimuli that are the same.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hmpim.arguments import checked, size_of
from hmpim.errors import ArgumentError
from hmpim.stimulus.kinds import design
from hmpim.stimulus.lead import rest_to_rest
from hmpim.stimulus.limits import Limits
from hmpim.stimulus.motion import FloatArray
from hmpim.stimulus.multisine import interleaved_multisines
from hmpim.stimulus.stimulus import Stimulus
from hmpim.stimulus.sweep import check_band, check_positive

__all__ = ["AxisPlan", "InputCondition", "condition_table", "design_axes", "input_condition"]

_SAME = 1e-6  # share of a stimulus's power that another one leaves unexplained
_SINGULAR = 1e8  # condition beyond which it is rounding, and infinite
_ABSENT = 1e-4  # an input this far (80 dB) below its own r.m.s. level is leakage
_ALIKE = 0.15  # sweep rates nearer than this, relatively, make one sweep a delayed copy of another
_Kind = Literal["hmpim", "reversed", "exponential"]
_KINDS: tuple[_Kind, ...] = ("hmpim", "reversed", "exponential")


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class AxisPlan:
    """What one axis may do and where it is to be excited.

    Parameters
    ----------
    axis : str
        Its name.
    limits : Limits
        What it may do.
    band : tuple of float
        First and last frequency, Hz.

    Examples
    --------
    >>> AxisPlan(axis="roll", limits=Limits(position=10), band=(0.5, 20)).band
    (0.5, 20.0)
    """

    axis: str
    limits: Limits
    band: tuple[float, float]

    def __post_init__(self) -> None:
        if not self.axis:
            raise ArgumentError(f"axis = {self.axis!r} names no axis; give each one a name")
        object.__setattr__(self, "band", check_band(self.band))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class InputCondition:
    """How well stimuli can be distinguished, over frequency.

    Parameters
    ----------
    names : tuple of str
        Of the axes.
    frequency : ndarray, shape (f,)
        Hz.
    condition : ndarray, shape (f,)
        Condition number of the input spectra, each scaled to the same power, over the
        neighbouring bins; infinite where an axis is not excited.
    bound : float
        Largest condition number at which a frequency counts as usable.
    """

    names: tuple[str, ...]
    frequency: FloatArray
    condition: FloatArray
    bound: float

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Where the condition number is at most `bound`, shape (f,)."""
        return np.asarray(self.condition <= self.bound)

    @property
    def share(self) -> float:
        """Share of the frequencies that is usable."""
        return float(np.mean(self.usable))


@checked
def design_axes(
    plans: Sequence[AxisPlan],
    *,
    duration: float,
    fs: float,
    method: Literal["sweeps", "multisines"] = "sweeps",
    tail: float = 0.5,
) -> tuple[Stimulus, ...]:
    """Design stimuli for several axes that one record can distinguish.

    Parameters
    ----------
    plans : sequence of AxisPlan
        One for each axis.
    duration : float
        Length of the record in s: leads, waveforms, and the tail at rest.
    fs : float
        Sampling rate, Hz.
    method : {'sweeps', 'multisines'}
        Sweeps that pass each frequency at different times: up as the paper's, down, up
        exponentially, and for further axes the same three, each later and faster. Or
        multisines with the lines dealt out in turn, over one period.
    tail : float
        Seconds at rest at the end, in which delayed responses are still read.

    Returns
    -------
    tuple of Stimulus
        In the order of `plans`, as many samples in each, inside its limits, from rest to rest.

    Raises
    ------
    ArgumentError
        If two axes share a name, there is none, or the duration leaves no time to move.
    LimitsError
        If an axis's limits and band cannot both be met.

    Examples
    --------
    >>> limits = Limits(position=10, velocity=200, unit="deg")
    >>> plans = [AxisPlan(axis=a, limits=limits, band=(0.5, 20)) for a in ("roll", "pitch")]
    >>> roll, pitch = design_axes(plans, duration=10, fs=200)
    >>> roll.samples, pitch.samples
    (2000, 2000)
    >>> bool(input_condition([roll, pitch], band=(1, 19)).share > 0.9)
    True
    """
    names = [plan.axis for plan in plans]
    if not plans or len(set(names)) < len(names):
        raise ArgumentError(f"axes {names!r} must be different names; give each plan its own axis")
    total = check_positive("duration", duration, "s")
    size_of(total, check_positive("fs", fs, "Hz"))
    if not 0.0 <= tail < math.inf:
        raise ArgumentError(f"tail = {tail!r} s must be 0 or a positive, finite time")
    if method not in ("sweeps", "multisines"):
        raise ArgumentError(f"method = {method!r} must be 'sweeps' or 'multisines'")
    length = total - tail
    for _ in range(8):  # what the leads take is known once they are made
        if length <= 0.0:
            raise ArgumentError(
                f"duration = {duration:g} s leaves no time to move between leads and a tail of "
                f"{tail:g} s; make it longer"
            )
        made = _made(plans, length, fs, method)
        over = max(s.waveform.duration for s in made) + tail - total
        if over <= 1e-9:
            break
        length -= over + 1.0 / fs
    count = math.floor(total * fs + 1e-6)
    return tuple(replace(s, tail=count / fs - s.waveform.duration) for s in made)


def _made(
    plans: Sequence[AxisPlan], length: float, fs: float, method: Literal["sweeps", "multisines"]
) -> list[Stimulus]:
    if method == "multisines":
        cores = interleaved_multisines(
            bands=[p.band for p in plans], limits=[p.limits for p in plans], duration=length
        )
        return [
            Stimulus(
                waveform=rest_to_rest(core, limits=p.limits, fs=fs),
                fs=fs,
                unit=p.limits.unit,
                limits=p.limits,
                axis=p.axis,
            )
            for p, core in zip(plans, cores, strict=True)
        ]
    made = []
    for plan, (kind, share) in zip(plans, _turns(plans), strict=True):
        swept = design(
            band=plan.band,
            duration=share * length,
            fs=fs,
            limits=plan.limits,
            kind=kind,
            tail=0.0,
            axis=plan.axis,
        )
        if share < 1.0:
            begin = (1.0 - share) * length
            waiting = rest_to_rest(
                swept.core, limits=plan.limits, fs=fs, longest=max(begin, swept.sweep_start)
            )
            swept = replace(swept, waveform=waiting)
        made.append(swept)
    return made


def _turns(plans: Sequence[AxisPlan]) -> list[tuple[_Kind, float]]:
    """Kind of each sweep, and the share of the time it takes: the later, the faster."""
    turns: list[tuple[_Kind, float]] = []
    rounds = math.ceil(len(plans) / len(_KINDS))
    for k, plan in enumerate(plans):
        kind = _KINDS[k % len(_KINDS)]
        share = 1.0 - 0.5 * (k // len(_KINDS)) / rounds
        before = [
            _rate(other.band, taken, kind)
            for other, (same, taken) in zip(plans, turns, strict=False)
            if same == kind
        ]
        if share < 1.0:
            longer = [share * (1.0 + 0.5 * _ALIKE * k) for k in range(1, 4)]  # gentler: first
            shorter = [share * (1.0 - 0.5 * _ALIKE * k) for k in range(1, 7)]
            share = next(
                (
                    tried
                    for tried in (share, *longer, *shorter)
                    if all(abs(_rate(plan.band, tried, kind) / r - 1) >= _ALIKE for r in before)
                ),
                share,
            )
        turns.append((kind, share))
    return turns


def _rate(band: tuple[float, float], share: float, kind: _Kind) -> float:
    """Band passed in a unit of time, in Hz or, for an exponential sweep, in ln Hz."""
    first, last = band
    return (math.log(last / first) if kind == "exponential" else last - first) / share


def input_condition(
    stimuli: Sequence[Stimulus] | ArrayLike,
    *,
    band: tuple[float, float],
    fs: float | None = None,
    names: Sequence[str] | None = None,
    width: float | None = None,
    bound: float = 10.0,
) -> InputCondition:
    """Condition number of the input spectra over frequency.

    Parameters
    ----------
    stimuli : sequence of Stimulus, or array_like of shape (m, n)
        Positions played at once; arrays need `fs`.
    band : tuple of float
        Hz.
    fs : float, optional
        Sampling rate of arrays, Hz.
    names : sequence of str, optional
        Of arrays; "input 0" and so on by default.
    width : float, optional
        Width in Hz of the neighbourhood that is taken together; by default six bins for each
        input.
    bound : float
        Condition number up to which a frequency is declared usable. At 10 the error of the
        worst combination of axes is ten times that of the best.

    Returns
    -------
    InputCondition

    Raises
    ------
    ArgumentError
        If stimuli are the same but for a factor, or sums of others: the axes are named.

    Examples
    --------
    >>> t = np.arange(2000) / 200
    >>> up = np.sin(2 * np.pi * (0.1 * t + t**2))
    >>> apart = input_condition([up, up[::-1]], fs=200, band=(1, 19))
    >>> bool(np.median(apart.condition) < 1.5)
    True
    """
    u, rate, labels = _signals(stimuli, fs, names)
    _refuse_same(u, labels)
    low, high = check_band(band)
    count = u.shape[1]
    spectrum = np.fft.rfft(u, axis=1)
    frequency = np.fft.rfftfreq(count, 1.0 / rate)
    bins = 6 * len(u) if width is None else max(round(width * count / rate), len(u))
    half = bins // 2
    centres = np.flatnonzero((frequency >= low) & (frequency <= high))
    centres = centres[(centres - half >= 1) & (centres + half < frequency.size)]
    if centres.size == 0:
        raise ArgumentError(
            f"band = ({low:g}, {high:g}) Hz is narrower than {bins} bins of {rate / count:.3g} Hz; "
            "widen it, or make the record longer"
        )
    around = spectrum[:, centres[:, None] + np.arange(-half, half + 1)]  # (m, f, bins)
    around = around.transpose(1, 0, 2)
    power = np.linalg.norm(around, axis=2, keepdims=True)
    level = np.linalg.norm(spectrum, axis=1) / math.sqrt(frequency.size)
    floor = _ABSENT * level[None, :, None] * math.sqrt(around.shape[2])
    scaled = np.divide(around, power, out=np.zeros_like(around), where=power > floor)
    values = np.linalg.svd(scaled, compute_uv=False)
    least = np.maximum(values[:, -1], np.finfo(float).tiny)
    condition = values[:, 0] / least
    condition = np.where(condition > _SINGULAR, np.inf, condition)
    if np.all(np.isinf(condition)):
        raise ArgumentError(
            f"axes {', '.join(labels)} cannot be distinguished anywhere from {low:g} to "
            f"{high:g} Hz; excite each of them there, with sweeps that pass at different times"
        )
    return InputCondition(
        names=labels,
        frequency=np.asarray(frequency[centres], dtype=np.float64),
        condition=np.asarray(condition),
        bound=bound,
    )


def _signals(
    stimuli: Sequence[Stimulus] | ArrayLike, fs: float | None, names: Sequence[str] | None
) -> tuple[FloatArray, float, tuple[str, ...]]:
    if isinstance(stimuli, Sequence) and all(isinstance(s, Stimulus) for s in stimuli):
        several = [s for s in stimuli if isinstance(s, Stimulus)]
        rates = {s.fs for s in several}
        if len(rates) != 1:
            raise ArgumentError(f"stimuli are sampled at {sorted(rates)} Hz; design them at one")
        count = max((s.samples for s in several), default=0)
        u = np.zeros((len(several), count))
        for row, s in zip(u, several, strict=True):
            row[: s.samples] = s.position
            row[s.samples :] = s.position[-1]
        rate = rates.pop()
        labels = tuple(s.axis or f"input {k}" for k, s in enumerate(several))
    else:
        u = np.atleast_2d(np.asarray(stimuli, dtype=np.float64))
        if fs is None:
            raise ArgumentError("fs is not given; arrays of samples need their rate in Hz")
        rate = check_positive("fs", fs, "Hz")
        labels = tuple(f"input {k}" for k in range(len(u))) if names is None else tuple(names)
    if u.ndim != 2 or len(labels) != len(u) or not np.all(np.isfinite(u)):
        raise ArgumentError(
            f"inputs of shape {u.shape} with {len(labels)} names; give finite samples, shape "
            "(m, n), and m names"
        )
    return u, rate, labels


def _refuse_same(u: FloatArray, labels: tuple[str, ...]) -> None:
    """Name inputs that do not move, are the same but for a factor, or sums of others."""
    centred = u - u.mean(axis=1, keepdims=True)
    size = np.linalg.norm(centred, axis=1)
    for label, one in zip(labels, size, strict=True):
        if one == 0.0:
            raise ArgumentError(f"{label} does not move; leave it out or give it a stimulus")
    unit = centred / size[:, None]
    alike = np.abs(unit @ unit.T)
    for i in range(len(u)):
        for j in range(i):
            if 1.0 - alike[i, j] ** 2 < _SAME:
                raise ArgumentError(
                    f"{labels[j]} and {labels[i]} are driven by the same stimulus and cannot be "
                    "distinguished; reverse one of them in time, or use design_axes"
                )
    values, vectors = np.linalg.eigh(unit @ unit.T)
    if values[0] < _SAME:
        among = [label for label, v in zip(labels, vectors[:, 0], strict=True) if abs(v) > 1e-3]
        raise ArgumentError(
            f"the stimuli of {', '.join(among)} are sums of one another and cannot be "
            "distinguished; use design_axes"
        )


def condition_table(found: InputCondition) -> str:
    """Say in a few lines how well axes can be distinguished, octave by octave.

    Examples
    --------
    >>> flat = np.arange(1.0, 4.0)
    >>> even = InputCondition(names=("a", "b"), frequency=flat, condition=np.ones(3), bound=10.0)
    >>> print(condition_table(even))
    condition number of the inputs a, b; usable up to 10: 100 % of the frequencies
           1 to 2        Hz: median 1, worst 1, usable 100 %
           2 to 3        Hz: median 1, worst 1, usable 100 %
    """
    lines = [
        f"condition number of the inputs {', '.join(found.names)}; usable up to "
        f"{found.bound:g}: {100 * found.share:.0f} % of the frequencies"
    ]
    low, last = float(found.frequency[0]), float(found.frequency[-1])
    while low < last:
        high = min(2.0 * low, last)
        inside = (found.frequency >= low) & (
            (found.frequency < high) if high < last else (found.frequency <= high)
        )
        if np.any(inside):
            here = found.condition[inside]
            lines.append(
                f"{low:>8.3g} to {high:<8.3g} Hz: median {np.median(here):.3g}, worst "
                f"{here.max():.3g}, usable {100 * np.mean(found.usable[inside]):.0f} %"
            )
        low = high
    return "\n".join(lines)
