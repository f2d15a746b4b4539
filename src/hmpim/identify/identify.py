"""From a record to every parameter: the algorithm.

`_identify_output` reads as docs/method.md has it, line for line.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

from hmpim.arguments import checked
from hmpim.identify.coupling.responses import inputs_of
from hmpim.identify.judgement import judged
from hmpim.identify.kept import keeping
from hmpim.identify.nonlinearities import fit_output, model_nonlinearity
from hmpim.identify.pair import Described, describe, describe_dead
from hmpim.identify.preparation.clocks import settled_between
from hmpim.identify.preparation.question import Question, recognise_software
from hmpim.identify.preparation.reference import aligned_with_reference
from hmpim.identify.preparation.refusals import (
    check_moves,
    check_samples,
    check_statistics,
    checked_intersample,
    checked_structures,
)
from hmpim.identify.recorder import leave_out_lost
from hmpim.identify.result import Identification, RecordSummary
from hmpim.identify.statistics.describe import identify_statistics
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.steps import (
    let_gain_change,
    look,
    look_again,
    mark_swapped,
    through_reference,
)
from hmpim.identify.threads import one_thread
from hmpim.record import Aligned, Intersample, Record, uniform

__all__ = ["LOOKS", "identify", "identify_output"]

LOOKS = 2
"""How often an output is examined again with its model known."""


@checked
def identify(
    record: Record | Statistics,
    *,
    intersample: Intersample | str = "auto",
    structures: Sequence[str] | None = None,
    reference: str | None = None,
    nonlinear: Literal["modelled", "reported"] = "modelled",
) -> Identification:
    """Find delay, scale factor, bias, noise, dynamics and bandwidth, with error bars.

    No prior knowledge is needed: structure, starting values and the behaviour of the input
    between its samples come from the record.

    Parameters
    ----------
    record : Record or Statistics
        Inputs and outputs of one test; every pair is identified. With the statistics of
        `hmpim.compress`, whatever needs samples is omitted, and a warning says so.
    intersample : {'auto', 'zoh', 'foh', 'bandlimited', 'feedforward', 'sampled'}
        Whether the input is held, linear or band-limited between its samples; 'feedforward' for
        a command that is held together with its velocity and acceleration; 'sampled' for
        software, whose output samples follow from samples of its input. 'auto' uses what the
        record states, otherwise the most likely; if rounding is the only noise and no system in
        continuous time explains the record to within it, the unit is taken for software.
    structures : sequence of str, optional
        Dynamics to try; all of `hmpim.model.STRUCTURES` by default, for software all of
        `hmpim.model.dynamics.FILTERS`.
    reference : str, optional
        Channel that holds the reference of a closed loop; it serves as the instrument.
    nonlinear : {'modelled', 'reported'}
        'modelled' includes backlash, a dead zone, friction or a spring in the model if that leaves
        white noise: the figures are those of the linear part. 'reported' gives the linear model
        that is best at this amplitude.

    Returns
    -------
    Identification
        One pair for each input and output, indexed output first.

    Raises
    ------
    RecordError
        If the record is too short, an input is constant, or all outputs are.
    ArgumentError
        If `intersample` or a structure is unknown, or the record has no channel `reference`.

    Notes
    -----
    The joint fit is maximum likelihood under white Gaussian noise; with coloured noise the
    error bars are widened. `PairIdentification.paper` holds the paper's figures (section IV).

    Examples
    --------
    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> t = np.arange(1000) / 100
    >>> u = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    >>> y = 2.0 * np.interp(t - 0.05, t, u, left=0) + 0.5 + 0.01 * rng.standard_normal(1000)
    >>> result = identify(Record.from_arrays({"u": u}, {"y": y}, fs=100.0))
    >>> round(result["y", "u"].delay.value, 3)
    0.05
    """
    chosen = checked_intersample(intersample, record.intersample)
    if isinstance(record, Statistics) and chosen == "feedforward":
        chosen = "zoh"  # the statistics hold no derivatives of the command
    names = checked_structures(structures, chosen)
    if isinstance(record, Statistics):
        check_statistics(chosen, reference)
        with one_thread():
            return identify_statistics(record, intersample=chosen, structures=names)
    check_samples(record)
    stated = record if chosen == record.intersample else replace(record, intersample=chosen)
    if reference is None:
        aligned, instrument = uniform(stated), None
    else:
        aligned, instrument = aligned_with_reference(stated, reference)
    check_moves(aligned)
    if chosen == "feedforward":  # not on a clock of its own
        chosen = aligned.intersample
    question = Question(
        record=record,
        aligned=aligned,
        output=aligned.outputs[0],
        intersample=chosen,
        structures=names,
        inputs=None,
        instrument=instrument,
        linear=nonlinear == "reported",
    )

    def between_clocks(one_clock: Aligned, plainly: bool) -> Identification:
        tried = question.plain if plainly else names
        cleared = replace(question, aligned=one_clock, intersample="bandlimited", structures=tried)
        return _identify_outputs(cleared)

    with one_thread(), keeping():
        if aligned.waveforms and instrument is None:
            return settled_between(record, aligned, between_clocks)
        return _identify_outputs(question)


def _identify_outputs(question: Question) -> Identification:
    """Identify every output of a record on its common clock."""
    record, aligned = question.record, question.aligned
    inputs = inputs_of(aligned, record) if len(aligned.inputs) > 1 else None
    found = [
        identify_output(replace(question, output=output, inputs=inputs))
        for output in aligned.outputs
    ]
    if inputs is not None:
        coherence = tuple(one.coherence for one in found if one.coherence is not None)
        inputs = replace(inputs, coherence=coherence)
    return Identification(
        record=RecordSummary(
            fs=aligned.fs, samples=record.samples, sha256=record.sha256, source=record.source
        ),
        pairs=tuple(
            replace(judged(pair), stopping=record.stopping) for one in found for pair in one.pairs
        ),
        inputs=inputs,
        data=record,
    )


def identify_output(question: Question) -> Described:
    """Identify one output against every input, jointly if there are several."""
    if not question.moves:
        return describe_dead(question)
    question = leave_out_lost(question)
    question = recognise_software(mark_swapped(question))
    seen = look(question)
    seen, fitted = fit_output(question, seen)
    for _ in range(LOOKS):
        before, seen = seen, look_again(question, seen, fitted)
        if not seen.counts_other_samples_than(before):
            break
        seen, fitted = fit_output(question, seen)
    question, fitted = model_nonlinearity(question, seen, fitted)
    fitted = let_gain_change(question, seen, fitted)
    fitted = through_reference(question, fitted)
    return describe(question, seen, fitted)
