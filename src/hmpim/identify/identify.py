"""From a record to every parameter: the paper's steps and the joint fit, side by side."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast, get_args

import numpy as np
from numpy.typing import NDArray

from hmpim.arguments import checked
from hmpim.errors import ArgumentError, RecordError
from hmpim.identify.between import moved_by, settled_finding, unfolded
from hmpim.identify.coupling.coupled import inputs_of, responses_of, settled, unrelated
from hmpim.identify.coupling.several import Joined, fit_together
from hmpim.identify.effects.drift import Drifting, with_drift
from hmpim.identify.effects.imperfections import (
    Imperfections,
    count_levels,
    find_imperfections,
    refine,
)
from hmpim.identify.effects.lost import stands_out
from hmpim.identify.fitting.enrich import PLAIN
from hmpim.identify.fitting.joint import joint_fit
from hmpim.identify.fitting.software import is_exact, software_fit
from hmpim.identify.fitting.trial import JointFit
from hmpim.identify.groups import EVERY
from hmpim.identify.judgement import judged
from hmpim.identify.pair import described, untold
from hmpim.identify.result import (
    Identification,
    InputSet,
    OutputCoherence,
    PairIdentification,
    RecordSummary,
)
from hmpim.identify.statistics.describe import identify_statistics
from hmpim.identify.statistics.statistics import Statistics
from hmpim.identify.swapped import is_swapped, lags_behind, swapped_finding
from hmpim.identify.threads import one_thread
from hmpim.identify.through import Instrument, fit_through, instrument_of
from hmpim.identify.whiteness import is_white
from hmpim.model.dynamics import FILTERS, STRUCTURES, StructureName
from hmpim.record import Aligned, Finding, Intersample, Record, Signal, uniform

__all__ = ["identify"]

_FEWEST_SAMPLES = 50

_LARGEST = 1e75
"""Size of a sample, and one over the least: fourth powers stay in the range of doubles."""

_EXACT = 1e-9
"""Share of the output (r.m.s.) up to which a model explains a record to rounding."""

_LOOKS = 2
"""How often an output is looked at again with its model in hand."""

_ROUNDS = 3
"""Times that what folds between two clocks is taken out and all is identified again, at most."""

_STILL = 0.003
"""Samples by which the delay may still move with it: less than a third of one hundredth."""

_BETTER = 0.7
"""Share of the noise's power under a drift below which a clipped level is taken instead."""


@checked
def identify(
    record: Record | Statistics,
    *,
    intersample: Intersample | str = "auto",
    structures: Sequence[str] | None = None,
    reference: str | None = None,
) -> Identification:
    """Find delay, scale factor, bias, noise, dynamics and bandwidth, with error bars.

    Nothing need be known beforehand: structure, starting values and what the input does
    between its samples come from the record.

    Parameters
    ----------
    record : Record or Statistics
        Inputs and outputs of one test; every pair is identified. Of `hmpim.compress`ed records,
        what needs samples is left out and said.
    intersample : {'auto', 'zoh', 'foh', 'bandlimited', 'sampled'}
        Whether the input is held, linear or band-limited between its samples; 'sampled' for
        software, whose output sample follows from samples of its input. 'auto' takes what the
        record states, and else the likeliest; where rounding is all the noise there is, and no
        system in continuous time explains the record to that, it is software.
    structures : sequence of str, optional
        Dynamics to try; all of `hmpim.model.STRUCTURES` by default, or of software all of
        `hmpim.model.dynamics.FILTERS`.

    Returns
    -------
    Identification
        One pair for each input and output; index it output first.

    Raises
    ------
    RecordError
        If the record is too short, an input is constant, or all outputs are.
    ArgumentError
        If `intersample` or a structure is not known, or `reference` is no channel of the record.

    Notes
    -----
    The joint fit is maximum likelihood under white Gaussian noise; with coloured noise the
    error bars are widened. The paper's figures (section IV) stand beside it in
    `PairIdentification.paper`.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> t = np.arange(1000) / 100
    >>> u = np.sin(2 * np.pi * (0.1 * t + 1.0 * t**2))
    >>> y = 2.0 * np.interp(t - 0.05, t, u, left=0) + 0.5 + 0.01 * rng.standard_normal(1000)
    >>> result = identify(Record.from_arrays({"u": u}, {"y": y}, fs=100.0))
    >>> round(result["y", "u"].delay.value, 3)
    0.05
    """
    chosen = _checked_intersample(intersample, record)
    known = list(FILTERS) if chosen == "sampled" else list(STRUCTURES)
    asked = tuple(structures) if structures is not None else tuple(known)
    for name in asked:
        if name not in known:
            raise ArgumentError(f"structure {name!r} is not known; choose of {known}")
    names = cast(tuple[StructureName, ...], asked)
    if isinstance(record, Statistics):
        if chosen == "sampled":
            raise ArgumentError(
                "statistics do not know software (intersample='sampled'); identify the record"
            )
        if reference is not None:
            raise ArgumentError(
                f"statistics keep no reference, and reference={reference!r} is asked for; identify "
                "the record"
            )
        with one_thread():
            return identify_statistics(record, intersample=chosen, structures=names)
    _check_length(record)
    _check_size(record)
    stated = record if chosen == record.intersample else replace(record, intersample=chosen)
    aligned, instrument = _aligned(stated, reference)
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
    with one_thread():
        if aligned.waveforms and instrument is None:
            return _between_clocks(record, aligned, names)
        return _identified(record, aligned, chosen, names, instrument)


