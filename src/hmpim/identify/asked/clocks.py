"""Inputs with corners between the samples: what folds in the output, put right by the model.

A held input has images of what it holds above half its rate. Sampled by another clock, the answer
to them folds back, and by that alone a delay may be off by a tenth of a sample. No filter takes it
out, as it lies among the rest. But with a model the whole answer to the true waveform is known at
the output's own stamps, and so is the answer to what of the input lies on the common clock::

    y on the grid  =  (y - answer to the waveform, at its own stamps) + answer to the grid's input

What is in the brackets is noise and what the model lacks. The model is first moved to where the
brackets are least (Gauss and Newton's steps, with the true waveform), so that a delay and a fast
pole, which the grid's input hardly tells apart, are told by the corners themselves. Then all is
identified again, and once more if the correction still moves.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.result import Identification, PairIdentification
from hmpim.model import Model, simulate
from hmpim.record import Aligned, Channel, Finding, Record, Signal, Waveform, fit_clock, on_grid

__all__ = ["settled_between"]


_STEPS = 15
"""Evaluations of all derivatives in which the models are moved."""

_APART = 1e-5
"""Relative step of the derivatives: of a delay of a sample a thousandth of what matters."""

_HOPELESS = 1e3
"""Times the output's range that stands for a model that cannot be simulated."""


_ROUNDS = 3
"""Times that what folds between two clocks is taken out and all is identified again, at most."""

_STILL = 0.003
"""Samples by which the delay may still move with it: less than a third of one hundredth."""


def settled_between(
    record: Record, aligned: Aligned, identified: Callable[[Aligned, bool], Identification]
) -> Identification:
    """Identify, what folds between the clocks taken out by the models found, until it stays.

    The record has the outputs at their own stamps; `identified` identifies an aligned record, by
    plain structures only if its second argument is true.
    """
    names = ", ".join(repr(signal.name) for signal in aligned.inputs)
    said = _settled_finding(names, _STILL / aligned.fs)
    told = tuple(f for f in aligned.findings if f.code != said.code)
    taken = _unfolded(record, aligned, identified(aligned, True))
    for _ in range(_ROUNDS):
        found = identified(replace(taken, findings=(*told, said)), False)
        before, taken = taken, _unfolded(record, aligned, found)
        if _moved_by(before, taken) < _STILL:
            return found
    return identified(before, False)  # with the doubt


def _unfolded(record: Record, aligned: Aligned, found: Identification) -> Aligned:
    """The record as if its inputs had nothing above half the rate, by the models found so far."""
    outputs = tuple(
        _one(channel, signal, record, aligned, found)
        for channel, signal in zip(record.outputs, aligned.outputs, strict=True)
    )
    return replace(aligned, outputs=outputs)


def _moved_by(before: Aligned, after: Aligned) -> float:
    """Return the delay, in samples, by which two corrections differ, the most of all outputs."""
    most = 0.0
    for first, second in zip(before.outputs, after.outputs, strict=True):
        slope = np.gradient(second.values)
        size = float(slope @ slope)
        if size > 0.0:
            most = max(most, abs(float(slope @ (second.values - first.values))) / size)
    return most


def _settled_finding(names: str, seconds: float) -> Finding:
    """Say that it was done."""
    return Finding(
        code="held_between",
        message=(
            f"Values of {names} change between samples of the outputs. The model "
            f"predicts what this folds into them; it was removed repeatedly, until the delay "
            f"changed by less than {1e6 * seconds:.2g} µs."
        ),
        severity="info",
        parameters=(),
    )


def _one(
    channel: Channel, signal: Signal, record: Record, aligned: Aligned, found: Identification
) -> Signal:
    """One output without what folds in it."""
    driven = [
        (model, waveform, source.values)
        for waveform, source in zip(aligned.waveforms, aligned.inputs, strict=True)
        if (model := _linear(found[channel.name, waveform.name])) is not None
    ]
    if not driven:
        return signal
    models, waveforms, smooth = (list(part) for part in zip(*driven, strict=True))
    counted = _counted(channel, aligned)
    models = _refined(models, waveforms, channel, counted)
    rest = channel.values - _answers(models, waveforms, channel.time)
    own = fit_clock(channel.time, nominal=record.fs)
    left, _ = on_grid(
        Channel(name=channel.name, time=channel.time, values=rest),
        own,
        aligned.time,
        fs=aligned.fs,
        intersample=None,
    )
    values = left + sum(
        simulate(model, u, fs=aligned.fs, intersample="bandlimited")
        for model, u in zip(models, smooth, strict=True)
    )
    values.setflags(write=False)
    return replace(signal, values=values)


