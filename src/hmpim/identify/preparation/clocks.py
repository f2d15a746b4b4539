"""Inputs with corners between the samples: aliasing in the output, corrected by the model.

A held input has images above half its rate. Sampled by another clock, the response to them folds
back, and by that alone a delay may be off by a tenth of a sample. No filter removes it, as it
overlaps the rest. But with a model, the response to the true waveform is known at the output's own
stamps, and so is the response to the part of the input that the common clock represents::

    y on the grid  =  (y - response to waveform, at its own stamps) + response to the grid's input

The difference in brackets is noise and model error. The model is first refined to minimise it
(Gauss-Newton steps, with the true waveform), so that the corners distinguish a delay from a fast
pole, which the grid's input hardly does. Then all is identified again, and once more if the
correction still moves.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy

from hmpim.errors import ArgumentError
from hmpim.identify.arrays import Mask, Real
from hmpim.identify.result import Identification
from hmpim.identify.result.pair import linear_model
from hmpim.model import Model, coefficient_vector, simulate
from hmpim.model.draws import with_coefficients
from hmpim.record import Aligned, Channel, Finding, Record, Signal, Waveform, fit_clock, on_grid

__all__ = ["settled_between"]


_STEPS = 15
"""Most evaluations of all derivatives while the models are refined."""

_APART = 1e-5
"""Relative step of the derivatives: of a delay of a sample, a thousandth of what matters."""

_HOPELESS = 1e3
"""Error, over the output's range, of a model that cannot be simulated."""

_ROUNDS = 3
"""Most times that the correction is made and all is identified again."""

_STILL = 0.003
"""Samples by which the delay may still move: less than a third of one hundredth."""


def settled_between(
    record: Record, aligned: Aligned, identified: Callable[[Aligned, bool], Identification]
) -> Identification:
    """Identify with the aliasing between the clocks corrected by the models, until it converges.

    The record has the outputs at their own stamps; `identified` identifies an aligned record, with
    plain structures only if its second argument is true.
    """
    names = ", ".join(repr(signal.name) for signal in aligned.inputs)
    finding = Finding(
        code="held_between",
        message=(
            f"Values of {names} change between samples of the outputs. The model "
            f"predicts what this folds into them; it was removed repeatedly, until the delay "
            f"changed by less than {1e6 * (_STILL / aligned.fs):.2g} µs."
        ),
        severity="info",
        parameters=(),
    )
    others = tuple(f for f in aligned.findings if f.code != finding.code)
    corrected = _unfolded(record, aligned, identified(aligned, True))
    for _ in range(_ROUNDS):
        found = identified(replace(corrected, findings=(*others, finding)), False)
        before, corrected = corrected, _unfolded(record, aligned, found)
        if _moved_by(before, corrected) < _STILL:
            return found
    return identified(before, False)  # with the doubt


def _unfolded(record: Record, aligned: Aligned, found: Identification) -> Aligned:
    """The record as if its inputs had no power above half the rate, by the models found so far."""
    outputs = tuple(
        _corrected(channel, signal, record, aligned, found)
        for channel, signal in zip(record.outputs, aligned.outputs, strict=True)
    )
    return replace(aligned, outputs=outputs)


def _moved_by(before: Aligned, after: Aligned) -> float:
    """Largest delay over all outputs, in samples, by which two corrections differ."""
    most = 0.0
    for first, second in zip(before.outputs, after.outputs, strict=True):
        slope = np.gradient(second.values)
        size = float(slope @ slope)
        if size > 0.0:
            most = max(most, abs(float(slope @ (second.values - first.values))) / size)
    return most


def _corrected(
    channel: Channel, signal: Signal, record: Record, aligned: Aligned, found: Identification
) -> Signal:
    """One output without aliasing from its inputs."""
    driven = [
        (model, waveform, source.values)
        for waveform, source in zip(aligned.waveforms, aligned.inputs, strict=True)
        if (model := linear_model(found[channel.name, waveform.name], fs=aligned.fs)) is not None
    ]
    if not driven:
        return signal
    models, waveforms, smooth = (list(part) for part in zip(*driven, strict=True))
    counted = _counted(channel, aligned)
    models = _refined(models, waveforms, channel, counted)
    rest = channel.values - _responses(models, waveforms, channel.time)
    own = fit_clock(channel.time, nominal=record.fs)
    on_clock, _ = on_grid(
        Channel(name=channel.name, time=channel.time, values=rest),
        own,
        aligned.time,
        fs=aligned.fs,
        intersample=None,
    )
    values = on_clock + sum(
        simulate(model, u, fs=aligned.fs, intersample="bandlimited")
        for model, u in zip(models, smooth, strict=True)
    )
    values.setflags(write=False)
    return replace(signal, values=values)


def _counted(channel: Channel, aligned: Aligned) -> Mask:
    """Samples of an output at which all inputs are known, shape (n,)."""
    known = np.logical_and.reduce([source.valid for source in aligned.inputs])
    nearest = np.rint((channel.time - aligned.start) * aligned.fs).astype(np.int64)
    inside = (nearest >= 0) & (nearest < aligned.samples)
    return np.asarray(inside & known[np.clip(nearest, 0, aligned.samples - 1)])


def _responses(models: list[Model], waveforms: list[Waveform], at: Real) -> Real:
    """Sum of the models' responses to the true waveforms, at any instants (s)."""
    total = np.zeros(at.size)
    for model, waveform in zip(models, waveforms, strict=True):
        y = simulate(model, waveform.values, fs=waveform.fs, intersample=waveform.intersample)
        total += np.interp(at, waveform.time, y)
    return total


def _refined(
    models: list[Model], waveforms: list[Waveform], channel: Channel, counted: Mask
) -> list[Model]:
    """Refine the models to explain an output best, with the true waveforms."""
    parts = [coefficient_vector(model) for model in models]
    poles = [slice(1 + len(model.numerator), None) for model in models]
    if not all(np.all(part[at] > 0.0) for part, at in zip(parts, poles, strict=True)):
        return models  # no logarithm exists
    for part, at in zip(parts, poles, strict=True):
        part[at] = np.log(part[at])
    cuts = np.cumsum([part.size for part in parts])[:-1]
    begun = np.concatenate(parts)
    hopeless = np.full(np.count_nonzero(counted), _HOPELESS * float(np.ptp(channel.values)))

    def made(x: Real) -> list[Model]:
        moved = np.split(x.copy(), cuts)
        for part, at in zip(moved, poles, strict=True):
            part[at] = np.exp(part[at])
        return [with_coefficients(*each) for each in zip(models, moved, strict=True)]

    def error(x: Real) -> Real:
        try:
            predicted = _responses(made(x), waveforms, channel.time)
        except ArgumentError:  # no stable model
            return hopeless
        rest = (channel.values - predicted)[counted]
        return np.asarray(rest - rest.mean())

    scale = np.where(np.abs(begun) > 0.0, np.abs(begun), 1.0)
    for own, model, at in zip(np.split(scale, cuts), models, poles, strict=True):
        own[0], own[at] = max(abs(model.delay), 1.0 / waveforms[0].fs), 1.0
    done = scipy.optimize.least_squares(
        error, begun, x_scale=scale, diff_step=np.full(begun.size, _APART), max_nfev=_STEPS
    )
    return made(np.asarray(done.x))