def _between_clocks(
    record: Record, aligned: Aligned, structures: tuple[StructureName, ...]
) -> Identification:
    """Identify, what folds between the clocks taken out by the models found, until it stays."""
    names = ", ".join(repr(signal.name) for signal in aligned.inputs)
    said = settled_finding(names, _STILL / aligned.fs)
    told = tuple(f for f in aligned.findings if f.code != said.code)
    plain = tuple(name for name in structures if name in PLAIN) or structures
    taken = unfolded(record, aligned, _identified(record, aligned, "bandlimited", plain))
    for _ in range(_ROUNDS):
        cleared = replace(taken.aligned, findings=(*told, said))
        found = _identified(record, cleared, "bandlimited", structures)
        before, taken = taken, unfolded(record, aligned, found)
        if moved_by(before, taken) < _STILL:
            return found
    return _identified(record, before.aligned, "bandlimited", structures)  # with the doubt


def _identified(
    record: Record,
    aligned: Aligned,
    chosen: Intersample | None,
    names: tuple[StructureName, ...],
    instrument: Instrument | None = None,
) -> Identification:
    """Identify every output of a record on its common clock."""
    inputs = inputs_of(aligned, record) if len(aligned.inputs) > 1 else None
    found = [
        _identify_output(aligned, output, record, chosen, names, inputs, instrument)
        for output in aligned.outputs
    ]
    if inputs is not None:
        coherence = tuple(seen for _, seen in found if seen is not None)
        inputs = replace(inputs, coherence=coherence)
    return Identification(
        record=RecordSummary(
            fs=aligned.fs, samples=record.samples, sha256=record.sha256, source=record.source
        ),
        pairs=tuple(
            replace(judged(pair), stopping=record.stopping) for pairs, _ in found for pair in pairs
        ),
        inputs=inputs,
        data=record,
    )


def _aligned(record: Record, reference: str | None) -> tuple[Aligned, Instrument | None]:
    """All channels on one clock; with a reference, the input is what the reference moves of it."""
    if reference is None:
        return uniform(record), None
    if len(record.inputs) > 1:
        raise ArgumentError(
            f"reference={reference!r} takes a record of one input; this one has "
            f"{len(record.inputs)}: leave the others out"
        )
    if record.intersample == "sampled":
        raise ArgumentError(
            f"reference={reference!r} takes a plant, not software (intersample='sampled'); leave "
            "one of the two out"
        )
    driver = next((c for c in record.channels if c.name == reference), None)
    if driver is None or driver in record.outputs or driver in record.inputs:
        known = ", ".join(c.name for c in (*record.references, *record.auxiliary)) or "none"
        raise ArgumentError(
            f"reference {reference!r} is no channel beside inputs and outputs; there are: {known}"
        )
    aligned = uniform(replace(record, inputs=(*record.inputs, driver), references=(), auxiliary=()))
    source, moves = aligned.inputs
    instrument = instrument_of(reference, moves.values, source.values)
    return replace(aligned, inputs=(replace(source, values=instrument.moved),)), instrument


def _checked_intersample(intersample: str, record: Record | Statistics) -> Intersample | None:
    if intersample == "auto":
        return record.intersample
    for known in get_args(Intersample):
        if intersample == known:
            return cast(Intersample, known)
    raise ArgumentError(
        f"intersample {intersample!r} is not known; choose of auto, zoh, foh, bandlimited, sampled"
    )


def _check_length(record: Record) -> None:
    for channel in (*record.inputs, *record.outputs):
        if channel.values.size < _FEWEST_SAMPLES:
            raise RecordError(
                f"channel {channel.name!r} has {channel.values.size} samples; at least "
                f"{_FEWEST_SAMPLES} are needed to tell dynamics from noise, so record longer"
            )


