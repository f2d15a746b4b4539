"""Quality of the data: what is odd about a record's clock and values, said plainly."""

import numpy as np
from numpy.typing import NDArray

from hmpim.record.channel import Channel
from hmpim.record.clock import Clock, fit_clock
from hmpim.record.even import evenly_sampled
from hmpim.record.finding import Finding
from hmpim.record.record import Record

__all__ = ["clock_findings", "inspect_record", "inspect_timing", "inspect_values"]

_NOISE_RAISED = 4.0
"""Share by which interpolation raises white noise, over the square of the jitter in intervals.

Measured with uniform jitter of 0.09 and 0.17 intervals (r.m.s.): 3.3 % and 12 %.
"""

_TOLERATED = 0.02
"""Relative error of the noise that needs no warning."""

_KNOWN = 0.15
"""Relative error beyond which the quadratic law no longer holds."""

STUCK_SHARE = 0.05
"""Share of a record over which an output may stand still while the input moves."""


def inspect_timing(time: NDArray[np.float64], fs: float) -> tuple[Finding, ...]:
    """Say what is odd about time stamps.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Strictly increasing time stamps in s.
    fs : float
        Stated rate in Hz.

    Returns
    -------
    tuple of Finding
        Codes 'gaps' (samples are missing), 'jitter' (stamps stray from a uniform clock by more
        than 1 % of the interval, see `hmpim.record.clock`), 'rate' (the stamps run at another
        rate than stated). Empty for a clean clock, and for one whose stamps are only rounded.

    Examples
    --------
    >>> import numpy as np
    >>> [f.code for f in inspect_timing(np.array([0.0, 0.1, 0.2, 0.5, 0.6]), 10.0)]
    ['gaps']
    """
    return clock_findings(fit_clock(time, nominal=fs), time, stated=fs)


def clock_findings(
    clock: Clock,
    time: NDArray[np.float64],
    *,
    stated: float | None = None,
    name: str = "",
    even: Clock | None = None,
) -> tuple[Finding, ...]:
    """Say what is odd about a clock that was laid through `time` (shape (n,), s).

    `even` is the clock of samples that were taken evenly, where only their stamps jitter.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.array([0.0, 0.1, 0.2, 0.35, 0.4, 0.5])
    >>> clock_findings(fit_clock(time), time)[0].code
    'jitter'
    """
    of = f" of {name!r}" if name else ""
    findings = []
    jittered, clock = clock.jittered or even is not None, even or clock
    gaps = clock.gaps
    if gaps.size:
        missing = np.diff(clock.index)[gaps] - 1
        worst = int(np.argmax(missing))
        start, stop = time[gaps[worst]], time[gaps[worst] + 1]
        findings.append(
            Finding(
                code="gaps",
                message=(
                    f"{int(missing.sum())} of {clock.length} samples{of} are missing, in "
                    f"{gaps.size} {'gap' if gaps.size == 1 else 'gaps'}; the longest lasts "
                    f"{stop - start:.4g} s from {start:.6g} s; the output is left out there, and "
                    "the input is filled in: repeat the test if the gap lies where the input moves"
                ),
                severity="info",
                parameters=(),
            )
        )
    if jittered:
        findings.append(_jitter(clock, time, of, evenly=even is not None))
    if stated is not None and abs(clock.fs / stated - 1) > 0.01:
        findings.append(
            Finding(
                code="rate",
                message=(
                    f"time stamps{of} run at {clock.fs:.6g} Hz where {stated:.6g} Hz is stated; "
                    "the stamps are used: correct the rate, or the unit of the time column"
                ),
                severity="info",
                parameters=(),
            )
        )
    return tuple(findings)


def _jitter(clock: Clock, time: NDArray[np.float64], of: str, *, evenly: bool) -> Finding:
    """Say how far stamps stray, and what became of the samples."""
    deviation = time - clock.start - clock.index / clock.fs
    share = 100 * clock.fs
    rms, most = float(np.sqrt(np.mean(deviation**2))), float(np.abs(deviation).max())
    strayed = (
        f"time stamps{of} stray from a uniform clock of {clock.fs:.6g} Hz by "
        f"{share * rms:.2g} % of the interval (r.m.s.), {share * most:.2g} % at most; "
    )
    parameters: tuple[str, ...] = ()
    if evenly:
        what = (
            "the samples were taken at equal intervals, as the signals are smooth there and not at "
            "the stamps; equal intervals are used: stamp each sample when it is taken"
        )
    else:
        raised = _NOISE_RAISED * (share * rms / 100) ** 2
        changed = ""
        if raised > _TOLERATED:
            changed = f", which raises their noise by about {100 * raised:.0f} %"
            parameters = ("noise_std",)
        if raised > _KNOWN:
            changed = ", which changes their noise"
        what = (
            f"the samples are interpolated{changed}; record with a hardware clock if errors at "
            "high frequency matter"
        )
    return Finding(
        code="even_samples" if evenly else "jitter",
        message=strayed + what,
        severity="doubt" if parameters else "info",
        parameters=parameters,
    )


