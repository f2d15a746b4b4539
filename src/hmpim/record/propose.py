"""Which channels may be the input and the outputs: a proposal with its reasons, never a choice."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hmpim.record.channel import Channel
from hmpim.record.clock import fit_clock
from hmpim.record.onto import on_grid

__all__ = ["Proposal", "propose"]

_ASKED = frozenset(
    [
        *("u", "input", "in", "command", "commanded", "cmd", "setpoint", "sp", "stimulus"),
        *(
            "drive",
            "demand",
            "desired",
            "des",
            "target",
            "excitation",
            "sweep",
            "chirp",
            "actuator",
        ),
        *("motor", "throttle", "reference", "ref"),
    ]
)
_ANSWERED = frozenset(
    [
        *("y", "output", "out", "response", "measured", "meas", "actual", "act", "feedback", "fb"),
        *("sensor", "encoder", "enc", "gyro", "acc", "accel", "rate", "position", "pos", "angle"),
        *("velocity", "vel", "tracker", "pickup"),
    ]
)

_FOLLOWS = 0.3
"""Correlation from which a channel is said to move with another: 9 % of its power."""

_AT_ONCE = 1e-6
"""Samples by which two channels must differ to be told apart: sums round to less."""

_MOST = 24  # channels that are held against each other
_LONGEST = 2**16  # samples that are enough to tell


@dataclass(frozen=True, slots=True, kw_only=True)
class Proposal:
    """What may be the input and what the outputs.

    Parameters
    ----------
    inputs, outputs : tuple of str
        Names of channels; empty where nothing speaks for any.
    reasons : tuple of (str, str)
        For every channel that was looked at, its name and what speaks for or against it.
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    reasons: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Follows:
    """How one channel follows another: how alike they are, and by how much it is later."""

    alike: float
    later: float


_ABSURD = 1e100
"""Range beyond which numbers are damage and no signal."""


def propose(channels: Sequence[Channel]) -> Proposal:
    """Propose an input and outputs from what the channels are called and how they move.

    The input is the channel whose name says so, or, if no name or several do, the one that all
    others which move with it follow. Outputs are those that follow it.

    Parameters
    ----------
    channels : sequence of Channel
        All that may be either.

    Examples
    --------
    >>> t = np.arange(0, 10, 0.01)
    >>> a = Channel(name="a", time=t, values=np.sin(t**2))
    >>> b = Channel(name="b", time=t, values=2 * np.sin(np.maximum(t - 0.05, 0) ** 2))
    >>> found = propose([b, a])
    >>> found.inputs, found.outputs
    (('a',), ('b',))
    >>> found.reasons[0]
    ('b', "follows 'a' by 0.0499 s (correlation 1.00)")
    """
    reasons: dict[str, str] = {}
    alive = []
    for c in channels:
        why = _idle(c)
        if why is None:
            alive.append(c)
        else:
            reasons[c.name] = why
    alive = alive[:_MOST]
    if len(alive) < 2:
        for c in alive:
            reasons[c.name] = "the only channel that moves"
        return _told((), (), channels, reasons)
    follows = _following(alive)
    chosen = _input(alive, follows)
    if chosen is None:
        for c in alive:
            reasons[c.name] = "moves, and no other channel moves with it"
        return _told((), (), channels, reasons)
    outputs = []
    for k, c in enumerate(alive):
        if k == chosen:
            continue
        found = follows[chosen][k]
        shift = _time(abs(found.later))
        with_it = f"{alive[chosen].name!r} by {shift} (correlation {found.alike:.2f})"
        if found.alike < _FOLLOWS:
            reasons[c.name] = (
                f"does not move with {alive[chosen].name!r} (correlation {found.alike:.2f})"
            )
        elif found.later < 0 and not _answers(c.name):
            reasons[c.name] = f"comes before {with_it}; perhaps a reference"
        else:
            outputs.append(c.name)
            reasons[c.name] = f"{'follows' if found.later >= 0 else 'comes before'} {with_it}"
    reasons[alive[chosen].name] = _why_input(chosen, alive, follows)
    return _told((alive[chosen].name,), tuple(outputs), channels, reasons)


def _told(
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    channels: Sequence[Channel],
    reasons: dict[str, str],
) -> Proposal:
    unseen = f"not looked at: {_MOST} channels are held against each other"
    return Proposal(
        inputs=inputs,
        outputs=outputs,
        reasons=tuple((c.name, reasons.get(c.name, unseen)) for c in channels),
    )


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if abs(seconds) >= 0.01 or not seconds else f"{1e3 * seconds:.3g} ms"


def _words(name: str) -> frozenset[str]:
    """Words of a name: ``gyroADC[0]``, ``cmd_roll`` and ``roll.position`` cut into theirs."""
    parts = re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)
    return frozenset(part.casefold() for part in parts)