def _check_size(record: Record) -> None:
    """Refuse numbers whose squares and products would leave the range of double precision."""
    for channel in (*record.inputs, *record.outputs):
        largest, span = float(np.abs(channel.values).max()), float(np.ptp(channel.values / 2))
        if largest > _LARGEST or 0.0 < span < 1 / _LARGEST:
            raise RecordError(
                f"channel {channel.name!r} reaches {largest:.3g}, out of the range from "
                f"{1 / _LARGEST:g} to {_LARGEST:g} that can be calculated with; give it in another "
                "unit, or look for damaged samples"
            )
    if not 1 / _LARGEST < record.fs < _LARGEST:
        raise RecordError(
            f"the record runs at {record.fs:.3g} Hz; check the unit of its time stamps, which are "
            "seconds"
        )


def _identify_output(
    aligned: Aligned,
    output: Signal,
    record: Record,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    inputs: InputSet | None,
    instrument: Instrument | None,
) -> tuple[list[PairIdentification], OutputCoherence | None]:
    """Identify one output against every input, together where there are several."""
    if np.ptp(output.values[output.valid]) == 0:
        dead = Finding(
            code="dead_channel",
            message=f"Output {output.name!r} is constant at {output.values[output.valid][0]:g}. "
            "The sensor is dead, stuck or not connected.",
            severity="doubt",
            parameters=EVERY,
        )
        return [untold(aligned, source, output, record, dead) for source in aligned.inputs], None
    backwards = _backwards(aligned, output) if instrument is None else ()
    if intersample is None and len(aligned.inputs) == 1 and not backwards and instrument is None:
        (source,) = aligned.inputs
        if bool(source.valid.all() and output.valid.all()) and _is_software(
            source.values, output.values
        ):
            intersample = "sampled"
            structures = cast(tuple[StructureName, ...], tuple(FILTERS))
    richest = max(count_levels(source.values) for source in aligned.inputs)
    found = find_imperfections(output.values, aligned.fs, richest=richest)
    if backwards:
        plain = tuple(name for name in structures if name in PLAIN) or structures
        joined, drifting = _joined(aligned, output, found, intersample, plain, inputs), None
        if lags_behind(joined.fits[0]):  # it was the clock
            backwards = ()
        else:
            structures = plain
    if not backwards:
        joined, drifting = _drifted(aligned, output, found, intersample, structures, inputs)
    if drifting is not None and found.saturation is None:
        clipped = _clipped(aligned, output, found, drifting, intersample, structures)
        if clipped is not None:
            found, joined, drifting = clipped[0], clipped[1], None
    for _ in range(_LOOKS):
        again = _looked_again(output, aligned.fs, found, joined, drifting, richest)
        if again is None:
            break
        changed, found = again.counts_otherwise_than(found), again
        if not changed:
            break
        joined, drifting = _drifted(aligned, output, found, intersample, structures, inputs)
    if inputs is not None:
        return _each_input(aligned, output, record, joined, found, inputs)
    (source,) = aligned.inputs
    if joined.related[0]:
        if instrument is not None:
            joint, own = fit_through(joined.fits[0], instrument)
            joined = replace(joined, fits=(joint,), covariances=(own,))
        pair = described(
            aligned, source, output, record, joined, 0, None, found, drifting, instrument
        )
        return [replace(pair, warnings=(*backwards, *pair.warnings))], None
    unfollowed = Finding(
        code="unrelated",
        message=f"Output {output.name!r} does not follow input {source.name!r}: a constant "
        "explains it as well. Check the channels, or excite more.",
        severity="doubt",
        parameters=EVERY,
    )
    (said,) = backwards or (unfollowed,)
    return [untold(aligned, source, output, record, said)], None


def _looked_again(
    output: Signal,
    fs: float,
    found: Imperfections,
    joined: Joined,
    drifting: Drifting | None,
    richest: int,
) -> Imperfections | None:
    """What is wrong with an output, now that there is a model; None where nothing asks for it."""
    residual = joined.fits[0].best.fit.residual
    seen = found.saturation is not None or found.hold is not None
    if not seen and is_white(residual) and not stands_out(residual):
        return None
    # A plateau can now be told from a crest.
    predicted = joined.prediction
    if drifting is not None:
        predicted = predicted + drifting.trend
    again = find_imperfections(output.values, fs, prediction=predicted, richest=richest)
    plateau = again.saturation
    if plateau is None and found.saturation is not None and found.saturation.noise == "after":
        again = replace(again, saturation=found.saturation)
    if drifting is not None and plateau is not None and plateau.noise == "after":
        again = replace(again, saturation=None)  # a wander bends the output as a level does
    return again


