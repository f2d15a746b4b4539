"""Samples that the recorder lost or changed, so that the unit never responded to them.

A recorder may corrupt a sample, repeat the previous one, freeze, or write a fixed word that means
"no value". In an input, such samples look like motion to which the output does not respond. But
an input may also contain a real pulse, as in an impact test, or a real standstill, as in a
trapezoid. The output decides: plain dynamics are fitted to the record as it is and to the record
without these samples, and the likelier of the two is kept.
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import CLEARLY, searched
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.effects.imperfections import Imperfections
from hmpim.identify.effects.lost_samples import find_repeated, find_spikes
from hmpim.identify.fits import counted_in, fit_once, imperfections_of
from hmpim.identify.fitting.data import refit
from hmpim.identify.fitting.enrich import INTEGRATING, PLAIN
from hmpim.identify.preparation.question import Question
from hmpim.identify.result.digits import percent
from hmpim.identify.result.groups import TIMING
from hmpim.identify.worth import FEW, MOST, PART, TWICE
from hmpim.record import Channel, Finding, Signal, fit_clock, on_grid
from hmpim.record.resample import CROSSINGS, share_above
from hmpim.record.runs import runs_of
from hmpim.record.slower import updates

__all__ = ["find_pulses", "find_standstills", "leave_out_lost"]

_LONGEST = 3
"""Greatest length of a pulse whose values differ, in samples, as for a spike of the output."""

_AROUND = 25
"""Samples on either side of a pulse or a standstill that it is compared with."""

_FEWEST_EQUAL = 8
"""Fewest successive equal samples that count as a standstill of an input."""

_SMOOTH = 0.4
"""Frequency, over the rate of a slow recorder, up to which its samples determine an input."""

_FOLDED = 0.001
"""Share of the power above that frequency, 3 % of the amplitude, from which it is not smooth."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Suspect:
    """A question without the samples of one kind that may be lost."""

    question: Question
    finding: Finding
    long: bool = False  # whether the stretches are too long to be filled in
    if_undecided: Question | None = None  # what is asked if neither is clearly likelier


def leave_out_lost(question: Question) -> Question:
    """Treat samples as lost if plain dynamics without them are clearly likelier.

    Closed loops, in which noise moves the input, and stated software are not examined.
    """
    if question.instrument is not None or question.intersample == "sampled":
        return question
    question = _examined(question, _words(question))
    for i in range(len(question.aligned.inputs)):
        for kind in (_pulses, partial(_pulses, equal=True), _repeats, _standstills, _slow_log):
            question = _examined(question, kind(question, i))
    return question


