"""Samples of the input that the unit did not respond to: the record lost them, not the unit.

A transfer that loses a word, or a loose contact of the recorder, shows as one to three samples away
from those around them. In the output such samples are left out; in the input they look like a blow,
to which a response is missing everywhere in the model. But an input may also contain such a pulse,
as an impact test does. The output tells which: it either contains the response, or not.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import maximum_filter1d

from hmpim.identify.arrays import Mask, Real
from hmpim.identify.chance import searched
from hmpim.identify.coupling.output_fit import OutputFit
from hmpim.identify.fits import counted_in, fit_once, imperfections_of
from hmpim.identify.fitting.enrich import INTEGRATING, PLAIN
from hmpim.identify.preparation.question import Question
from hmpim.identify.worth import TWICE
from hmpim.record import Channel, Finding, Signal, fit_clock, on_grid

__all__ = ["find_pulses", "leave_out_glitches"]

_LONGEST = 3
"""Most samples of a glitch, as of a spike of the output."""

_AROUND = 25
"""Samples on either side with which a pulse is compared."""


def leave_out_glitches(question: Question) -> Question:
    """Take short pulses of an input for lost samples, if the output contains no response to them.

    Not in loops, where the output and the noise move the input, and not for stated software.
    """
    if question.instrument is not None or question.intersample == "sampled":
        return question
    for i, source in enumerate(question.aligned.inputs):
        pulses = find_pulses(source.values, source.valid)
        if pulses is None:
            continue
        mended = _without(question, i, pulses)
        if _gain(question, mended) > searched(source.values.size):
            question = mended
    return question


def find_pulses(u: Real, valid: Mask) -> Mask | None:
    """Return samples, (n,), at which an input moves out and back as fast as nowhere nearby.

    Both steps must be twice the largest of 25 samples before and after; None if there are none.

    Examples
    --------
    >>> u = np.sin(np.arange(500) ** 2 / 5000)
    >>> find_pulses(u, np.ones(500, dtype=bool)) is None
    True
    >>> u[[100, 300, 301]] += 5.0
    >>> np.flatnonzero(find_pulses(u, np.ones(500, dtype=bool))).tolist()
    [100, 300, 301]
    """
    size = u.size
    moves = np.diff(u)
    found = np.zeros(size, dtype=bool)
    # Of the _AROUND steps that end with step k, at place k + _AROUND.
    largest = maximum_filter1d(np.pad(np.abs(moves), _AROUND), _AROUND, origin=_AROUND // 2)
    for length in range(1, _LONGEST + 1):
        at = np.arange(1, size - length)  # the first sample of the pulse
        out, back = moves[at - 1], -moves[at + length - 1]
        before, after = largest[at + _AROUND - 2], largest[at + length + 2 * _AROUND - 1]
        step = np.minimum(np.abs(out), np.abs(back))
        for k in at[(out * back > 0.0) & (step > TWICE * np.maximum(before, after))]:
            if valid[k - 1 : k + length + 1].all():
                found[k : k + length] = True
    return found if found.any() else None


def _without(question: Question, i: int, pulses: Mask) -> Question:
    """The question with these samples of input `i` taken for lost."""
    aligned = question.aligned
    source = aligned.inputs[i]
    mended = _filled(question, source, source.valid & ~pulses)
    count = int(np.count_nonzero(pulses))
    finding = Finding(
        code="input_spikes",
        message=f"{count} sample{'s' if count > 1 else ''} of the input {source.name!r} "
        f"{'lie' if count > 1 else 'lies'} far from the neighbours, the first at "
        f"{aligned.time[np.argmax(pulses)] - aligned.start:.4g} s after the first sample, but the "
        "output does not respond: taken for lost. Look for lost bits or loose contacts.",
        severity="info",
        parameters=(),
    )
    inputs = (*aligned.inputs[:i], mended, *aligned.inputs[i + 1 :])
    found = (*aligned.findings, finding)
    return replace(question, aligned=replace(aligned, inputs=inputs, findings=found))


def _filled(question: Question, source: Signal, known: Mask) -> Signal:
    """An input of which only these samples are known."""
    aligned = question.aligned
    channel = Channel(name=source.name, time=aligned.time[known], values=source.values[known])
    clock = fit_clock(channel.time, nominal=aligned.fs)
    values, valid = on_grid(
        channel, clock, aligned.time, fs=aligned.fs, intersample=question.intersample
    )
    return replace(source, values=values, valid=valid)


def _gain(recorded: Question, mended: Question) -> float:
    """Log-likelihood that plain dynamics, or an integrator, gain from the mended input."""
    names = tuple(name for name in recorded.structures if name in (*PLAIN, *INTEGRATING))
    seen = imperfections_of(recorded, inputs=[u.values for u in recorded.aligned.inputs])
    counted = counted_in(recorded, seen)
    before, after = (fit_once(each, seen, names or each.structures) for each in (recorded, mended))
    fits = [fit for fit in (*before.fits, *after.fits) if fit.related]
    late = max((fit.forgotten for fit in fits), default=0)
    counts = np.ones(recorded.output.values.size, dtype=bool) if counted is None else counted.copy()
    counts[:late] = False
    if not counts.any() or not any(fit.related for fit in after.fits):
        return 0.0
    y = recorded.output.values
    rest, left = (_power(y, fitted, counts) for fitted in (before, after))
    share = min(fit.effective_share for fit in after.fits)
    if rest <= left or left == 0.0:
        return 0.0
    return 0.5 * share * np.count_nonzero(counts) * float(np.log(rest / left))


def _power(y: Real, fitted: OutputFit, counts: Mask) -> float:
    """Mean square of the residual, with a constant fitted."""
    return float(np.var((y - fitted.prediction)[counts]))