def _linear(pair: PairIdentification) -> Model | None:
    """Model of what a pair does but for bias and effects; None where there is none."""
    delay, scale = pair.parameters.delay, pair.parameters.scale_factor
    if delay is None or scale is None:
        return None
    return Model(
        delay=delay.value,
        scale_factor=scale.value,
        numerator=pair.numerator,
        denominator=pair.denominator,
    )


def _counted(channel: Channel, aligned: Aligned) -> Mask:
    """Samples of an output at which all inputs are known, shape (n,)."""
    known = np.logical_and.reduce([source.valid for source in aligned.inputs])
    nearest = np.rint((channel.time - aligned.start) * aligned.fs).astype(np.int64)
    inside = (nearest >= 0) & (nearest < aligned.samples)
    return np.asarray(inside & known[np.clip(nearest, 0, aligned.samples - 1)])


def _answers(models: list[Model], waveforms: list[Waveform], at: Real) -> Real:
    """What models answer to what the inputs truly were, at any instants (s)."""
    total = np.zeros(at.size)
    for model, waveform in zip(models, waveforms, strict=True):
        y = simulate(model, waveform.values, fs=waveform.fs, intersample=waveform.intersample)
        total += np.interp(at, waveform.time, y)
    return total


def _refined(
    models: list[Model], waveforms: list[Waveform], channel: Channel, counted: Mask
) -> list[Model]:
    """The models moved to where they explain an output best, by the true waveforms."""
    if not np.all([c > 0.0 for model in models for c in _moved_coefficients(model)]):
        return models  # no logarithm
    parts = [_vector(model) for model in models]
    cuts = np.cumsum([part.size for part in parts])[:-1]
    begun = np.concatenate(parts)
    hopeless = np.full(np.count_nonzero(counted), _HOPELESS * float(np.ptp(channel.values)))

    def made(x: Real) -> list[Model]:
        return [_made(model, part) for model, part in zip(models, np.split(x, cuts), strict=True)]

    def left(x: Real) -> Real:
        try:
            answers = _answers(made(x), waveforms, channel.time)
        except ArgumentError:  # not stable
            return hopeless
        rest = (channel.values - answers)[counted]
        return np.asarray(rest - rest.mean())

    scale = np.where(np.abs(begun) > 0.0, np.abs(begun), 1.0)
    for part, model, cut in zip(parts, models, [0, *cuts], strict=True):
        scale[cut] = max(abs(model.delay), 1.0 / waveforms[0].fs)
        scale[cut + part.size - len(_moved_coefficients(model)) : cut + part.size] = 1.0
    small = np.full(begun.size, _APART)
    done = scipy.optimize.least_squares(
        left, begun, x_scale=scale, diff_step=small, max_nfev=_STEPS
    )
    return made(np.asarray(done.x))


def _moved_coefficients(model: Model) -> tuple[float, ...]:
    """Coefficients of the denominator but the last, which is 1, or 0 of an integrator."""
    return model.denominator[: -1 if model.denominator[-1] else -2]


def _vector(model: Model) -> Real:
    """Delay, numerator with the scale factor, logarithms of what moves in the denominator."""
    numerator = model.scale_factor * np.asarray(model.numerator)
    return np.concatenate([[model.delay], numerator, np.log(_moved_coefficients(model))])


def _made(model: Model, vector: Real) -> Model:
    zeros = len(model.numerator)
    moved = np.exp(vector[1 + zeros :])
    fixed = model.denominator[moved.size :]
    return replace(
        model,
        delay=float(vector[0]),
        scale_factor=1.0,
        numerator=tuple(vector[1 : 1 + zeros].tolist()),
        denominator=(*moved.tolist(), *fixed),
    )