def _is_software(u: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Whether rounding is all the noise there is, and no plainer system explains the record."""
    if not is_exact(u, y):
        return False
    filters = software_fit(u, y).best.fit
    enough = _EXACT**2 * float(np.sum((y - y.mean()) ** 2))
    plain = [trial.fit for trial in joint_fit(u, y, structures=PLAIN).trials]
    exact = [fit.structure.parameters for fit in plain if fit.cost <= enough]
    return filters.cost <= enough and filters.structure.parameters <= min(exact, default=np.inf)


def _backwards(aligned: Aligned, output: Signal) -> tuple[Finding, ...]:
    """What is said where the one input there is follows the output."""
    if len(aligned.inputs) > 1:
        return ()
    (source,) = aligned.inputs
    if not is_swapped(source.values, output.values, source.valid & output.valid):
        return ()
    return (swapped_finding(source.name, output.name),)


def _each_input(
    aligned: Aligned,
    output: Signal,
    record: Record,
    joined: Joined,
    found: Imperfections,
    inputs: InputSet,
) -> tuple[list[PairIdentification], OutputCoherence]:
    """Describe one output against each of several inputs, each one in its own band."""
    responses = responses_of(aligned, output, joined, inputs)
    pairs = []
    for i, source in enumerate(aligned.inputs):
        own = replace(record, band=inputs.bands[i])
        if joined.related[i]:
            pair = described(aligned, source, output, own, joined, i, responses, found)
            pairs.append(settled(pair, joined, i, inputs, aligned.fs))
            continue
        seen = responses.columns[i]
        finding = unrelated(output.name, source.name, seen)
        pair = untold(aligned, source, output, own, finding, seen)
        pairs.append(pair)
    return pairs, responses.coherence


def _drifted(
    aligned: Aligned,
    output: Signal,
    found: Imperfections,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    inputs: InputSet | None,
) -> tuple[Joined, Drifting | None]:
    """Fit an output, with a bias that drifts where the residual asks for it."""
    joined = _joined(aligned, output, found, intersample, structures, inputs)
    if len(aligned.inputs) > 1 or joined.fits[0].silent:
        return joined, None

    plain = tuple(name for name in structures if name in PLAIN) or structures

    def fitted(rows: NDArray[np.float64], quickly: bool) -> JointFit:
        names = plain if quickly else structures
        return _joined(aligned, output, found, intersample, names, None, rows).fits[0]

    drifting = with_drift(joined.fits[0], fitted, clipped=found.saturation is not None)
    if drifting is None:
        return joined, None
    return replace(
        joined,
        fits=(drifting.joint,),
        related=(drifting.joint.related,),
    ), drifting


def _clipped(
    aligned: Aligned,
    output: Signal,
    found: Imperfections,
    drifting: Drifting,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
) -> tuple[Imperfections, Joined] | None:
    """Levels behind the noise, where they explain better what was taken for a drift."""
    joined = _joined(aligned, output, found, intersample, structures, None)
    predicted = joined.prediction
    plateau = find_imperfections(output.values, aligned.fs, prediction=predicted).saturation
    if plateau is None or plateau.noise != "after":
        return None
    found = replace(found, saturation=plateau)
    joined = _joined(aligned, output, found, intersample, structures, None)
    refined = refine(joined.fits[0], found, aligned.fs)
    drifted = drifting.joint
    left = drifted.best.fit.cost / drifted.problem.counted
    if refined is None or refined[1].noise_std ** 2 > _BETTER * left:
        return None
    return found, joined


def _joined(
    aligned: Aligned,
    output: Signal,
    found: Imperfections,
    intersample: Intersample | None,
    structures: tuple[StructureName, ...],
    inputs: InputSet | None,
    nuisance: NDArray[np.float64] | None = None,
) -> Joined:
    """Fit an output to all inputs on the samples that say what it was."""
    valid = None if bool(output.valid.all()) else np.asarray(output.valid)
    told = found.telling(output.values.size, aligned.fs)
    if told is not None:
        valid = told if valid is None else valid & told
    measured = np.logical_and.reduce([source.valid for source in aligned.inputs])
    return fit_together(
        [source.values for source in aligned.inputs],
        output.values,
        valid=valid,
        known=None if bool(measured.all()) else np.asarray(measured),
        intersample=intersample,
        structures=structures,
        alike=() if inputs is None else inputs.alike_bins(aligned.samples, aligned.fs),
        nuisance=nuisance,
    )