def find_pulses(x: Real, valid: Mask, *, equal: bool = False) -> Mask | None:
    """Return samples, (n,), at which a signal moves out and back as fast as nowhere nearby.

    Both steps must be more than twice the largest of the 25 steps before and the 25 steps after. A
    pulse has at most three samples; with `equal`, four or more, all equal. None if there is no
    pulse.

    Examples
    --------
    >>> x = np.sin(np.arange(500) ** 2 / 5000)
    >>> find_pulses(x, np.ones(500, dtype=bool)) is None
    True
    >>> x[[100, 300, 301]] += 5.0
    >>> np.flatnonzero(find_pulses(x, np.ones(500, dtype=bool))).tolist()
    [100, 300, 301]
    """
    size, moves = x.size, np.diff(x)
    speeds = np.abs(moves)
    # Of the _AROUND steps that end with step k, at place k + _AROUND.
    largest = scipy.ndimage.maximum_filter1d(np.pad(speeds, _AROUND), _AROUND, origin=_AROUND // 2)
    sharp = np.flatnonzero(speeds > TWICE * largest[_AROUND - 1 :][: speeds.size]) + 1
    if equal:
        first, last = runs_of(np.concatenate([[False], moves == 0.0]))
        long = (last - first >= _LONGEST) & np.isin(first - 1, sharp)
        begin, end = first[long] - 1, last[long]
    else:
        begin = np.tile(sharp, _LONGEST)
        end = begin + np.repeat(np.arange(1, _LONGEST + 1), sharp.size)
    inside = (begin > 0) & (end < size)
    begin, end = begin[inside], end[inside]
    usual = np.maximum(largest[begin + _AROUND - 2], largest[end + 2 * _AROUND - 1])
    out, back = moves[begin - 1], -moves[end - 1]
    fast = np.minimum(np.abs(out), np.abs(back)) > TWICE * usual
    found = np.zeros(size, dtype=bool)
    for a, b in zip(begin[fast & (out * back > 0.0)], end[fast & (out * back > 0.0)], strict=True):
        if valid[a - 1 : b + 1].all():
            found[a:b] = True
    return found if found.any() else None


def find_standstills(x: Real) -> Mask | None:
    """Return samples, (n,), at which a signal that moves before and after stands still.

    The first sample of a standstill is not included. None if there is no standstill.

    Examples
    --------
    >>> x = np.sin(np.arange(500) / 20)
    >>> find_standstills(x) is None
    True
    >>> x[200:220] = x[200]
    >>> np.flatnonzero(find_standstills(x))[[0, -1]].tolist()
    [201, 219]
    """
    stands = np.concatenate([[False], np.diff(x) == 0.0])
    found = np.zeros(x.size, dtype=bool)
    first, last = runs_of(stands)
    long = last - first + 1 >= _FEWEST_EQUAL
    for a, b in zip(first[long], last[long], strict=True):
        around = np.concatenate([stands[max(a - _AROUND, 0) : a], stands[b : b + _AROUND]])
        if around.size == 2 * _AROUND and not around.any():
            found[a:b] = True
    return found if found.any() else None


def _examined(question: Question, suspect: _Suspect | None) -> Question:
    """The question without the suspect samples if the record is then clearly likelier."""
    if suspect is None or not _moves(suspect.question):
        return question
    seen = imperfections_of(question, inputs=[u.values for u in question.aligned.inputs])
    before, again = _compared(question, suspect, seen)
    spikes = find_spikes(question.output.values, again.prediction)
    if spikes is not None:
        seen = replace(seen, spikes=spikes)
        before, again = _compared(question, suspect, seen)
    gain = _gain(suspect, seen, before, again)
    # Held or slowly recorded are two hypotheses; lost samples are searched for.
    searches = suspect.if_undecided is None
    if gain > (searched(question.output.values.size) if searches else CLEARLY):
        return _with(suspect.question, suspect.finding)
    if suspect.if_undecided is not None and gain > -CLEARLY:
        return suspect.if_undecided
    return question


def _compared(
    question: Question, suspect: _Suspect, seen: Imperfections
) -> tuple[OutputFit, OutputFit]:
    """Fits to the record as it is, and without the suspect samples.

    Samples of the output are left out first and then added: they may hide the response.
    """
    again = _fitted(suspect.question, seen)
    if suspect.question.aligned is question.aligned:
        more = question.output.valid & ~suspect.question.output.valid
        return _counting_too(again, more), again
    return _fitted(question, seen), again


def _gain(suspect: _Suspect, seen: Imperfections, before: OutputFit, after: OutputFit) -> float:
    """Gain in log-likelihood by leaving out what is lost.

    At least half of all samples must count; the others may respond to lost ones. A long loss cannot
    be filled in, so the samples that respond to it have their own variance.
    """
    y, fits = suspect.question.output.values, (*before.fits, *after.fits)
    known = counted_in(suspect.question, seen)
    every = np.ones(y.size, dtype=bool) if known is None else known.copy()
    every[: max(fit.forgotten for fit in fits)] = False
    masks = [fit.problem.valid for fit in after.fits if fit.problem.valid is not None]
    counts = np.logical_and.reduce([every, *masks])
    if np.count_nonzero(counts) < MOST * np.count_nonzero(every):
        return -np.inf

    def power(fitted: OutputFit, here: Mask) -> float:
        return max(float(np.var((y - fitted.prediction)[here])), np.finfo(float).tiny)

    earlier, later = power(before, counts), power(after, counts)
    gain, lost = 0.0, every & ~counts
    if suspect.long and lost.any():
        earlier, inside = power(before, every), max(power(after, lost), later)
        gain = np.count_nonzero(lost) * float(np.log(earlier / inside))
    gain += np.count_nonzero(counts) * float(np.log(earlier / later))
    return 0.5 * min(fit.effective_share for fit in after.fits) * gain


def _with(question: Question, finding: Finding) -> Question:
    aligned = question.aligned
    return replace(question, aligned=replace(aligned, findings=(*aligned.findings, finding)))


def _moves(question: Question) -> bool:
    """Whether the output and every input move."""
    inputs = question.aligned.inputs
    return question.moves and all(np.ptp(source.values) > 0.0 for source in inputs)


def _fitted(question: Question, seen: Imperfections) -> OutputFit:
    """Fit plain dynamics and integrators; all structures if none of these is allowed."""
    names = tuple(name for name in question.structures if name in (*PLAIN, *INTEGRATING))
    return fit_once(question, seen, names or question.structures)


def _counting_too(fitted: OutputFit, more: Mask) -> OutputFit:
    """The same dynamics, fitted from where they ended with more samples of the output, (n,)."""
    fits = []
    for one in fitted.fits:
        valid = one.problem.valid
        if valid is not None:
            valid = valid | (more & (np.arange(more.size) >= one.forgotten))
        problem = replace(one.problem, valid=valid)
        fits.append(replace(one.with_fit(refit(problem, one.best.fit)), problem=problem))
    return replace(fitted, fits=tuple(fits))


def _words(question: Question) -> _Suspect | None:
    """The question without fixed words in the output: equal values, far from those around."""
    output = question.output
    found = find_pulses(output.values, output.valid, equal=True)
    if found is None:
        return None
    value = output.values[np.argmax(found)]
    finding = Finding(
        code="fixed_word",
        message=f"The output {output.name!r} jumps far away and stays at one value over "
        f"{_samples(found)}, first at {value:.6g}; these samples are left out. Look for a word "
        "that means 'no value', or for loose contacts.",
        severity="info",
        parameters=(),
    )
    mended = replace(output, valid=output.valid & ~found)
    return _Suspect(question=replace(question, output=mended), finding=finding)


def _pulses(question: Question, i: int, *, equal: bool = False) -> _Suspect | None:
    """The question without short pulses in an input, or without fixed words if `equal`."""
    source, aligned = question.aligned.inputs[i], question.aligned
    found = find_pulses(source.values, source.valid, equal=equal)
    if found is None or np.mean(found) > FEW:  # more are a stimulus, such as a doublet's pulses
        return None
    if np.unique(source.values).size < FEW * source.values.size:
        return None  # a sequence of a few levels jumps from one to the other
    finding = Finding(
        code="input_spikes",
        message=f"The input {source.name!r} jumps far away and back at {_samples(found)}, first "
        f"{aligned.time[np.argmax(found)] - aligned.start:.4g} s after the beginning, but the "
        "output does not respond: these samples count as lost. Look for lost bits or loose "
        "contacts.",
        severity="info",
        parameters=(),
    )
    return _Suspect(question=_without(question, i, found), finding=finding)


def _repeats(question: Question, i: int) -> _Suspect | None:
    """The question without samples of an input that repeat the previous one."""
    source = question.aligned.inputs[i]
    found = find_repeated(source.values)
    if found is None:
        return None
    finding = Finding(
        code="input_repeated",
        message=f"The input {source.name!r} repeats the previous sample to the last digit at "
        f"{_samples(found)}, but the output shows that it moved: these samples count as lost. "
        "Look for lost frames.",
        severity="info",
        parameters=(),
    )
    return _Suspect(question=_without(question, i, found), finding=finding)


def _standstills(question: Question, i: int) -> _Suspect | None:
    """The question without standstills of an input."""
    source = question.aligned.inputs[i]
    found = find_standstills(source.values)
    if found is None:
        return None
    finding = Finding(
        code="input_frozen",
        message=f"The input {source.name!r} stands still over {_samples(found)}, but the output "
        "shows that it moved: these samples count as lost. Look for lost updates.",
        severity="info",
        parameters=(),
    )
    return _Suspect(question=_without(question, i, found), finding=finding, long=True)


def _slow_log(question: Question, i: int) -> _Suspect | None:
    """The question with an input interpolated that a slower clock records, if it is smooth."""
    source, fs = question.aligned.inputs[i], question.aligned.fs
    at = updates(source.values)
    if at is None or question.intersample is not None:
        return None
    slow = fs * (at.size - 1) / float(at[-1] - at[0])
    if share_above(source.values[at], fs=slow, limit=_SMOOTH * slow) > _FOLDED:
        return None
    finding = Finding(
        code="input_slow",
        message=f"The input {source.name!r} is recorded at only {slow:.4g} Hz, but the output "
        "shows that it moves between these samples: it is interpolated.",
        severity="info",
        parameters=(),
    )
    undecided = Finding(
        code="input_slow",
        message=f"The input {source.name!r} changes at only {slow:.4g} Hz and is treated as held. "
        "If it moved smoothly and only its record is so slow, the delay is "
        f"{0.5 / slow:.3g} s longer. This record cannot distinguish the two, and the intervals "
        "cover both: record the input faster, or state intersample='zoh' (--intersample zoh) if "
        "the unit receives the held values.",
        severity="doubt",
        parameters=TIMING,
    )
    later = {**question.later, i: 0.5 * fs / slow}
    known = np.zeros(source.valid.size, dtype=bool)
    known[at] = True
    values = _filled(question, source, known).values.copy()
    values[at[-1] :] = source.values[at[-1]]
    read = _with_input(question, i, replace(source, values=values))
    # Near the ends of the record a spline replaces the band-limited interpolation. It is inaccurate
    # if the input moves faster than a fifth of the slow rate there.
    valid = question.output.valid.copy()
    first, last = at[:CROSSINGS], at[-CROSSINGS:]
    for end, here in ((first, slice(first[-1])), (last, slice(last[0], None))):
        valid[here] &= share_above(source.values[end], fs=slow, limit=PART * slow) < _FOLDED
    output = replace(question.output, valid=valid)
    smooth = replace(read, output=output, intersample="bandlimited")
    asked = _with(replace(question, later=later), undecided)
    return _Suspect(question=smooth, finding=finding, if_undecided=asked)


def _samples(found: Mask) -> str:
    count = int(np.count_nonzero(found))
    return f"{count} sample{'s' if count > 1 else ''} ({percent(count / found.size)} %)"


def _with_input(question: Question, i: int, source: Signal) -> Question:
    """The question with another input `i`."""
    inputs = (*question.aligned.inputs[:i], source, *question.aligned.inputs[i + 1 :])
    return replace(question, aligned=replace(question.aligned, inputs=inputs))


def _without(question: Question, i: int, lost: Mask) -> Question:
    """The question with these samples of input `i` filled in."""
    source = question.aligned.inputs[i]
    return _with_input(question, i, _filled(question, source, source.valid & ~lost))


def _filled(question: Question, source: Signal, known: Mask) -> Signal:
    """An input with all samples but the known ones interpolated."""
    aligned = question.aligned
    channel = Channel(name=source.name, time=aligned.time[known], values=source.values[known])
    clock = fit_clock(channel.time, nominal=aligned.fs)
    values, valid = on_grid(
        channel, clock, aligned.time, fs=aligned.fs, intersample=question.intersample
    )
    return replace(source, values=values, valid=valid)