def _idle(channel: Channel) -> str | None:
    """Why a channel can be neither, or None."""
    values = channel.values
    if values.size < 20:
        return f"has {values.size} samples, too few to tell anything"
    with np.errstate(over="ignore"):
        span = float(np.ptp(values))
    if not span < _ABSURD:
        return f"reaches {np.abs(values).max():.3g}, which no signal does; samples are damaged"
    if not np.isfinite(span) or span <= 1e-12 * float(np.abs(values).max()):
        return f"always reads {values[0]:.6g}"
    steps = np.diff(values)
    if float(np.ptp(steps)) <= 1e-6 * abs(float(np.median(steps))):
        return "counts up evenly, as an index or a time does"
    return None


def _following(channels: Sequence[Channel]) -> list[list[_Follows]]:
    """For each channel and each other one, how the other follows it."""
    clocks = [fit_clock(c.time) for c in channels]
    start = max(float(c.time[0]) for c in channels)
    stop = min(float(c.time[-1]) for c in channels)
    fs = min(clock.fs for clock in clocks)
    count = int((stop - start) * fs)
    if count < 20:
        nothing = _Follows(alike=0.0, later=0.0)
        return [[nothing] * len(channels) for _ in channels]
    grid = start + np.arange(min(count, _LONGEST)) / fs
    n = 1 << int(np.ceil(np.log2(2 * grid.size)))
    spectra = []
    for c, clock in zip(channels, clocks, strict=True):
        with np.errstate(over="ignore", invalid="ignore"):  # between damaged stamps
            values, _ = on_grid(c, clock, grid, fs=fs, intersample=None)
            # Differences tell motion from drift, and have no mean.
            moved = np.diff(values, prepend=values[0])
            size = float(np.linalg.norm(moved))
        usable = 0.0 < size < np.inf
        spectra.append(np.fft.rfft(moved / size if usable else np.zeros_like(moved), n))
    return [[_follow(one, other, n, fs) for other in spectra] for one in spectra]


def _follow(
    one: NDArray[np.complex128], other: NDArray[np.complex128], n: int, fs: float
) -> _Follows:
    cross = np.fft.irfft(other * np.conj(one), n)
    best = int(np.argmax(np.abs(cross)))
    a, b, c = (abs(float(cross[(best + k) % n])) for k in (-1, 0, 1))
    curve = a - 2 * b + c
    part = 0.5 * (a - c) / curve if curve < 0 else 0.0
    lag = (best if best <= n // 2 else best - n) + part
    return _Follows(alike=min(b, 1.0), later=0.0 if abs(lag) < _AT_ONCE else lag / fs)


def _input(channels: Sequence[Channel], follows: Sequence[Sequence[_Follows]]) -> int | None:
    """Which channel is the input: by name if one says so, else by which comes first."""
    linked = [
        k
        for k in range(len(channels))
        if any(j != k and follows[k][j].alike >= _FOLLOWS for j in range(len(channels)))
    ]
    if not linked:
        return None
    named = [k for k in linked if _asked(channels[k].name)]
    plain = [k for k in named if not _words(channels[k].name) & {"reference", "ref", "sp"}]
    pool = plain or named or [k for k in linked if not _answers(channels[k].name)]
    pool = pool or linked
    return max(pool, key=lambda k: _leads(k, follows))


def _asked(name: str) -> bool:
    """Whether a name says what is asked; the last part of a path counts before the whole.

    ``RATE.RDes`` is the desired roll in the message of rates.
    """
    last, words = _words(re.split(r"[./]", name)[-1]), _words(name)
    return any(bool(part & _ASKED) and not part & _ANSWERED for part in (last, words))


def _answers(name: str) -> bool:
    return bool(_words(name) & _ANSWERED) and not _asked(name)


def _leads(k: int, follows: Sequence[Sequence[_Follows]]) -> float:
    """By how much, weighed by likeness, the others come after a channel."""
    others = [f for j, f in enumerate(follows[k]) if j != k and f.alike >= _FOLLOWS]
    return float(sum(f.alike * np.sign(f.later) for f in others))


def _why_input(k: int, channels: Sequence[Channel], follows: Sequence[Sequence[_Follows]]) -> str:
    others = [f for j, f in enumerate(follows[k]) if j != k and f.alike >= _FOLLOWS]
    first = all(f.later >= 0 for f in others)
    word = sorted(_words(channels[k].name) & _ASKED)
    named = f"its name says {word[0]!r}" if word else ""
    led = "every channel that moves with it comes later" if first else ""
    return " and ".join(part for part in (named, led) if part) or (
        "it comes before most channels that move with it"
    )