def inspect_values(record: Record) -> tuple[Finding, ...]:
    """Say what is odd about the values of a record's channels.

    Parameters
    ----------
    record : Record
        The record to look at.

    Returns
    -------
    tuple of Finding
        Codes 'dead_channel' (one value throughout), 'stuck' (an output stands still for over
        5 % of the record, not at either end of its range, while an input moves), and
        'repeated_samples' (over half of an output's samples repeat the one before).

    Examples
    --------
    >>> record = Record.from_arrays({"u": [0, 1, 0]}, {"y": [3, 3, 3]}, fs=10.0)
    >>> inspect_values(record)[0].code
    'dead_channel'
    """
    findings = []
    dead = set()
    for channel in (*record.inputs, *record.outputs):
        if _still(channel.values):
            dead.add(channel.name)
            findings.append(
                Finding(
                    code="dead_channel",
                    message=(
                        f"channel {channel.name!r} is {channel.values[0]:.6g} from "
                        "beginning to end; "
                        "check its cable, its range and its column"
                    ),
                    severity="info",
                    parameters=(),
                )
            )
    for output in record.outputs:
        if output.name in dead:
            continue
        stuck = _stuck(output, record.inputs)
        if stuck is not None:
            findings.append(stuck)
        # A clipped output repeats its limits; that is told as saturation.
        values = output.values[:-1]
        inner = (values > output.values.min()) & (values < output.values.max())
        if not inner.any():
            continue
        share = float(np.mean(np.diff(output.values)[inner] == 0))
        if share > 0.5:
            every = 1 / (1 - share)
            findings.append(
                Finding(
                    code="repeated_samples",
                    message=(
                        f"{100 * share:.0f} % of the samples of {output.name!r} repeat the one "
                        f"before, a new value about every {every:.2g} samples: the unit updates "
                        "more slowly than it is recorded, or its quantisation is coarse"
                    ),
                    severity="info",
                    parameters=(),
                )
            )
    return tuple(findings)


def inspect_record(record: Record) -> tuple[Finding, ...]:
    """Say what is odd about a record: as it was read, then its clocks, then its values.

    Examples
    --------
    >>> inspect_record(Record.from_arrays({"u": [0, 1, 0]}, {"y": [0, 0, 1]}, fs=10.0))
    ()
    """
    findings: list[Finding] = []
    seen: list[NDArray[np.float64]] = []
    channels = (*record.outputs, *record.inputs)
    shared = all(np.array_equal(c.time, channels[0].time) for c in channels)
    for channel in channels:
        if any(channel.time is t or np.array_equal(channel.time, t) for t in seen):
            continue
        clock = fit_clock(channel.time, nominal=record.fs)
        stated = record.fs if not seen else None  # the stated rate is that of the first clock
        name = channel.name if seen else ""
        even = evenly_sampled(channels, clock, nominal=record.fs) if shared else None
        found = clock_findings(clock, channel.time, stated=stated, name=name, even=even)
        findings.extend(found)
        seen.append(channel.time)
    return (*record.findings, *findings, *inspect_values(record))


def _still(values: NDArray[np.float64]) -> bool:
    # Rounding in a logger's own scaling may leave the last bits alive.
    return float(np.ptp(values)) <= 1e-12 * float(np.abs(values).max())


def _stuck(output: Channel, inputs: tuple[Channel, ...]) -> Finding | None:
    """Longest stretch of one value, if it is suspicious."""
    values = output.values
    edges = np.concatenate(([0], np.flatnonzero(np.diff(values) != 0) + 1, [values.size]))
    lengths = np.diff(edges)
    # The ends of the range are left to the search for saturation.
    inner = (values[edges[:-1]] > values.min()) & (values[edges[:-1]] < values.max())
    if not inner.any():
        return None
    k = int(np.argmax(np.where(inner, lengths, 0)))
    length = int(lengths[k])
    if length < max(20, STUCK_SHARE * values.size):
        return None
    start, stop = output.time[edges[k]], output.time[edges[k + 1] - 1]
    for u in inputs:
        within = u.values[(u.time >= start) & (u.time <= stop)]
        if within.size and np.ptp(within) > 0.05 * np.ptp(u.values):
            return Finding(
                code="stuck",
                message=(
                    f"{output.name!r} stands still at {values[edges[k]]:.6g} from {start:.6g} s to "
                    f"{stop:.6g} s ({length} samples) while {u.name!r} moves; check the unit, or "
                    "cut that part out"
                ),
                severity="info",
                parameters=(),
            )
    return None
