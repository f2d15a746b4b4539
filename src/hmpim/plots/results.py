"""What a picture needs, taken from the result or the record that holds it."""

from typing import TYPE_CHECKING, Any

from hmpim.errors import ArgumentError

if TYPE_CHECKING:
    from hmpim.identify import Identification, PairIdentification
    from hmpim.record import Record

__all__ = ["model_of", "residual_of", "signals_of"]


def signals_of(record: "Record") -> dict[str, Any]:
    """Return what `hmpim.plots.input_output` takes, of a record of one input and one output.

    Raises
    ------
    ArgumentError
        If there are several, so that two must be chosen.

    Examples
    --------
    >>> from hmpim.record import Record
    >>> record = Record.from_arrays({"u": [0, 1]}, {"y": [0, 2]}, fs=1.0, units={"y": "V"})
    >>> found = signals_of(record)
    >>> found["y"].tolist(), found["output_unit"]
    ([0.0, 2.0], 'V')
    """
    from hmpim.record import uniform

    if len(record.inputs) > 1 or len(record.outputs) > 1:
        names = ", ".join(c.name for c in (*record.inputs, *record.outputs))
        raise ArgumentError(
            f"the record has several channels ({names}); choose two with "
            "record.with_roles(inputs=[...], outputs=[...])"
        )
    aligned = uniform(record)
    u, y = aligned.inputs[0], aligned.outputs[0]
    return {
        **{"time": aligned.time, "u": u.values, "y": y.values},
        **{"input_name": u.name, "output_name": y.name},
        **{"input_unit": u.unit, "output_unit": y.unit},
    }


def model_of(result: "Identification | PairIdentification") -> dict[str, Any]:
    """Return what `hmpim.plots.model_over_measurement` takes.

    Raises
    ------
    ArgumentError
        If there are several pairs, or the result was read from a file, which holds no histories.
    """
    pair = _pair(result)
    assert pair.prediction is not None
    assert pair.residual is not None
    return {
        **{"time": pair.time, "measured": pair.prediction + pair.residual},
        **{"predicted": pair.prediction, "output_name": pair.output, "unit": _unit(pair)},
    }


def residual_of(result: "Identification | PairIdentification") -> dict[str, Any]:
    """Return what `hmpim.plots.residuals` takes.

    Raises
    ------
    ArgumentError
        As of `model_of`.
    """
    pair = _pair(result)
    parts = {"time": pair.time, "residual": pair.residual}
    return {**parts, "output_name": pair.output, "unit": _unit(pair)}


def _pair(result: "Identification | PairIdentification") -> "PairIdentification":
    """The only pair of a result, with its histories."""
    from hmpim.identify import Identification

    pairs = tuple(result) if isinstance(result, Identification) else (result,)
    if len(pairs) != 1:
        names = ", ".join(f'result["{p.output}", "{p.input}"]' for p in pairs[:4])
        raise ArgumentError(f"the result has {len(pairs)} pairs; give one of them: {names}")
    (pair,) = pairs
    if pair.time is None or pair.prediction is None or pair.residual is None:
        raise ArgumentError(
            "this result holds no time histories, as one that was read from a file; identify the "
            "record again"
        )
    return pair


def _unit(pair: "PairIdentification") -> str:
    """Unit of the output, as its figures have it."""
    return pair.noise_std.unit if pair.noise_std is not None else ""
